//! Scenes for the tests of training.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test binary uses a part of this")]

use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::{MaterialModel, TieOptions};
use plica_geometry::shapes::{Wedge, block, block_skin, wedge, wedge_skin};
use plica_geometry::{Embedding, EmbeddingKind, HexMesh, Skin};
use plica_sim::*;
use plica_training::*;

const E: f64 = 3e4;

/// What a scene is made of.
pub struct Shape {
    pub coarse: HexMesh,
    pub accurate: HexMesh,
    pub skin: Skin,
    pub region: Vec<[Point3<f64>; 2]>,
    pub radius_m: f64,
}

/// A block of 40 x 40 x 20 mm with few elements: an interaction takes a fraction of a second.
pub fn tiny() -> Setup {
    let size = [0.04, 0.04, 0.02];
    setup(Shape {
        coarse: block(size, [3, 3, 2]),
        accurate: block(size, [8, 8, 4]),
        skin: block_skin(size, 0.002),
        region: vec![[Point3::new(0.012, 0.012, 0.0), Point3::new(0.028, 0.028, 1.0)]],
        radius_m: 0.006,
    })
}

/// The wedge of the scenes.
pub fn wedge_scene(divisions: [usize; 3], spacing_m: f64) -> Setup {
    let shape = Wedge::default();
    setup(Shape {
        coarse: wedge(&shape, [8, 4, 4]),
        accurate: wedge(&shape, divisions),
        skin: wedge_skin(&shape, spacing_m),
        region: vec![[Point3::new(0.02, 0.012, 0.0), Point3::new(0.08, 0.048, 1.0)]],
        radius_m: 0.007,
    })
}

pub fn setup(shape: Shape) -> Setup {
    let skin = shape.skin.clustered();
    let kind = EmbeddingKind::MovingLeastSquares { support_cells: 1.75 };
    let embedding = Embedding::new(&shape.coarse, skin.positions(), kind).unwrap();
    let bottom = |mesh: &HexMesh| mesh.nodes().iter().map(|p| p.z < 1e-9).collect();
    let material = Material { young_modulus_pa: E, poisson_ratio: 0.45, density_kg_per_m3: 1000.0 };
    let accurate_material =
        plica_accurate::Material { model: MaterialModel::StableNeoHookean, young_modulus_pa: E, poisson_ratio: 0.48 };
    let ranges = PressRanges {
        region: shape.region.clone(),
        approach: Approach::Along(-Vector3::z()),
        depth_share: [0.1, 0.35],
        drag_m: [0.0, 0.005],
        drag_share: 2.0 / 3.0,
    };
    let set = |name: &str, count, candidates_per_example, source| InteractionSet {
        name: name.into(),
        tool: 0,
        count,
        candidates_per_example,
        source,
    };
    let sides =
        PressRanges { region: Vec::new(), approach: Approach::Normal, depth_share: [0.05, 0.1], ..ranges.clone() };
    Setup {
        scene_hash: "0".repeat(64),
        accurate: AccurateDescription {
            materials: vec![accurate_material; shape.accurate.n_hexes()],
            densities_kg_per_m3: vec![1000.0; shape.accurate.n_hexes()],
            fixed: bottom(&shape.accurate),
            mesh: shape.accurate,
        },
        tie: TieOptions::for_modulus(E),
        stamp_axes: [Vector3::x(), Vector3::y()],
        drive: DriveOptions::default(),
        features: FeatureScales::default(),
        training: set("in_region", 4, 2, Source::Press(ranges.clone())),
        training_seed: 1,
        evaluation: vec![
            set("in_region", 2, 1, Source::Press(ranges.clone())),
            set("lift", 1, 1, Source::Lift(ranges)),
            set("side", 1, 1, Source::Press(sides)),
        ],
        evaluation_seed: 2,
        coarse: ModelDescription {
            fixed: bottom(&shape.coarse),
            materials: vec![material; shape.coarse.n_hexes()],
            mesh: shape.coarse,
            skin,
            embedding,
            mass_damping_per_s: 1.0,
            gravity_m_per_s2: Vector3::zeros(),
            element: ElementKind::EnhancedStrain,
            timestep_s: 1e-3,
            substeps: 1,
            solver: SolverOptions::default(),
            contact: ContactOptions::default(),
            sleep: SleepOptions::default(),
            tools: vec![tool(ToolShape::Capsule { radius_m: shape.radius_m, length_m: 0.1 })],
            planes: Vec::new(),
            bounds_m: None,
        },
    }
}

pub fn tool(shape: ToolShape) -> ToolDescription {
    ToolDescription {
        name: "probe".into(),
        shape,
        coupling: Coupling::Spring(SpringCoupling::default()),
        friction: 0.8,
        sampling: Sampling::Latest,
        max_tool_speed_m_per_s: 3.0,
        stale_after_s: 0.2,
        world_from_tracker: Isometry3::identity(),
        tool_from_marker: Isometry3::identity(),
        position_scale: 1.0,
    }
}
