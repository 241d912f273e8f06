//! Tools of a scene, checked.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use plica_geometry::import::ObjPart;
use plica_geometry::{ConvexPolytope, HullError, hull_stand_off};
use plica_sim::{Coupling, Sampling, SpringCoupling, ToolDescription, ToolShape};

use super::files::Parts;
use super::raw::{RawCoupling, RawSampling, RawShape, RawTool, RawTransform};
use crate::checks::Check;
use crate::error::ConfigError;
use crate::extents::{self, Size};

/// Most tools of a scene.
const MAX_TOOLS: usize = 16;
/// Least and largest number of points of a convex hull.
const HULL_POINTS: RangeInclusive<usize> = 4..=1000;

/// A part whose hull stands further off its surface than this share of its extent is not convex.
const CONVEX: f64 = 5e-3;

/// All tools in alphabetical order; sentences for their users go to `remarks`.
pub(super) fn check(
    c: &Check<'_>,
    tools: &BTreeMap<String, RawTool>,
    parts: Parts<'_>,
    remarks: &mut Vec<String>,
) -> Result<Vec<ToolDescription>, ConfigError> {
    if tools.len() > MAX_TOOLS {
        let problem = format!("{} tools; the allowed range is 0 to {MAX_TOOLS}", tools.len());
        return Err(c.error("tools", problem, "remove tools, or run a second daemon with another --session"));
    }
    tools.iter().map(|(name, raw)| check_tool(c, name, raw, parts, remarks)).collect()
}

fn check_tool(
    c: &Check<'_>,
    name: &str,
    raw: &RawTool,
    parts: Parts<'_>,
    remarks: &mut Vec<String>,
) -> Result<ToolDescription, ConfigError> {
    let key = |k: &str| format!("tools.{name}.{k}");
    c.name(&format!("tools.{name}"), name)?;
    Ok(ToolDescription {
        name: name.to_owned(),
        shape: check_shape(c, &key("shape"), &raw.shape, parts, remarks)?,
        coupling: check_coupling(c, &key, raw)?,
        friction: raw.friction,
        sampling: check_sampling(c, &key, raw)?,
        max_tool_speed_m_per_s: raw.max_tool_speed_m_per_s,
        stale_after_s: 1e-3 * raw.stale_after_ms,
        world_from_tracker: check_transform(c, &key("world_from_tracker"), &raw.world_from_tracker)?,
        tool_from_marker: check_transform(c, &key("tool_from_marker"), &raw.tool_from_marker)?,
        position_scale: raw.position_scale,
    })
}

fn check_transform(c: &Check<'_>, key: &str, raw: &RawTransform) -> Result<Isometry3<f64>, ConfigError> {
    let translation = Translation3::from(raw.translation_m);
    let rotation = c.rotation(&format!("{key}.rotation_xyzw"), raw.rotation_xyzw)?;
    Ok(Isometry3::from_parts(translation, rotation))
}

fn check_shape(
    c: &Check<'_>,
    key: &str,
    raw: &RawShape,
    parts: Parts<'_>,
    remarks: &mut Vec<String>,
) -> Result<ToolShape, ConfigError> {
    match raw {
        RawShape::Ball { radius_m } => Ok(ToolShape::Ball { radius_m: *radius_m }),
        RawShape::Capsule { radius_m, length_m } => Ok(ToolShape::Capsule { radius_m: *radius_m, length_m: *length_m }),
        RawShape::Cuboid { size_m } => Ok(ToolShape::Cuboid { half_extents_m: size_m.map(|extent| 0.5 * extent) }),
        RawShape::ConvexHull { points_m } => {
            let key = format!("{key}.convex_hull.points_m");
            if !HULL_POINTS.contains(&points_m.len()) {
                let [least, most] = [HULL_POINTS.start(), HULL_POINTS.end()];
                let problem = format!("{} points; the allowed range is {least} to {most}", points_m.len());
                return Err(c.error(&key, problem, "give the corners of a body, not all in one plane"));
            }
            let polytope = ConvexPolytope::hull(points_m.iter().map(|point| Point3::from(*point)).collect());
            let flat = |e: HullError| c.error(&key, e.to_string(), "add points that do not lie in one plane");
            Ok(ToolShape::ConvexHull { polytope: polytope.map_err(flat)? })
        }
        RawShape::Mesh { file, metres_per_unit } => {
            let path = c.document().file().parent().unwrap_or(Path::new("")).join(&file.0);
            let read = parts(&path, *metres_per_unit);
            mesh(c, &format!("{key}.mesh"), &file.0, read, remarks)
        }
    }
}

/// Hulls of the parts of an OBJ file, which is named as typed: a client of a daemon is not told its folders.
fn mesh(
    c: &Check<'_>,
    key: &str,
    typed: &str,
    read: Result<Vec<ObjPart>, String>,
    remarks: &mut Vec<String>,
) -> Result<ToolShape, ConfigError> {
    let file_key = format!("{key}.file");
    let named = |problem: String| format!("{typed}: {problem}");
    let parts =
        read.map_err(|problem| c.error(&file_key, named(problem), "give an OBJ file whose groups are convex parts"))?;
    let unit_key = format!("{key}.metres_per_unit");
    match extents::judge("the tool", &unit_key, extents_m(parts.iter().flat_map(|part| &part.points))) {
        Size::Plausible => {}
        Size::Doubtful(doubt) => remarks.push(format!("{file_key}: {doubt}")),
        Size::Impossible(problem) => return Err(c.error(&unit_key, problem, "give 1e-3 for a file in mm")),
    }
    let hull = |(i, part): (usize, ObjPart)| {
        let polytope = ConvexPolytope::hull(part.points.clone()).map_err(|e: HullError| {
            let problem = named(format!("part {}: {e}", i + 1));
            c.error(&file_key, problem, "give an OBJ file whose groups have a volume each")
        })?;
        let off = hull_stand_off(&polytope, &part.points, &part.triangles);
        let extent = Vector3::from(extents_m(&part.points)).norm();
        if off > CONVEX * extent {
            remarks.push(format!(
                "{file_key}: part `{}` is not convex: its convex hull touches in its place and stands up to {:.2} mm off its \
                 surface; split it into convex parts, each a group of its own (`o NAME`), by hand or with CoACD or V-HACD",
                part.name,
                1e3 * off
            ));
        }
        Ok(polytope)
    };
    Ok(ToolShape::Compound { polytopes: parts.into_iter().enumerate().map(hull).collect::<Result<_, _>>()? })
}

/// Extents of the box around points \[m\].
fn extents_m<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> [f64; 3] {
    let none = [Point3::from(Vector3::repeat(f64::MAX)), Point3::from(Vector3::repeat(f64::MIN))];
    let [low, high] = points.into_iter().fold(none, |[low, high], p| [low.inf(p), high.sup(p)]);
    (high - low).into()
}

fn check_coupling(c: &Check<'_>, key: &dyn Fn(&str) -> String, raw: &RawTool) -> Result<Coupling, ConfigError> {
    if raw.coupling == RawCoupling::Rigid {
        let of_the_spring = [
            ("coupling_stiffness_n_per_m", raw.coupling_stiffness_n_per_m),
            ("coupling_damping_n_s_per_m", raw.coupling_damping_n_s_per_m),
            ("proxy_mass_kg", raw.proxy_mass_kg),
            ("coupling_lever_m", raw.coupling_lever_m),
            ("max_force_n", raw.max_force_n),
            ("max_torque_n_m", raw.max_torque_n_m),
        ];
        of_the_spring.iter().try_for_each(|(name, value)| c.absent(&key(name), value, "coupling = \"rigid\""))?;
        return Ok(Coupling::Rigid);
    }
    let d = SpringCoupling::default();
    Ok(Coupling::Spring(SpringCoupling {
        mass_kg: raw.proxy_mass_kg.unwrap_or(d.mass_kg),
        stiffness_n_per_m: raw.coupling_stiffness_n_per_m.unwrap_or(d.stiffness_n_per_m),
        damping_n_s_per_m: raw.coupling_damping_n_s_per_m.or(d.damping_n_s_per_m),
        max_force_n: raw.max_force_n.unwrap_or(d.max_force_n),
        max_torque_n_m: raw.max_torque_n_m.unwrap_or(d.max_torque_n_m),
        lever_m: raw.coupling_lever_m.unwrap_or(d.lever_m),
    }))
}

fn check_sampling(c: &Check<'_>, key: &dyn Fn(&str) -> String, raw: &RawTool) -> Result<Sampling, ConfigError> {
    let delay_key = key("delay_ms");
    match raw.sampling {
        RawSampling::Latest => {
            c.absent(&delay_key, &raw.delay_ms, "sampling = \"latest\"")?;
            Ok(Sampling::Latest)
        }
        RawSampling::Interpolate => {
            let delay_ms = c.required(&delay_key, raw.delay_ms, "sampling = \"interpolate\"")?;
            Ok(Sampling::Interpolate { delay_s: 1e-3 * delay_ms })
        }
    }
}
