//! Trains a block: solves a few presses of a ball with both models, keeps the examples, and enriches a skin with them.
//!
//! `cargo run --release -p plica-training --example train_a_block`

use std::error::Error;
use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::{MaterialModel, TieOptions};
use plica_geometry::shapes::{block, block_skin};
use plica_geometry::{Embedding, EmbeddingKind, HexMesh};
use plica_sim::enrichment::{Enricher, EnrichmentOptions};
use plica_sim::*;
use plica_training::*;

/// 40 x 40 x 20 mm.
const SIZE_M: [f64; 3] = [0.04, 0.04, 0.02];
const YOUNG_MODULUS_PA: f64 = 3e4;
const DENSITY_KG_PER_M3: f64 = 1000.0;

fn main() -> Result<(), Box<dyn Error>> {
    let setup = Setup {
        scene_hash: "0".repeat(64),
        coarse: coarse()?,
        accurate: accurate(),
        tie: TieOptions::for_modulus(YOUNG_MODULUS_PA),
        stamp_axes: [Vector3::x(), Vector3::y()],
        drive: DriveOptions::default(),
        features: FeatureScales::default(),
        training: presses(),
        training_seed: 1,
        evaluation: Vec::new(),
        evaluation_seed: 2,
    };
    let job = TrainingJob {
        id: "example".into(),
        client_id: "example".into(),
        kind: DatabaseKind::Training,
        scene_name: "block".into(),
        examples: None,
        seed: None,
        threads: None,
        submitted_unix_s: now_unix_s(),
    };
    let path = std::env::temp_dir().join(format!("train_a_block-{}", std::process::id()));
    let folder = TrainingFolder::open(&path)?;
    let mut done = 0;
    run(&setup, &job, default_threads() as usize, &folder, &mut |progress| {
        if progress.done > done {
            done = progress.done;
            println!("{done} of {} interactions", progress.total);
        }
        ControlFlow::Continue(())
    })?;
    let database = Database::read(&folder.paths().database(), Some(&setup.scene_hash))?;
    let model = Model::new(setup.coarse)?;
    let enricher =
        Enricher::new(&model, &database.leading_examples(database.examples.len()), EnrichmentOptions::default())?;
    let path = folder.paths().database();
    println!("{}: enriches within {:.0} mm of the contact", path.display(), 1e3 * enricher.radius_m());
    for example in &database.examples {
        let detail = example.detail.iter().map(|d| Vector3::from(*d).norm()).fold(0.0, f32::max);
        println!(
            "pressed {:.1} mm at ({:.0}, {:.0}) mm: the coarse skin is off by up to {:.2} mm",
            1e3 * example.record.depth_m,
            1e3 * example.contact_point[0],
            1e3 * example.contact_point[1],
            1e3 * detail
        );
    }
    Ok(())
}

/// The model that runs in real time: 3 x 3 x 2 hexahedra below a fine skin.
fn coarse() -> Result<ModelDescription, Box<dyn Error>> {
    let (mesh, skin) = (block(SIZE_M, [3, 3, 2]), block_skin(SIZE_M, 2e-3).clustered());
    let material =
        Material { young_modulus_pa: YOUNG_MODULUS_PA, poisson_ratio: 0.45, density_kg_per_m3: DENSITY_KG_PER_M3 };
    Ok(ModelDescription {
        embedding: Embedding::new(&mesh, skin.positions(), EmbeddingKind::MovingLeastSquares { support_cells: 1.75 })?,
        fixed: bottom(&mesh),
        materials: vec![material; mesh.n_hexes()],
        mesh,
        skin,
        mass_damping_per_s: 1.0,
        gravity_m_per_s2: Vector3::zeros(),
        element: ElementKind::EnhancedStrain,
        timestep_s: 1e-3,
        substeps: 1,
        solver: SolverOptions::default(),
        contact: ContactOptions::default(),
        sleep: SleepOptions::default(),
        tools: vec![ball()],
        planes: Vec::new(),
        bounds_m: None,
    })
}

/// The same block in small elements of the accurate material.
fn accurate() -> AccurateDescription {
    let mesh = block(SIZE_M, [8, 8, 4]);
    let material = plica_accurate::Material {
        model: MaterialModel::StableNeoHookean,
        young_modulus_pa: YOUNG_MODULUS_PA,
        poisson_ratio: 0.48,
    };
    AccurateDescription {
        materials: vec![material; mesh.n_hexes()],
        densities_kg_per_m3: vec![DENSITY_KG_PER_M3; mesh.n_hexes()],
        fixed: bottom(&mesh),
        mesh,
    }
}

/// Eight presses from above, some of them dragged, picked from 16.
fn presses() -> InteractionSet {
    InteractionSet {
        name: "in_region".into(),
        tool: 0,
        count: 8,
        candidates_per_example: 2,
        source: Source::Press(PressRanges {
            region: vec![[Point3::new(0.012, 0.012, 0.0), Point3::new(0.028, 0.028, 1.0)]],
            approach: Approach::Along(-Vector3::z()),
            depth_share: [0.1, 0.35],
            drag_m: [0.0, 0.005],
            drag_share: 2.0 / 3.0,
        }),
    }
}

fn bottom(mesh: &HexMesh) -> Vec<bool> {
    mesh.nodes().iter().map(|p| p.z < 1e-9).collect()
}

/// A ball of 6 mm radius. Training holds every tool rigidly.
fn ball() -> ToolDescription {
    ToolDescription {
        name: "ball".into(),
        shape: ToolShape::Ball { radius_m: 0.006 },
        coupling: Coupling::Rigid,
        friction: 0.8,
        sampling: Sampling::Latest,
        max_tool_speed_m_per_s: 3.0,
        stale_after_s: 0.2,
        world_from_tracker: Isometry3::identity(),
        tool_from_marker: Isometry3::identity(),
        position_scale: 1.0,
    }
}
