//! One implicit step of the coarse object, with its tools and supports \[MG04\].
//!
//! `A dv = r`, `A = M (1 + h alpha) + h^2 K(R)`, `r = h f(x + h v) + h M (g - alpha v)`; contact adds rows to `A` and `r`
//! (see [`crate::contact`]), and two or three passes find which rows push and which slide.

use nalgebra::{Isometry3, Vector6};

use crate::contact::{
    ContactCoupling, Placement, ProxyMotion, Rows, Search, Selection, V3, at_arm, contact_point, evaluate,
    predict_secant, settle, stack_forces,
};
use crate::lanes::{Mat3, Node};
use crate::model::Model;
use crate::probe::{Probe, Stage};
use crate::report::TickReport;
use crate::solver::{CgInfo, CgStop, conjugate_gradient, norm_squared, set_zero};
use crate::state::State;
use crate::tool::Target;
use crate::workspace::Workspace;

/// Passes in which rows may switch either way.
const FREE_PASSES: u32 = 4;
/// Largest number of passes; later ones only switch rows off and lower their friction.
const MAX_PASSES: u32 = 12;
/// Residual of a solve, as a share of the contact impulse.
const IMPULSE_TOLERANCE: f32 = 1e-4;
/// Indentation whose static force bounds a multiplier, in cells.
const MAX_PRESS_CELLS: f32 = 4.0;
/// Largest penetration that one step resolves, in cells.
const MAX_CORRECTION_CELLS: f32 = 0.1;
/// Speed limit of nodes \[m/s\]: several times the speeds of a hand or a free ring-down, and a bound on those from a
/// tool forced through the object.
const MAX_NODE_SPEED: f32 = 10.0;
/// Normal rows of a slippery tool are stiffer by this factor. Neighbouring skin points hang on the same nodes, so that load
/// passes between their rows ten times more slowly than one row takes it up; a tool that sways over the skin is then pushed
/// on by rows that let go late. Friction takes that energy away, and without friction nothing else does.
const SLIPPERY_STIFFENING: f32 = 100.0;
/// Coulomb friction from which on the plain stiffness is quiet.
const SLIPPERY_FRICTION: f32 = 0.1;
/// Largest reach of contact detection, in cells.
const MAX_REACH_CELLS: f32 = 2.0;

/// One step of `model.dt`; sub-step `index` of the tick.
pub(crate) fn step(
    model: &Model,
    index: u32,
    state: &mut State,
    workspace: &mut Workspace,
    probe: &mut impl Probe,
    report: &mut TickReport,
) {
    probe.enter(Stage::Solve);
    rotate_elements(model, state, workspace);
    load_residual(model, state, workspace);
    probe.enter(Stage::Contact);
    begin_tools(model, index, state, workspace);
    find_contacts(model, state, workspace, report);
    solve_with_contact(model, workspace, probe, report);
    finish_tools(model, index, state, workspace);
    remember_contacts(model, state, workspace, report);
    probe.enter(Stage::Embedding);
    advance(model, state, workspace);
    model.embedding.apply(&state.u, &mut state.skin);
}

/// Tools of a sleeping object follow their devices.
pub(crate) fn move_tools_freely(model: &Model, state: &mut State, workspace: &mut Workspace) {
    workspace.rows.clear();
    for index in 0..model.description.substeps {
        begin_tools(model, index, state, workspace);
        for (body, motion) in workspace.motions.iter_mut().enumerate() {
            motion.factor(body as u32, &workspace.rows, model.dt);
            motion.advance(&motion.solve(&motion.residual()));
        }
        finish_tools(model, index, state, workspace);
    }
}

/// `world <- tool` in run-time precision.
pub(crate) fn placement(pose: &Isometry3<f64>) -> Placement {
    Placement { rotation: pose.rotation.to_rotation_matrix().matrix().cast(), origin: pose.translation.vector.cast() }
}

pub(crate) fn rotate_elements(model: &Model, state: &mut State, workspace: &mut Workspace) {
    model.elements.update_rotations(&state.u, &mut state.quaternions, &mut workspace.rotations);
    if model.tridiagonal.is_some() {
        set_zero(&mut workspace.node_quaternions);
        model.elements.add_node_quaternions(&state.quaternions, &mut workspace.node_quaternions);
        workspace.warp.set_rotations(&workspace.node_quaternions[..model.n_free]);
    }
}

/// `r = h f(x + h v) + h M (g - alpha v) + h f_external`
pub(crate) fn load_residual(model: &Model, state: &State, workspace: &mut Workspace) {
    let (h, d) = (model.dt, &model.description);
    let gravity: V3 = d.gravity_m_per_s2.cast();
    let alpha = d.mass_damping_per_s as f32;
    set_zero(&mut workspace.dv);
    set_zero(&mut workspace.residual);
    model.elements.add_forces(&state.u, &state.v, h, h, &workspace.rotations, &mut workspace.residual);
    for ((r, v), m) in workspace.residual.iter_mut().zip(&state.v).zip(&model.node_mass) {
        for k in 0..3 {
            r[k] += h * m * (gravity[k] - alpha * v[k]);
        }
    }
    for (r, force) in workspace.residual.iter_mut().zip(&state.external_forces) {
        for k in 0..3 {
            r[k] += h * force[k];
        }
    }
}

/// Part of this tick's motion in one sub-step.
fn substep_target(model: &Model, index: u32, target: &Target) -> Target {
    let n = f64::from(model.description.substeps);
    let at = |share: f64| {
        let t = target.before.translation.vector.lerp(&target.pose.translation.vector, share);
        let r = target.before.rotation.try_slerp(&target.pose.rotation, share, 1e-12).unwrap_or(target.pose.rotation);
        Isometry3::from_parts(t.into(), r)
    };
    match model.description.substeps {
        1 => *target,
        _ => Target { before: at(f64::from(index) / n), pose: at(f64::from(index + 1) / n), placed: false },
    }
}

fn begin_tools(model: &Model, index: u32, state: &mut State, workspace: &mut Workspace) {
    for (body, tool) in model.description.tools.iter().enumerate() {
        let Some(target) = &workspace.targets[body] else { continue };
        let target = substep_target(model, index, target);
        workspace.motions[body] = state.proxies[body].begin(tool, &target, f64::from(model.dt));
        workspace.placements[body] = placement(&state.proxies[body].pose);
    }
}

fn finish_tools(model: &Model, index: u32, state: &mut State, workspace: &mut Workspace) {
    for (body, tool) in model.description.tools.iter().enumerate() {
        let Some(target) = &workspace.targets[body] else { continue };
        let target = substep_target(model, index, target);
        state.proxies[body].finish(tool, &target, &workspace.motions[body], f64::from(model.dt));
    }
}

/// Rows of all bodies, with multipliers from the last tick.
pub(crate) fn find_contacts(model: &Model, state: &State, workspace: &mut Workspace, report: &mut TickReport) {
    let options = &model.description.contact;
    let n_tools = model.n_tools();
    let skin_motion = state.max_speed() * model.dt;
    workspace.rows.clear();
    for (body, solid) in model.solids.iter().enumerate() {
        if body < n_tools && workspace.targets[body].is_none() {
            continue;
        }
        let lever = workspace.motions.get(body).map_or(1.0, |m| m.lever);
        let twist = workspace.motions.get(body).map_or(Vector6::zeros(), ProxyMotion::free_twist);
        let speed = twist.fixed_rows::<3>(0).norm() + twist.fixed_rows::<3>(3).norm() / lever * solid.reach();
        let motion = (speed * model.dt + skin_motion).min(MAX_REACH_CELLS * model.cell_size);
        let placement = workspace.placements[body];
        let reach = options.activation_gap_m as f32 + motion;
        let search = Search { surface: &model.surface, skin: &state.skin, solid, placement: &placement, reach };
        let candidates = workspace.detector.find(&search);
        let friction = model.description.tools.get(body).map_or(options.plane_friction, |t| t.friction);
        let selection = Selection {
            body: body as u32,
            friction: friction as f32,
            origin: placement.origin,
            activation_gap: options.activation_gap_m as f32,
            max_contacts: model.max_contacts(body),
            spacing: 0.35 * model.cell_size,
            dt: model.dt,
            max_correction: MAX_CORRECTION_CELLS * model.cell_size,
            max_press: MAX_PRESS_CELLS * model.cell_size,
            surface: &model.surface,
            old: &state.contacts,
        };
        let first_row = workspace.rows.rows.len();
        let velocity = |arm: V3| at_arm(&twist, lever, &arm);
        report.dropped_contacts += workspace.rows.select(&model.embedding, &state.v, candidates, velocity, &selection);
        report.dropped_contacts += workspace.detector.overflow;
        // A row that is only predicted may push in this very solve.
        let may_touch = workspace.rows.rows.len() > first_row;
        if let Some(point) = workspace.contact_points.get_mut(body) {
            *point = if may_touch { contact_point(&search, &workspace.detector) } else { None };
        }
    }
    predict_rows(model, &mut workspace.rows, &workspace.motions);
}

/// Displacements before the solve, stiffness, and which rows are expected to push.
///
/// Stiffness `kappa / (h^2 w o)`: `1 / (h^2 w)` is the stiffness of the skin point itself, mass included, so that
/// `kappa` depends on neither Young's modulus nor the time step; `o` counts the rows that load the same surroundings. A
/// floor on `w` keeps points
/// next to fixed nodes from becoming infinitely stiff.
fn predict_rows(model: &Model, rows: &mut Rows, motions: &[ProxyMotion]) {
    let (h, kappa) = (model.dt, model.description.contact.stiffness_ratio as f32);
    for row in &mut rows.rows {
        let tool_velocity = motions.get(row.contact.body as usize).map_or(V3::zeros(), |m| m.point_velocity(&row.arm));
        row.u = (row.skin_velocity - tool_velocity) * h;
        row.active = row.contact.normal_force > 0.0 || row.gap + row.contact.normal.dot(&row.u) < 0.0;
    }
    for index in 0..rows.rows.len() {
        let row = &rows.rows[index];
        let yields = row.inverse_mass;
        let crowd = rows.crowding(index, model.cell_size);
        let stiffness = kappa / (h * h * yields * crowd);
        let is_tool = (row.contact.body as usize) < motions.len();
        let stiffening = if is_tool { slippery_stiffening(row.friction) } else { 1.0 };
        let row = &mut rows.rows[index];
        (row.stiffness, row.normal_stiffness) = (stiffness, stiffness * stiffening);
        predict_secant(&mut rows.rows[index]);
    }
    stack_forces(rows);
}

/// Factor on the normal stiffness of a tool's rows: [`SLIPPERY_STIFFENING`] without friction, 1 from [`SLIPPERY_FRICTION`] on.
fn slippery_stiffening(friction: f32) -> f32 {
    1.0 + (SLIPPERY_STIFFENING - 1.0) * (1.0 - friction / SLIPPERY_FRICTION).max(0.0)
}

/// Solves, adapts the rows, and solves again until every row pushes and every friction state holds.
pub(crate) fn solve_with_contact(
    model: &Model,
    workspace: &mut Workspace,
    probe: &mut impl Probe,
    report: &mut TickReport,
) {
    let multipliers: f32 = workspace.rows.rows.iter().map(|r| r.contact.normal_force).sum();
    let mut stop = None;
    for pass in 0..MAX_PASSES {
        let Workspace { coupling, rows, motions, residual, .. } = workspace;
        coupling.begin_pass(rows, motions, model.dt, residual);
        probe.enter(Stage::Solve);
        let bound = *stop.get_or_insert_with(|| {
            let first = norm_squared(&workspace.residual[..model.n_free]).sqrt();
            model.description.solver.tolerance as f32 * first + IMPULSE_TOLERANCE * model.dt * multipliers
        });
        let (info, fell_back) = solve(model, workspace, bound);
        report.iterations += info.iterations;
        report.fallbacks += u32::from(fell_back);
        report.passes += 1;
        probe.enter(Stage::Contact);
        let Workspace { coupling, rows, motions, residual, dv, .. } = workspace;
        coupling.end_pass(rows, motions, model.dt, dv);
        stack_forces(rows);
        if rows.rows.is_empty() || pass + 1 == MAX_PASSES {
            break;
        }
        rows.add_forces(-model.dt, residual);
        if !evaluate(rows, pass + 1 < FREE_PASSES) {
            break;
        }
        stack_forces(rows);
    }
}

/// Conjugate gradients; a solve that does not converge is restored and repeated with block Jacobi.
fn solve(model: &Model, workspace: &mut Workspace, residual_bound: f32) -> (CgInfo, bool) {
    let options = &model.description.solver;
    let Workspace { rotations, warp, cg, dv, residual, dv_before, residual_before, rows, coupling, motions, .. } =
        workspace;
    let mut matrix = ImplicitMatrix { model, rotations, coupling, rows, motions };
    let mut multiply = |p: &[Node], out: &mut [Node]| matrix.multiply(p, out);
    let primary = CgStop { residual: residual_bound, max_iterations: options.max_iterations };
    let Some(tridiagonal) = &model.tridiagonal else {
        let jacobi = |r: &[Node], z: &mut [Node]| model.jacobi.apply(r, z);
        return (conjugate_gradient(dv, residual, &mut multiply, jacobi, primary, cg), false);
    };
    dv_before.copy_from_slice(dv);
    residual_before.copy_from_slice(residual);
    let warped = |r: &[Node], z: &mut [Node]| tridiagonal.apply_warped(r, z, warp);
    let info = conjugate_gradient(dv, residual, &mut multiply, warped, primary, cg);
    if info.converged {
        return (info, false);
    }
    dv.copy_from_slice(dv_before);
    residual.copy_from_slice(residual_before);
    let jacobi = |r: &[Node], z: &mut [Node]| model.jacobi.apply(r, z);
    let fallback = CgStop { residual: residual_bound, max_iterations: options.fallback_iterations };
    let second = conjugate_gradient(dv, residual, &mut multiply, jacobi, fallback, cg);
    (CgInfo { iterations: info.iterations + second.iterations, ..second }, true)
}

/// `A` at the present rotations, with the active contact rows.
struct ImplicitMatrix<'a> {
    model: &'a Model,
    rotations: &'a [Mat3],
    coupling: &'a mut ContactCoupling,
    rows: &'a Rows,
    motions: &'a [ProxyMotion],
}

impl ImplicitMatrix<'_> {
    /// `out = A p`
    #[inline(always)]
    fn multiply(&mut self, p: &[Node], out: &mut [Node]) {
        let h = self.model.dt;
        let inertia = 1.0 + h * self.model.description.mass_damping_per_s as f32;
        set_zero(out);
        self.model.elements.add_product(p, h * h, self.rotations, out);
        for ((out, p), m) in out.iter_mut().zip(p).zip(&self.model.node_mass) {
            for k in 0..4 {
                out[k] = (m * inertia).mul_add(p[k], out[k]);
            }
        }
        self.coupling.add_product(self.rows, self.motions, h, p, out);
    }
}

/// `v += dv`, `x += h v`; nodes faster than [`MAX_NODE_SPEED`] are slowed to it.
fn advance(model: &Model, state: &mut State, workspace: &Workspace) {
    let nodes = state.u.iter_mut().zip(&mut state.v).zip(&workspace.dv);
    for ((u, v), dv) in nodes.take(model.n_free) {
        let faster: [f32; 3] = std::array::from_fn(|k| v[k] + dv[k]);
        let speed = faster.iter().map(|c| c * c).sum::<f32>().sqrt();
        let share = if speed > MAX_NODE_SPEED { MAX_NODE_SPEED / speed } else { 1.0 };
        for k in 0..3 {
            v[k] = faster[k] * share;
            u[k] = model.dt.mul_add(v[k], u[k]);
        }
    }
}

/// Multipliers for the next step, and contact figures of the report.
fn remember_contacts(model: &Model, state: &mut State, workspace: &mut Workspace, report: &mut TickReport) {
    let options = &model.description.contact;
    let decay = (1.0 - f64::from(model.dt) / options.recovery_time_s).max(0.0) as f32;
    state.contacts.clear();
    report.n_contacts = 0;
    report.max_penetration_m = 0.0;
    for row in &mut workspace.rows.rows {
        settle(row, options.multiplier_relaxation as f32, decay);
        state.contacts.push(row.contact);
        report.n_contacts += u32::from(row.active);
        report.max_penetration_m = report.max_penetration_m.max(-row.contact.gap);
    }
}
