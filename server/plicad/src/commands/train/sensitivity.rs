//! `plicad train --sensitivity`: sensitivity of the accurate skin to mesh, tie and reference.

use plica_scene::Config;
use plica_scene::scene::AccurateMesh;
use plica_scene::{model, setup};
use plica_training::{Difference, Sensitivity, Variations, sensitivity};

use super::watch::Ending;

/// Divisions of the other meshes, over those of the scene; the last one is the reference.
const REFINEMENTS: [f64; 3] = [0.75, 1.0, 1.5];
/// Factors on the stiffness of the tie.
const TIE_FACTORS: [f64; 4] = [0.1, 1.0, 10.0, 100.0];

pub(super) fn run(config: &Config, n_interactions: usize, n_threads: usize, json: bool) -> anyhow::Result<()> {
    let ending = Ending::listen()?;
    let setup = setup::setup(config)?;
    let AccurateMesh { divisions: own, grading } = config.object().accurate().mesh;
    let mut meshes = Vec::new();
    for factor in REFINEMENTS {
        let divisions = own.map(|n| ((factor * n as f64).round() as usize).max(1));
        let name = divisions.map(|n| n.to_string()).join("x");
        meshes.push((name, model::describe_accurate(config, Some(AccurateMesh { divisions, grading }))?));
    }
    let variations =
        Variations { n_interactions, meshes, tie_factors: TIE_FACTORS.to_vec(), independent_on_all_meshes: true };
    let mut newest = String::new();
    let mut observer = |variant: &str| {
        if newest != variant {
            tracing::info!("solves {n_interactions} interactions: {variant}");
            variant.clone_into(&mut newest);
        }
        ending.flow()
    };
    let found = sensitivity(&setup, &variations, n_threads, &mut observer)?;
    print(&found);
    if json {
        println!("{}", serde_json::to_string(&found)?);
    }
    Ok(())
}

fn print(found: &Sensitivity) {
    println!("{} interactions; millimetres, over the interactions", found.interactions);
    println!("{:<60} {:>22} {:>22}", "", "RMS over the skin", "worst vertex");
    println!("{:<60} {:>10} {:>11} {:>10} {:>11}", "", "median", "max", "median", "max");
    let mut group = "";
    for d in &found.differences {
        if d.group != group {
            group = &d.group;
            println!("{group}");
        }
        row(d);
    }
    println!("force on the tool [N]");
    for f in &found.forces {
        let (size, over) = (f.size_n, f.over_independent);
        println!("  {:<58} {:>10.3} {:>11.3}   x {:.2} of independent", f.of, size.median, size.max, over.median);
    }
    for left_out in &found.left_out {
        println!("left out: {left_out}");
    }
}

fn row(d: &Difference) {
    let mm = |x: f64| format!("{:.4}", 1e3 * x);
    let (rms, worst) = (&d.rms_m, &d.worst_m);
    println!(
        "  {:<58} {:>10} {:>11} {:>10} {:>11}",
        format!("{} from {}", d.of, d.from),
        mm(rms.median),
        mm(rms.max),
        mm(worst.median),
        mm(worst.max)
    );
}
