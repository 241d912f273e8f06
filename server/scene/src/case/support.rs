//! Supports of a case: as checked, and resolved to nodes.

use nalgebra::{Point3, Rotation3, Unit, Vector3};
use plica_accurate::Constraints;
use plica_geometry::NodeIdx;
use plica_geometry::import::NamedMesh;
use plica_geometry::select::Selector;

use super::raw::{RawSupport, RawTurn};
use super::select;
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;

/// Difference between two given positions that is rounding, as a share of the mesh's diagonal.
const SAME: f64 = 1e-9;

/// Checked support, not yet resolved on the mesh.
#[derive(Debug, Clone)]
pub(super) struct SupportSpec {
    name: String,
    selector: Selector,
    /// Unit vectors along which the nodes are held.
    directions: Vec<Vector3<f64>>,
    motion: Motion,
}

/// Motion of a support under full loads.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    /// \[m\]
    Displacement(Vector3<f64>),
    Turn(Turn),
}

/// Rotation about an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Turn {
    axis: Unit<Vector3<f64>>,
    through: Point3<f64>,
    angle_rad: f64,
}

/// Support: nodes with given positions along some directions.
#[derive(Debug, Clone)]
pub struct Support {
    /// Name in the case.
    pub name: String,
    /// Nodes with the directions, unit vectors, in which this support, and no earlier one, holds them.
    pub rows: Vec<(NodeIdx, Vector3<f64>)>,
    motion: Motion,
}

impl Support {
    /// Position of a node at rest under a share of the motion \[m\].
    pub(super) fn position(&self, rest: &Point3<f64>, share: f64) -> Vector3<f64> {
        self.motion.position(rest, share)
    }
}

impl Motion {
    fn position(&self, rest: &Point3<f64>, share: f64) -> Vector3<f64> {
        match self {
            Self::Displacement(displacement) => Vector3::from_fn(|k, _| rest[k] + share * displacement[k]),
            Self::Turn(turn) => {
                let rotation = Rotation3::from_axis_angle(&turn.axis, share * turn.angle_rad);
                turn.through.coords + rotation * (rest - turn.through)
            }
        }
    }
}

pub(super) fn check(c: &Check<'_>, raw: &[RawSupport]) -> Result<Vec<SupportSpec>, ConfigError> {
    let support = |(i, s): (usize, &RawSupport)| {
        let key = format!("supports.{i}");
        let directions = directions(c, &key, s)?;
        let selector = select::check(c, &format!("{key}.select"), &s.select)?;
        Ok(SupportSpec { name: s.name.clone(), selector, motion: motion(c, &key, s, &directions)?, directions })
    };
    raw.iter().enumerate().map(support).collect()
}

fn directions(c: &Check<'_>, key: &str, s: &RawSupport) -> Result<Vec<Vector3<f64>>, ConfigError> {
    if let Some(normal) = s.normal {
        c.absent(&format!("{key}.axes"), &s.axes, "normal")?;
        return Ok(vec![direction(c, &format!("{key}.normal"), normal)?.into_inner()]);
    }
    let mut held = [s.axes.is_none(); 3];
    s.axes.iter().flatten().for_each(|axis| held[*axis as usize] = true);
    if held == [false; 3] {
        return Err(c.error(&format!("{key}.axes"), "holds nothing", "name at least one of \"x\", \"y\", \"z\""));
    }
    let unit = |axis: usize| Vector3::from_fn(|k, _| if k == axis { 1.0 } else { 0.0 });
    Ok((0..3).filter(|&k| held[k]).map(unit).collect())
}

/// A unit vector; refuses one without a direction.
pub(super) fn direction(c: &Check<'_>, key: &str, raw: [f64; 3]) -> Result<Unit<Vector3<f64>>, ConfigError> {
    Unit::try_new(Vector3::from(raw), f64::MIN_POSITIVE)
        .ok_or_else(|| c.error(key, "has length 0", "give the components of a direction, such as [0, 0, 1]"))
}

fn motion(c: &Check<'_>, key: &str, s: &RawSupport, directions: &[Vector3<f64>]) -> Result<Motion, ConfigError> {
    if let Some(RawTurn { axis, through_m, angle_deg }) = s.turn {
        c.absent(&format!("{key}.displacement_m"), &s.displacement_m, "turn")?;
        c.absent(&format!("{key}.normal"), &s.normal, "turn")?;
        let axis = direction(c, &format!("{key}.turn.axis"), axis)?;
        return Ok(Motion::Turn(Turn { axis, through: through_m.into(), angle_rad: angle_deg.to_radians() }));
    }
    let displacement = Vector3::from(s.displacement_m.unwrap_or_default());
    if s.normal.is_none() {
        let is_held = |k: usize| directions.iter().any(|direction| direction[k] == 1.0);
        if let Some(axis) = (0..3).find(|&k| displacement[k] != 0.0 && !is_held(k)) {
            let problem = format!("moves along {}, which is not among the axes", ["x", "y", "z"][axis]);
            return Err(c.error(&format!("{key}.displacement_m"), problem, "add the axis, or put 0 there"));
        }
    }
    Ok(Motion::Displacement(displacement))
}

/// Nodes of each support. A direction of a node that two supports hold belongs to the first; both must move it equally.
pub(super) fn find(document: &Document, specs: &[SupportSpec], mesh: &NamedMesh) -> Result<Vec<Support>, ConfigError> {
    let [lower, upper] = mesh.mesh.bounds();
    let same = SAME * (upper - lower).norm();
    let mut constraints = Constraints::none(mesh.mesh.n_nodes());
    let mut supports: Vec<Support> = Vec::with_capacity(specs.len());
    for (i, spec) in specs.iter().enumerate() {
        let nodes = spec.selector.nodes(&mesh.mesh, &mesh.groups);
        let nodes = nodes.map_err(|e| select::explain(document, &format!("supports.{i}.select"), &mesh.mesh, &e))?;
        let mut rows = Vec::with_capacity(nodes.len());
        for node in nodes {
            let rest = &mesh.mesh.nodes()[node.index()];
            let target = spec.motion.position(rest, 1.0);
            for direction in &spec.directions {
                match constraints.give_along(node.index(), direction, direction.dot(&target)) {
                    None => rows.push((node, *direction)),
                    Some(off) if off.abs() <= same => {}
                    Some(off) => {
                        let wanted = without_rounding(direction.dot(&(target - rest.coords)));
                        let earlier =
                            supports.iter().find(|s| s.rows.iter().any(|(n, d)| *n == node && d.dot(direction) != 0.0));
                        let earlier = earlier.map_or("an earlier support", |s| &s.name);
                        let at: [f64; 3] = rest.coords.into();
                        let problem = format!(
                            "`{earlier}` moves the node at {at:?} m by {} m along {}, `{}` by {wanted} m",
                            without_rounding(wanted - off),
                            name_of(direction),
                            spec.name
                        );
                        let advice = "let them select different nodes or axes";
                        return Err(document.error(&format!("supports.{i}"), problem, advice));
                    }
                }
            }
        }
        supports.push(Support { name: spec.name.clone(), rows, motion: spec.motion });
    }
    Ok(supports)
}

/// A length for a message \[m\].
fn without_rounding(length_m: f64) -> f64 {
    (1e12 * length_m).round() / 1e12
}

/// Name of an axis, or the components of another direction.
fn name_of(direction: &Vector3<f64>) -> String {
    match (0..3).find(|&k| direction[k] == 1.0) {
        Some(k) => ["x", "y", "z"][k].to_owned(),
        None => format!("[{:.3}, {:.3}, {:.3}]", direction.x, direction.y, direction.z),
    }
}
