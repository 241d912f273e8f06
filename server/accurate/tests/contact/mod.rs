//! Shared by the contact tests: bodies held at the bottom, tools, presses.
#![allow(dead_code, unreachable_pub, reason = "every test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

pub mod quarter;

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::contact::{
    ContactError, ContactInfo, ContactParams, ContactState, ContactSurface, Obstacle, Press,
};
use plica_accurate::{Constraints, Energy, Material, MaterialModel, Solid, Solver, reactions};
use plica_geometry::shapes::block;
use plica_geometry::{ConvexPolytope, HexMesh, NodeIdx};

/// A solid with supports, and its contact faces.
pub struct Body {
    pub mesh: HexMesh,
    pub solid: Solid,
    pub constraints: Constraints,
    pub surface: ContactSurface,
    pub solver: Solver,
    pub x: Vec<Vector3<f64>>,
}

impl Body {
    /// Nodes at z = 0 are held; all other boundary faces are contact faces.
    pub fn held_below(mesh: HexMesh, material: Material) -> Self {
        let mut constraints = Constraints::none(mesh.n_nodes());
        for (node, position) in mesh.nodes().iter().enumerate().filter(|(_, p)| p.z < 1e-9) {
            constraints.hold(node, &position.coords);
        }
        let surface = ContactSurface::of_boundary(&mesh, &constraints);
        Self::new(mesh, material, constraints, surface)
    }

    pub fn new(mesh: HexMesh, material: Material, constraints: Constraints, surface: ContactSurface) -> Self {
        let solid = Solid::new(&mesh, &vec![material; mesh.n_hexes()]).unwrap();
        let solver = Solver::new(&constraints, &[&solid]).unwrap();
        let x = mesh.nodes().iter().map(|p| p.coords).collect();
        Self { mesh, solid, constraints, surface, solver, x }
    }

    /// Back to rest, the tool at `pose`.
    pub fn rest(&mut self, pose: &Isometry3<f64>) -> ContactState {
        self.x = self.mesh.nodes().iter().map(|p| p.coords).collect();
        ContactState::untouched(&self.surface, pose, &self.x)
    }

    /// From rest, the tool at the path's first pose, along the others.
    pub fn press(&mut self, tool: &Tool, path: &[Isometry3<f64>]) -> (ContactInfo, ContactState) {
        let mut state = self.rest(&path[0]);
        let info = self.go_on(tool, &path[1..], &mut state).unwrap();
        (info, state)
    }

    pub fn go_on(
        &mut self,
        tool: &Tool,
        path: &[Isometry3<f64>],
        state: &mut ContactState,
    ) -> Result<ContactInfo, ContactError> {
        self.go_on_watched(tool, path, state, &mut |_| ControlFlow::Continue(()))
    }

    pub fn go_on_watched(
        &mut self,
        tool: &Tool,
        path: &[Isometry3<f64>],
        state: &mut ContactState,
        observer: &mut dyn FnMut(plica_accurate::contact::ContactProgress) -> ControlFlow<()>,
    ) -> Result<ContactInfo, ContactError> {
        let press = Press {
            energies: &[&self.solid],
            constraints: &self.constraints,
            surface: &self.surface,
            obstacle: &tool.shape,
            friction: tool.friction,
            params: tool.params,
        };
        press.follow(path, &mut self.solver, state, &mut self.x, observer)
    }

    /// Force \[N\] that the supports exert, and its torque about a point \[N m\].
    pub fn support(&self, about: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let energies: [&dyn Energy; 1] = [&self.solid];
        let mut sum = (Vector3::zeros(), Vector3::zeros());
        for (node, all) in reactions(&energies, &self.x).iter().enumerate() {
            let given = self.constraints.is_given(node);
            let force = Vector3::from_fn(|k, _| if given[k] { all[k] } else { 0.0 });
            sum.0 += force;
            sum.1 += (self.x[node] - about).cross(&force);
        }
        sum
    }
}

/// Tool and parameters of a press.
#[derive(Clone)]
pub struct Tool {
    pub shape: Obstacle,
    pub friction: f64,
    pub params: ContactParams,
}

pub const YOUNG_MODULUS_PA: f64 = 3e4;
/// The block that most tests press \[m\].
pub const BLOCK_M: [f64; 3] = [0.06, 0.06, 0.024];

/// A soft block, nearly incompressible, held at the bottom.
pub fn soft_block(divisions: [usize; 3]) -> Body {
    Body::held_below(block(BLOCK_M, divisions), stable(0.45))
}

pub fn stable(poisson_ratio: f64) -> Material {
    Material { model: MaterialModel::StableNeoHookean, young_modulus_pa: YOUNG_MODULUS_PA, poisson_ratio }
}

impl Tool {
    pub fn new(shape: Obstacle, friction: f64) -> Self {
        Self { shape, friction, params: ContactParams::new(YOUNG_MODULUS_PA, 2e-3) }
    }

    pub fn ball(radius_m: f64, friction: f64) -> Self {
        Self::new(Obstacle::Ball { radius_m }, friction)
    }

    pub fn capsule(friction: f64) -> Self {
        Self::new(Obstacle::Capsule { radius_m: 7e-3, length_m: 0.1 }, friction)
    }

    pub fn cuboid(half_extents_m: [f64; 3], friction: f64) -> Self {
        Self::new(Obstacle::Polytope(ConvexPolytope::cuboid(half_extents_m).unwrap()), friction)
    }

    /// The same with tolerances for tests that compare forces.
    pub fn exactly(mut self) -> Self {
        self.params.pressure_tolerance = 1e-4;
        self.params.newton_tolerance = 1e-8;
        self
    }
}

pub fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Isometry3::translation(x, y, z)
}

/// A block whose nodes have the given coordinates along each axis \[m\].
pub fn graded_block(coordinates_m: [&[f64]; 3]) -> HexMesh {
    let cells = coordinates_m.map(|c| c.len() - 1);
    let unit = block([1.0; 3], cells);
    let place = |p: &Point3<f64>| {
        let along = |axis: usize| coordinates_m[axis][(p[axis] * cells[axis] as f64).round() as usize];
        Point3::new(along(0), along(1), along(2))
    };
    HexMesh::new(unit.nodes().iter().map(place).collect(), unit.hexes().to_vec()).unwrap()
}

/// The boundary faces whose nodes all fulfil `is_on`.
pub fn quads(mesh: &HexMesh, is_on: impl Fn(&Point3<f64>) -> bool) -> Vec<[NodeIdx; 4]> {
    let mut quads = mesh.boundary_quads();
    quads.retain(|quad| quad.iter().all(|node| is_on(&mesh.nodes()[node.index()])));
    quads
}
