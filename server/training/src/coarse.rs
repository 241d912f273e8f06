//! The coarse half of the tandem: the real-time model is driven to an interaction and settles there.

use std::ops::ControlFlow;

use nalgebra::{Isometry3, Point3, Vector3};
use plica_sim::{
    Coupling, Model, ModelDescription, ModelError, NoProbe, PoseSample, Sampling, State, TickInput, ToolPose,
    Workspace, tick,
};

use crate::setup::DriveOptions;
use crate::tool_path::ToolPath;

/// Ticks between two calls of the observer.
const TICKS_PER_CALL: u64 = 32;

/// The real-time model with rigid tools, ready to be driven from rest again and again.
pub struct Coarse {
    model: Model,
    workspace: Workspace,
    state: State,
    at_rest: State,
}

/// A tool and its pose, `world <- tool`.
#[derive(Debug, Clone, Copy)]
struct PlacedTool {
    tool: usize,
    pose: Isometry3<f64>,
}

/// How the model came to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settling {
    /// Simulated time from the end of the motion until it counted as settled \[s\].
    pub time_s: f64,
    /// Farthest that a node moved within the last window \[m\].
    pub motion_m: f64,
    /// Speed of the fastest node at the end \[m/s\].
    pub speed_m_per_s: f64,
    /// Whether that is little enough.
    pub settled: bool,
    /// States that had to be rolled back.
    pub rollbacks: u64,
}

/// The coarse model at rest under a tool or a load.
#[derive(Debug, Clone)]
pub struct CoarseResult {
    /// `u`, nodal displacements, `[n_nodes]` \[m\].
    pub displacements: Vec<Vector3<f64>>,
    /// Skin offsets from rest, as the real-time model publishes them, `[n_skin]` \[m\].
    pub offsets: Vec<Vector3<f64>>,
    /// Contact point on the reference skin \[m\]; `None` if nothing is touched.
    pub contact_point: Option<Point3<f64>>,
    /// Contact force on the tool \[N\].
    pub tool_force: Vector3<f64>,
    /// How it came to rest.
    pub settling: Settling,
}

/// Observer of a solve: called every few ticks and before every Newton step. `Break` ends the solve.
pub type SolveObserver<'a> = &'a mut dyn FnMut() -> ControlFlow<()>;

/// A solve that its observer ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interrupted;

impl Coarse {
    /// Builds the model of `description` with rigid tools that follow every pose, and without sleep.
    ///
    /// # Errors
    /// See [`ModelError`].
    pub fn new(description: &ModelDescription, drive: &DriveOptions) -> Result<Self, ModelError> {
        let mut description = description.clone();
        description.sleep.enabled = false;
        description.mass_damping_per_s = description.mass_damping_per_s.max(drive.mass_damping_per_s);
        for tool in &mut description.tools {
            tool.coupling = Coupling::Rigid;
            tool.sampling = Sampling::Latest;
            tool.max_tool_speed_m_per_s = 100.0;
            tool.stale_after_s = f64::INFINITY;
            (tool.world_from_tracker, tool.tool_from_marker) = (Isometry3::identity(), Isometry3::identity());
            tool.position_scale = 1.0;
        }
        let model = Model::new(description)?;
        let (state, workspace) = (State::new(&model), Workspace::new(&model));
        Ok(Self { at_rest: state.clone(), model, state, workspace })
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// From rest: `tool` follows `path` and is held until the object has settled.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn press(
        &mut self,
        tool: usize,
        path: &ToolPath,
        drive: &DriveOptions,
        observer: SolveObserver<'_>,
    ) -> Result<CoarseResult, Interrupted> {
        self.restart();
        self.go_on(tool, path, drive, observer)
    }

    /// The same from the present state, in which the tool is at the start of `path`.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn go_on(
        &mut self,
        tool: usize,
        path: &ToolPath,
        drive: &DriveOptions,
        observer: SolveObserver<'_>,
    ) -> Result<CoarseResult, Interrupted> {
        let n_ticks = (path.length_m() / (drive.speed_m_per_s * self.model.timestep_s())).ceil() as u64;
        for k in 0..=n_ticks {
            self.tick(Some(PlacedTool { tool, pose: path.at(k as f64 / n_ticks.max(1) as f64) }), observer)?;
        }
        let settling = self.settle(Some(PlacedTool { tool, pose: *path.end() }), drive, observer)?;
        let reading = &self.state.tools()[tool];
        let contact_point = reading.in_contact.then_some(reading.reference_contact_point_m);
        Ok(self.result(contact_point, reading.contact_force_n, settling))
    }

    /// Goes on from the present state under constant nodal forces, `[n_nodes]` \[N\], until it has settled.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn load(
        &mut self,
        forces: &[Vector3<f64>],
        drive: &DriveOptions,
        observer: SolveObserver<'_>,
    ) -> Result<CoarseResult, Interrupted> {
        self.state.set_external_forces(&self.model, forces);
        let settling = self.settle(None, drive, observer)?;
        Ok(self.result(None, Vector3::zeros(), settling))
    }

    /// Returns to the state at rest.
    pub fn restart(&mut self) {
        self.state.copy_from(&self.at_rest);
    }

    fn tick(&mut self, placed: Option<PlacedTool>, observer: SolveObserver<'_>) -> Result<(), Interrupted> {
        let number = self.state.tick();
        if number.is_multiple_of(TICKS_PER_CALL) && observer().is_break() {
            return Err(Interrupted);
        }
        let sample = |pose| PoseSample { sequence: number + 1, source_time_ns: None, valid: true, pose };
        let pose = placed.map(|placed| ToolPose { tool: placed.tool, sample: sample(placed.pose) });
        let input = TickInput { clock_s: self.state.sim_time_s(), poses: pose.as_slice() };
        tick(&self.model, input, &mut self.state, &mut self.workspace, &mut NoProbe);
        Ok(())
    }

    /// Holds until no node has moved farther than `settled_m` within a window, as long as patience lasts.
    fn settle(
        &mut self,
        placed: Option<PlacedTool>,
        drive: &DriveOptions,
        observer: SolveObserver<'_>,
    ) -> Result<Settling, Interrupted> {
        let ticks = |seconds: f64| (seconds / self.model.timestep_s()).round().max(1.0) as u64;
        let (window, patience) = (ticks(drive.window_s), ticks(drive.patience_s));
        let (mut waited, mut motion_m) = (0, f64::INFINITY);
        while waited < patience && motion_m > drive.settled_m {
            let before = self.state.node_displacements(&self.model);
            for _ in 0..window {
                self.tick(placed, observer)?;
            }
            waited += window;
            let now = self.state.node_displacements(&self.model);
            motion_m = largest(now.iter().zip(&before).map(|(a, b)| (a - b).norm()));
        }
        Ok(Settling {
            time_s: waited as f64 * self.model.timestep_s(),
            motion_m,
            speed_m_per_s: largest(self.state.node_velocities(&self.model).iter().map(Vector3::norm)),
            settled: motion_m <= drive.tolerated_m.max(drive.settled_m),
            rollbacks: self.state.rollbacks(),
        })
    }

    fn result(&self, contact_point: Option<Point3<f64>>, tool_force: Vector3<f64>, settling: Settling) -> CoarseResult {
        let mut offsets = vec![[0.0_f32; 3]; self.model.n_skin()];
        self.state.write_skin_offsets(&self.model, &mut offsets);
        CoarseResult {
            displacements: self.state.node_displacements(&self.model),
            offsets: offsets.iter().map(|o| Vector3::from(o.map(f64::from))).collect(),
            contact_point,
            tool_force,
            settling,
        }
    }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}
