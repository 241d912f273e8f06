//! Scene files: [`RawConfig`] as typed, [`Config`] checked.

mod accurate;
mod bench;
mod enrichment;
mod files;
mod material;
mod object;
pub(crate) mod raw;
mod runtime;
mod tool;
mod training;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use plica_sim::{ContactOptions, Plane, SleepOptions, ToolDescription};
use schemars::Schema;

pub use accurate::{AccurateConfig, AccurateMesh};
pub use bench::{BenchConfig, Keyframe};
pub use enrichment::EnrichmentConfig;
pub use files::{MAX_FILE_BYTES, SceneFile};
pub use material::Region;
pub use object::{Face, FixedConfig, MeshConfig, ObjectConfig, PositionFormat, PublishConfig, SkinConfig};
pub use raw::RawConfig;
pub use runtime::RuntimeConfig;
pub use training::{OutsideConfig, RecordedConfig, TrainingConfig};

use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;
use crate::extents::{self, Size};
use crate::ranges;

/// Text of the built-in scene, the wedge.
pub const BUILT_IN_SCENE: &str = include_str!("../../../configs/scenes/wedge.toml");

/// A checked scene. SI units; every number is within the range that `plicad schema` names.
#[derive(Debug, Clone)]
pub struct Config {
    name: String,
    file: PathBuf,
    object: ObjectConfig,
    tools: Vec<ToolDescription>,
    contact: ContactOptions,
    runtime: RuntimeConfig,
    bench: Option<BenchConfig>,
    training: TrainingConfig,
    enrichment: EnrichmentConfig,
    files: Vec<SceneFile>,
    text: String,
    remarks: Vec<String>,
}

/// JSON Schema of scene files: every key with its meaning, unit and range.
pub fn schema() -> &'static Schema {
    static SCHEMA: OnceLock<Schema> = OnceLock::new();
    SCHEMA.get_or_init(|| schemars::schema_for!(RawConfig))
}

impl Config {
    /// The built-in scene.
    pub fn built_in() -> Result<Self, ConfigError> {
        Self::parse(Path::new("wedge.toml"), BUILT_IN_SCENE)
    }

    /// Reads and checks a scene file.
    pub fn from_file(file: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(file).map_err(|e| ConfigError {
            file: file.to_owned(),
            line: None,
            key: String::new(),
            problem: format!("cannot be read: {e}"),
            advice: "check the path; `plicad serve` without a scene runs the built-in wedge".into(),
        })?;
        Self::parse(file, &text)
    }

    /// Checks the text of a scene file and reads the meshes that it names. `file` names it in messages and resolves relative
    /// paths.
    pub fn parse(file: &Path, text: &str) -> Result<Self, ConfigError> {
        Self::parse_with(file, text, &files::read_parts)
    }

    /// Checks the text of a scene file, with meshes from `parts`.
    fn parse_with(file: &Path, text: &str, parts: files::Parts<'_>) -> Result<Self, ConfigError> {
        let document = Document::parse(file, text)?;
        let raw: RawConfig = document.read()?;
        ranges::check(&document, schema().as_value())?;
        let check = Check::new(&document);
        let object = object::check(&check, &raw.objects)?;
        let mut remarks = Vec::new();
        let (name, size_m) = (object.name(), object.mesh().extents_m());
        if let Size::Doubtful(doubt) = extents::judge("the object", &format!("objects.{name}.mesh"), size_m) {
            remarks.push(doubt);
        }
        let tools = tool::check(&check, &raw.tools, parts, &mut remarks)?;
        let bench = raw.bench.as_ref().map(|b| bench::check(&check, b, &tools)).transpose()?;
        let training = check_training(&check, &raw, &tools)?;
        Ok(Self {
            name: file.file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned()),
            file: file.to_owned(),
            object,
            contact: runtime::contact(&raw.contact),
            runtime: runtime::runtime(&raw.runtime),
            enrichment: check_enrichment(&check, &raw, &training)?,
            training,
            files: files::list(file, &raw),
            text: text.to_owned(),
            tools,
            bench,
            remarks,
        })
    }

    /// Sentences about the scene that its user should read: tools that are not convex, extents that are hardly meant.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Files that the text of a scene names. All of the text is checked, and no file is opened.
    ///
    /// # Errors
    /// As [`Config::parse`], except for the content of files.
    pub fn files_of(file: &Path, text: &str) -> Result<Vec<SceneFile>, ConfigError> {
        Ok(Self::parse_with(file, text, &files::stand_in)?.files)
    }

    /// Name of the scene: the file's name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// File that the scene was read from.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The object.
    pub fn object(&self) -> &ObjectConfig {
        &self.object
    }

    /// Replaces the element of the real-time model, to compare both in one scene.
    pub fn set_element(&mut self, element: plica_sim::ElementKind) {
        self.object.set_element(element);
    }

    /// Tools in alphabetical order of their names.
    pub fn tools(&self) -> &[ToolDescription] {
        &self.tools
    }

    /// Index of a tool by name.
    pub fn tool_index(&self, name: &str) -> Option<usize> {
        self.tools.iter().position(|t| t.name == name)
    }

    /// Contact detection and law.
    pub fn contact(&self) -> &ContactOptions {
        &self.contact
    }

    /// Time step, gravity, real-time thread.
    pub fn runtime(&self) -> &RuntimeConfig {
        &self.runtime
    }

    /// Scripted tool motion of `plicad bench`.
    pub fn bench(&self) -> Option<&BenchConfig> {
        self.bench.as_ref()
    }

    /// Interactions and sampling of `plicad train`.
    pub fn training(&self) -> &TrainingConfig {
        &self.training
    }

    /// Enrichment method and its options.
    pub fn enrichment(&self) -> &EnrichmentConfig {
        &self.enrichment
    }

    /// Replaces the database to start with.
    pub fn set_database(&mut self, file: PathBuf) {
        self.enrichment.database = Some(file);
    }

    /// Files that the scene names; they are copied into the folder of a job.
    pub fn files(&self) -> &[SceneFile] {
        &self.files
    }

    /// The scene file's text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Immovable half-spaces.
    pub fn planes(&self) -> &[Plane] {
        self.object.planes()
    }

    /// Sleep of an object at rest.
    pub fn sleep(&self) -> &SleepOptions {
        self.runtime.sleep()
    }
}

fn check_training(c: &Check<'_>, raw: &RawConfig, tools: &[ToolDescription]) -> Result<TrainingConfig, ConfigError> {
    let (name, object) = raw.objects.first_key_value().expect("the object was checked before");
    training::check(c, &format!("objects.{name}.training"), &object.training, tools)
}

fn check_enrichment(
    c: &Check<'_>,
    raw: &RawConfig,
    training: &TrainingConfig,
) -> Result<EnrichmentConfig, ConfigError> {
    let (name, object) = raw.objects.first_key_value().expect("the object was checked before");
    enrichment::check(c, &format!("objects.{name}.enrichment"), &object.enrichment, training.stamp_axes)
}

#[cfg(test)]
mod tests;
