//! Files that a scene names: tools from meshes, recorded motions.

use std::path::PathBuf;

use super::checks::Check;
use super::raw::{RawConfig, RawShape};

/// A file that a scene names.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    /// Key that names it.
    pub key: String,
    /// Path as typed, relative to the scene file.
    pub typed: String,
    /// Where it is.
    pub path: PathBuf,
    /// Of a mesh: metres per unit.
    pub metres_per_unit: Option<f64>,
}

pub(super) fn list(c: &Check<'_>, raw: &RawConfig) -> Vec<SceneFile> {
    let folder = c.document().file().parent().map(PathBuf::from).unwrap_or_default();
    let file = |key: String, typed: &str, metres_per_unit: Option<f64>| SceneFile {
        key,
        typed: typed.to_owned(),
        path: folder.join(typed),
        metres_per_unit,
    };
    let meshes = raw.tools.iter().filter_map(|(name, tool)| match &tool.shape {
        RawShape::Mesh { file: typed, metres_per_unit } => {
            Some(file(format!("tools.{name}.shape.mesh.file"), typed, Some(*metres_per_unit)))
        }
        _ => None,
    });
    let motions = raw.objects.iter().filter_map(|(name, object)| {
        let recorded = object.training.recorded.as_ref()?;
        Some(file(format!("objects.{name}.training.recorded.file"), &recorded.file, None))
    });
    meshes.chain(motions).collect()
}
