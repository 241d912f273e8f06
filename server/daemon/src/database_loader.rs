//! Loads a database of examples and prepares it for enrichment.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use plica_scene::Config;
use plica_scene::hash::{HashError, scene_hash};
use plica_sim::Model;
use plica_sim::enrichment::{Enricher, EnricherError, EnrichmentOptions, LiveEnrichment};
use plica_training::{Database, DatabaseError, DatabaseKind};

/// Largest accepted database file.
const MAX_BYTES: u64 = 4 << 30;

/// Why a database cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EnrichmentError {
    /// Not an ordinary file, or too large.
    #[error("{path}: {problem}", path = path.display())]
    File {
        /// Given path.
        path: PathBuf,
        /// Problem.
        problem: String,
    },
    /// A file that belongs to the scene cannot be read.
    #[error(transparent)]
    Hash(#[from] HashError),
    /// Damaged, of another version, or of another scene.
    #[error(transparent)]
    Database(#[from] DatabaseError),
    /// A database of held-out interactions, which must never be trained on.
    #[error("{path}: holds held-out interactions, made to evaluate; name a database of kind training", path = path.display())]
    HeldOut {
        /// The file.
        path: PathBuf,
    },
    /// The method cannot use it.
    #[error("{path}: {source}", path = path.display())]
    Enricher {
        /// The file.
        path: PathBuf,
        /// Why.
        source: EnricherError,
    },
}

/// Scene hash and method, for loading databases.
#[derive(Debug, Clone)]
pub struct Enrichment {
    model: Arc<Model>,
    scene_hash: String,
    options: EnrichmentOptions,
}

/// Prepared examples.
#[derive(Debug, Clone)]
pub struct Ready {
    /// Tables of the method.
    pub enricher: Arc<Enricher>,
    /// Number of training examples.
    pub n_examples: usize,
}

impl Enrichment {
    /// Loader for a scene and its model.
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

    /// Enrichment for the simulation thread.
    pub fn live(&self, ready: &Ready) -> Box<LiveEnrichment> {
        let live = LiveEnrichment::new(&self.model, Arc::clone(&ready.enricher));
        // A copy, so that every page is written already and the simulation thread faults on none.
        Box::new(live.clone())
    }
}

/// Prepared examples of the database that a scene starts with, if it names one.
///
/// # Errors
/// See [`EnrichmentError`].
pub fn at_start(config: &Config, model: &Arc<Model>) -> Result<Option<(Enrichment, Ready)>, EnrichmentError> {
    let Some(path) = &config.enrichment().database else { return Ok(None) };
    let enrichment = Enrichment::new(config, model)?;
    let ready = enrichment.read(path)?;
    Ok(Some((enrichment, ready)))
}

/// Refuses devices and pipes, which would be read without end.
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
