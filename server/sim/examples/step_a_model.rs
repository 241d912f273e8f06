//! Steps a model: a ball is pressed 5 mm into a soft block, and the force on it is printed.
//!
//! `cargo run --release -p plica-sim --example step_a_model`

use nalgebra::{Isometry3, Vector3};
use plica_geometry::shapes::{block, block_skin};
use plica_geometry::{Embedding, EmbeddingKind};
use plica_sim::*;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = Model::new(soft_block()?)?;
    let (mut state, mut workspace) = (State::new(&model), Workspace::new(&model));
    for sequence in 0..300 {
        let depth_m = 0.005 * (sequence as f64 / 200.0).min(1.0);
        let pose = Isometry3::translation(0.04, 0.02, 0.05 - depth_m);
        let sample = PoseSample { sequence, source_time_ns: None, valid: true, pose };
        let input = TickInput { clock_s: 1e-3 * sequence as f64, poses: &[ToolPose { tool: 0, sample }] };
        tick(&model, input, &mut state, &mut workspace, &mut NoProbe);
    }
    println!("{:.3} N upwards", state.tools()[0].contact_force_n.z);
    Ok(())
}

/// 80 x 40 x 40 mm, fixed at the bottom, with one tool.
fn soft_block() -> Result<ModelDescription, Box<dyn std::error::Error>> {
    let size_m = [0.08, 0.04, 0.04];
    let (mesh, skin) = (block(size_m, [8, 4, 4]), block_skin(size_m, 2e-3).clustered());
    let kind = EmbeddingKind::MovingLeastSquares { support_cells: 1.75 };
    let material = Material { young_modulus_pa: 3e4, poisson_ratio: 0.45, density_kg_per_m3: 1000.0 };
    Ok(ModelDescription {
        embedding: Embedding::new(&mesh, skin.positions(), kind)?,
        fixed: mesh.nodes().iter().map(|p| p.z < 1e-9).collect(),
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
        planes: vec![],
        bounds_m: None,
    })
}

/// A rigid ball of 10 mm radius.
fn ball() -> ToolDescription {
    ToolDescription {
        name: "ball".into(),
        shape: ToolShape::Ball { radius_m: 0.01 },
        coupling: Coupling::Rigid,
        friction: 0.5,
        sampling: Sampling::Latest,
        max_tool_speed_m_per_s: 3.0,
        stale_after_s: 0.2,
        world_from_tracker: Isometry3::identity(),
        tool_from_marker: Isometry3::identity(),
        position_scale: 1.0,
    }
}
