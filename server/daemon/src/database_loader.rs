//! Loads a database of examples and prepares it for enrichment.

use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use plica_scene::Config;
use plica_scene::hash::{HashError, scene_hash};
use plica_sim::Model;
use plica_sim::enrichment::{Enricher, EnricherError, EnrichmentOptions, LiveEnrichment};
use plica_training::{Database, DatabaseError, DatabaseKind, FileFault, MAX_DATABASE_BYTES, RegularFile, SceneLimits};

/// Characters of a name in an error.
const MAX_NAME_SHOWN: usize = 64;

/// Why a database cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum EnrichmentError {
    /// No regular file, or too large.
    #[error("{path}: {problem}", path = path.display())]
    File {
        /// Given path.
        path: PathBuf,
        /// Problem.
        problem: String,
    },
    /// The folder of databases cannot be used.
    #[error("the folder of databases {path} cannot be used: {source}; give an existing folder with --databases", path = path.display())]
    Folder {
        /// Given path.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A client names more than a file in the folder of databases.
    #[error(
        "`{0}` is no name of a file: give the id of a job, or the name of a file in the folder of databases, without folders"
    )]
    NoName(String),
    /// The daemon has no folder of databases.
    #[error(
        "`{0}` is no id of a job, and this daemon has no folder of databases; start plicad with --databases DIR to name files in it"
    )]
    NoFolder(String),
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
    limits: SceneLimits,
    options: EnrichmentOptions,
    /// Folder of the databases that clients may name.
    folder: Option<PathBuf>,
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
        let [lowest_m, highest_m] = box_of(model);
        let (n_nodes, n_skin) = (model.n_nodes(), model.n_skin());
        let limits = SceneLimits { scene_hash: scene_hash(config)?, n_nodes, n_skin, lowest_m, highest_m };
        Ok(Self { model: Arc::clone(model), limits, options, folder: None })
    }

    /// The same, with a folder of databases that clients may name.
    ///
    /// # Errors
    /// [`EnrichmentError::Folder`].
    pub fn with_folder(self, folder: Option<&Path>) -> Result<Self, EnrichmentError> {
        let found = |path: &Path| {
            let listed = path.canonicalize().and_then(|found| std::fs::read_dir(&found).map(|_| found));
            listed.map_err(|source| EnrichmentError::Folder { path: path.to_owned(), source })
        };
        Ok(Self { folder: folder.map(found).transpose()?, ..self })
    }

    /// Opens a file in the folder of databases by its name; errors do not say where the folder is.
    ///
    /// # Errors
    /// See [`EnrichmentError`].
    pub fn open_named(&self, name: &str) -> Result<RegularFile, EnrichmentError> {
        let shown = || name.chars().filter(|c| !c.is_control()).take(MAX_NAME_SHOWN).collect();
        let Some(folder) = &self.folder else { return Err(EnrichmentError::NoFolder(shown())) };
        let mut parts = Path::new(name).components();
        let is_name = matches!((parts.next(), parts.next()), (Some(Component::Normal(only)), None) if only == name);
        if !is_name || name.contains(['\\', '\0']) {
            return Err(EnrichmentError::NoName(shown()));
        }
        let failed = |problem| EnrichmentError::File { path: PathBuf::from(name), problem };
        let found = folder.join(name).canonicalize().map_err(|e| failed(FileFault::Io(e).to_string()))?;
        if !found.starts_with(folder) {
            return Err(failed("is a link that leads out of the folder of databases".into()));
        }
        RegularFile::open_unlinked(&found, MAX_DATABASE_BYTES).map_err(|fault| failed(fault.to_string()))
    }

    /// Reads and checks a database and prepares the tables. Takes seconds.
    ///
    /// # Errors
    /// See [`EnrichmentError`].
    pub fn read(&self, path: &Path) -> Result<Ready, EnrichmentError> {
        self.read_open(open(path)?, path)
    }

    /// The same for an open file, which errors call `path`.
    ///
    /// # Errors
    /// See [`EnrichmentError`].
    pub fn read_open(&self, file: RegularFile, path: &Path) -> Result<Ready, EnrichmentError> {
        let database = Database::read_for(file, path, &self.limits)?;
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

/// Opens a database that the operator names.
fn open(path: &Path) -> Result<RegularFile, EnrichmentError> {
    let place = if path.is_relative() { "; the path begins where this program was started" } else { "" };
    let failed = |fault| EnrichmentError::File { path: path.to_owned(), problem: format!("{fault}{place}") };
    RegularFile::open(path, MAX_DATABASE_BYTES).map_err(failed)
}

/// Box of the object at rest: lower and upper corner \[m\].
fn box_of(model: &Model) -> [[f64; 3]; 2] {
    let skin = &model.description().skin;
    let extreme = |of: fn(f64, f64) -> f64, start: f64| {
        std::array::from_fn(|k| skin.positions().iter().map(|p| p[k]).fold(start, of))
    };
    [extreme(f64::min, f64::INFINITY), extreme(f64::max, f64::NEG_INFINITY)]
}
