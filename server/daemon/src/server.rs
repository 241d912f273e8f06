//! A whole daemon in one value: model, simulation thread, bus.

use std::sync::Arc;

use plica_jobs::{DataFolderError, Jobs, Supervision};
use plica_protocol::keys::Keys;
use plica_scene::Config;
use plica_scene::model::{self, SceneModelError};
use plica_sim::{Model, Sampling, ToolDescription};

use crate::bus::{Bus, BusError, BusOptions, Deaf, Parts, Peer, SceneInfo, ToolInfo};
use crate::database_loader::{Enrichment, EnrichmentError};
use crate::limits::{FrameTooLarge, check_frame};
use crate::realtime::{Grants, Loop, LoopOptions, Running, ThreadOptions, spawn};

/// Why a daemon cannot start.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The scene has no model.
    #[error(transparent)]
    Scene(#[from] SceneModelError),
    /// Frames would never arrive.
    #[error(transparent)]
    Frame(#[from] FrameTooLarge),
    /// The bus cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The simulation thread cannot be started.
    #[error("the simulation thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The examples that it should start with cannot be used.
    #[error(transparent)]
    Enrichment(#[from] EnrichmentError),
    /// The data folder is locked by another daemon.
    #[error(transparent)]
    Data(#[from] DataFolderError),
}

/// A running daemon.
pub struct Server {
    bus: Bus,
    simulation: Running,
    model: Arc<Model>,
    supervision: Option<Supervision>,
}

impl Server {
    /// Builds the scene, reads the examples that it names, opens the bus and starts ticking (in lock-step: waits for `rpc/step`). Without jobs.
    pub fn start(config: &Config, options: &BusOptions, lock_step: bool) -> Result<Self, ServerError> {
        Self::start_with_jobs(config, options, lock_step, || Ok((Jobs::unavailable("it was started without"), None)))
    }

    /// Starts with jobs, which are opened after the bus, so that a taken port is reported first.
    pub fn start_with_jobs(
        config: &Config,
        options: &BusOptions,
        lock_step: bool,
        jobs: impl FnOnce() -> Result<(Jobs, Option<Supervision>), DataFolderError>,
    ) -> Result<Self, ServerError> {
        let keys = Keys::new(&options.session).map_err(BusError::from)?;
        let session = Bus::open(options)?;
        let (jobs, supervision) = jobs()?;
        let model = Arc::new(model::build(config)?);
        check_frame(config, model.n_skin())?;
        let publish = config.object().publish();
        let loop_options = LoopOptions { publish_hz: publish.publish_hz, wrench_hz: publish.wrench_hz, lock_step };
        let (mut core, ports) = Loop::new(Arc::clone(&model), loop_options);
        let enrichment = Enrichment::new(config, &model).map_err(EnrichmentError::from)?;
        let enrichment = enrichment.with_folder(options.databases.as_deref())?;
        if let Some(database) = &config.enrichment().database {
            core.enrich(enrichment.live(&enrichment.read(database)?));
        }
        let simulation = spawn(core, thread_options(config))?;
        let grants = simulation.grants().clone();
        let parts = Parts {
            session,
            ports_of_bus: Bus::ports(options),
            keys,
            scene: describe(config),
            model: Arc::clone(&model),
            enrichment,
            ports,
            grants,
            jobs,
        };
        Ok(Self { bus: Bus::start(parts)?, simulation, model, supervision })
    }

    /// The scene's model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Privileges that the operating system granted to the simulation thread.
    pub fn grants(&self) -> &Grants {
        self.simulation.grants()
    }

    /// False once the simulation thread has ended by itself, which is a fault.
    pub fn is_alive(&self) -> bool {
        self.simulation.is_alive()
    }

    /// Judges whether the bus still answers; call it several times a second. See [`Bus::listen`].
    ///
    /// # Errors
    /// The bus is deaf: end the process with [`Server::abandon`].
    pub fn listen(&mut self) -> Result<(), Deaf> {
        self.bus.listen()
    }

    /// Turns of the simulation so far: it lives while they rise.
    pub fn turns(&self) -> u64 {
        self.bus.turns()
    }

    /// Far ends of the connections to the daemon's ports.
    pub fn peers(&self) -> Vec<Peer> {
        self.bus.peers()
    }

    /// Stops ticking and the running job, and leaves a deaf bus as it is.
    pub fn abandon(self) {
        let Self { bus, simulation, supervision, .. } = self;
        supervision.iter().for_each(Supervision::begin_stop);
        simulation.stop();
        bus.abandon();
        drop(supervision);
    }

    /// Stops ticking, closes the bus and ends the running job, in five seconds at most; without a job in three.
    pub fn stop(self) {
        let Self { bus, simulation, supervision, .. } = self;
        supervision.iter().for_each(Supervision::begin_stop);
        simulation.stop();
        bus.close();
        drop(supervision);
    }
}

fn thread_options(config: &Config) -> ThreadOptions {
    let runtime = config.runtime();
    ThreadOptions { priority: runtime.realtime_priority(), cpu: runtime.cpu(), lock_memory: runtime.lock_memory() }
}

fn describe(config: &Config) -> SceneInfo {
    SceneInfo {
        name: config.name().to_owned(),
        object: config.object().name().to_owned(),
        tools: config.tools().iter().map(describe_tool).collect(),
        publish: config.object().publish(),
    }
}

fn describe_tool(tool: &ToolDescription) -> ToolInfo {
    ToolInfo {
        name: tool.name.clone(),
        stale_after_s: tool.stale_after_s,
        position_scale: tool.position_scale,
        sampling: match tool.sampling {
            Sampling::Latest => "latest",
            Sampling::Interpolate { .. } => "interpolate",
        },
    }
}
