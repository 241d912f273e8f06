//! A scene file as typed: every key of the TOML, nothing checked beyond its type. `plicad schema` prints this.

#![allow(rustdoc::broken_intra_doc_links, reason = "units in brackets; the schema shows this text as it is")]

mod enrichment;
mod training;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

pub(crate) use enrichment::*;
pub(crate) use training::*;

/// Largest coordinate of a point in a scene or case \[m\].
pub(crate) const LARGEST_M: f64 = 1e3;

/// A scene: one soft object, tools, contact and run time.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Plica scene")]
pub struct RawConfig {
    /// Soft objects by name. Version 1 runs exactly one.
    pub objects: BTreeMap<String, RawObject>,
    /// Tools by name.
    #[serde(default)]
    pub tools: BTreeMap<String, RawTool>,
    /// Contact detection and law.
    #[serde(default)]
    pub contact: RawContact,
    /// Time step, gravity, real-time thread.
    #[serde(default)]
    pub runtime: RawRuntime,
    /// Scripted tool motion of `plicad bench`.
    pub bench: Option<RawBench>,
}

/// One soft object.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawObject {
    /// Shape.
    pub mesh: RawMesh,
    /// Material outside of all regions.
    pub material: RawMaterial,
    /// Boxes of another material; a later region wins.
    #[serde(default)]
    pub regions: Vec<RawRegion>,
    /// Supports of the object.
    #[serde(default)]
    pub supports: RawSupports,
    /// Real-time model.
    #[serde(default)]
    pub coarse: RawCoarse,
    /// Published surface.
    #[serde(default)]
    pub skin: RawSkin,
    /// Contents and rates of the published data.
    #[serde(default)]
    pub publish: RawPublish,
    /// Quasi-static model of the examples.
    #[serde(default)]
    pub accurate: RawAccurate,
    /// Tie of the accurate skin to the coarse imprint.
    #[serde(default)]
    pub tie: RawTie,
    /// Interactions and sampling of `plicad train`.
    #[serde(default)]
    pub training: RawTraining,
    /// Enrichment method and its options.
    #[serde(default)]
    pub enrichment: RawEnrichment,
}

/// Generated shape of an object.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawMesh {
    /// Generator of the shape.
    pub generator: RawGenerator,
    /// Wedge: extent along x [m].
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub length_m: Option<f64>,
    /// Wedge: extent along y [m].
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub width_m: Option<f64>,
    /// Wedge: height at x = 0 [m].
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub thick_height_m: Option<f64>,
    /// Wedge: height at x = length [m].
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub thin_height_m: Option<f64>,
    /// Block: extents along x, y, z [m].
    #[schemars(inner(range(min = 1e-3, max = 10.0)))]
    pub size_m: Option<[f64; 3]>,
}

/// Generators of shapes. All start at the origin and extend towards +x, +y, +z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawGenerator {
    /// Height falls linearly along x.
    Wedge,
    /// A box.
    Block,
}

/// Isotropic linear elastic material.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawMaterial {
    /// Young's modulus [Pa].
    #[schemars(range(min = 10.0, max = 1e9))]
    pub young_modulus_pa: f64,
    /// Poisson's ratio [-].
    #[schemars(range(min = 0.0, max = 0.499))]
    pub poisson_ratio: f64,
    /// Density [kg/m3].
    #[schemars(range(min = 1.0, max = 2e4))]
    pub density_kg_per_m3: f64,
    /// Damping proportional to mass [1/s].
    #[serde(default = "defaults::one")]
    #[schemars(range(min = 0.0, max = 1e3))]
    pub mass_damping_per_s: f64,
}

/// A box of another material. A hexahedron belongs to the box that contains its centre.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRegion {
    /// Name, for messages.
    pub name: String,
    /// Lower corner [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub min_m: [f64; 3],
    /// Upper corner [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub max_m: [f64; 3],
    /// Young's modulus [Pa]; the object's where left out.
    #[schemars(range(min = 10.0, max = 1e9))]
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio [-]; the object's where left out.
    #[schemars(range(min = 0.0, max = 0.499))]
    pub poisson_ratio: Option<f64>,
    /// Density [kg/m3]; the object's where left out.
    #[schemars(range(min = 1.0, max = 2e4))]
    pub density_kg_per_m3: Option<f64>,
}

/// Supports of the object.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSupports {
    /// Coarse nodes held at their rest position.
    pub fixed: RawFixed,
    /// Immovable half-spaces that the skin may rest on.
    pub planes: Vec<RawPlane>,
    /// Box that the object may move in; once out, it is put back.
    pub bounds: Option<RawBox>,
}

/// Coarse nodes that never move.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawFixed {
    /// Faces of the mesh's bounding box; nodes on them are held.
    pub faces: Vec<RawFace>,
    /// Boxes; nodes inside are held.
    pub boxes: Vec<RawBox>,
}

/// A face of a mesh's bounding box.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawFace {
    /// Least x.
    XMin,
    /// Largest x.
    XMax,
    /// Least y.
    YMin,
    /// Largest y.
    YMax,
    /// Least z: the bottom.
    ZMin,
    /// Largest z.
    ZMax,
}

/// A file that belongs to the scene: its path, relative to the scene file.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, JsonSchema)]
pub struct RawFile(pub String);

/// An axis-aligned box.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBox {
    /// Lower corner [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub min_m: [f64; 3],
    /// Upper corner [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub max_m: [f64; 3],
}

/// An immovable half-space.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawPlane {
    /// A point of its surface [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub point_m: [f64; 3],
    /// Direction towards the object; need not be of unit length.
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub normal: [f64; 3],
}

/// Real-time model of an object.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawCoarse {
    /// Hexahedra along x, y, z.
    #[schemars(inner(range(min = 1, max = 200)))]
    pub divisions: [u32; 3],
    /// Hexahedron whose stiffness is precomputed.
    pub element: RawElement,
    /// Implicit steps per tick.
    #[schemars(range(min = 1, max = 16))]
    pub substeps: u32,
    /// Linear solver.
    pub solver: RawSolver,
}

/// Elements of the real-time model; both cost the same at run time.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawElement {
    /// Bends without locking.
    EnhancedStrain,
    /// Trilinear with 2x2x2 points; too stiff in bending, for comparison.
    FullIntegration,
}

/// Linear solver of the implicit step.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolver {
    /// Preconditioner of the conjugate gradients.
    pub preconditioner: RawPreconditioner,
    /// Residual at which the iteration stops, as a share of the first one [-].
    #[schemars(range(min = 1e-7, max = 0.1))]
    pub tolerance: f64,
    /// Most iterations before the solve is repeated with block Jacobi.
    #[schemars(range(min = 1, max = 200))]
    pub max_iterations: u32,
    /// Most iterations of the repetition with block Jacobi.
    #[schemars(range(min = 1, max = 500))]
    pub fallback_iterations: u32,
}

/// Preconditioners.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawPreconditioner {
    /// Block tridiagonal while its tables fit the cache.
    Auto,
    /// Rest-state inverse, warped by node rotations.
    BlockTridiagonal,
    /// Inverse 3x3 diagonal blocks.
    BlockJacobi,
}

/// Published surface.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSkin {
    /// Largest edge of the skin grid [m].
    #[schemars(range(min = 1e-4, max = 1.0))]
    pub spacing_m: f64,
    /// Interpolation from coarse nodes to skin vertices.
    pub embedding: RawEmbedding,
    /// Radius of moving least squares in coarse cells.
    #[schemars(range(min = 1.0, max = 3.0))]
    pub support_cells: f64,
}

/// Interpolation from coarse nodes to skin vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawEmbedding {
    /// Smooth across cells.
    MovingLeastSquares,
    /// The cell's own corners.
    Trilinear,
}

/// Contents and rates of the published data.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawPublish {
    /// Skin frames per second while somebody listens.
    #[schemars(range(min = 1.0, max = 1e3))]
    pub publish_hz: f64,
    /// Whether frames hold vertex normals.
    pub normals: bool,
    /// Format of skin positions.
    pub format: RawFormat,
    /// Wrenches per second and tool.
    #[schemars(range(min = 1.0, max = 1e3))]
    pub wrench_hz: f64,
}

/// Format of skin positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawFormat {
    /// 32-bit floats, world positions.
    F32,
    /// 16-bit offsets from rest with one scale.
    I16,
}

/// A tool that touches the object.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTool {
    /// Shape in the tool's own frame.
    pub shape: RawShape,
    /// Coupling of the simulated proxy to the device.
    #[serde(default = "defaults::spring")]
    pub coupling: RawCoupling,
    /// Spring of the coupling [N/m].
    #[schemars(range(min = 1.0, max = 1e5))]
    pub coupling_stiffness_n_per_m: Option<f64>,
    /// Damper of the coupling [N s/m]; critical for the proxy's mass where left out.
    #[schemars(range(min = 0.0, max = 1e3))]
    pub coupling_damping_n_s_per_m: Option<f64>,
    /// Mass of the proxy [kg].
    #[schemars(range(min = 1e-4, max = 1.0))]
    pub proxy_mass_kg: Option<f64>,
    /// Lever of the rotational coupling [m]: rotational stiffness is stiffness times lever squared.
    #[schemars(range(min = 1e-3, max = 1.0))]
    pub coupling_lever_m: Option<f64>,
    /// Largest force the coupling transmits [N].
    #[schemars(range(min = 0.01, max = 1e3))]
    pub max_force_n: Option<f64>,
    /// Largest torque the coupling transmits [N m].
    #[schemars(range(min = 1e-4, max = 100.0))]
    pub max_torque_n_m: Option<f64>,
    /// Sampling of device poses, one per tick.
    #[serde(default = "defaults::latest")]
    pub sampling: RawSampling,
    /// Interpolation: delay behind the newest sample [ms].
    #[schemars(range(min = 0.0, max = 500.0))]
    pub delay_ms: Option<f64>,
    /// Fastest motion followed [m/s]; a faster jump re-places the tool without sweep.
    #[serde(default = "defaults::tool_speed")]
    #[schemars(range(min = 0.01, max = 100.0))]
    pub max_tool_speed_m_per_s: f64,
    /// Coulomb friction against the skin [-].
    #[serde(default = "defaults::friction")]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub friction: f64,
    /// Age of the newest pose at which the tool is held and flagged as stale [ms].
    #[serde(default = "defaults::stale_ms")]
    #[schemars(range(min = 1.0, max = 6e4))]
    pub stale_after_ms: f64,
    /// Pose of the tracker in the world.
    #[serde(default)]
    pub world_from_tracker: RawTransform,
    /// Pose of the tracked marker on the tool.
    #[serde(default)]
    pub tool_from_marker: RawTransform,
    /// Factor on tracked positions before `world_from_tracker` [-].
    #[serde(default = "defaults::one")]
    #[schemars(range(min = 1e-4, max = 1e4))]
    pub position_scale: f64,
}

/// Shape of a tool, in its own frame.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawShape {
    /// Ball around the origin.
    Ball {
        /// Radius [m].
        #[schemars(range(min = 5e-4, max = 0.5))]
        radius_m: f64,
    },
    /// Rod with round ends, from the origin along +z.
    Capsule {
        /// Radius [m].
        #[schemars(range(min = 5e-4, max = 0.5))]
        radius_m: f64,
        /// Distance between the centres of the two ends [m].
        #[schemars(range(min = 1e-4, max = 2.0))]
        length_m: f64,
    },
    /// Box around the origin.
    Cuboid {
        /// Extents along x, y, z [m].
        #[schemars(inner(range(min = 1e-3, max = 1.0)))]
        size_m: [f64; 3],
    },
    /// Convex hull of points.
    ConvexHull {
        /// Points [m], at least four that do not lie in a plane.
        #[schemars(inner(inner(range(min = -LARGEST_M, max = LARGEST_M))))]
        points_m: Vec<[f64; 3]>,
    },
    /// Union of convex parts from an OBJ file: every group or object (`g`, `o`) is one part.
    Mesh {
        /// Path, relative to the scene file.
        file: RawFile,
        /// Metres per unit of the file.
        #[serde(default = "defaults::one")]
        #[schemars(range(min = 1e-6, max = 1e3))]
        metres_per_unit: f64,
    },
}

/// Coupling of the simulated proxy to the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawCoupling {
    /// A light rigid body on a saturating 6-DOF spring-damper.
    Spring,
    /// The proxy follows the device exactly.
    Rigid,
}

/// Sampling of device poses, one per tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawSampling {
    /// The newest pose.
    Latest,
    /// Between samples, `delay_ms` in the past.
    Interpolate,
}

/// A rigid transform.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawTransform {
    /// Translation [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub translation_m: [f64; 3],
    /// Unit quaternion `x, y, z, w`.
    pub rotation_xyzw: [f64; 4],
}

/// Contact detection and law.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawContact {
    /// Penalty over the effective stiffness of the touched skin point [-].
    #[schemars(range(min = 1.0, max = 100.0))]
    pub stiffness_ratio: f64,
    /// Share of the multiplier error corrected per tick.
    #[schemars(range(min = 1e-3, max = 1.0))]
    pub multiplier_relaxation: f64,
    /// Predicted gap below which a skin point becomes a contact row [m].
    #[schemars(range(min = 0.0, max = 0.01))]
    pub activation_gap_m: f64,
    /// Time in which penetration found at a new contact is resolved [s].
    #[schemars(range(min = 1e-4, max = 1.0))]
    pub recovery_time_s: f64,
    /// Most contact rows per tool.
    #[schemars(range(min = 1, max = 256))]
    pub max_contacts: u32,
    /// Most contact rows per plane of the supports.
    #[schemars(range(min = 1, max = 1024))]
    pub max_support_contacts: u32,
    /// Coulomb friction of the planes [-].
    #[schemars(range(min = 0.0, max = 2.0))]
    pub plane_friction: f64,
}

/// Time step, gravity, real-time thread.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawRuntime {
    /// Length of a tick [s].
    #[schemars(range(min = 1e-4, max = 0.02))]
    pub timestep_s: f64,
    /// Acceleration of free fall along -z [m/s2].
    #[schemars(range(min = 0.0, max = 100.0))]
    pub gravity_m_per_s2: f64,
    /// `SCHED_FIFO` priority of the simulation thread; 0 keeps the ordinary scheduler.
    #[schemars(range(min = 0, max = 99))]
    pub realtime_priority: u32,
    /// Core that the simulation thread is pinned to.
    #[schemars(range(min = 0, max = 1023))]
    pub cpu: Option<u32>,
    /// Whether memory is locked, so that no tick waits for a page.
    pub lock_memory: bool,
    /// Sleep of an object at rest, which is not solved.
    pub sleep: RawSleep,
}

/// Sleep of an object at rest, which is not solved.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSleep {
    /// Whether an object at rest sleeps.
    pub enabled: bool,
    /// Fastest node that counts as at rest [m/s].
    #[schemars(range(min = 1e-8, max = 0.1))]
    pub speed_m_per_s: f64,
    /// Time at rest with no tool near before the object sleeps [s].
    #[schemars(range(min = 0.0, max = 60.0))]
    pub after_s: f64,
}

/// Scripted tool motion of `plicad bench`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawBench {
    /// Keyframes per tool, in order of time; straight lines between them, held after the last.
    pub motion: Vec<RawKeyframe>,
    /// Time at which the tool's force is reported as the force at full press [s].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub full_press_s: Option<f64>,
}

/// Pose of a tool at one time.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawKeyframe {
    /// Name of the tool.
    pub tool: String,
    /// Time [s].
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub time_s: f64,
    /// Position of the tool's origin [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub position_m: [f64; 3],
    /// Unit quaternion `x, y, z, w`.
    #[serde(default = "defaults::upright")]
    pub orientation_xyzw: [f64; 4],
}

/// Defaults of keys.
mod defaults {
    use plica_sim::{ContactOptions, SleepOptions, SolverOptions};

    use super::*;

    pub(super) fn one() -> f64 {
        1.0
    }
    pub(super) fn tool_speed() -> f64 {
        3.0
    }
    pub(super) fn friction() -> f64 {
        0.5
    }
    pub(super) fn stale_ms() -> f64 {
        200.0
    }
    pub(super) fn upright() -> [f64; 4] {
        [0.0, 0.0, 0.0, 1.0]
    }
    pub(super) fn spring() -> RawCoupling {
        RawCoupling::Spring
    }
    pub(super) fn latest() -> RawSampling {
        RawSampling::Latest
    }

    impl Default for RawCoarse {
        fn default() -> Self {
            Self {
                divisions: [8, 4, 4],
                element: RawElement::EnhancedStrain,
                substeps: 1,
                solver: RawSolver::default(),
            }
        }
    }

    impl Default for RawSolver {
        fn default() -> Self {
            let d = SolverOptions::default();
            Self {
                preconditioner: RawPreconditioner::Auto,
                tolerance: d.tolerance,
                max_iterations: d.max_iterations,
                fallback_iterations: d.fallback_iterations,
            }
        }
    }

    impl Default for RawSkin {
        fn default() -> Self {
            Self { spacing_m: 2e-3, embedding: RawEmbedding::MovingLeastSquares, support_cells: 1.75 }
        }
    }

    impl Default for RawPublish {
        fn default() -> Self {
            Self { publish_hz: 90.0, normals: false, format: RawFormat::F32, wrench_hz: 1000.0 }
        }
    }

    impl Default for RawTransform {
        fn default() -> Self {
            Self { translation_m: [0.0; 3], rotation_xyzw: upright() }
        }
    }

    impl Default for RawContact {
        fn default() -> Self {
            let d = ContactOptions::default();
            Self {
                stiffness_ratio: d.stiffness_ratio,
                multiplier_relaxation: d.multiplier_relaxation,
                activation_gap_m: d.activation_gap_m,
                recovery_time_s: d.recovery_time_s,
                max_contacts: d.max_contacts as u32,
                max_support_contacts: d.max_support_contacts as u32,
                plane_friction: d.plane_friction,
            }
        }
    }

    impl Default for RawRuntime {
        fn default() -> Self {
            Self {
                timestep_s: 1e-3,
                gravity_m_per_s2: 0.0,
                realtime_priority: 60,
                cpu: None,
                lock_memory: true,
                sleep: RawSleep::default(),
            }
        }
    }

    impl Default for RawSleep {
        fn default() -> Self {
            let d = SleepOptions::default();
            Self { enabled: d.enabled, speed_m_per_s: d.speed_m_per_s, after_s: d.after_s }
        }
    }
}
