//! The soft object of a scene, checked.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use plica_accurate::TieOptions;
use plica_geometry::EmbeddingKind;
use plica_geometry::shapes::Wedge;
use plica_sim::{ElementKind, Material, Plane, Preconditioner, SolverOptions};

use super::accurate::{self, AccurateConfig};
use super::material::{self, Region};
use super::raw::{
    RawBox, RawElement, RawEmbedding, RawFace, RawFormat, RawGenerator, RawMesh, RawObject, RawPlane,
    RawPreconditioner, RawPublish, RawSkin, RawSolver, RawSupports,
};
use crate::checks::Check;
use crate::error::ConfigError;

/// Most hexahedra that the real-time model accepts.
const MAX_HEXES: u64 = 20_000;
/// Most skin vertices, estimated from surface and spacing.
const MAX_SKIN: f64 = 300_000.0;

/// The soft object of a scene.
#[derive(Debug, Clone)]
pub struct ObjectConfig {
    name: String,
    mesh: MeshConfig,
    divisions: [usize; 3],
    material: Material,
    mass_damping_per_s: f64,
    regions: Vec<Region>,
    fixed: FixedConfig,
    planes: Vec<Plane>,
    bounds_m: Option<[Point3<f64>; 2]>,
    element: ElementKind,
    substeps: u32,
    solver: SolverOptions,
    skin: SkinConfig,
    publish: PublishConfig,
    accurate: AccurateConfig,
    tie: TieOptions,
}

/// Shape of an object.
#[derive(Debug, Clone)]
pub enum MeshConfig {
    /// Height falls linearly along x.
    Wedge(Wedge),
    /// A box of these extents \[m\].
    Block([f64; 3]),
}

/// Selection of held coarse nodes.
#[derive(Debug, Clone, Default)]
pub struct FixedConfig {
    /// Faces of the mesh's bounding box.
    pub faces: Vec<Face>,
    /// Lower and upper corners of boxes \[m\].
    pub boxes: Vec<[Point3<f64>; 2]>,
}

/// Face of a bounding box: axis and end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Face {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Whether it is the end with the largest coordinate.
    pub upper: bool,
}

/// Published surface.
#[derive(Debug, Clone, Copy)]
pub struct SkinConfig {
    /// Largest edge of the skin grid \[m\].
    pub spacing_m: f64,
    /// Interpolation from coarse nodes to skin vertices.
    pub embedding: EmbeddingKind,
}

/// Contents and rates of the published data.
#[derive(Debug, Clone, Copy)]
pub struct PublishConfig {
    /// Skin frames per second.
    pub publish_hz: f64,
    /// Whether frames hold normals.
    pub normals: bool,
    /// Format of skin positions.
    pub format: PositionFormat,
    /// Wrenches per second and tool.
    pub wrench_hz: f64,
}

/// Format of skin positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PositionFormat {
    /// 32-bit floats, world positions.
    F32,
    /// 16-bit offsets from rest with one scale.
    I16,
}

impl ObjectConfig {
    /// Name on the bus.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Shape.
    pub fn mesh(&self) -> &MeshConfig {
        &self.mesh
    }
    /// Hexahedra along x, y, z.
    pub fn divisions(&self) -> [usize; 3] {
        self.divisions
    }
    /// Material outside of all regions.
    pub fn material(&self) -> Material {
        self.material
    }
    /// Damping proportional to mass \[1/s\].
    pub fn mass_damping_per_s(&self) -> f64 {
        self.mass_damping_per_s
    }
    /// Boxes of another material; a later one wins.
    pub fn regions(&self) -> &[Region] {
        &self.regions
    }
    /// Selection of held coarse nodes.
    pub fn fixed(&self) -> &FixedConfig {
        &self.fixed
    }
    /// Immovable half-spaces.
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }
    /// Lower and upper corner of the box that the object may move in \[m\], where the scene has one.
    pub fn bounds_m(&self) -> Option<[Point3<f64>; 2]> {
        self.bounds_m
    }
    /// Element whose stiffness is precomputed.
    pub fn element(&self) -> ElementKind {
        self.element
    }
    pub(super) fn set_element(&mut self, element: ElementKind) {
        self.element = element;
    }
    /// Implicit steps per tick.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }
    /// Linear solver.
    pub fn solver(&self) -> SolverOptions {
        self.solver
    }
    /// Published surface.
    pub fn skin(&self) -> SkinConfig {
        self.skin
    }
    /// Contents and rates of the published data.
    pub fn publish(&self) -> PublishConfig {
        self.publish
    }
    /// Quasi-static model of the examples.
    pub fn accurate(&self) -> &AccurateConfig {
        &self.accurate
    }
    /// Tie of the accurate skin to the coarse imprint.
    pub fn tie(&self) -> TieOptions {
        self.tie
    }
}

/// The one object of a scene.
pub(super) fn check(c: &Check<'_>, objects: &BTreeMap<String, RawObject>) -> Result<ObjectConfig, ConfigError> {
    let names: Vec<_> = objects.keys().map(String::as_str).collect();
    let [name] = names[..] else {
        let key = names.get(1).map_or("objects".into(), |n| format!("objects.{n}"));
        let problem = format!("a scene has exactly one object in this version, this one has {}", names.len());
        return Err(c.error(&key, problem, "keep one `[objects.<name>]`; run a second daemon with another --session"));
    };
    let key = format!("objects.{name}");
    c.name(&key, name)?;
    let raw = &objects[name];
    let mesh = check_mesh(c, &format!("{key}.mesh"), &raw.mesh)?;
    let divisions = check_divisions(c, &format!("{key}.coarse.divisions"), raw.coarse.divisions)?;
    let material = material::coarse(&raw.material);
    let (fixed, planes) = check_supports(c, &format!("{key}.supports"), &raw.supports)?;
    let accurate = accurate::check(c, &format!("{key}.accurate"), &raw.accurate, divisions, material)?;
    Ok(ObjectConfig {
        name: name.to_owned(),
        skin: check_skin(c, &format!("{key}.skin"), &raw.skin, &mesh)?,
        divisions,
        material,
        mass_damping_per_s: raw.material.mass_damping_per_s,
        regions: material::check_regions(c, &format!("{key}.regions"), &raw.regions, material, accurate.material)?,
        fixed,
        planes,
        bounds_m: check_bounds(c, &format!("{key}.supports.bounds"), raw.supports.bounds.as_ref(), &mesh)?,
        mesh,
        element: match raw.coarse.element {
            RawElement::EnhancedStrain => ElementKind::EnhancedStrain,
            RawElement::FullIntegration => ElementKind::FullIntegration,
        },
        substeps: raw.coarse.substeps,
        solver: solver(&raw.coarse.solver),
        publish: publish(&raw.publish),
        tie: accurate::tie(&raw.tie, accurate.material.young_modulus_pa),
        accurate,
    })
}

fn check_mesh(c: &Check<'_>, key: &str, raw: &RawMesh) -> Result<MeshConfig, ConfigError> {
    let length = |name: &str, value: Option<f64>| c.required(&format!("{key}.{name}"), value, "generator = \"wedge\"");
    match raw.generator {
        RawGenerator::Wedge => {
            c.absent(&format!("{key}.size_m"), &raw.size_m, "generator = \"wedge\"")?;
            Ok(MeshConfig::Wedge(Wedge {
                length_m: length("length_m", raw.length_m)?,
                width_m: length("width_m", raw.width_m)?,
                thick_height_m: length("thick_height_m", raw.thick_height_m)?,
                thin_height_m: length("thin_height_m", raw.thin_height_m)?,
            }))
        }
        RawGenerator::Block => {
            let names = ["length_m", "width_m", "thick_height_m", "thin_height_m"];
            let values = [raw.length_m, raw.width_m, raw.thick_height_m, raw.thin_height_m];
            for (name, value) in names.iter().zip(values) {
                c.absent(&format!("{key}.{name}"), &value, "generator = \"block\"")?;
            }
            let key = format!("{key}.size_m");
            Ok(MeshConfig::Block(c.required(&key, raw.size_m, "generator = \"block\"")?))
        }
    }
}

fn check_divisions(c: &Check<'_>, key: &str, raw: [u32; 3]) -> Result<[usize; 3], ConfigError> {
    let n_hexes: u64 = raw.iter().map(|n| u64::from(*n)).product();
    if n_hexes > MAX_HEXES {
        let problem = format!("{n_hexes} hexahedra; the allowed range is 1 to {MAX_HEXES}");
        return Err(c.error(key, problem, "use fewer divisions: 100 to 1,000 hexahedra run at 1 kHz"));
    }
    Ok(raw.map(|n| n as usize))
}

fn check_supports(c: &Check<'_>, key: &str, raw: &RawSupports) -> Result<(FixedConfig, Vec<Plane>), ConfigError> {
    let boxes = raw.fixed.boxes.iter().enumerate();
    let boxes = boxes.map(|(i, b)| c.corners(&format!("{key}.fixed.boxes.{i}"), b.min_m, b.max_m));
    let fixed = FixedConfig {
        faces: raw.fixed.faces.iter().map(|f| face(*f)).collect(),
        boxes: boxes.collect::<Result<_, _>>()?,
    };
    let plane = |(i, p): (usize, &RawPlane)| {
        let key = format!("{key}.planes.{i}");
        let normal: Vector3<f64> = p.normal.into();
        if normal.norm() < 1e-6 {
            let problem = format!("{:?} has no direction; its length must be 1e-6 or more", p.normal);
            return Err(c.error(&format!("{key}.normal"), problem, "a floor has normal = [0, 0, 1]"));
        }
        Ok(Plane { point_m: p.point_m.into(), normal })
    };
    Ok((fixed, raw.planes.iter().enumerate().map(plane).collect::<Result<_, _>>()?))
}

/// Bounds have the object at rest inside.
fn check_bounds(
    c: &Check<'_>,
    key: &str,
    raw: Option<&RawBox>,
    mesh: &MeshConfig,
) -> Result<Option<[Point3<f64>; 2]>, ConfigError> {
    let Some(raw) = raw else { return Ok(None) };
    let [low, high] = c.corners(key, raw.min_m, raw.max_m)?;
    let extents = mesh.extents_m();
    for k in 0..3 {
        let is_below = low[k] >= 0.0;
        if is_below || high[k] <= extents[k] {
            let (corner, value) = if is_below { ("min_m", raw.min_m) } else { ("max_m", raw.max_m) };
            let problem = format!("{value:?} leaves no room around the object, which spans 0 to {extents:?} m");
            let advice = "enlarge the box so that the object lies inside with room to move, or leave `bounds` out";
            return Err(c.error(&format!("{key}.{corner}"), problem, advice));
        }
    }
    Ok(Some([low, high]))
}

fn face(raw: RawFace) -> Face {
    let (axis, upper) = match raw {
        RawFace::XMin => (0, false),
        RawFace::XMax => (0, true),
        RawFace::YMin => (1, false),
        RawFace::YMax => (1, true),
        RawFace::ZMin => (2, false),
        RawFace::ZMax => (2, true),
    };
    Face { axis, upper }
}

fn solver(raw: &RawSolver) -> SolverOptions {
    SolverOptions {
        preconditioner: match raw.preconditioner {
            RawPreconditioner::Auto => Preconditioner::Auto,
            RawPreconditioner::BlockTridiagonal => Preconditioner::BlockTridiagonal,
            RawPreconditioner::BlockJacobi => Preconditioner::BlockJacobi,
        },
        tolerance: raw.tolerance,
        max_iterations: raw.max_iterations,
        fallback_iterations: raw.fallback_iterations,
    }
}

fn check_skin(c: &Check<'_>, key: &str, raw: &RawSkin, mesh: &MeshConfig) -> Result<SkinConfig, ConfigError> {
    let spacing_key = format!("{key}.spacing_m");
    let spacing_m = raw.spacing_m;
    let [x, y, z] = mesh.extents_m();
    let estimate = 2.0 * (x * y + y * z + z * x) / (spacing_m * spacing_m);
    if estimate > MAX_SKIN {
        let least = (2.0 * (x * y + y * z + z * x) / MAX_SKIN).sqrt();
        let problem = format!("{spacing_m} makes about {estimate:.0} vertices; at most {MAX_SKIN} are allowed");
        return Err(c.error(&spacing_key, problem, format!("choose {least:.1e} or more for this object")));
    }
    let support_cells = raw.support_cells;
    let embedding = match raw.embedding {
        RawEmbedding::MovingLeastSquares => EmbeddingKind::MovingLeastSquares { support_cells },
        RawEmbedding::Trilinear => EmbeddingKind::Trilinear,
    };
    Ok(SkinConfig { spacing_m, embedding })
}

fn publish(raw: &RawPublish) -> PublishConfig {
    PublishConfig {
        publish_hz: raw.publish_hz,
        normals: raw.normals,
        format: match raw.format {
            RawFormat::F32 => PositionFormat::F32,
            RawFormat::I16 => PositionFormat::I16,
        },
        wrench_hz: raw.wrench_hz,
    }
}

impl MeshConfig {
    /// Extents of the bounding box, which starts at the origin \[m\].
    pub fn extents_m(&self) -> [f64; 3] {
        match self {
            Self::Wedge(w) => [w.length_m, w.width_m, w.thick_height_m.max(w.thin_height_m)],
            Self::Block(size) => *size,
        }
    }
}
