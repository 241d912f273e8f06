//! The gates of all tools, and the queues behind them.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use plica_protocol::DecodeError;
use plica_protocol::pose::Pose;
use plica_protocol::rpc::{ErrorCode, ErrorReply, StepPose};
use plica_protocol::status::{Counters, QUEUE_FULL};
use plica_sim::{PoseSample, ToolPose};

use super::pose_gate::PoseGate;
use super::scene_info::SceneInfo;
use crate::realtime::MAX_STEP_POSES;
use crate::wire;

/// Gates and queues of poses for the simulation thread.
pub(super) struct PoseIntake {
    names: Vec<String>,
    tools: Vec<Mutex<Tool>>,
    started: Instant,
}

struct Tool {
    gate: PoseGate,
    queue: rtrb::Producer<PoseSample>,
}

impl PoseIntake {
    pub(super) fn new(scene: &SceneInfo, queues: Vec<rtrb::Producer<PoseSample>>) -> Self {
        let tool = |(stale_after_s, queue): (&f64, _)| Mutex::new(Tool { gate: PoseGate::new(*stale_after_s), queue });
        Self {
            names: scene.tools.clone(),
            tools: scene.stale_after_s.iter().zip(queues).map(tool).collect(),
            started: Instant::now(),
        }
    }

    pub(super) fn tool(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// Handles a message for a tool.
    pub(super) fn arrive(&self, tool: usize, message: Result<Pose, DecodeError>) {
        let now_s = self.now_s();
        let mut tool = self.lock(tool);
        let Some(pose) = tool.gate.admit(message, now_s) else { return };
        if tool.queue.push(wire::pose_sample(&pose)).is_err() {
            tool.gate.turn_back(QUEUE_FULL);
        }
    }

    /// Accepts the poses of a step request: all of them, or none and the error of the first refused one.
    pub(super) fn take_for_step(&self, poses: &[StepPose]) -> Result<Vec<ToolPose>, ErrorReply> {
        if poses.len() > MAX_STEP_POSES {
            let message = format!("{} poses; at most {MAX_STEP_POSES} fit into one step", poses.len());
            return Err(ErrorReply::new(ErrorCode::RpcMalformed, message));
        }
        let now_s = self.now_s();
        let mut tools: Vec<_> = (0..self.tools.len()).map(|i| self.lock(i)).collect();
        let mut gates: Vec<_> = tools.iter().map(|t| t.gate.clone()).collect();
        let mut taken = Vec::with_capacity(poses.len());
        for (i, step_pose) in poses.iter().enumerate() {
            let tool = self.tool(&step_pose.tool).ok_or_else(|| self.unknown_tool(&step_pose.tool))?;
            let bad = |why: String| ErrorReply::new(ErrorCode::BadPose, format!("poses[{i}]: {why}"));
            let pose = step_pose.to_pose().map_err(|e| bad(e.to_string()))?;
            gates[tool].try_take(&pose, now_s).map_err(|e| bad(e.kind().to_owned()))?;
            taken.push(ToolPose { tool, sample: wire::pose_sample(&pose) });
        }
        for (tool, gate) in tools.iter_mut().zip(gates) {
            tool.gate = gate;
        }
        Ok(taken)
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
        let message = format!("the scene has no tool `{name}`; it has: {}", self.names.join(", "));
        ErrorReply::new(ErrorCode::UnknownTool, message)
    }

    fn now_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    fn lock(&self, tool: usize) -> MutexGuard<'_, Tool> {
        self.tools[tool].lock().unwrap_or_else(PoisonError::into_inner)
    }
}
