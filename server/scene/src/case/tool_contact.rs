//! Contact of a case's body with its tools.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::contact::{
    ContactError, ContactInfo, ContactParams, ContactProgress, ContactState, ContactSurface, NormalContact, Obstacle,
    Press,
};
use plica_accurate::{Constraints, Energy, Solver};
use plica_geometry::HexMesh;

use super::tool::Tool;

/// Longest motion of a tool in an increment, as a share of the mean edge of the mesh.
const INCREMENT_CELLS: f64 = 0.5;
/// Largest change of pressures by the last solve, as a share of the largest.
const PRESSURE_TOLERANCE: f64 = 2e-3;
const NEWTON_TOLERANCE: f64 = 1e-7;
const MAX_UPDATES: u32 = 60;

/// Surface and parameters of contact.
#[derive(Debug)]
pub(super) struct ToolContact {
    surface: ContactSurface,
    params: ContactParams,
}

/// Force and moment of a tool on the body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ToolLoad {
    /// \[N\]
    pub(super) force: Vector3<f64>,
    /// About the origin \[N m\].
    pub(super) moment: Vector3<f64>,
}

/// Body under a share of its loads.
#[derive(Clone, Copy)]
pub(super) struct LoadedBody<'a> {
    pub(super) share: f64,
    pub(super) energies: &'a [&'a dyn Energy],
    pub(super) constraints: &'a Constraints,
    pub(super) tools: &'a [Tool],
}

/// Obstacle and pose under a share of the loads: a single tool's own, or the union of several in the frame of the world.
struct Placed {
    obstacle: Obstacle,
    pose: Isometry3<f64>,
}

impl ToolContact {
    /// Contact points on the boundary of `mesh` where `constraints` leave it free; `young_modulus_pa` is that of the softest material \[Pa\].
    pub(super) fn new(mesh: &HexMesh, constraints: &Constraints, young_modulus_pa: f64) -> Self {
        let params = ContactParams {
            pressure_tolerance: PRESSURE_TOLERANCE,
            newton_tolerance: NEWTON_TOLERANCE,
            max_updates: MAX_UPDATES,
            ..ContactParams::new(young_modulus_pa, INCREMENT_CELLS * mesh.mean_longest_edge())
        };
        Self { surface: ContactSurface::of_boundary(mesh, constraints), params }
    }

    /// Longest share of the loads in which no tool moves further than an increment.
    pub(super) fn longest_step(&self, tools: &[Tool]) -> f64 {
        let way = tools.iter().map(Tool::way_m).fold(0.0, f64::max);
        if tools.len() > 1 && way > 0.0 { self.params.max_increment_m / way } else { 1.0 }
    }

    /// No contact yet.
    pub(super) fn untouched(&self, tools: &[Tool], x: &[Vector3<f64>]) -> ContactState {
        ContactState::untouched(&self.surface, &place(tools, 0.0).pose, x)
    }

    /// Moves `x` to equilibrium with the tools where they are under a share of the loads.
    pub(super) fn follow(
        &self,
        body: &LoadedBody<'_>,
        solver: &mut Solver,
        state: &mut ContactState,
        x: &mut [Vector3<f64>],
        observer: &mut dyn FnMut(ContactProgress) -> ControlFlow<()>,
    ) -> Result<ContactInfo, ContactError> {
        let Placed { obstacle, pose } = place(body.tools, body.share);
        let press = Press {
            energies: body.energies,
            constraints: body.constraints,
            surface: &self.surface,
            obstacle: &obstacle,
            friction: body.tools.iter().map(|tool| tool.friction).fold(0.0, f64::max),
            params: self.params,
        };
        press.follow(&[pose], solver, state, x, observer)
    }

    /// Number of negative directions with the contact as it is, without the stiffness of friction.
    pub(super) fn n_negative(
        &self,
        body: &LoadedBody<'_>,
        solver: &mut Solver,
        state: &ContactState,
        x: &[Vector3<f64>],
    ) -> Option<usize> {
        let Placed { obstacle, pose } = place(body.tools, body.share);
        let ContactParams { young_modulus_pa, penalty_ratio, .. } = self.params;
        let sizes = self.surface.points().iter().map(|point| point.size_m);
        let penalties: Vec<f64> = sizes.map(|size| penalty_ratio * young_modulus_pa / size).collect();
        let contact = NormalContact {
            surface: &self.surface,
            obstacle: &obstacle,
            pose: &pose,
            multipliers_pa: state.pressures_pa(),
            penalties_pa_per_m: &penalties,
        };
        let mut energies = body.energies.to_vec();
        energies.push(&contact as &dyn Energy);
        solver.n_negative(&energies, body.constraints, x)
    }

    /// Forces of each tool on the body, and of all tools on each node, `[n_nodes]` \[N\].
    pub(super) fn loads(
        &self,
        tools: &[Tool],
        state: &ContactState,
        x: &[Vector3<f64>],
    ) -> (Vec<ToolLoad>, Vec<Vector3<f64>>) {
        let mut loads = vec![ToolLoad::default(); tools.len()];
        let mut at_nodes = vec![Vector3::zeros(); x.len()];
        for (q, point) in self.surface.points().iter().enumerate() {
            let pressure = state.pressures_pa()[q];
            if pressure <= 0.0 {
                continue;
            }
            let position = point.position(x);
            let (tool, normal) = nearest(tools, &position);
            let force = (normal * pressure - state.tractions_pa()[q]) * point.area_m2;
            loads[tool].force += force;
            loads[tool].moment += position.coords.cross(&force);
            point.nodes.iter().zip(point.shares).for_each(|(node, share)| at_nodes[node.index()] += force * share);
        }
        (loads, at_nodes)
    }
}

/// The tool nearest to a point under full loads, and its normal there.
fn nearest(tools: &[Tool], point: &Point3<f64>) -> (usize, Vector3<f64>) {
    let gaps = tools.iter().map(|tool| tool.obstacle.gap(&tool.pose(1.0), point)).enumerate();
    let nearest = gaps.min_by(|a, b| a.1.distance_m.total_cmp(&b.1.distance_m));
    nearest.map_or((0, Vector3::z()), |(tool, gap)| (tool, gap.normal))
}

fn place(tools: &[Tool], share: f64) -> Placed {
    match tools {
        [tool] => Placed { obstacle: tool.obstacle.clone(), pose: tool.pose(share) },
        several => {
            let posed = |tool: &Tool| Obstacle::Posed(Box::new(tool.obstacle.clone()), tool.pose(share));
            Placed { obstacle: Obstacle::Union(several.iter().map(posed).collect()), pose: Isometry3::identity() }
        }
    }
}
