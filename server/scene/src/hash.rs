//! Scene hash: SHA-256 of everything in a scene that determines the values of its examples.
//!
//! Canonical JSON of the checked scene: the object with its materials and supports, gravity, coarse mesh and element, skin
//! and embedding, accurate model, tie, friction, and the tools' shapes; bytes of mesh files. Left out:
//! publishing, run time (except gravity, which deforms both models), options of the linear solver, coupling of tools to their
//! devices, ranges of training, and enrichment. Numbers are hashed as typed; computed numbers are not, since their last digit
//! may differ between machines.

use std::path::PathBuf;

use plica_geometry::EmbeddingKind;
use plica_sim::{ElementKind, Material, ToolDescription, ToolShape};
use plica_training::{FileFault, RegularFile, fingerprint};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::scene::{AccurateConfig, AccurateMesh, Config, MAX_FILE_BYTES, MeshConfig, ObjectConfig, Region};

/// Version of the hash, raised when its meaning changes.
const HASH_VERSION: u32 = 1;

/// A file that belongs to the scene cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{key}: {path} {source}", path = path.display())]
pub struct HashError {
    key: String,
    path: PathBuf,
    source: FileFault,
}

/// Scene hash, 64 hexadecimal digits.
///
/// # Errors
/// A mesh file cannot be read.
pub fn scene_hash(config: &Config) -> Result<String, HashError> {
    Ok(fingerprint(&json!({
        "hash_version": HASH_VERSION,
        "object": object(config.object()),
        "gravity_m_per_s2": <[f64; 3]>::from(config.runtime().gravity_m_per_s2()),
        "plane_friction": config.contact().plane_friction,
        "tools": config.tools().iter().map(|t| tool(config, t)).collect::<Result<Vec<_>, _>>()?,
    })))
}

fn object(object: &ObjectConfig) -> Value {
    let fixed = object.fixed();
    let faces: Vec<_> = fixed.faces.iter().map(|f| json!({ "axis": f.axis, "upper": f.upper })).collect();
    let boxes: Vec<_> = fixed.boxes.iter().map(|b| json!([b[0].coords.as_slice(), b[1].coords.as_slice()])).collect();
    let planes = object.planes().iter();
    let planes: Vec<_> = planes.map(|p| json!([p.point_m.coords.as_slice(), p.normal.as_slice()])).collect();
    let (accurate, tie) = (object.accurate(), object.tie());
    json!({
        "mesh": mesh(object.mesh()),
        "material": material(&object.material()),
        "regions": object.regions().iter().map(region).collect::<Vec<_>>(),
        "supports": { "faces": faces, "boxes": boxes, "planes": planes },
        "coarse": { "divisions": object.divisions(), "element": match object.element() {
            ElementKind::EnhancedStrain => "enhanced_strain",
            ElementKind::FullIntegration => "full_integration",
        }},
        "skin": { "spacing_m": object.skin().spacing_m, "embedding": match object.skin().embedding {
            EmbeddingKind::MovingLeastSquares { support_cells } => json!({ "support_cells": support_cells }),
            EmbeddingKind::Trilinear => json!("trilinear"),
        }},
        "accurate": accurate_model(accurate),
        "tie": { "compliance_m": tie.compliance_m, "band_m": tie.band_m, "rim_floor": tie.rim_floor },
    })
}

fn mesh(mesh: &MeshConfig) -> Value {
    match mesh {
        MeshConfig::Wedge(w) => json!({ "wedge": [w.length_m, w.width_m, w.thick_height_m, w.thin_height_m] }),
        MeshConfig::Block(size) => json!({ "block": size }),
    }
}

fn material(m: &Material) -> Value {
    json!([m.young_modulus_pa, m.poisson_ratio, m.density_kg_per_m3])
}

/// An even mesh has no gradings, so that the hash of a scene is what it was before there were any.
fn accurate_model(accurate: &AccurateConfig) -> Value {
    let AccurateMesh { divisions, grading } = accurate.mesh;
    let mut model = json!({ "divisions": divisions, "material": accurate_material(&accurate.material) });
    if grading != [1.0; 3] {
        model["grading"] = json!(grading);
    }
    model
}

fn accurate_material(m: &plica_accurate::Material) -> Value {
    let model = match m.model {
        plica_accurate::MaterialModel::Linear => json!("linear"),
        plica_accurate::MaterialModel::CompressibleNeoHookean => json!("compressible_neo_hookean"),
        plica_accurate::MaterialModel::StableNeoHookean => json!("stable_neo_hookean"),
        plica_accurate::MaterialModel::Exponential { exponent } => json!({ "exponential": exponent }),
        plica_accurate::MaterialModel::FibreReinforced(fibres) => {
            json!({ "fibre_reinforced": [fibres.young_modulus_pa, fibres.direction.x, fibres.direction.y, fibres.direction.z] })
        }
    };
    json!([model, m.young_modulus_pa, m.poisson_ratio])
}

/// Region without its name, which is for people.
fn region(r: &Region) -> Value {
    json!({
        "corners": [r.corners[0].coords.as_slice(), r.corners[1].coords.as_slice()],
        "coarse": material(&r.coarse),
        "accurate": accurate_material(&r.accurate),
    })
}

fn tool(config: &Config, tool: &ToolDescription) -> Result<Value, HashError> {
    let shape = match &tool.shape {
        ToolShape::Ball { radius_m } => json!({ "ball": radius_m }),
        ToolShape::Capsule { radius_m, length_m } => json!({ "capsule": [radius_m, length_m] }),
        // Halves of the typed numbers, exact.
        ToolShape::Cuboid { half_extents_m } => json!({ "cuboid": half_extents_m }),
        ToolShape::ConvexHull { polytope } => {
            json!({ "hull": polytope.points().iter().map(|p| p.coords.as_slice().to_vec()).collect::<Vec<_>>() })
        }
        ToolShape::Compound { .. } => mesh_file(config, &tool.name)?,
    };
    Ok(json!({ "name": tool.name, "shape": shape, "friction": tool.friction }))
}

/// Checksum of a mesh file and its scale. Points are computed and therefore left out.
fn mesh_file(config: &Config, tool: &str) -> Result<Value, HashError> {
    let key = format!("tools.{tool}.shape.mesh.file");
    let Some(file) = config.files().iter().find(|f| f.key == key) else { return Ok(Value::Null) };
    let bytes = RegularFile::open(&file.path, MAX_FILE_BYTES).and_then(RegularFile::read);
    let bytes = bytes.map_err(|source| HashError { key, path: file.path.clone(), source })?;
    let digits = plica_training::hexadecimal(&Sha256::digest(bytes));
    Ok(json!({ "mesh_sha256": digits, "metres_per_unit": file.metres_per_unit }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use std::path::Path;

    use super::*;
    use crate::scene::BUILT_IN_SCENE;

    fn hash(text: &str) -> String {
        scene_hash(&Config::parse(Path::new("scene.toml"), text).unwrap()).unwrap()
    }

    fn with(from: &str, to: &str) -> String {
        assert!(BUILT_IN_SCENE.contains(from), "{from}");
        hash(&BUILT_IN_SCENE.replacen(from, to, 1))
    }

    #[test]
    fn what_decides_an_example_changes_the_hash() {
        let own = hash(BUILT_IN_SCENE);
        let changes = [
            ("young_modulus_pa = 3e4 ", "young_modulus_pa = 3.1e4 "),
            ("poisson_ratio = 0.45 ", "poisson_ratio = 0.44 "),
            ("poisson_ratio = 0.48 ", "poisson_ratio = 0.47 "),
            ("length_m = 0.12 ", "length_m = 0.121 "),
            ("faces = [\"z_min\"]", "faces = [\"x_min\"]"),
            ("divisions = [8, 4, 4]", "divisions = [8, 4, 3]"),
            ("divisions = [32, 16, 8]", "divisions = [32, 16, 9]"),
            ("grading = [1.0, 1.0, 1.0]", "grading = [1.0, 1.0, 0.5]"),
            ("element = \"enhanced_strain\"", "element = \"full_integration\""),
            ("spacing_m = 0.00122", "spacing_m = 0.00123"),
            ("embedding = \"moving_least_squares\"", "embedding = \"trilinear\""),
            ("support_cells = 1.75", "support_cells = 1.8"),
            ("model = \"stable_neo_hookean\"", "model = \"linear\""),
            ("compliance_m = 2e-5", "compliance_m = 1e-5"),
            ("band_m = 2e-3", "band_m = 3e-3"),
            ("rim_floor = 1e-4", "rim_floor = 1e-3"),
            ("radius_m = 0.007", "radius_m = 0.006"),
            ("friction = 0.8 ", "friction = 0.7 "),
            ("gravity_m_per_s2 = 0.0", "gravity_m_per_s2 = 9.81"),
        ];
        let mut all: Vec<String> = changes.iter().map(|(from, to)| with(from, to)).collect();
        all.push(own);
        all.sort();
        let n = all.len();
        all.dedup();
        assert_eq!(all.len(), n, "two scenes share a hash");
    }

    #[test]
    fn what_does_not_decide_it_keeps_the_hash() {
        let own = hash(BUILT_IN_SCENE);
        let changes = [
            ("publish_hz = 90.0", "publish_hz = 30.0"),
            ("format = \"f32\"", "format = \"i16\""),
            ("realtime_priority = 60", "realtime_priority = 0"),
            ("timestep_s = 0.001", "timestep_s = 0.002"),
            ("coupling_stiffness_n_per_m = 1000.0", "coupling_stiffness_n_per_m = 500.0"),
            ("examples = 128", "examples = 7"),
            ("seed = 1\n", "seed = 11\n"),
            ("max_contacts = 32", "max_contacts = 64"),
            ("full_press_s = 0.5", "full_press_s = 0.4"),
            ("method = \"kriging-stamp\"", "method = \"ridge-vector\""),
            ("# radius_cells = 7.0", "radius_cells = 5.0"),
        ];
        for (from, to) in changes {
            assert_eq!(with(from, to), own, "{from} -> {to}");
        }
    }

    #[test]
    fn neither_order_nor_layout_of_the_file_matters() {
        let own = hash(BUILT_IN_SCENE);
        // Another order of keys and tables, other spellings of numbers, no comments, inline tables.
        let table: toml::Table = BUILT_IN_SCENE.parse().unwrap();
        let sorted = toml::to_string(&table).unwrap();
        assert_ne!(sorted, BUILT_IN_SCENE);
        assert_eq!(hash(&sorted), own);
        assert_eq!(with("young_modulus_pa = 3e4 ", "young_modulus_pa = 30_000.0 "), own);
        // Keys that are left out are their defaults.
        assert_eq!(with("element = \"enhanced_strain\"", "# element ="), own);
        assert_eq!(with("rim_floor = 1e-4", "# rim_floor ="), own);
        assert_eq!(with("grading = [1.0, 1.0, 1.0]", "# grading ="), own);
    }

    #[test]
    fn a_mesh_file_counts_by_its_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        let from = "shape = { capsule = { radius_m = 0.007, length_m = 0.1 } }";
        let text = BUILT_IN_SCENE.replacen(from, "shape = { mesh = { file = \"tool.obj\" } }", 1);
        let tetrahedron = "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 2 3\nf 1 2 4\n";
        let hash = |obj: &str| {
            std::fs::write(folder.path().join("tool.obj"), obj).unwrap();
            scene_hash(&Config::parse(&scene, &text).unwrap()).unwrap()
        };
        assert_eq!(hash(tetrahedron), hash(tetrahedron));
        assert_ne!(hash(tetrahedron), hash(&tetrahedron.replace("0.01", "0.02")));
    }
}
