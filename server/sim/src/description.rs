//! A scene as plain data: input of [`Model`](crate::Model). SI units; right-handed, z up.

use std::borrow::Cow;

use nalgebra::{Isometry3, Point3, Vector3};
use plica_geometry::{ConvexPolytope, Embedding, HexMesh, HullError, Skin};

/// Constant data of a scene.
#[derive(Debug, Clone)]
pub struct ModelDescription {
    /// Coarse mesh.
    pub mesh: HexMesh,
    /// Skin whose vertices are in published order (see `Skin::clustered`).
    pub skin: Skin,
    /// Interpolation from coarse nodes to skin vertices, `[n_skin]` rows.
    pub embedding: Embedding,
    /// Nodes held at their rest position, `[n_nodes]`.
    pub fixed: Vec<bool>,
    /// Material of each hexahedron, `[n_hexes]`.
    pub materials: Vec<Material>,
    /// Damping proportional to mass \[1/s\].
    pub mass_damping_per_s: f64,
    /// Acceleration of free fall \[m/s2\].
    pub gravity_m_per_s2: Vector3<f64>,
    /// Element of the stiffness.
    pub element: ElementKind,
    /// Length of a tick \[s\].
    pub timestep_s: f64,
    /// Implicit steps per tick, each of `timestep_s / substeps`.
    pub substeps: u32,
    /// Linear solver.
    pub solver: SolverOptions,
    /// Contact detection and law.
    pub contact: ContactOptions,
    /// Conditions for skipping the solve of an object at rest.
    pub sleep: SleepOptions,
    /// Tools, in the order in which [`ToolPose::tool`](crate::ToolPose) counts them.
    pub tools: Vec<ToolDescription>,
    /// Immovable half-spaces that the skin rests on.
    pub planes: Vec<Plane>,
    /// Lower and upper corner of the box that the object may move in \[m\]; `None`: a box around the object at rest, far larger
    /// where nothing holds it ([`Model::room_m`](crate::Model::room_m)).
    pub bounds_m: Option<[Point3<f64>; 2]>,
}

/// Isotropic linear elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Young's modulus \[Pa\].
    pub young_modulus_pa: f64,
    /// Poisson's ratio, in [0, 0.499].
    pub poisson_ratio: f64,
    /// Density \[kg/m3\].
    pub density_kg_per_m3: f64,
}

/// The hexahedron whose stiffness is precomputed. Both cost the same at run time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ElementKind {
    /// Enhanced strain with nine modes, condensed \[SR90\]: bends without locking.
    #[default]
    EnhancedStrain,
    /// Trilinear, 2x2x2 Gauss points: locks in bending; kept for comparison with other systems.
    FullIntegration,
}

/// Linear solver of the implicit step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverOptions {
    /// Preconditioner of the conjugate gradients.
    pub preconditioner: Preconditioner,
    /// Residual at which the solve ends, as a share of the first one.
    pub tolerance: f64,
    /// Iterations after which the solve is restored and repeated with block Jacobi.
    pub max_iterations: u32,
    /// Iterations of the repeated solve.
    pub fallback_iterations: u32,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { preconditioner: Preconditioner::Auto, tolerance: 1e-3, max_iterations: 16, fallback_iterations: 20 }
    }
}

/// Preconditioner of the conjugate gradients.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Preconditioner {
    /// Block tridiagonal while its tables fit the second-level cache, else block Jacobi.
    #[default]
    Auto,
    /// Exact inverse of the rest-state matrix, warped by node rotations.
    BlockTridiagonal,
    /// Inverse 3x3 diagonal blocks of the rest-state matrix.
    BlockJacobi,
}

/// Contact detection and law (MATH.md, "Contact").
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactOptions {
    /// Penalty over the effective stiffness `1/(h^2 w)` of the skin point in contact \[-\].
    pub stiffness_ratio: f64,
    /// Share of the multiplier error corrected per tick, in (0, 1].
    pub multiplier_relaxation: f64,
    /// A skin point whose predicted gap is below this becomes a contact row \[m\].
    pub activation_gap_m: f64,
    /// Time constant with which penetration found at a new contact is resolved \[s\].
    pub recovery_time_s: f64,
    /// Most contact rows per tool.
    pub max_contacts: usize,
    /// Most contact rows per plane: a support carries the whole object.
    pub max_support_contacts: usize,
    /// Coulomb friction of the planes; tools carry their own.
    pub plane_friction: f64,
}

impl Default for ContactOptions {
    fn default() -> Self {
        Self {
            stiffness_ratio: 10.0,
            multiplier_relaxation: 0.3,
            activation_gap_m: 0.2e-3,
            recovery_time_s: 10e-3,
            max_contacts: 32,
            max_support_contacts: 64,
            plane_friction: 0.5,
        }
    }
}

/// Conditions for skipping the solve of an object at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SleepOptions {
    /// Whether an object sleeps at all.
    pub enabled: bool,
    /// Node speed below which the object is at rest \[m/s\].
    pub speed_m_per_s: f64,
    /// Time at rest, with no tool near, before it sleeps \[s\].
    pub after_s: f64,
}

impl Default for SleepOptions {
    fn default() -> Self {
        Self { enabled: true, speed_m_per_s: 1e-4, after_s: 0.5 }
    }
}

/// A tool of the scene.
#[derive(Debug, Clone)]
pub struct ToolDescription {
    /// Name on the bus.
    pub name: String,
    /// Shape around the tool's origin.
    pub shape: ToolShape,
    /// Coupling of the simulated proxy to the device.
    pub coupling: Coupling,
    /// Coulomb friction coefficient against the skin.
    pub friction: f64,
    /// Sampling of device poses, one pose per tick.
    pub sampling: Sampling,
    /// Largest speed that is followed; a faster jump re-places the tool without sweep \[m/s\].
    pub max_tool_speed_m_per_s: f64,
    /// A tool without a new pose for this long is held and flagged \[s\].
    pub stale_after_s: f64,
    /// `world <- tracker`.
    pub world_from_tracker: Isometry3<f64>,
    /// `tool <- marker`, so that `world_from_tool = world_from_tracker * tracker_from_marker * tool_from_marker^-1`.
    pub tool_from_marker: Isometry3<f64>,
    /// Factor on tracked positions before `world_from_tracker` \[-\].
    pub position_scale: f64,
}

/// Shape of a tool, in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub enum ToolShape {
    /// Ball around the origin.
    Ball {
        /// Radius \[m\].
        radius_m: f64,
    },
    /// Rod with round ends: from the origin (centre of the tip's hemisphere) along +z.
    Capsule {
        /// Radius \[m\].
        radius_m: f64,
        /// Distance between the centres of the two ends \[m\].
        length_m: f64,
    },
    /// Box around the origin.
    Cuboid {
        /// Half of each edge \[m\].
        half_extents_m: [f64; 3],
    },
    /// Convex hull of points.
    ConvexHull {
        /// The hull \[m\].
        polytope: ConvexPolytope,
    },
    /// Union of convex hulls (a mesh file, decomposed).
    Compound {
        /// Hull of each part \[m\].
        polytopes: Vec<ConvexPolytope>,
    },
}

impl ToolShape {
    /// Convex polytopes whose union is the shape; none for a round shape.
    ///
    /// # Errors
    /// [`HullError`]: a cuboid without a volume.
    pub fn polytopes(&self) -> Result<Cow<'_, [ConvexPolytope]>, HullError> {
        Ok(match self {
            Self::Ball { .. } | Self::Capsule { .. } => Cow::Borrowed(&[]),
            Self::Cuboid { half_extents_m } => Cow::Owned(vec![ConvexPolytope::cuboid(*half_extents_m)?]),
            Self::ConvexHull { polytope } => Cow::Borrowed(std::slice::from_ref(polytope)),
            Self::Compound { polytopes } => Cow::Borrowed(polytopes),
        })
    }
}

/// Coupling of the simulated proxy to the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coupling {
    /// The proxy has the pose of the device.
    Rigid,
    /// A light rigid body on a saturating 6-DOF spring-damper.
    Spring(SpringCoupling),
}

/// Saturating 6-DOF spring-damper between device pose and proxy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringCoupling {
    /// Mass of the proxy \[kg\].
    pub mass_kg: f64,
    /// Spring \[N/m\].
    pub stiffness_n_per_m: f64,
    /// Damper \[N s/m\]; `None`: critical for `mass_kg`.
    pub damping_n_s_per_m: Option<f64>,
    /// Largest force that the coupling transmits \[N\].
    pub max_force_n: f64,
    /// Largest torque that the coupling transmits \[N m\].
    pub max_torque_n_m: f64,
    /// Lever that turns the four translational numbers into rotational ones, `k_rot = k l^2` \[m\].
    pub lever_m: f64,
}

impl Default for SpringCoupling {
    fn default() -> Self {
        Self {
            mass_kg: 2e-3,
            stiffness_n_per_m: 1000.0,
            damping_n_s_per_m: None,
            max_force_n: 20.0,
            max_torque_n_m: 0.5,
            lever_m: 0.02,
        }
    }
}

/// Sampling of device poses, one pose per tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sampling {
    /// The newest pose, approached at `max_tool_speed_m_per_s` at most.
    Latest,
    /// Interpolation between samples, this far in the past.
    Interpolate {
        /// Delay behind the newest sample's time \[s\].
        delay_s: f64,
    },
}

/// An immovable half-space; `normal` points to the side of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of the surface \[m\].
    pub point_m: Point3<f64>,
    /// Outward direction; need not be of unit length.
    pub normal: Vector3<f64>,
}
