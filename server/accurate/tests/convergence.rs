//! The error falls with the mesh at the element's order: 2 for displacements, 1 for their gradients.
//!
//! Errors are compared with those in `convergence.json`, from which `examples/convergence_chart.rs` draws a picture.
//! `cargo test --release -p plica-accurate --test convergence -- --ignored` writes that file anew.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::manufactured::{Errors, errors};
use common::material;
use plica_accurate::MaterialModel;
use serde_json::{Value, json};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/convergence.json");
const MODELS: [MaterialModel; 3] =
    [MaterialModel::Linear, MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean];
const CELLS: [usize; 4] = [2, 4, 8, 16];

fn all_errors(model: MaterialModel) -> Vec<Errors> {
    CELLS.map(|cells| errors(material(model, 3e4, 0.45), cells)).to_vec()
}

fn stored() -> Value {
    serde_json::from_str(&std::fs::read_to_string(FILE).unwrap()).unwrap()
}

#[test]
fn errors_fall_at_the_order_of_the_element() {
    let stored = stored();
    for model in MODELS {
        let found = all_errors(model);
        let orders = |error: fn(&Errors) -> f64| {
            found.windows(2).map(|pair| (error(&pair[0]) / error(&pair[1])).log2()).collect::<Vec<_>>()
        };
        let (l2, h1) = (orders(|e| e.l2), orders(|e| e.h1));
        println!("{model:?}: errors {found:?}, orders {l2:.3?} and {h1:.3?}");
        assert!((l2[2] - 2.0).abs() <= 0.1 && (h1[2] - 1.0).abs() <= 0.05, "{model:?}: {l2:?}, {h1:?}");
        let row = &stored["materials"][format!("{model:?}")];
        for (i, errors) in found.iter().enumerate() {
            common::assert_close(errors.l2, row["l2"][i].as_f64().unwrap(), 1e-6, "stored error");
            common::assert_close(errors.h1, row["h1"][i].as_f64().unwrap(), 1e-6, "stored error of the gradient");
        }
    }
}

#[test]
#[ignore = "writes convergence.json"]
fn write_stored_errors() {
    let mut materials = serde_json::Map::new();
    for model in MODELS {
        let found = all_errors(model);
        let column = |error: fn(&Errors) -> f64| found.iter().map(error).collect::<Vec<_>>();
        materials.insert(format!("{model:?}"), json!({"l2": column(|e| e.l2), "h1": column(|e| e.h1)}));
    }
    let file = json!({"cells": CELLS, "poisson_ratio": 0.45, "materials": materials});
    std::fs::write(FILE, format!("{file:#}\n")).unwrap();
}
