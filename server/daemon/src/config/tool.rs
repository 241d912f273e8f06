//! The tools of a scene, checked.

use std::collections::BTreeMap;

use plica_geometry::{ConvexPolytope, HullError};
use plica_sim::{Coupling, Sampling, SpringCoupling, ToolDescription, ToolShape};

use super::checks::Check;
use super::raw::{RawCoupling, RawSampling, RawShape, RawTool};
use super::{ConfigError, obj};

/// Most tools of a scene.
const MAX_TOOLS: usize = 16;

/// All tools in alphabetical order.
pub(super) fn check(c: &Check<'_>, tools: &BTreeMap<String, RawTool>) -> Result<Vec<ToolDescription>, ConfigError> {
    if tools.len() > MAX_TOOLS {
        let problem = format!("{} tools; the allowed range is 0 to {MAX_TOOLS}", tools.len());
        return Err(c.error("tools", problem, "remove tools, or run a second daemon with another --session"));
    }
    tools.iter().map(|(name, raw)| check_tool(c, name, raw)).collect()
}

fn check_tool(c: &Check<'_>, name: &str, raw: &RawTool) -> Result<ToolDescription, ConfigError> {
    let key = |k: &str| format!("tools.{name}.{k}");
    c.name(&format!("tools.{name}"), name)?;
    Ok(ToolDescription {
        name: name.to_owned(),
        shape: check_shape(c, &key("shape"), &raw.shape)?,
        coupling: check_coupling(c, &key, raw)?,
        friction: c.number(&key("friction"), raw.friction, 0.0, 2.0)?,
        sampling: check_sampling(c, &key, raw)?,
        max_tool_speed_m_per_s: c.number(&key("max_tool_speed_m_per_s"), raw.max_tool_speed_m_per_s, 0.01, 100.0)?,
        stale_after_s: 1e-3 * c.number(&key("stale_after_ms"), raw.stale_after_ms, 1.0, 6e4)?,
        world_from_tracker: c.transform(&key("world_from_tracker"), &raw.world_from_tracker)?,
        tool_from_marker: c.transform(&key("tool_from_marker"), &raw.tool_from_marker)?,
        position_scale: c.number(&key("position_scale"), raw.position_scale, 1e-4, 1e4)?,
    })
}

fn check_shape(c: &Check<'_>, key: &str, raw: &RawShape) -> Result<ToolShape, ConfigError> {
    let radius = |kind: &str, r: f64| c.number(&format!("{key}.{kind}.radius_m"), r, 5e-4, 0.5);
    match raw {
        RawShape::Ball { radius_m } => Ok(ToolShape::Ball { radius_m: radius("ball", *radius_m)? }),
        RawShape::Capsule { radius_m, length_m } => Ok(ToolShape::Capsule {
            radius_m: radius("capsule", *radius_m)?,
            length_m: c.number(&format!("{key}.capsule.length_m"), *length_m, 1e-4, 2.0)?,
        }),
        RawShape::Cuboid { size_m } => {
            for extent in size_m {
                c.number(&format!("{key}.cuboid.size_m"), *extent, 1e-3, 1.0)?;
            }
            Ok(ToolShape::Cuboid { half_extents_m: size_m.map(|extent| 0.5 * extent) })
        }
        RawShape::ConvexHull { points_m } => {
            let key = format!("{key}.convex_hull.points_m");
            if points_m.len() < 4 {
                let problem = format!("{} points; at least 4 are needed, at most 1000 allowed", points_m.len());
                return Err(c.error(&key, problem, "add points that do not lie in one plane"));
            }
            c.count(&key, points_m.len() as u32, 4, 1000)?;
            let points = points_m.iter().map(|p| c.point(&key, *p));
            let polytope = ConvexPolytope::hull(points.collect::<Result<_, _>>()?);
            let flat = |e: HullError| c.error(&key, e.to_string(), "add points that do not lie in one plane");
            Ok(ToolShape::ConvexHull { polytope: polytope.map_err(flat)? })
        }
        RawShape::Mesh { file, metres_per_unit } => {
            let key = format!("{key}.mesh");
            let scale = c.number(&format!("{key}.metres_per_unit"), *metres_per_unit, 1e-6, 1e3)?;
            let path = c.document().file().parent().unwrap_or(std::path::Path::new("")).join(file);
            let hulls = obj::read_parts(&path, scale).map_err(|problem| {
                c.error(&format!("{key}.file"), problem, "give an OBJ file whose groups are convex parts")
            })?;
            let polytopes = hulls.into_iter().map(ConvexPolytope::hull).collect::<Result<_, _>>();
            let flat = |e: HullError| {
                let problem = format!("{}: {e}", path.display());
                c.error(&format!("{key}.file"), problem, "give an OBJ file whose groups have a volume each")
            };
            Ok(ToolShape::Compound { polytopes: polytopes.map_err(flat)? })
        }
    }
}

fn check_coupling(c: &Check<'_>, key: &dyn Fn(&str) -> String, raw: &RawTool) -> Result<Coupling, ConfigError> {
    let keys = [
        ("coupling_stiffness_n_per_m", raw.coupling_stiffness_n_per_m, 1.0, 1e5),
        ("coupling_damping_n_s_per_m", raw.coupling_damping_n_s_per_m, 0.0, 1e3),
        ("proxy_mass_kg", raw.proxy_mass_kg, 1e-4, 1.0),
        ("coupling_lever_m", raw.coupling_lever_m, 1e-3, 1.0),
        ("max_force_n", raw.max_force_n, 0.01, 1e3),
        ("max_torque_n_m", raw.max_torque_n_m, 1e-4, 100.0),
    ];
    for (name, value, least, most) in keys {
        match (raw.coupling, value) {
            (RawCoupling::Rigid, _) => c.absent(&key(name), &value, "coupling = \"rigid\"")?,
            (RawCoupling::Spring, Some(value)) => drop(c.number(&key(name), value, least, most)?),
            (RawCoupling::Spring, None) => {}
        }
    }
    if raw.coupling == RawCoupling::Rigid {
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
            Ok(Sampling::Interpolate { delay_s: 1e-3 * c.number(&delay_key, delay_ms, 0.0, 500.0)? })
        }
    }
}
