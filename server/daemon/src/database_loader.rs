//! From a database of examples to detail on the skin of a running simulation.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use plica_scene::Config;
use plica_scene::hash::{HashError, scene_hash};
use plica_sim::Model;
use plica_sim::enrichment::{Enricher, EnricherError, EnrichmentOptions, LiveEnrichment};
use plica_training::{Database, DatabaseError, DatabaseKind};

/// A larger file is no database that a simulation can be enriched with.
const MAX_BYTES: u64 = 4 << 30;

/// Why a database cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EnrichmentError {
    /// It is no file of a sensible size.
    #[error("{path}: {problem}", path = path.display())]
    File {
        /// What was named.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A file that belongs to the scene cannot be read.
    #[error(transparent)]
    Hash(#[from] HashError),
    /// It is damaged, of another version, or of another scene.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// It holds what must never be learned from.
    #[error("{path}: holds held-out interactions, made to evaluate; name a database of kind training", path = path.display())]
    HeldOut {
        /// The file.
        path: PathBuf,
    },
    /// The method makes nothing of it.
    #[error("{path}: {source}", path = path.display())]
    Enricher {
        /// The file.
        path: PathBuf,
        /// Why.
        source: EnricherError,
    },
}

/// What it takes to enrich a scene, but for the examples.
#[derive(Debug, Clone)]
pub struct Enrichment {
    model: Arc<Model>,
    scene_hash: String,
    options: EnrichmentOptions,
}

/// Examples made ready.
#[derive(Debug, Clone)]
pub struct Ready {
    /// Tables of the method.
    pub enricher: Arc<Enricher>,
    /// How many examples it has learned from.
    pub n_examples: usize,
}

impl Enrichment {
    /// Of a scene and its model.
    ///
    /// # Errors
    /// A mesh file of the scene cannot be read.
    pub fn new(config: &Config, model: &Arc<Model>) -> Result<Self, HashError> {
        let options = config.enrichment().options;
        Ok(Self { model: Arc::clone(model), scene_hash: scene_hash(config)?, options })
    }

    /// Reads and checks a database and prepares the tables. Takes seconds.
    ///
    /// # Errors
    /// See [`EnrichmentError`].
    pub fn read(&self, path: &Path) -> Result<Ready, EnrichmentError> {
        check_file(path)?;
        let database = Database::read(path, Some(&self.scene_hash))?;
        if database.about.kind == DatabaseKind::Evaluation {
            return Err(EnrichmentError::HeldOut { path: path.to_owned() });
        }
        let enricher = Enricher::new(&self.model, &database.leading_examples(usize::MAX), self.options);
        let enricher = enricher.map_err(|source| EnrichmentError::Enricher { path: path.to_owned(), source })?;
        Ok(Ready { enricher: Arc::new(enricher), n_examples: database.examples.len() })
    }

    /// What the simulation thread is given.
    pub fn live(&self, ready: &Ready) -> Box<LiveEnrichment> {
        let live = LiveEnrichment::new(&self.model, Arc::clone(&ready.enricher));
        // A copy: every page of it has been written, so that the simulation thread faults on none.
        Box::new(live.clone())
    }
}

/// Examples that a scene starts with, if it names some.
///
/// # Errors
/// See [`EnrichmentError`].
pub fn at_start(config: &Config, model: &Arc<Model>) -> Result<Option<(Enrichment, Ready)>, EnrichmentError> {
    let Some(path) = &config.enrichment().database else { return Ok(None) };
    let enrichment = Enrichment::new(config, model)?;
    let ready = enrichment.read(path)?;
    Ok(Some((enrichment, ready)))
}

/// A device or a pipe would be read without end.
fn check_file(path: &Path) -> Result<(), EnrichmentError> {
    let failed = |problem: String| EnrichmentError::File { path: path.to_owned(), problem };
    let place = if path.is_relative() { "; the path begins where this program was started" } else { "" };
    let unreadable = |e: std::io::Error| failed(format!("cannot be read: {e}{place}"));
    let metadata = fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(failed("is no file".into()));
    }
    if metadata.len() > MAX_BYTES {
        return Err(failed(format!("has {} bytes; at most {MAX_BYTES} are read", metadata.len())));
    }
    Ok(())
}
