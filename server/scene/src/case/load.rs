//! Loads of a case: as checked, and resolved to faces, nodes and elements.

use nalgebra::Vector3;
use plica_accurate::{Couple, Energy, NodalForces, Pressure, Traction, face_area, volume_forces};
use plica_geometry::import::NamedMesh;
use plica_geometry::select::Selector;
use plica_geometry::{ElementIdx, Face, NodeIdx, VolumeMesh};

use super::raw::{RawCase, RawLoad};
use super::select;
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;

/// A load and its selector.
#[derive(Debug, Clone)]
pub(super) struct LoadSpec {
    name: String,
    selector: Selector,
    kind: LoadKind,
}

/// Kinds of loads.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LoadKind {
    /// Force per rest area \[Pa\].
    Traction([f64; 3]),
    /// Pressure on the deformed surface \[Pa\].
    Pressure(f64),
    /// Total force \[N\] on faces, or on nodes where no face is selected.
    Force([f64; 3]),
    /// Total force \[N\] on nodes.
    NodalForce([f64; 3]),
    /// Moment \[N m\].
    Moment([f64; 3]),
    /// Force per rest volume \[N/m^3\].
    BodyForce([f64; 3]),
    /// Acceleration \[m/s^2\].
    Gravity([f64; 3]),
}

/// A load at full strength.
#[derive(Debug, Clone)]
pub enum Load {
    /// Force per rest area \[Pa\] on faces.
    Traction(Vec<Face>, Vector3<f64>),
    /// Pressure \[Pa\] on deformed faces.
    Pressure(Vec<Face>, f64),
    /// Forces \[N\] at nodes.
    Forces(Vec<(NodeIdx, Vector3<f64>)>),
    /// Moment \[N m\] on faces.
    Moment(Vec<Face>, Vector3<f64>),
}

pub(super) fn check(c: &Check<'_>, raw: &RawCase) -> Result<Vec<LoadSpec>, ConfigError> {
    let load = |(i, l): (usize, &RawLoad)| {
        let key = format!("loads.{i}");
        let kinds = [
            l.traction_pa.map(LoadKind::Traction),
            l.pressure_pa.map(LoadKind::Pressure),
            l.force_n.map(LoadKind::Force),
            l.nodal_force_n.map(LoadKind::NodalForce),
            l.moment_n_m.map(LoadKind::Moment),
            l.body_force_n_per_m3.map(LoadKind::BodyForce),
            l.gravity_m_per_s2.map(LoadKind::Gravity),
        ];
        let given: Vec<LoadKind> = kinds.into_iter().flatten().collect();
        let [kind] = given[..] else {
            let advice = "give exactly one of traction_pa, pressure_pa, force_n, nodal_force_n, moment_n_m, body_force_n_per_m3 and \
                          gravity_m_per_s2";
            return Err(c.error(&key, format!("has {} of seven kinds of load", given.len()), advice));
        };
        let lacks =
            raw.material.density_kg_per_m3.is_none() && raw.regions.iter().all(|r| r.density_kg_per_m3.is_none());
        if matches!(kind, LoadKind::Gravity(_)) && lacks {
            let key = format!("{key}.gravity_m_per_s2");
            return Err(c.error(&key, "acts on no density", "add material.density_kg_per_m3"));
        }
        Ok(LoadSpec { name: l.name.clone(), selector: select::check(c, &format!("{key}.select"), &l.select)?, kind })
    };
    raw.loads.iter().enumerate().map(load).collect()
}

/// Mesh of a case with the density of each element \[kg/m^3\], 0 where none is given, and the held nodes.
pub(super) struct Body<'a> {
    pub(super) mesh: &'a NamedMesh,
    pub(super) densities_kg_per_m3: &'a [f64],
    pub(super) is_held: &'a [bool],
}

/// Resolves a load; `key` is its path in the file. Sentences that its user should read go to `remarks`.
pub(super) fn find(
    document: &Document,
    key: &str,
    spec: &LoadSpec,
    body: &Body<'_>,
    remarks: &mut Vec<String>,
) -> Result<Load, ConfigError> {
    let mesh = body.mesh;
    let explain = |e| select::explain(document, &format!("{key}.select"), &mesh.mesh, &e);
    let faces = || spec.selector.faces(&mesh.mesh, &mesh.groups);
    let nodes = || spec.selector.nodes(&mesh.mesh, &mesh.groups);
    let elements = || spec.selector.elements(&mesh.mesh, &mesh.groups);
    let on_nodes = |force: [f64; 3], nodes: Vec<NodeIdx>| {
        let share = Vector3::from(force) / nodes.len() as f64;
        Load::Forces(nodes.into_iter().map(|node| (node, share)).collect())
    };
    let load = match spec.kind {
        LoadKind::Traction(traction) => Load::Traction(faces().map_err(explain)?, traction.into()),
        LoadKind::Pressure(pressure) => Load::Pressure(faces().map_err(explain)?, pressure),
        LoadKind::Moment(moment) => Load::Moment(faces().map_err(explain)?, moment.into()),
        LoadKind::NodalForce(force) => on_nodes(force, nodes().map_err(explain)?),
        LoadKind::Force(force) => match faces() {
            Ok(faces) => {
                let area: f64 = faces.iter().map(|face| face_area(mesh.mesh.nodes(), face)).sum();
                Load::Traction(faces, Vector3::from(force) / area)
            }
            Err(_) => on_nodes(force, nodes().map_err(explain)?),
        },
        LoadKind::BodyForce(force) => {
            let elements = elements().map_err(explain)?;
            Load::forces(volume_forces(&mesh.mesh, elements.into_iter().map(|element| (element, force.into()))))
        }
        LoadKind::Gravity(acceleration) => {
            let elements = elements().map_err(explain)?;
            let weight = |element: ElementIdx| {
                (element, Vector3::from(acceleration) * body.densities_kg_per_m3[element.index()])
            };
            Load::forces(volume_forces(&mesh.mesh, elements.into_iter().map(weight)))
        }
    };
    remarks.extend(load.remark(spec, body.is_held));
    Ok(load)
}

impl Load {
    fn forces(forces: NodalForces) -> Self {
        Self::Forces(forces.forces().to_vec())
    }

    /// A sentence about a force of which held nodes carry a part.
    fn remark(&self, spec: &LoadSpec, is_held: &[bool]) -> Option<String> {
        let n_held = |nodes: &mut dyn Iterator<Item = NodeIdx>| nodes.filter(|node| is_held[node.index()]).count();
        let (n, of) = match (self, spec.kind) {
            (Self::Traction(faces, _), LoadKind::Force(_)) => {
                let is_held = |face: &&Face| face.nodes().iter().all(|node| is_held[node.index()]);
                (faces.iter().filter(is_held).count(), "faces")
            }
            (Self::Forces(forces), LoadKind::Force(_) | LoadKind::NodalForce(_)) => {
                (n_held(&mut forces.iter().map(|(node, _)| *node)), "nodes")
            }
            _ => return None,
        };
        (n > 0).then(|| {
            format!("load `{}` acts on {n} {of} that are held, so that a part of it deforms nothing", spec.name)
        })
    }

    /// A share of the load.
    pub(super) fn at(&self, mesh: &VolumeMesh, share: f64) -> Box<dyn Energy> {
        match self {
            Self::Traction(faces, traction_pa) => {
                Box::new(Traction::on_faces(mesh.nodes(), faces, traction_pa * share))
            }
            Self::Pressure(faces, pressure_pa) => Box::new(Pressure::new(faces.clone(), pressure_pa * share)),
            Self::Forces(forces) => {
                Box::new(NodalForces::new(forces.iter().map(|(node, force)| (*node, force * share)).collect()))
            }
            Self::Moment(faces, moment_nm) => Box::new(Couple::on_faces(mesh.nodes(), faces, moment_nm * share)),
        }
    }
}
