//! The mesh of a case: generated or read.

use std::path::PathBuf;

use nalgebra::Point3;
use plica_geometry::import::{Groups, ImportError, NamedMesh, read_mesh};
use plica_geometry::shapes::{Hexahedron, Wedge, hexahedron};

use super::raw::{RawGenerator, RawMesh};
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;

/// Most hexahedra that a generator makes.
const MAX_HEXES: u64 = 1_000_000;

/// Where a mesh comes from.
#[derive(Debug, Clone)]
pub enum MeshSource {
    /// Made of a hexahedron.
    Generated(Box<Hexahedron>),
    /// Read from a file.
    File {
        /// Path, resolved.
        path: PathBuf,
        /// Metres per unit of the file.
        metres_per_unit: f64,
    },
}

impl MeshSource {
    /// Makes or reads the mesh.
    pub(super) fn load(&self, document: &Document) -> Result<NamedMesh, ConfigError> {
        match self {
            Self::Generated(shape) => {
                let mesh = hexahedron(shape).map_err(|e| {
                    let advice = "list the corners counter-clockwise around the bottom, then around the top";
                    document.error("mesh.corners_m", e.to_string(), advice)
                })?;
                Ok(NamedMesh { mesh, groups: Groups::default() })
            }
            Self::File { path, metres_per_unit } => read_mesh(path, *metres_per_unit).map_err(|e| {
                let ImportError { path, place, problem, advice } = e;
                document.error("mesh.file", format!("{}{place}: {problem}", path.display()), advice)
            }),
        }
    }
}

pub(super) fn check(c: &Check<'_>, raw: &RawMesh) -> Result<MeshSource, ConfigError> {
    match (raw.generator, &raw.file) {
        (Some(generator), None) => {
            c.absent("mesh.metres_per_unit", &raw.metres_per_unit, "a generator")?;
            check_shape(c, raw, generator).map(|shape| MeshSource::Generated(Box::new(shape)))
        }
        (None, Some(file)) => {
            check_no_shape(c, raw)?;
            let folder = c.document().file().parent().map(PathBuf::from).unwrap_or_default();
            let metres_per_unit = raw.metres_per_unit.unwrap_or(1.0);
            Ok(MeshSource::File { path: folder.join(file), metres_per_unit })
        }
        _ => Err(c.error(
            "mesh",
            "needs a generator or a file, not both",
            "give generator = \"block\" or file = \"x.msh\"",
        )),
    }
}

fn check_no_shape(c: &Check<'_>, raw: &RawMesh) -> Result<(), ConfigError> {
    let because = "a mesh file";
    c.absent("mesh.divisions", &raw.divisions, because)?;
    c.absent("mesh.grading", &raw.grading, because)?;
    check_absent(c, raw, &["size_m", "corners_m", "length_m", "width_m", "thick_height_m", "thin_height_m"], because)
}

/// Keys that have no meaning beside another.
fn check_absent(c: &Check<'_>, raw: &RawMesh, names: &[&str], because: &str) -> Result<(), ConfigError> {
    for &name in names {
        let is_given = match name {
            "size_m" => raw.size_m.is_some(),
            "corners_m" => raw.corners_m.is_some(),
            "length_m" => raw.length_m.is_some(),
            "width_m" => raw.width_m.is_some(),
            "thick_height_m" => raw.thick_height_m.is_some(),
            _ => raw.thin_height_m.is_some(),
        };
        c.absent(&format!("mesh.{name}"), &is_given.then_some(()), because)?;
    }
    Ok(())
}

fn check_shape(c: &Check<'_>, raw: &RawMesh, generator: RawGenerator) -> Result<Hexahedron, ConfigError> {
    let wedge = ["length_m", "width_m", "thick_height_m", "thin_height_m"];
    let corners = match generator {
        RawGenerator::Block => {
            check_absent(c, raw, &[&wedge[..], &["corners_m"]].concat(), "generator = \"block\"")?;
            let [x, y, z] = c.required("mesh.size_m", raw.size_m, "generator = \"block\"")?;
            wedge_corners(&Wedge { length_m: x, width_m: y, thick_height_m: z, thin_height_m: z })
        }
        RawGenerator::Wedge => {
            check_absent(c, raw, &["size_m", "corners_m"], "generator = \"wedge\"")?;
            let values = [raw.length_m, raw.width_m, raw.thick_height_m, raw.thin_height_m];
            let mut sizes = [0.0; 4];
            for (size, (name, value)) in sizes.iter_mut().zip(wedge.iter().zip(values)) {
                *size = c.required(&format!("mesh.{name}"), value, "generator = \"wedge\"")?;
            }
            let [length_m, width_m, thick_height_m, thin_height_m] = sizes;
            wedge_corners(&Wedge { length_m, width_m, thick_height_m, thin_height_m })
        }
        RawGenerator::Hexahedron => {
            check_absent(c, raw, &[&wedge[..], &["size_m"]].concat(), "generator = \"hexahedron\"")?;
            let corners = c.required("mesh.corners_m", raw.corners_m, "generator = \"hexahedron\"")?;
            corners.map(Point3::from)
        }
    };
    let divisions = check_divisions(c, c.required("mesh.divisions", raw.divisions, "a generator")?)?;
    let grading = raw.grading.unwrap_or([1.0; 3]);
    Ok(Hexahedron { corners, divisions, grading })
}

fn wedge_corners(wedge: &Wedge) -> [Point3<f64>; 8] {
    let (x, y) = (wedge.length_m, wedge.width_m);
    let ring = [(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)];
    let bottom = ring.map(|(x, y)| Point3::new(x, y, 0.0));
    let top = ring.map(|(x, y)| Point3::new(x, y, wedge.height_m(x)));
    std::array::from_fn(|i| if i < 4 { bottom[i] } else { top[i - 4] })
}

fn check_divisions(c: &Check<'_>, raw: [u32; 3]) -> Result<[usize; 3], ConfigError> {
    let n_hexes: u64 = raw.iter().map(|n| u64::from(*n)).product();
    if n_hexes > MAX_HEXES {
        let problem = format!("{n_hexes} hexahedra; the allowed range is 1 to {MAX_HEXES}");
        return Err(c.error("mesh.divisions", problem, "use fewer divisions"));
    }
    Ok(raw.map(|n| n as usize))
}
