//! Files that a scene names: tools from meshes, recorded motions.

use std::path::{Path, PathBuf};

use nalgebra::Point3;
use plica_geometry::import::{ObjPart, parse_obj_parts};
use plica_training::RegularFile;

use super::raw::{RawConfig, RawShape};

/// A file that a scene names.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneFile {
    /// Key that names it.
    pub key: String,
    /// Path as typed, relative to the scene file.
    pub typed: String,
    /// Path, resolved.
    pub path: PathBuf,
    /// Metres per unit of a mesh file.
    pub metres_per_unit: Option<f64>,
}

/// Largest file that a scene may name.
pub const MAX_FILE_BYTES: u64 = 64 << 20;

/// Source of meshes: the parts in a file of a unit \[m\], or a sentence.
pub(super) type Parts<'a> = &'a dyn Fn(&Path, f64) -> Result<Vec<ObjPart>, String>;

/// The parts in an OBJ file.
pub(super) fn read_parts(path: &Path, metres_per_unit: f64) -> Result<Vec<ObjPart>, String> {
    let bytes = RegularFile::open(path, MAX_FILE_BYTES).and_then(RegularFile::read).map_err(|e| e.to_string())?;
    parse_obj_parts(&bytes, metres_per_unit)
}

/// One part with a volume, in place of a file that is not to be opened.
pub(super) fn stand_in(_: &Path, _: f64) -> Result<Vec<ObjPart>, String> {
    let corners = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 0.01]];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    Ok(vec![ObjPart { name: "part 1".into(), points: corners.map(Point3::from).to_vec(), triangles }])
}

/// All files that belong to a scene: each key of type [`RawFile`](super::raw::RawFile).
pub(super) fn list(scene: &Path, raw: &RawConfig) -> Vec<SceneFile> {
    let folder = scene.parent().map(PathBuf::from).unwrap_or_default();
    let file = |key: String, typed: &str, metres_per_unit: Option<f64>| SceneFile {
        key,
        typed: typed.to_owned(),
        path: folder.join(typed),
        metres_per_unit,
    };
    let meshes = raw.tools.iter().filter_map(|(name, tool)| match &tool.shape {
        RawShape::Mesh { file: typed, metres_per_unit } => {
            Some(file(format!("tools.{name}.shape.mesh.file"), &typed.0, Some(*metres_per_unit)))
        }
        _ => None,
    });
    let motions = raw.objects.iter().filter_map(|(name, object)| {
        let recorded = object.training.recorded.as_ref()?;
        Some(file(format!("objects.{name}.training.recorded.file"), &recorded.file.0, None))
    });
    meshes.chain(motions).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;
    use crate::scene::Config;
    use crate::scene::raw::RawConfig;

    const SCENE: &str = r#"
[objects.block]
mesh = { generator = "block", size_m = [0.04, 0.04, 0.02] }
material = { young_modulus_pa = 3e4, poisson_ratio = 0.4, density_kg_per_m3 = 1000.0 }
training = { recorded = { file = "press.csv" } }
[tools.fork]
shape = { mesh = { file = "fork.obj" } }
"#;

    /// Paths of keys whose type is `RawFile`, without the names of tables.
    fn file_keys(schema: &Value) -> Vec<String> {
        let definitions = schema["$defs"].as_object().into_iter().flatten();
        let named = definitions.flat_map(|(owner, definition)| {
            let mut keys = Vec::new();
            collect(owner, definition, &mut keys);
            keys
        });
        named.collect()
    }

    fn collect(at: &str, value: &Value, keys: &mut Vec<String>) {
        match value {
            Value::Object(map) if map.get("$ref").is_some_and(|r| r == "#/$defs/RawFile") => keys.push(at.to_owned()),
            Value::Object(map) => map.iter().for_each(|(key, inner)| collect(&format!("{at}.{key}"), inner, keys)),
            Value::Array(items) => items.iter().for_each(|inner| collect(at, inner, keys)),
            _ => {}
        }
    }

    #[test]
    fn every_key_of_the_type_file_is_listed_and_no_other() {
        let schema = serde_json::to_value(schemars::schema_for!(RawConfig)).expect("a schema is JSON");
        let listed = Config::files_of(Path::new("scenes/fork.toml"), SCENE).expect("a scene");
        let paths: Vec<_> = listed.iter().map(|file| file.path.display().to_string()).collect();
        assert_eq!(paths, ["scenes/fork.obj", "scenes/press.csv"]);
        let keys = file_keys(&schema);
        assert_eq!(keys.len(), listed.len(), "a key of type RawFile is not in `list`: {keys:?}");
    }
}
