//! The gates of all tools, and the queues behind them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use plica_protocol::DecodeError;
use plica_protocol::pose::Pose;
use plica_protocol::rpc::{ErrorCode, ErrorReply, StepRequest};
use plica_protocol::status::{Counters, QUEUE_FULL};
use plica_sim::{PoseSample, ToolPose};

use super::pose_gate::PoseGate;
use super::scene_info::{SceneInfo, ToolInfo};
use crate::realtime::Statistics;
use crate::wire;

/// Gates and queues of poses for the simulation thread.
pub(super) struct PoseIntake {
    infos: Vec<ToolInfo>,
    tools: Vec<Mutex<Tool>>,
    /// Holds simulated time, which judges order and takeover: while it stands, no source becomes stale.
    statistics: Arc<Statistics>,
}

struct Tool {
    gate: PoseGate,
    queue: rtrb::Producer<PoseSample>,
}

impl PoseIntake {
    pub(super) fn new(scene: &SceneInfo, queues: Vec<rtrb::Producer<PoseSample>>, statistics: Arc<Statistics>) -> Self {
        let tool = |(info, queue): (&ToolInfo, _)| Mutex::new(Tool { gate: PoseGate::new(info.stale_after_s), queue });
        Self { infos: scene.tools.clone(), tools: scene.tools.iter().zip(queues).map(tool).collect(), statistics }
    }

    pub(super) fn tool(&self, name: &str) -> Option<usize> {
        self.infos.iter().position(|info| info.name == name)
    }

    /// Handles a message for a tool.
    pub(super) fn arrive(&self, tool: usize, message: Result<Pose, DecodeError>) {
        let now_s = self.statistics.sim_time.get();
        let mut tool = self.lock(tool);
        let Some(pose) = tool.gate.admit(message, now_s) else { return };
        if tool.queue.push(wire::pose_sample(&pose)).is_err() {
            tool.gate.turn_back(QUEUE_FULL);
        }
    }

    /// Accepts the poses of a step request at simulated time `now_s`: all of them, or none and the error of the first refused one.
    /// Poses of a step without ticks wait for the next tick, as those from the stream do.
    pub(super) fn take_for_step(&self, request: &StepRequest, now_s: f64) -> Result<Vec<ToolPose>, ErrorReply> {
        let poses = &request.poses;
        let mut tools: Vec<_> = (0..self.tools.len()).map(|i| self.lock(i)).collect();
        let mut gates: Vec<_> = tools.iter().map(|t| t.gate.clone()).collect();
        let mut taken = Vec::with_capacity(poses.len());
        for (i, step_pose) in poses.iter().enumerate() {
            let tool = self.tool(&step_pose.tool).ok_or_else(|| self.unknown_tool(&step_pose.tool))?;
            let bad = |why: String| ErrorReply::new(ErrorCode::BadPose, format!("poses[{i}]: {why}"));
            let pose = step_pose.to_pose(self.infos[tool].position_scale).map_err(|e| bad(e.to_string()))?;
            gates[tool].try_take(&pose, now_s).map_err(|e| bad(e.kind().to_owned()))?;
            taken.push(ToolPose { tool, sample: wire::pose_sample(&pose) });
        }
        let waits = request.ticks == 0;
        let n_for = |tool: usize| taken.iter().filter(|pose: &&ToolPose| pose.tool == tool).count();
        if let Some((tool, _)) = tools.iter().enumerate().find(|(i, t)| waits && t.queue.slots() < n_for(*i)) {
            let message =
                format!("{QUEUE_FULL}: too many poses of `{}` wait for a tick; step first", self.infos[tool].name);
            return Err(ErrorReply::new(ErrorCode::BadPose, message));
        }
        for (tool, gate) in tools.iter_mut().zip(gates) {
            tool.gate = gate;
        }
        if !waits {
            return Ok(taken);
        }
        for ToolPose { tool, sample } in taken {
            // There is room: this is the only thread that holds the queue.
            let _ = tools[tool].queue.push(sample);
        }
        Ok(Vec::new())
    }

    /// Forgets the sources that hold tools.
    pub(super) fn forget(&self) {
        (0..self.tools.len()).for_each(|tool| self.lock(tool).gate.forget());
    }

    /// Accepted poses and rejected ones by kind.
    pub(super) fn counts(&self, tool: usize) -> (u64, Counters) {
        let tool = self.lock(tool);
        (tool.gate.accepted(), tool.gate.rejected().clone())
    }

    fn unknown_tool(&self, name: &str) -> ErrorReply {
        let names: Vec<&str> = self.infos.iter().map(|info| info.name.as_str()).collect();
        let message = format!("the scene has no tool `{name}`; it has: {}", names.join(", "));
        ErrorReply::new(ErrorCode::UnknownTool, message)
    }

    fn lock(&self, tool: usize) -> MutexGuard<'_, Tool> {
        self.tools[tool].lock().unwrap_or_else(PoisonError::into_inner)
    }
}
