//! Selectors of parts of a mesh.

use plica_geometry::VolumeMesh;
use plica_geometry::predicate::Predicate;
use plica_geometry::select::{SelectError, Selector, Side};

use super::raw::RawSelect;
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;
use crate::scene::raw::RawFace;

pub(super) fn check(c: &Check<'_>, key: &str, raw: &RawSelect) -> Result<Selector, ConfigError> {
    let RawSelect { within, face, group, condition } = raw;
    if within.is_none() && face.is_none() && group.is_none() && condition.is_none() {
        let advice = "give box = { min_m, max_m }, face = \"x_min\", group = \"NAME\" or where = \"z < 1e-3\"";
        return Err(c.error(key, "selects nothing", advice));
    }
    let within = within.as_ref().map(|b| c.corners(&format!("{key}.box"), b.min_m, b.max_m)).transpose()?;
    let condition = condition.as_ref().map(|text| check_condition(c, &format!("{key}.where"), text)).transpose()?;
    Ok(Selector { within, side: face.map(side), group: group.clone(), condition })
}

fn check_condition(c: &Check<'_>, key: &str, text: &str) -> Result<Predicate, ConfigError> {
    Predicate::parse(text).map_err(|e| {
        let advice = "write comparisons of x, y, z in metres, joined by && and ||: \"x > 0.5e-3 && z < 1e-6\"";
        c.error(key, format!("`{text}`, {e}"), advice)
    })
}

fn side(face: RawFace) -> Side {
    let (axis, upper) = match face {
        RawFace::XMin => (0, false),
        RawFace::XMax => (0, true),
        RawFace::YMin => (1, false),
        RawFace::YMax => (1, true),
        RawFace::ZMin => (2, false),
        RawFace::ZMax => (2, true),
    };
    Side { axis, upper }
}

/// Error of a selector that selects nothing, with advice.
pub(super) fn explain(document: &Document, key: &str, mesh: &VolumeMesh, error: &SelectError) -> ConfigError {
    let advice = match error {
        SelectError::UnknownGroup { .. } => "take one of these, or name the part in the mesh file".to_owned(),
        SelectError::NoVolume { .. } => "take a group of volumes".to_owned(),
        SelectError::Empty { .. } => {
            format!("all conditions must hold together; the body at rest spans {}", extent(mesh))
        }
    };
    document.error(key, error.to_string(), advice)
}

/// Lower and upper corner of the bounding box, for a message.
pub(super) fn extent(mesh: &VolumeMesh) -> String {
    let [lower, upper] = mesh.bounds().map(|x| format!("[{:.4e}, {:.4e}, {:.4e}]", x.x, x.y, x.z));
    format!("{lower} to {upper} m")
}
