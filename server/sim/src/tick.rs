//! One tick: device poses -> proxies -> contact and coarse step -> embedding -> gates.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::TickInput;
use crate::contact::Search;
use crate::description::Coupling;
use crate::model::Model;
use crate::probe::{Probe, Stage};
use crate::report::TickReport;
use crate::rotation::IDENTITY;
use crate::state::State;
use crate::step::{move_tools_freely, step};
use crate::workspace::Workspace;

/// Takes one time step. Allocates nothing; the result depends on nothing but the arguments.
pub fn tick(
    model: &Model,
    input: TickInput<'_>,
    state: &mut State,
    workspace: &mut Workspace,
    probe: &mut impl Probe,
) -> TickReport {
    let mut report = TickReport::default();
    probe.enter(Stage::Poses);
    take_poses(model, &input, state, &mut report);
    aim_tools(model, input.clock_s, state, workspace);
    if fall_asleep_or_wake(model, state, workspace) {
        move_tools_freely(model, state, workspace);
        report.sleeping = true;
    } else {
        for substep in 0..model.description.substeps {
            step(model, substep, state, workspace, probe, &mut report);
        }
    }
    probe.enter(Stage::Gates);
    gate_output(model, state, workspace, &mut report);
    write_readings(model, &input, state, workspace);
    state.tick += 1;
    report
}

/// Input gate: poses with a component that is not finite are refused and counted.
fn take_poses(model: &Model, input: &TickInput<'_>, state: &mut State, report: &mut TickReport) {
    for pose in input.poses {
        let taken = match (state.tracks.get_mut(pose.tool), model.description.tools.get(pose.tool)) {
            (Some(track), Some(tool)) => track.push(tool, &pose.sample, input.clock_s),
            _ => false,
        };
        report.poses_refused += u32::from(!taken);
    }
}

/// Target of each tool at the end of this tick; a placed tool forgets its contacts.
fn aim_tools(model: &Model, clock_s: f64, state: &mut State, workspace: &mut Workspace) {
    for (index, tool) in model.description.tools.iter().enumerate() {
        let target = state.tracks[index].advance(tool, clock_s, model.timestep_s());
        if let Some(target) = target.filter(|t| t.placed) {
            state.proxies[index].place(&target.pose);
            state.contacts.retain(|c| c.body as usize != index);
        }
        workspace.targets[index] = target;
    }
}

/// An object at rest with no tool near is not solved.
fn fall_asleep_or_wake(model: &Model, state: &mut State, workspace: &mut Workspace) -> bool {
    let options = &model.description.sleep;
    let is_slow = state.max_speed() < options.speed_m_per_s as f32;
    let is_quiet = options.enabled && is_slow && !any_tool_is_near(model, state, workspace);
    state.quiet_s = if is_quiet { state.quiet_s + model.timestep_s() } else { 0.0 };
    let falls_asleep = state.quiet_s >= options.after_s;
    if falls_asleep && !state.sleeping {
        state.v.fill([0.0; 4]);
    }
    state.sleeping = falls_asleep;
    state.sleeping
}

fn any_tool_is_near(model: &Model, state: &State, workspace: &mut Workspace) -> bool {
    (0..model.n_tools()).any(|index| {
        let Some(target) = workspace.targets[index] else { return false };
        let (proxy, solid) = (&state.proxies[index], &model.solids[index]);
        let moves = (target.pose.translation.vector - proxy.pose.translation.vector).norm() as f32;
        let placement = crate::step::placement(&proxy.pose);
        let reach = moves + model.cell_size;
        let search = Search { surface: &model.surface, skin: &state.skin, solid, placement: &placement, reach };
        workspace.detector.is_near(&search)
    })
}

/// Ticks within which a second roll-back discards the last good state too: the object returns to its rest shape.
const RELAPSE_TICKS: u64 = 50;

/// Output gate: a state that is not finite, or that has left its room, is replaced by the last good one, at rest. An object that
/// nothing holds goes back to where it began, as it would leave its room again from where it was.
fn gate_output(model: &Model, state: &mut State, workspace: &mut Workspace, report: &mut TickReport) {
    let [low, high] = model.largest_displacements;
    let is_good = |n: &[f32; 4]| (0..3).all(|k| n[k] > low[k] && n[k] < high[k]);
    let is_finite = |n: &[f32; 4]| (n[0] + n[1] + n[2]).is_finite();
    if state.u.iter().all(is_good) && state.v.iter().all(is_finite) && state.proxies_are_finite() {
        state.good_u.copy_from_slice(&state.u);
        state.good_quaternions.copy_from_slice(&state.quaternions);
        state.ticks_since_rollback = state.ticks_since_rollback.saturating_add(1);
        return;
    }
    report.rolled_back = true;
    state.rollbacks += 1;
    let is_finite = state.u.iter().all(is_finite);
    if state.ticks_since_rollback < RELAPSE_TICKS || (is_finite && model.is_free()) {
        state.good_u.fill([0.0; 4]);
        state.good_quaternions.fill(IDENTITY);
    }
    state.ticks_since_rollback = 0;
    state.u.copy_from_slice(&state.good_u);
    state.quaternions.copy_from_slice(&state.good_quaternions);
    state.v.fill([0.0; 4]);
    state.contacts.clear();
    for (proxy, target) in state.proxies.iter_mut().zip(&workspace.targets) {
        if let Some(target) = target {
            proxy.place(&target.pose);
        }
    }
    workspace.rows.clear();
    model.embedding.apply(&state.u, &mut state.skin);
}

/// Readings of the tools. Force: with a spring the bounded coupling force during contact, else the contact forces. The
/// coupling force in free air (inertia of the proxy, steps of a slow tracker) is not displayed.
fn write_readings(model: &Model, input: &TickInput<'_>, state: &mut State, workspace: &Workspace) {
    for (index, tool) in model.description.tools.iter().enumerate() {
        let (track, proxy) = (&state.tracks[index], &state.proxies[index]);
        let reading = &mut state.readings[index];
        let (mut force, mut torque, mut n_contacts, mut sliding) = (Vector3::zeros(), Vector3::zeros(), 0, false);
        if !state.sleeping {
            for row in workspace.rows.rows.iter().filter(|r| r.active && r.contact.body as usize == index) {
                force -= row.force.cast::<f64>();
                torque -= row.arm.cross(&row.force).cast::<f64>();
                n_contacts += 1;
                sliding |= row.contact.slides();
            }
        }
        reading.contact_force_n = force;
        (reading.force_n, reading.torque_n_m) = match &tool.coupling {
            Coupling::Rigid => (force, torque),
            Coupling::Spring(_) if n_contacts == 0 => (Vector3::zeros(), Vector3::zeros()),
            Coupling::Spring(spring) => {
                let f = -proxy.coupling_force;
                (f.fixed_rows::<3>(0).into(), f.fixed_rows::<3>(3) * spring.lever_m)
            }
        };
        reading.present = proxy.present;
        reading.proxy = if proxy.present { proxy.pose } else { Isometry3::identity() };
        reading.pose_sequence = track.sequence;
        reading.pose_source_time_ns = track.source_time_ns;
        reading.pose_age_s = track.age_s(input.clock_s);
        reading.stale = reading.pose_age_s > tool.stale_after_s;
        reading.n_contacts = n_contacts;
        reading.in_contact = n_contacts > 0;
        reading.sliding = sliding;
        reading.saturated = proxy.saturated;
        reading.placements = track.placements;
        let point = workspace.contact_points[index].filter(|_| n_contacts > 0);
        reading.contact_point_is_new = point.is_some();
        if let Some(point) = point {
            reading.contact_point_m = Point3::from(point.deformed.cast::<f64>());
            reading.reference_contact_point_m = Point3::from(point.reference.cast::<f64>());
        }
    }
}
