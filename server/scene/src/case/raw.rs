//! A case file as typed: every key of the TOML, nothing checked beyond its type.

#![allow(rustdoc::broken_intra_doc_links, reason = "units in brackets, as in the scene file")]

use schemars::JsonSchema;
use serde::Deserialize;

use crate::scene::raw::{LARGEST_M, RawBox, RawFace};

/// Largest stress \[Pa\] or force \[N\] of a load.
const LARGEST_LOAD: f64 = 1e15;

/// One accurate solve: a mesh with materials, supports, loads and probes.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "Plica case")]
pub struct RawCase {
    /// Shape, by generator or file.
    pub mesh: RawMesh,
    /// Material of everything that no region claims.
    pub material: RawMaterial,
    /// Parts of another material; a later region wins.
    #[serde(default)]
    pub regions: Vec<RawRegion>,
    /// Supports of the body.
    #[serde(default)]
    pub supports: Vec<RawSupport>,
    /// Loads on the body.
    #[serde(default)]
    pub loads: Vec<RawLoad>,
    /// Rigid tools that touch the body.
    #[serde(default)]
    pub tools: Vec<RawCaseTool>,
    /// Quantities to report.
    #[serde(default)]
    pub probes: Vec<RawProbe>,
    /// Load stepping and Newton iteration.
    #[serde(default)]
    pub solve: RawSolve,
}

/// Shape of the body.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawMesh {
    /// Generator of the shape.
    pub generator: Option<RawGenerator>,
    /// Block: extents along x, y, z [m]; one corner is the origin.
    #[schemars(inner(range(min = 1e-9, max = 1e3)))]
    pub size_m: Option<[f64; 3]>,
    /// Wedge: extent along x [m].
    #[schemars(range(min = 1e-9, max = 1e3))]
    pub length_m: Option<f64>,
    /// Wedge: extent along y [m].
    #[schemars(range(min = 1e-9, max = 1e3))]
    pub width_m: Option<f64>,
    /// Wedge: height at x = 0 [m].
    #[schemars(range(min = 1e-9, max = 1e3))]
    pub thick_height_m: Option<f64>,
    /// Wedge: height at x = length [m].
    #[schemars(range(min = 1e-9, max = 1e3))]
    pub thin_height_m: Option<f64>,
    /// Hexahedron: corners [m], counter-clockwise around the bottom seen from above, then around the top.
    #[schemars(inner(inner(range(min = -LARGEST_M, max = LARGEST_M))))]
    pub corners_m: Option<[[f64; 3]; 8]>,
    /// Hexahedra along the three directions of a generated shape.
    #[schemars(inner(range(min = 1, max = 10_000)))]
    pub divisions: Option<[u32; 3]>,
    /// Length of the last hexahedron over that of the first, along each direction.
    #[schemars(inner(range(min = 1e-3, max = 1e3)))]
    pub grading: Option<[f64; 3]>,
    /// Mesh file of hexahedra or tetrahedra (.vtu, .msh), relative to the case file.
    pub file: Option<String>,
    /// Metres per unit of the file.
    #[schemars(range(min = 1e-9, max = 1e3))]
    pub metres_per_unit: Option<f64>,
    /// Nodes of the file closer than this become one [m]. Left out, parts that touch without sharing nodes are an error; 0 keeps
    /// them apart, with a warning.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub merge_tolerance_m: Option<f64>,
}

/// Generators of shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawGenerator {
    /// A box.
    Block,
    /// Height falls linearly along x.
    Wedge,
    /// Any hexahedron by its corners.
    Hexahedron,
}

/// A material by two constants, and what its law has besides.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawMaterial {
    /// Material law.
    pub model: RawModel,
    /// Young's modulus [Pa], with `poisson_ratio`.
    #[schemars(range(min = 1e-3, max = 1e13))]
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio [-], with `young_modulus_pa`.
    #[schemars(range(min = -0.99, max = 0.499_999))]
    pub poisson_ratio: Option<f64>,
    /// Shear modulus [Pa], with `lambda_pa`.
    #[schemars(range(min = 1e-3, max = 1e13))]
    pub mu_pa: Option<f64>,
    /// Lamé's first parameter [Pa], with `mu_pa`.
    #[schemars(range(min = -5e12, max = 5e18))]
    pub lambda_pa: Option<f64>,
    /// Exponent of the exponential law [-].
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub exponent: Option<f64>,
    /// Fibres of the fibre-reinforced law.
    pub fibres: Option<RawFibres>,
    /// Density [kg/m3], for `gravity_m_per_s2`.
    #[schemars(range(min = 1e-3, max = 1e5))]
    pub density_kg_per_m3: Option<f64>,
}

/// Material laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawModel {
    /// Small strain, small rotation.
    Linear,
    /// Energy with the logarithm of the volume ratio.
    CompressibleNeoHookean,
    /// Finite energy under any compression.
    StableNeoHookean,
    /// Stiffens exponentially, as soft tissue does.
    Exponential,
    /// Compressible Neo-Hookean, stiffer along fibres.
    FibreReinforced,
}

/// Fibres of a transversely isotropic material, with a direction by exactly one of `direction`, `about`, `array`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFibres {
    /// Young's modulus along the fibres [Pa]; at least `young_modulus_pa`, which is that across them.
    #[schemars(range(min = 1e-3, max = 1e13))]
    pub fibre_modulus_pa: f64,
    /// One direction for all fibres.
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub direction: Option<[f64; 3]>,
    /// Circles around an axis.
    pub about: Option<RawFibreAxis>,
    /// Name of a cell array of three components of a .vtu file.
    pub array: Option<String>,
}

/// Axis of circular fibres.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawFibreAxis {
    /// Direction of the axis.
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub axis: [f64; 3],
    /// A point of the axis [m].
    #[serde(default)]
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub through_m: [f64; 3],
}

/// A part of another material.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawRegion {
    /// Name, for messages.
    pub name: String,
    /// Hexahedra of the region.
    pub select: RawSelect,
    /// Material law; that of `material` where left out.
    pub model: Option<RawModel>,
    /// Young's modulus [Pa], with `poisson_ratio`.
    #[schemars(range(min = 1e-3, max = 1e13))]
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio [-], with `young_modulus_pa`.
    #[schemars(range(min = -0.99, max = 0.499_999))]
    pub poisson_ratio: Option<f64>,
    /// Shear modulus [Pa], with `lambda_pa`.
    #[schemars(range(min = 1e-3, max = 1e13))]
    pub mu_pa: Option<f64>,
    /// Lamé's first parameter [Pa], with `mu_pa`.
    #[schemars(range(min = -5e12, max = 5e18))]
    pub lambda_pa: Option<f64>,
    /// Exponent of the exponential law [-].
    #[schemars(range(min = 1e-3, max = 1e4))]
    pub exponent: Option<f64>,
    /// Fibres of the fibre-reinforced law.
    pub fibres: Option<RawFibres>,
    /// Density [kg/m3], that of `material` where left out.
    #[schemars(range(min = 1e-3, max = 1e5))]
    pub density_kg_per_m3: Option<f64>,
}

/// A part of the mesh; all given conditions must hold.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSelect {
    /// A box.
    #[serde(rename = "box")]
    pub within: Option<RawBox>,
    /// A face of the mesh's bounding box.
    pub face: Option<RawFace>,
    /// A named group of the mesh file.
    pub group: Option<String>,
    /// A condition on x, y, z in metres.
    #[serde(rename = "where")]
    pub condition: Option<String>,
}

/// Coordinate axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawAxis {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
}

/// Nodes whose displacement is given.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawSupport {
    /// Name, for messages and force probes.
    pub name: String,
    /// Nodes.
    pub select: RawSelect,
    /// Directions in which the nodes are held; all where left out.
    pub axes: Option<Vec<RawAxis>>,
    /// Only direction in which the nodes are held, of any length: a roller or a plane of symmetry at any angle. In place of `axes`.
    #[schemars(inner(range(min = -1e3, max = 1e3)))]
    pub normal: Option<[f64; 3]>,
    /// Displacement of the nodes [m], along held directions; 0 where left out.
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub displacement_m: Option<[f64; 3]>,
    /// Rotation of the nodes about an axis; held axes follow it.
    pub turn: Option<RawTurn>,
}

/// Rotation about an axis in space.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawTurn {
    /// Direction of the axis, of any length.
    #[schemars(inner(range(min = -1e3, max = 1e3)))]
    pub axis: [f64; 3],
    /// Point on the axis [m]; the origin where left out.
    #[serde(default)]
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub through_m: [f64; 3],
    /// Angle [degrees], right-handed.
    #[schemars(range(min = -3600.0, max = 3600.0))]
    pub angle_deg: f64,
}

/// A load, of exactly one kind.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawLoad {
    /// Name, for messages.
    pub name: String,
    /// Boundary faces; with `force_n` also nodes; with `nodal_force_n` nodes; with `body_force_n_per_m3` and `gravity_m_per_s2`
    /// hexahedra.
    pub select: RawSelect,
    /// Dead load: force per rest area [Pa].
    #[schemars(inner(range(min = -LARGEST_LOAD, max = LARGEST_LOAD)))]
    pub traction_pa: Option<[f64; 3]>,
    /// Follower load: pressure on the deformed faces [Pa].
    #[schemars(range(min = -LARGEST_LOAD, max = LARGEST_LOAD))]
    pub pressure_pa: Option<f64>,
    /// Dead load: total force [N], spread evenly over the faces, or over the nodes where no face is selected.
    #[schemars(inner(range(min = -LARGEST_LOAD, max = LARGEST_LOAD)))]
    pub force_n: Option<[f64; 3]>,
    /// Dead load: total force [N], in equal parts on all selected nodes, inner ones too.
    #[schemars(inner(range(min = -LARGEST_LOAD, max = LARGEST_LOAD)))]
    pub nodal_force_n: Option<[f64; 3]>,
    /// Follower load: moment [N m] on the faces, about an axis that keeps its direction, by forces that turn with the faces and
    /// have no resultant.
    #[schemars(inner(range(min = -LARGEST_LOAD, max = LARGEST_LOAD)))]
    pub moment_n_m: Option<[f64; 3]>,
    /// Dead load: force per rest volume [N/m3].
    #[schemars(inner(range(min = -LARGEST_LOAD, max = LARGEST_LOAD)))]
    pub body_force_n_per_m3: Option<[f64; 3]>,
    /// Weight: acceleration [m/s2], times the density of each hexahedron's material.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub gravity_m_per_s2: Option<[f64; 3]>,
}

/// A rigid tool, which moves as the loads grow.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawCaseTool {
    /// Name, for messages and force probes.
    pub name: String,
    /// Shape in the tool's own frame.
    pub shape: RawCaseShape,
    /// Origin of the tool's frame without loads [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub position_m: [f64; 3],
    /// Direction of the shape's z axis, of any length; z where left out.
    #[schemars(inner(range(min = -1e3, max = 1e3)))]
    pub axis: Option<[f64; 3]>,
    /// Motion of the tool under full loads [m].
    #[serde(default)]
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub motion_m: [f64; 3],
    /// Coulomb friction [-]; above 0 only with a single tool.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub friction: f64,
}

/// Shape of a tool of a case, in its own frame.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum RawCaseShape {
    /// Ball around the origin.
    Ball {
        /// Radius [m].
        #[schemars(range(min = 1e-9, max = 1e3))]
        radius_m: f64,
    },
    /// Rod with round ends, from the origin along +z.
    Capsule {
        /// Radius [m].
        #[schemars(range(min = 1e-9, max = 1e3))]
        radius_m: f64,
        /// Distance between the centres of the two ends [m].
        #[schemars(range(min = 1e-9, max = 1e3))]
        length_m: f64,
    },
    /// Box around the origin.
    Cuboid {
        /// Extents along x, y, z [m].
        #[schemars(inner(range(min = 1e-9, max = 1e3)))]
        size_m: [f64; 3],
    },
    /// Flat-ended round punch from the origin along +z: a prism of 64 sides around the circle.
    Punch {
        /// Radius [m].
        #[schemars(range(min = 1e-9, max = 1e3))]
        radius_m: f64,
        /// Length [m].
        #[schemars(range(min = 1e-9, max = 1e3))]
        length_m: f64,
    },
    /// All points with z <= 0: a floor.
    HalfSpace {},
}

/// Quantities to report.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// Name in the output.
    pub name: String,
    /// Quantity that the probe reports.
    pub quantity: RawQuantity,
    /// Displacement, stress: point of the body at rest [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub at_m: Option<[f64; 3]>,
    /// Displacement: point whose nearest node is read [m].
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub nearest_to_m: Option<[f64; 3]>,
    /// Displacement: mean over these nodes.
    pub select: Option<RawSelect>,
    /// Force, moment: name of the support that exerts it.
    pub support: Option<String>,
    /// Force, moment: name of the tool that exerts it.
    pub tool: Option<String>,
    /// Moment: point about which it acts [m]; the origin where left out.
    #[schemars(inner(range(min = -LARGEST_M, max = LARGEST_M)))]
    pub about_m: Option<[f64; 3]>,
}

/// Quantities of probes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RawQuantity {
    /// [m], three components.
    Displacement,
    /// Force that a support or a tool exerts on the body [N], three components.
    Force,
    /// Moment that a support or a tool exerts on the body [N m], three components.
    Moment,
    /// Deformed volume [m3].
    Volume,
    /// Cauchy stress [Pa]: xx, yy, zz, xy, yz, xz.
    Stress,
}

/// Load stepping and Newton iteration.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolve {
    /// Equal parts in which loads and displacements are applied.
    #[schemars(range(min = 1, max = 1000))]
    pub steps: u32,
    /// Largest force left, as a share of the largest nodal force.
    #[schemars(range(min = 1e-13, max = 1e-3))]
    pub tolerance: f64,
    /// Newton steps per part.
    #[schemars(range(min = 1, max = 1000))]
    pub max_iterations: u32,
    /// Most successive halvings of a part that fails.
    #[schemars(range(min = 0, max = 20))]
    pub max_halvings: u32,
    /// Arc length: follows the equilibrium past limit points, the share of the loads being unknown.
    pub arc_length: Option<RawArcLength>,
}

impl Default for RawSolve {
    fn default() -> Self {
        Self { steps: 1, tolerance: 1e-9, max_iterations: 50, max_halvings: 8, arc_length: None }
    }
}

/// Steps along the path of equilibria in place of steps of the loads.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawArcLength {
    /// Largest motion of any node in a step [m].
    #[schemars(range(min = 1e-12, max = 1e3))]
    pub step_m: f64,
    /// Steps after which the path ends, unless it carries all loads before.
    #[schemars(range(min = 1, max = 10_000))]
    pub max_steps: u32,
}
