//! Probes: quantities of the result that a case reports.

use nalgebra::Point3;
use plica_geometry::import::NamedMesh;
use plica_geometry::select::Selector;
use plica_geometry::{ElementPoint, NodeIdx};

use super::raw::{RawCase, RawProbe, RawQuantity};
use super::select;
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;

/// Distance of a point outside of the mesh that counts as rounding, as a share of the mesh's diagonal.
const OUTSIDE_TOLERANCE: f64 = 1e-6;

/// A checked probe, not yet resolved on the mesh.
#[derive(Debug, Clone)]
pub(super) struct ProbeSpec {
    name: String,
    target: Target,
}

#[derive(Debug, Clone)]
enum Target {
    DisplacementAt(Point3<f64>),
    DisplacementNearest(Point3<f64>),
    DisplacementOver(Selector),
    Force(Source),
    Moment(Source, Point3<f64>),
    Volume,
    StressAt(Point3<f64>),
}

/// Source of a force on the body, by its number in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    Support(usize),
    Tool(usize),
}

/// A probe resolved to nodes or a point of an element.
#[derive(Debug, Clone)]
pub struct Probe {
    /// Name in the output.
    pub name: String,
    pub(super) sensor: Sensor,
}

#[derive(Debug, Clone)]
pub(super) enum Sensor {
    /// Weighted sum of displacements.
    Displacement(Vec<(NodeIdx, f64)>),
    Force(Source),
    /// About a point \[m\].
    Moment(Source, Point3<f64>),
    Volume,
    /// Cauchy stress at a point.
    Stress(ElementPoint),
}

pub(super) fn check(c: &Check<'_>, raw: &RawCase) -> Result<Vec<ProbeSpec>, ConfigError> {
    let probe = |(i, p): (usize, &RawProbe)| {
        let target = check_target(c, &format!("probes.{i}"), p, raw)?;
        Ok(ProbeSpec { name: p.name.clone(), target })
    };
    raw.probes.iter().enumerate().map(probe).collect()
}

fn check_target(c: &Check<'_>, key: &str, p: &RawProbe, raw: &RawCase) -> Result<Target, ConfigError> {
    let (quantity, allowed): (&str, &[&str]) = match p.quantity {
        RawQuantity::Displacement => ("displacement", &["at_m", "nearest_to_m", "select"]),
        RawQuantity::Force => ("force", &["support", "tool"]),
        RawQuantity::Moment => ("moment", &["support", "tool"]),
        RawQuantity::Stress => ("stress", &["at_m"]),
        RawQuantity::Volume => ("volume", &[]),
    };
    let given = [
        ("at_m", p.at_m.is_some()),
        ("nearest_to_m", p.nearest_to_m.is_some()),
        ("select", p.select.is_some()),
        ("support", p.support.is_some()),
        ("tool", p.tool.is_some()),
    ];
    let given: Vec<&str> = given.iter().filter(|(_, is_given)| *is_given).map(|(name, _)| *name).collect();
    if let Some(name) = given.iter().find(|name| !allowed.contains(name)) {
        return Err(c.error(&format!("{key}.{name}"), format!("has no meaning with {quantity}"), "remove the key"));
    }
    if given.len() != allowed.len().min(1) {
        let advice = format!("give exactly one of {}", allowed.join(", "));
        return Err(c.error(key, format!("{quantity} is asked for at {} places", given.len()), advice));
    }
    if p.quantity != RawQuantity::Moment {
        c.absent(&format!("{key}.about_m"), &p.about_m, quantity)?;
    }
    match (p.quantity, p.at_m, p.nearest_to_m, &p.select) {
        (RawQuantity::Displacement, Some(x), ..) => Ok(Target::DisplacementAt(x.into())),
        (RawQuantity::Displacement, _, Some(x), ..) => Ok(Target::DisplacementNearest(x.into())),
        (RawQuantity::Displacement, .., Some(s)) => {
            select::check(c, &format!("{key}.select"), s).map(Target::DisplacementOver)
        }
        (RawQuantity::Stress, Some(x), ..) => Ok(Target::StressAt(x.into())),
        (RawQuantity::Force, ..) => check_source(c, key, p, raw).map(Target::Force),
        (RawQuantity::Moment, ..) => {
            let about = Point3::from(p.about_m.unwrap_or_default());
            check_source(c, key, p, raw).map(|source| Target::Moment(source, about))
        }
        _ => Ok(Target::Volume),
    }
}

fn check_source(c: &Check<'_>, key: &str, p: &RawProbe, raw: &RawCase) -> Result<Source, ConfigError> {
    let supports = || raw.supports.iter().map(|s| s.name.as_str()).collect::<Vec<_>>();
    let tools = || raw.tools.iter().map(|t| t.name.as_str()).collect::<Vec<_>>();
    let find = |kind: &str, name: &str, known: Vec<&str>| {
        known.iter().position(|n| *n == name).ok_or_else(|| {
            let problem = format!("there is no {kind} `{name}`");
            c.error(&format!("{key}.{kind}"), problem, format!("name one of: {}", known.join(", ")))
        })
    };
    match (&p.support, &p.tool) {
        (Some(name), _) => find("support", name, supports()).map(Source::Support),
        (None, name) => find("tool", name.as_deref().unwrap_or_default(), tools()).map(Source::Tool),
    }
}

impl ProbeSpec {
    /// Finds the nodes or the element of a probe; `key` is its path in the file.
    pub(super) fn resolve(&self, document: &Document, key: &str, mesh: &NamedMesh) -> Result<Probe, ConfigError> {
        let sensor = match &self.target {
            Target::DisplacementAt(x) => Sensor::Displacement(mesh.mesh.weights_at(&find(document, key, mesh, x)?)),
            Target::DisplacementNearest(x) => Sensor::Displacement(vec![(nearest_node(mesh, x), 1.0)]),
            Target::DisplacementOver(selector) => {
                let nodes = selector.nodes(&mesh.mesh, &mesh.groups);
                let nodes = nodes.map_err(|e| select::explain(document, &format!("{key}.select"), &mesh.mesh, &e))?;
                let share = 1.0 / nodes.len() as f64;
                Sensor::Displacement(nodes.into_iter().map(|node| (node, share)).collect())
            }
            Target::Force(source) => Sensor::Force(*source),
            Target::Moment(source, about) => Sensor::Moment(*source, *about),
            Target::Volume => Sensor::Volume,
            Target::StressAt(x) => Sensor::Stress(find(document, key, mesh, x)?),
        };
        Ok(Probe { name: self.name.clone(), sensor })
    }
}

/// Element of a point, with its reference coordinates there.
fn find(document: &Document, key: &str, mesh: &NamedMesh, x: &Point3<f64>) -> Result<ElementPoint, ConfigError> {
    let [lower, upper] = mesh.mesh.bounds();
    let reach = OUTSIDE_TOLERANCE * (upper - lower).norm();
    mesh.mesh.locate(x, reach).ok_or_else(|| {
        let problem = format!("lies outside the body at rest, which spans {}", select::extent(&mesh.mesh));
        document.error(&format!("{key}.at_m"), problem, "give a point inside, or nearest_to_m for a node")
    })
}

fn nearest_node(mesh: &NamedMesh, x: &Point3<f64>) -> NodeIdx {
    let distances = mesh.mesh.nodes().iter().map(|node| (node - x).norm()).enumerate();
    let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| node);
    NodeIdx::from_index(nearest)
}
