//! A whole daemon in one value: model, simulation thread, bus.

use std::sync::Arc;

use plica_protocol::keys::Keys;
use plica_sim::Model;

use crate::bus::{Bus, BusError, BusOptions, Scene};
use crate::config::Config;
use crate::limits::{FrameTooLarge, check_frame};
use crate::realtime::{Grants, Loop, LoopOptions, Running, ThreadOptions, spawn};
use crate::scene::{self, SceneError};

/// Why a daemon does not start.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The scene makes no model.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Frames would never arrive.
    #[error(transparent)]
    Frame(#[from] FrameTooLarge),
    /// The bus cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The simulation thread cannot be started.
    #[error("the simulation thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

/// A running daemon.
pub struct Server {
    bus: Bus,
    simulation: Running,
    model: Arc<Model>,
}

impl Server {
    /// Builds the scene, opens the bus and starts ticking (in lock-step: waits for `rpc/step`).
    pub fn start(config: &Config, options: &BusOptions, lock_step: bool) -> Result<Self, ServerError> {
        let keys = Keys::new(&options.session).map_err(BusError::from)?;
        let session = Bus::open(options)?;
        let model = Arc::new(scene::build(config)?);
        check_frame(config, model.n_skin())?;
        let publish = config.object().publish();
        let loop_options = LoopOptions { publish_hz: publish.publish_hz, wrench_hz: publish.wrench_hz, lock_step };
        let (core, ports) = Loop::new(Arc::clone(&model), loop_options);
        let simulation = spawn(core, thread_options(config))?;
        let grants = simulation.grants().clone();
        let bus = Bus::start(session, keys, describe(config), Arc::clone(&model), ports, grants)?;
        Ok(Self { bus, simulation, model })
    }

    /// The scene's model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// What the operating system granted to the simulation thread.
    pub fn grants(&self) -> &Grants {
        self.simulation.grants()
    }

    /// False once the simulation thread has ended by itself, which is a fault.
    pub fn is_alive(&self) -> bool {
        self.simulation.is_alive()
    }

    /// Stops ticking and closes the bus, in three seconds at most.
    pub fn stop(self) {
        self.simulation.stop();
        self.bus.close();
    }
}

fn thread_options(config: &Config) -> ThreadOptions {
    let runtime = config.runtime();
    ThreadOptions { priority: runtime.realtime_priority(), cpu: runtime.cpu(), lock_memory: runtime.lock_memory() }
}

fn describe(config: &Config) -> Scene {
    Scene {
        name: config.name().to_owned(),
        object: config.object().name().to_owned(),
        tools: config.tools().iter().map(|t| t.name.clone()).collect(),
        stale_after_s: config.tools().iter().map(|t| t.stale_after_s).collect(),
        publish: config.object().publish(),
    }
}
