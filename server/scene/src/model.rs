//! Model descriptions from a checked scene.

use nalgebra::{Point3, Vector3};
use plica_geometry::shapes::Wedge;
use plica_geometry::{Embedding, EmbeddingError, HexIdx, HexMesh, Skin, shapes};
use plica_sim::{Material, Model, ModelDescription, ModelError};
use plica_training::AccurateDescription;

use crate::scene::{AccurateMesh, Config, Face, FixedConfig, MeshConfig, ObjectConfig, Region};

/// Distance of a node from a face at which it lies on the face, as a share of the object's size.
const ON_FACE: f64 = 1e-6;

/// Why a checked scene has no model.
#[derive(Debug, thiserror::Error)]
pub enum SceneModelError {
    /// The skin cannot be interpolated from the mesh.
    #[error("{file}: objects.{object}.skin: {cause}; choose more divisions, or embedding = \"trilinear\"")]
    Embedding {
        /// The scene.
        file: String,
        /// The object.
        object: String,
        /// Why.
        cause: EmbeddingError,
    },
    /// A support holds no node.
    #[error(
        "{file}: objects.{object}.supports.fixed.{what} holds no coarse node; move or enlarge it (the object spans {extents:?} m)"
    )]
    EmptySupport {
        /// The scene.
        file: String,
        /// The object.
        object: String,
        /// Face or box.
        what: String,
        /// Extents of the object \[m\].
        extents: [f64; 3],
    },
    /// The model cannot be built.
    #[error("{file}: {cause}")]
    Model {
        /// The scene.
        file: String,
        /// Why.
        cause: ModelError,
    },
}

/// Real-time model of a scene.
pub fn build(config: &Config) -> Result<Model, SceneModelError> {
    let file = config.file().display().to_string();
    Model::new(describe(config)?).map_err(|cause| SceneModelError::Model { file, cause })
}

/// Description of the real-time model of a scene.
pub fn describe(config: &Config) -> Result<ModelDescription, SceneModelError> {
    let object = config.object();
    let (mesh, skin) = generate(object);
    let skin = skin.clustered();
    let embedding = Embedding::new(&mesh, skin.positions(), object.skin().embedding).map_err(|cause| {
        let (file, object) = (config.file().display().to_string(), object.name().to_owned());
        SceneModelError::Embedding { file, object, cause }
    })?;
    Ok(ModelDescription {
        fixed: fixed_nodes(config, &mesh)?,
        materials: materials(object, &mesh),
        mesh,
        skin,
        embedding,
        mass_damping_per_s: object.mass_damping_per_s(),
        gravity_m_per_s2: config.runtime().gravity_m_per_s2(),
        element: object.element(),
        timestep_s: config.runtime().timestep_s(),
        substeps: object.substeps(),
        solver: object.solver(),
        contact: *config.contact(),
        sleep: *config.sleep(),
        tools: config.tools().to_vec(),
        planes: config.planes().to_vec(),
        bounds_m: object.bounds_m(),
    })
}

/// Description of the accurate model of a scene, with the scene's divisions or other ones.
///
/// # Errors
/// [`SceneModelError::EmptySupport`].
pub fn describe_accurate(config: &Config, mesh: Option<AccurateMesh>) -> Result<AccurateDescription, SceneModelError> {
    let (object, accurate) = (config.object(), config.object().accurate());
    let mesh = generate_mesh(object, mesh.unwrap_or(accurate.mesh));
    let regions: Vec<_> = mesh.hex_indices().map(|hex| region_of(object, &mesh, hex)).collect();
    let material = |region: &Option<&Region>| region.map_or(accurate.material, |r| r.accurate);
    let density = |region: &Option<&Region>| region.map_or(object.material(), |r| r.coarse).density_kg_per_m3;
    Ok(AccurateDescription {
        fixed: fixed_nodes(config, &mesh)?,
        materials: regions.iter().map(material).collect(),
        densities_kg_per_m3: regions.iter().map(density).collect(),
        mesh,
    })
}

/// Skin of a scene's object.
pub fn skin(config: &Config) -> Skin {
    generate(config.object()).1
}

fn generate(object: &ObjectConfig) -> (HexMesh, Skin) {
    let spacing = object.skin().spacing_m;
    let skin = match object.mesh() {
        MeshConfig::Wedge(wedge) => shapes::wedge_skin(wedge, spacing),
        MeshConfig::Block(size) => shapes::block_skin(*size, spacing),
    };
    (generate_mesh(object, AccurateMesh { divisions: object.divisions(), grading: [1.0; 3] }), skin)
}

fn generate_mesh(object: &ObjectConfig, mesh: AccurateMesh) -> HexMesh {
    let AccurateMesh { divisions, grading } = mesh;
    let block = |[length_m, width_m, height_m]: [f64; 3]| Wedge {
        length_m,
        width_m,
        thick_height_m: height_m,
        thin_height_m: height_m,
    };
    match object.mesh() {
        MeshConfig::Wedge(wedge) => shapes::graded_wedge(wedge, divisions, grading),
        MeshConfig::Block(size) => shapes::graded_wedge(&block(*size), divisions, grading),
    }
}

/// Material of each hexahedron.
fn materials(object: &ObjectConfig, mesh: &HexMesh) -> Vec<Material> {
    let material = |hex| region_of(object, mesh, hex).map_or(object.material(), |r| r.coarse);
    mesh.hex_indices().map(material).collect()
}

/// Last region that contains the centre of a hexahedron.
fn region_of<'a>(object: &'a ObjectConfig, mesh: &HexMesh, hex: HexIdx) -> Option<&'a Region> {
    let corners = mesh.corner_positions(hex);
    let centre = Point3::from(corners.iter().map(|c| c.coords).sum::<Vector3<f64>>() / 8.0);
    object.regions().iter().rev().find(|r| inside(&centre, &r.corners))
}

fn fixed_nodes(config: &Config, mesh: &HexMesh) -> Result<Vec<bool>, SceneModelError> {
    let object = config.object();
    let FixedConfig { faces, boxes } = object.fixed();
    let mut fixed = vec![false; mesh.n_nodes()];
    let bounds = bounds(mesh);
    let empty = |what: String| SceneModelError::EmptySupport {
        file: config.file().display().to_string(),
        object: object.name().to_owned(),
        what,
        extents: object.mesh().extents_m(),
    };
    for (i, face) in faces.iter().enumerate() {
        hold(&mut fixed, mesh, |p| on_face(p, *face, &bounds))
            .then_some(())
            .ok_or_else(|| empty(format!("faces[{i}]")))?;
    }
    for (i, corners) in boxes.iter().enumerate() {
        hold(&mut fixed, mesh, |p| inside(p, corners)).then_some(()).ok_or_else(|| empty(format!("boxes[{i}]")))?;
    }
    Ok(fixed)
}

/// Holds the nodes that `picks` selects. Returns whether there is one.
fn hold(fixed: &mut [bool], mesh: &HexMesh, picks: impl Fn(&Point3<f64>) -> bool) -> bool {
    let mut any = false;
    for (held, position) in fixed.iter_mut().zip(mesh.nodes()) {
        if picks(position) {
            *held = true;
            any = true;
        }
    }
    any
}

fn bounds(mesh: &HexMesh) -> [Point3<f64>; 2] {
    let first = mesh.nodes()[0];
    mesh.nodes().iter().fold([first, first], |[min, max], p| [min.inf(p), max.sup(p)])
}

fn on_face(p: &Point3<f64>, face: Face, bounds: &[Point3<f64>; 2]) -> bool {
    let size = (bounds[1] - bounds[0]).norm();
    let plane = bounds[usize::from(face.upper)][face.axis];
    (p[face.axis] - plane).abs() <= ON_FACE * size
}

fn inside(p: &Point3<f64>, corners: &[Point3<f64>; 2]) -> bool {
    (0..3).all(|i| (corners[0][i]..=corners[1][i]).contains(&p[i]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use std::path::Path;

    use super::*;
    use crate::scene::BUILT_IN_SCENE;

    fn with(from: &str, to: &str) -> Result<ModelDescription, SceneModelError> {
        describe(&Config::parse(Path::new("scene.toml"), &BUILT_IN_SCENE.replacen(from, to, 1)).unwrap())
    }

    #[test]
    fn the_wedge_has_the_sizes_of_the_design() {
        let description = describe(&Config::built_in().unwrap()).unwrap();
        assert_eq!(description.mesh.n_hexes(), 128);
        assert!((6_500..7_300).contains(&description.skin.n_vertices()), "{}", description.skin.n_vertices());
        assert_eq!(description.fixed.iter().filter(|f| **f).count(), 9 * 5);
    }

    #[test]
    fn regions_claim_hexahedra_by_their_centre() {
        let region = "[[objects.wedge.regions]]\nname = \"core\"\nmin_m = [0, 0, 0]\nmax_m = [0.06, 1, 1]\nyoung_modulus_pa = 1e6\n\n[objects.wedge.supports]";
        let description = with("[objects.wedge.supports]", region).unwrap();
        let hard = description.materials.iter().filter(|m| m.young_modulus_pa == 1e6).count();
        assert_eq!(hard, 64);
        assert_eq!(description.materials[0].poisson_ratio, 0.45);
    }

    #[test]
    fn the_accurate_model_takes_what_it_is_given_and_the_rest_from_the_object() {
        let region = "[[objects.wedge.regions]]\nname = \"core\"\nmin_m = [0, 0, 0]\nmax_m = [0.06, 1, 1]\nyoung_modulus_pa = 1e6\n\n[objects.wedge.supports]";
        let text = BUILT_IN_SCENE.replacen("[objects.wedge.supports]", region, 1);
        let config = Config::parse(Path::new("scene.toml"), &text).unwrap();
        let accurate = describe_accurate(&config, None).unwrap();
        assert_eq!(accurate.mesh.n_hexes(), 4096);
        let hard = accurate.materials.iter().filter(|m| m.young_modulus_pa == 1e6);
        assert!(hard.clone().all(|m| m.poisson_ratio == 0.48), "the region does not say, so the accurate model does");
        assert_eq!(hard.count(), 2048);
        assert_eq!(accurate.fixed.iter().filter(|f| **f).count(), 33 * 17);
        let text = text.replacen("young_modulus_pa = 1e6", "poisson_ratio = 0.1", 1);
        let config = Config::parse(Path::new("scene.toml"), &text).unwrap();
        let accurate =
            describe_accurate(&config, Some(AccurateMesh { divisions: [4, 2, 2], grading: [1.0; 3] })).unwrap();
        assert_eq!(accurate.materials.iter().filter(|m| m.poisson_ratio == 0.1).count(), 8);
        assert!(accurate.materials.iter().all(|m| m.young_modulus_pa == 3e4));
    }

    #[test]
    fn a_support_that_holds_nothing_is_an_error() {
        let error = with("boxes = []", "boxes = [{ min_m = [5, 5, 5], max_m = [6, 6, 6] }]").unwrap_err();
        assert!(error.to_string().contains("boxes[0] holds no coarse node"), "{error}");
    }
}
