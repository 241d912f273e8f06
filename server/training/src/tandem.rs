//! The tandem solve of one interaction \[SSH12, 4.1\]: the coarse model settles, then the accurate one follows its imprint.

use nalgebra::Isometry3;
use plica_accurate::contact::Obstacle;
use plica_accurate::{Tie, TieTarget};

use crate::accurate::{Accurate, AccurateFailure, AccurateResult, Touch};
use crate::coarse::{Coarse, CoarseResult, Interrupted, SolveObserver};
use crate::error::BuildError;
use crate::example::{Example, Outcome, Reason, Record, Rejection, difference, numbers, rows, to_f32};
use crate::interaction::{Action, Interaction, to_numbers};
use crate::obstacle::obstacle;
use crate::setup::Setup;
use crate::solve_info::{SMALLEST_JACOBIAN, SolveInfo};
use crate::suction::{Disc, LiftTarget, lift};
use crate::tie_targets::{around_tool, under_disc};
use crate::tool_path::ToolPath;
use crate::worth::{Unguarded, Worth};
use plica_geometry::{ReferenceSkin, SurfacePoint};

/// Largest distance of a straightened path from the recorded one, as a share of the mean edge of the accurate mesh.
const STRAIGHT_CELLS: f64 = 0.05;

/// Both models of a scene, with the memory of one thread.
pub struct Tandem<'a> {
    setup: &'a Setup,
    skin: ReferenceSkin,
    obstacles: Vec<Obstacle>,
    coarse: Coarse,
    accurate: Accurate,
}

/// The coarse half of an interaction.
#[derive(Debug, Clone)]
pub struct CoarseHalf {
    /// The settled state.
    pub state: CoarseResult,
    /// Contact point on the reference skin.
    pub contact: SurfacePoint,
    /// Pose of the tool.
    pub pose: Isometry3<f64>,
    /// Skin vertices in the contact band.
    pub targets: Vec<TieTarget>,
    /// Load on the object.
    pub load: Load,
}

/// Load on the object.
#[derive(Debug, Clone)]
pub enum Load {
    /// A tool at the end of its path.
    Tool(ToolPath),
    /// Forces at skin vertices, `[n_skin]` \[N\].
    Suction(Vec<nalgebra::Vector3<f64>>),
}

/// Why an interaction has no result.
#[derive(Debug)]
pub enum Stop {
    /// Ended by the observer.
    Interrupted,
    /// The interaction is rejected.
    Rejected(Reason, String, Option<Box<Worth>>),
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Interrupted => f.write_str("interrupted"),
            Self::Rejected(_, message, _) => f.write_str(message),
        }
    }
}

impl From<Interrupted> for Stop {
    fn from(_: Interrupted) -> Self {
        Self::Interrupted
    }
}

impl<'a> Tandem<'a> {
    /// Builds both models.
    ///
    /// # Errors
    /// See [`BuildError`].
    pub fn new(setup: &'a Setup) -> Result<Self, BuildError> {
        let coarse = &setup.coarse;
        if !coarse.planes.is_empty() {
            return Err(BuildError::Unsupported { what: "supports.planes" });
        }
        let obstacles = coarse
            .tools
            .iter()
            .map(|tool| obstacle(&tool.shape).map_err(|source| BuildError::Tool { tool: tool.name.clone(), source }));
        Ok(Self {
            skin: ReferenceSkin::new(&coarse.skin),
            obstacles: obstacles.collect::<Result<_, _>>()?,
            accurate: Accurate::new(&setup.accurate, &coarse.skin, &coarse.gravity_m_per_s2)?,
            coarse: Coarse::new(coarse, &setup.drive)?,
            setup,
        })
    }

    /// The skin at rest.
    pub fn skin(&self) -> &ReferenceSkin {
        &self.skin
    }

    /// The accurate model.
    pub fn accurate(&mut self) -> &mut Accurate {
        &mut self.accurate
    }

    /// Solves an interaction; `with_independent` by the accurate model's own contact as well.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn solve(
        &mut self,
        index: u32,
        interaction: &Interaction,
        with_independent: bool,
        observer: SolveObserver<'_>,
    ) -> Result<Outcome, Interrupted> {
        match self.try_solve(index, interaction, with_independent, observer) {
            Ok(example) if example.is_finite() => Ok(Outcome::Accepted(Box::new(example))),
            Ok(_) => {
                let rejected =
                    self.rejected(index, interaction, Reason::NotFinite, "a number of it is not finite".into());
                Ok(Outcome::Rejected(rejected))
            }
            Err(Stop::Rejected(reason, message, worth)) => {
                let rejected = self.rejected(index, interaction, reason, message);
                Ok(Outcome::Rejected(Rejection { worth: worth.map(|worth| *worth), ..rejected }))
            }
            Err(Stop::Interrupted) => Err(Interrupted),
        }
    }

    fn rejected(&self, index: u32, interaction: &Interaction, reason: Reason, message: String) -> Rejection {
        Rejection {
            index,
            kind: interaction.kind.clone(),
            reason,
            message,
            contact_point_m: interaction.contact_point_m,
            depth_m: interaction.depth_m(),
            drag_m: interaction.drag().into(),
            worth: None,
            interaction_sha256: self.setup.fingerprint(interaction),
        }
    }

    fn try_solve(
        &mut self,
        index: u32,
        interaction: &Interaction,
        with_independent: bool,
        observer: SolveObserver<'_>,
    ) -> Result<Example, Stop> {
        let half = self.solve_coarse(interaction, observer)?;
        let tied = self.solve_tied(&half, observer)?;
        let independent =
            if with_independent { Some(self.solve_independent(interaction, &half, observer)?) } else { None };
        let offsets = &half.state.offsets;
        Ok(Example {
            displacements: half.state.displacements.iter().map(to_f32).collect(),
            detail: difference(&tied.offsets, offsets),
            independent_detail: independent.as_ref().map(|r| difference(&r.offsets, offsets)),
            contact_point: numbers(&half.contact.position),
            contact_frame: rows(&self.skin.frame(&half.contact, &self.setup.stamp_axes)),
            tool_pose: to_numbers(&half.pose),
            coarse_force: half.state.tool_force.into(),
            tied_force: tied.tool_force.into(),
            independent_force: independent.as_ref().map(|r| r.tool_force.into()),
            record: Record {
                index,
                kind: interaction.kind.clone(),
                tool: interaction.tool,
                depth_m: interaction.depth_m(),
                drag_m: interaction.drag().into(),
                settling: (&half.state.settling).into(),
                n_tied: half.targets.len() as u32,
                tied: tied.solve,
                independent: independent.as_ref().map(|r| r.solve),
                tied_unguarded: self.worth(&tied),
                independent_unguarded: independent.as_ref().and_then(|r| self.worth(r)),
                interaction_sha256: self.setup.fingerprint(interaction),
            },
        })
    }

    /// The coarse model settles at the interaction.
    ///
    /// # Errors
    /// See [`Stop`].
    pub fn solve_coarse(&mut self, interaction: &Interaction, observer: SolveObserver<'_>) -> Result<CoarseHalf, Stop> {
        let half = match &interaction.action {
            Action::Lift { height_m, radius_m } => {
                let (centre, normal) = (interaction.contact_point(), interaction.normal());
                self.lift_coarse(&Disc { centre, normal, radius_m: *radius_m }, *height_m, observer)?
            }
            _ => self.press_coarse(interaction, observer)?,
        };
        let settling = &half.state.settling;
        if settling.rollbacks > 0 {
            return Err(Stop::Rejected(
                Reason::CoarseUnstable,
                format!("{} states were rolled back", settling.rollbacks),
                None,
            ));
        }
        if !settling.settled {
            let (um, time_s) = (1e6 * settling.motion_m, settling.time_s);
            let message = format!("a node still moves by {um:.1} um per window after {time_s:.1} s");
            return Err(Stop::Rejected(Reason::NotSettled, message, None));
        }
        Ok(half)
    }

    fn press_coarse(&mut self, interaction: &Interaction, observer: SolveObserver<'_>) -> Result<CoarseHalf, Stop> {
        let (tool, setup) = (interaction.tool as usize, self.setup);
        let nothing = || Stop::Rejected(Reason::NothingTouched, "the tool passes the object by".into(), None);
        let path = ToolPath::of(interaction, &self.obstacles[tool], &self.skin).ok_or_else(nothing)?;
        let state = self.coarse.press(tool, &path, &setup.drive, observer)?;
        self.under_tool(tool, path, state).ok_or_else(nothing)
    }

    /// `None` if nothing is touched.
    fn under_tool(&self, tool: usize, path: ToolPath, state: CoarseResult) -> Option<CoarseHalf> {
        let contact = self.skin.nearest(&state.contact_point?);
        let targets = around_tool(&self.skin, &state.offsets, &self.obstacles[tool], path.end(), &self.setup.tie);
        let is_touched = !targets.is_empty();
        is_touched.then(|| CoarseHalf { contact, pose: *path.end(), targets, load: Load::Tool(path), state })
    }

    /// Settles at each pose in turn, starting from the previous one; the first from rest. `None` where nothing is touched.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn walk(
        &mut self,
        tool: usize,
        poses: &[Isometry3<f64>],
        mut each: impl FnMut(&mut Self, Option<CoarseHalf>) -> Result<(), Interrupted>,
        observer: SolveObserver<'_>,
    ) -> Result<(), Interrupted> {
        let drive = self.setup.drive;
        for (i, pose) in poses.iter().enumerate() {
            let path = ToolPath::new(poses[i.saturating_sub(1)..i].iter().chain([pose]).copied().collect());
            let state = match i {
                0 => self.coarse.press(tool, &path, &drive, observer)?,
                _ => self.coarse.go_on(tool, &path, &drive, observer)?,
            };
            let half = self.under_tool(tool, path, state);
            each(self, half)?;
        }
        Ok(())
    }

    fn lift_coarse(&mut self, disc: &Disc, height_m: f64, observer: SolveObserver<'_>) -> Result<CoarseHalf, Stop> {
        let contact = self.skin.nearest(&disc.centre);
        let young_modulus_pa = self.setup.tie.young_modulus_pa;
        let target = LiftTarget { disc, at: &contact, height_m, young_modulus_pa };
        let lifted = lift(&mut self.coarse, &self.skin, target, &self.setup.drive, observer)?;
        if !lifted.reached {
            let message = format!("{:.2} mm of {:.2} mm", 1e3 * lifted.height_m, 1e3 * height_m);
            return Err(Stop::Rejected(Reason::HeightNotReached, message, None));
        }
        let mut state = lifted.state;
        state.tool_force = -lifted.skin_forces.iter().sum::<nalgebra::Vector3<f64>>();
        let targets = under_disc(&self.skin, &state.offsets, disc, &self.setup.tie);
        // The tool only marks the place: its axis along the normal, its tip where the skin was raised to.
        let turned = crate::interaction::rotation(crate::interaction::orientation(&-disc.normal));
        let raised = disc.centre + disc.normal * (lifted.height_m + disc.radius_m);
        let pose = Isometry3::from_parts(raised.coords.into(), turned);
        Ok(CoarseHalf { contact, pose, targets, load: Load::Suction(lifted.skin_forces), state })
    }

    /// The accurate model follows the coarse imprint.
    ///
    /// # Errors
    /// See [`Stop`].
    pub fn solve_tied(&mut self, half: &CoarseHalf, observer: SolveObserver<'_>) -> Result<AccurateResult, Stop> {
        let tie = Tie::new(self.accurate.embedding(), &half.targets, &self.setup.tie);
        let result = self.accurate.tied(&tie, observer);
        self.accept(result, Reason::TiedNotConverged, Reason::TiedInverted)
    }

    /// The accurate model under the tool itself, or under the same suction: only the pressure of the suction is taken from the
    /// coarse model.
    ///
    /// # Errors
    /// See [`Stop`].
    pub fn solve_independent(
        &mut self,
        interaction: &Interaction,
        half: &CoarseHalf,
        observer: SolveObserver<'_>,
    ) -> Result<AccurateResult, Stop> {
        let tool = interaction.tool as usize;
        let friction = self.setup.coarse.tools[tool].friction;
        let result = match &half.load {
            Load::Suction(forces) => self.accurate.loaded(forces, observer),
            Load::Tool(path) => {
                // A recorded path has a pose every fraction of a millimetre, at which nothing need be solved.
                let passes = matches!(interaction.action, Action::Follow { .. });
                let straight = passes.then(|| path.straightened(STRAIGHT_CELLS * self.accurate.cell_m()));
                let path = straight.as_ref().unwrap_or(path);
                self.accurate.pressed(Touch { obstacle: &self.obstacles[tool], friction, path, passes }, observer)
            }
        };
        self.accept(result, Reason::IndependentNotConverged, Reason::IndependentInverted)
    }

    /// Worth of the result without a guard beside the one with it, where that was needed.
    fn worth(&self, result: &AccurateResult) -> Option<Worth> {
        let unguarded = result.unguarded.as_ref()?;
        Some(unguarded.worth(self.skin.vertex_areas()))
    }

    fn accept(
        &self,
        result: Result<AccurateResult, AccurateFailure>,
        not_converged: Reason,
        inverted: Reason,
    ) -> Result<AccurateResult, Stop> {
        let worth = |unguarded: &Unguarded| Some(Box::new(unguarded.worth(self.skin.vertex_areas())));
        match result {
            Ok(result) if !result.solve.is_turned_over() => Ok(result),
            Ok(AccurateResult { solve: SolveInfo { smallest_jacobian, iterations, .. }, unguarded, .. }) => {
                let message = format!(
                    "smallest J is {smallest_jacobian:.3}, below {SMALLEST_JACOBIAN}, after {iterations} Newton steps"
                );
                Err(Stop::Rejected(inverted, message, unguarded.as_deref().and_then(worth)))
            }
            Err(AccurateFailure::Failed(message, last)) => Err(Stop::Rejected(not_converged, message, worth(&last))),
            Err(AccurateFailure::Interrupted) => Err(Stop::Interrupted),
        }
    }
}
