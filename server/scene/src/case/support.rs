//! Supports of a case, resolved to nodes.

use nalgebra::{Point3, Vector3};
use plica_geometry::NodeIdx;
use plica_geometry::import::NamedMesh;

use super::checked::SupportSpec;
use super::select;
use crate::document::Document;
use crate::error::ConfigError;

/// Support: nodes with given displacements.
#[derive(Debug, Clone)]
pub struct Support {
    /// Name in the case.
    pub name: String,
    /// Nodes with the directions in which this support, and no earlier one, holds them.
    pub nodes: Vec<(NodeIdx, [bool; 3])>,
    /// Where they are moved to \[m\].
    pub displacement_m: Vector3<f64>,
}

/// Nodes of each support. If two supports hold an axis of a node it belongs to the first; both must give the same displacement.
pub(super) fn find(document: &Document, specs: &[SupportSpec], mesh: &NamedMesh) -> Result<Vec<Support>, ConfigError> {
    let mut owner: Vec<[Option<usize>; 3]> = vec![[None; 3]; mesh.mesh.n_nodes()];
    let mut supports = Vec::with_capacity(specs.len());
    for (i, spec) in specs.iter().enumerate() {
        let nodes = spec.selector.nodes(&mesh.mesh, &mesh.groups);
        let nodes = nodes.map_err(|e| select::explain(document, &format!("supports.{i}.select"), &mesh.mesh, &e))?;
        let mut held = Vec::with_capacity(nodes.len());
        for node in nodes {
            let mut axes = [false; 3];
            for k in (0..3).filter(|&k| spec.axes[k]) {
                match owner[node.index()][k] {
                    None => {
                        owner[node.index()][k] = Some(i);
                        axes[k] = true;
                    }
                    Some(first) if specs[first].displacement_m[k] == spec.displacement_m[k] => {}
                    Some(first) => {
                        let (key, at) = (format!("supports.{i}"), &mesh.mesh.nodes()[node.index()]);
                        return Err(contradiction(document, &key, [&specs[first], spec], k, at));
                    }
                }
            }
            held.push((node, axes));
        }
        supports.push(Support { name: spec.name.clone(), nodes: held, displacement_m: spec.displacement_m.into() });
    }
    Ok(supports)
}

fn contradiction(
    document: &Document,
    key: &str,
    [first, second]: [&SupportSpec; 2],
    axis: usize,
    at: &Point3<f64>,
) -> ConfigError {
    let (at, along): ([f64; 3], _) = (at.coords.into(), ["x", "y", "z"][axis]);
    let [one, other] = [first, second].map(|support| support.displacement_m[axis]);
    let problem =
        format!("`{}` moves the node at {at:?} m by {one} m along {along}, `{}` by {other} m", first.name, second.name);
    document.error(key, problem, "let them select different nodes or axes")
}
