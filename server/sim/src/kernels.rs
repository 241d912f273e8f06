//! The kernels of a tick, one call each, for benches that measure one alone; [`tick`](crate::tick()) is the interface.

use crate::model::Model;
use crate::probe::NoProbe;
use crate::report::TickReport;
use crate::state::State;
use crate::step;
use crate::workspace::Workspace;

/// Finds the contact rows of the state that the last tick left, with the tools where they are; returns how many.
pub fn find_contacts(model: &Model, state: &State, workspace: &mut Workspace) -> usize {
    step::find_contacts(model, state, workspace, &mut TickReport::default());
    workspace.rows.rows.len()
}

/// Solves one step with the rows that [`find_contacts`] left; returns the iterations of conjugate gradients.
pub fn solve(model: &Model, state: &mut State, workspace: &mut Workspace) -> u32 {
    let mut report = TickReport::default();
    step::rotate_elements(model, state, workspace);
    step::load_residual(model, state, workspace);
    step::solve_with_contact(model, workspace, &mut NoProbe, &mut report);
    report.iterations
}

/// Moves the skin to the node displacements.
pub fn embed(model: &Model, state: &mut State) {
    model.embedding.apply(&state.u, &mut state.skin);
}
