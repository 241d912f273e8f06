//! A case file as typed: every key of the TOML, nothing checked beyond its type.

#![allow(rustdoc::broken_intra_doc_links, reason = "units in brackets, as in the scene file")]

use serde::Deserialize;

use crate::scene::raw::{RawBox, RawFace};

/// One accurate solve: a mesh, its materials, what holds and loads it, and what to tell of the result.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawCase {
    /// Shape, by generator or file.
    pub mesh: RawMesh,
    /// Material of everything that no region claims.
    pub material: RawMaterial,
    /// Parts of another material; a later one wins.
    #[serde(default)]
    pub regions: Vec<RawRegion>,
    /// What holds the body.
    #[serde(default)]
    pub supports: Vec<RawSupport>,
    /// What loads it.
    #[serde(default)]
    pub loads: Vec<RawLoad>,
    /// What to tell of the result.
    #[serde(default)]
    pub probes: Vec<RawProbe>,
    /// How to solve.
    #[serde(default)]
    pub solve: RawSolve,
}

/// Shape of the body.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawMesh {
    /// Which generator makes the shape.
    pub generator: Option<RawGenerator>,
    /// Block: extents along x, y, z [m]; one corner is the origin.
    pub size_m: Option<[f64; 3]>,
    /// Wedge: extent along x [m].
    pub length_m: Option<f64>,
    /// Wedge: extent along y [m].
    pub width_m: Option<f64>,
    /// Wedge: height at x = 0 [m].
    pub thick_height_m: Option<f64>,
    /// Wedge: height at x = length [m].
    pub thin_height_m: Option<f64>,
    /// Hexahedron: corners [m], counter-clockwise around the bottom seen from above, then around the top.
    pub corners_m: Option<[[f64; 3]; 8]>,
    /// Hexahedra along the three directions of a generated shape.
    pub divisions: Option<[u32; 3]>,
    /// Length of the last hexahedron over that of the first, along each direction.
    pub grading: Option<[f64; 3]>,
    /// Mesh file of hexahedra (.vtu, .msh), relative to the case file.
    pub file: Option<String>,
    /// Metres per unit of the file.
    pub metres_per_unit: Option<f64>,
}

/// Generators of shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RawGenerator {
    /// A box.
    Block,
    /// Height falls linearly along x.
    Wedge,
    /// Any hexahedron by its corners.
    Hexahedron,
}

/// An isotropic material by two of its constants.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawMaterial {
    /// Which law.
    pub model: RawModel,
    /// Young's modulus [Pa], with `poisson_ratio`.
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio [-], with `young_modulus_pa`.
    pub poisson_ratio: Option<f64>,
    /// Shear modulus [Pa], with `lambda_pa`.
    pub mu_pa: Option<f64>,
    /// Lamé's first parameter [Pa], with `mu_pa`.
    pub lambda_pa: Option<f64>,
}

/// Material laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RawModel {
    /// Small strain, small rotation.
    Linear,
    /// With the logarithm of the volume ratio.
    CompressibleNeoHookean,
    /// Finite however it is squeezed.
    StableNeoHookean,
}

/// A part of another material.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawRegion {
    /// Name, for messages.
    pub name: String,
    /// Hexahedra of the region.
    pub select: RawSelect,
    /// Which law; that of `material` where left out.
    pub model: Option<RawModel>,
    /// Young's modulus [Pa], with `poisson_ratio`.
    pub young_modulus_pa: Option<f64>,
    /// Poisson's ratio [-], with `young_modulus_pa`.
    pub poisson_ratio: Option<f64>,
    /// Shear modulus [Pa], with `lambda_pa`.
    pub mu_pa: Option<f64>,
    /// Lamé's first parameter [Pa], with `mu_pa`.
    pub lambda_pa: Option<f64>,
}

/// A part of the mesh; all given conditions must hold.
#[derive(Debug, Clone, Default, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
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
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawSupport {
    /// Name, for messages and force probes.
    pub name: String,
    /// Nodes.
    pub select: RawSelect,
    /// Directions in which the nodes are held.
    #[serde(default = "all_axes")]
    pub axes: Vec<RawAxis>,
    /// Where they are moved to [m]; 0 where left out.
    pub displacement_m: Option<[f64; 3]>,
}

fn all_axes() -> Vec<RawAxis> {
    vec![RawAxis::X, RawAxis::Y, RawAxis::Z]
}

/// A load on boundary faces; exactly one of the three numbers.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawLoad {
    /// Name, for messages.
    pub name: String,
    /// Boundary faces; with `force_n` also nodes.
    pub select: RawSelect,
    /// Dead: force per rest area [Pa], keeps its direction.
    pub traction_pa: Option<[f64; 3]>,
    /// Follower: pushes against the deformed faces [Pa].
    pub pressure_pa: Option<f64>,
    /// Dead: total force [N], spread evenly over the faces, or over the nodes where no face is selected.
    pub force_n: Option<[f64; 3]>,
}

/// What to tell of the result.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RawProbe {
    /// Its name in the output.
    pub name: String,
    /// What it tells.
    pub quantity: RawQuantity,
    /// Displacement, stress: at this point of the body at rest [m].
    pub at_m: Option<[f64; 3]>,
    /// Displacement: of the node nearest to this point [m].
    pub nearest_to_m: Option<[f64; 3]>,
    /// Displacement: mean over these nodes.
    pub select: Option<RawSelect>,
    /// Force: name of the support that exerts it.
    pub support: Option<String>,
}

/// What a probe tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RawQuantity {
    /// [m], three components.
    Displacement,
    /// Force that a support exerts on the body [N], three components.
    Force,
    /// Deformed volume [m3].
    Volume,
    /// Cauchy stress [Pa]: xx, yy, zz, xy, yz, xz.
    Stress,
}

/// How to solve.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawSolve {
    /// Equal parts in which loads and displacements are applied, 1 to 1000.
    pub steps: u32,
    /// Largest force left, as a share of the largest nodal force, 1e-13 to 1e-3.
    pub tolerance: f64,
    /// Newton steps per part, 1 to 1000.
    pub max_iterations: u32,
    /// How often in a row a part that fails is halved, 0 to 20.
    pub max_halvings: u32,
}

impl Default for RawSolve {
    fn default() -> Self {
        Self { steps: 1, tolerance: 1e-9, max_iterations: 50, max_halvings: 8 }
    }
}
