//! A case with its selections resolved.

use nalgebra::Vector3;
use plica_accurate::{Constraints, Energy, Material, MaterialModel, NodalForces, Pressure, Solid, Traction, reactions};
use plica_geometry::import::NamedMesh;
use plica_geometry::{HexMesh, NodeIdx};

use super::checked::{Case, LoadKind, LoadSpec};
use super::probe::Probe;
use super::support::{self, Support};
use super::{held, select};
use crate::document::Document;
use crate::error::ConfigError;
use crate::extents::{self, Size};

/// A mesh with materials, supports, loads and probes.
#[derive(Debug)]
pub struct Problem {
    mesh: NamedMesh,
    solid: Solid,
    is_linear: bool,
    may_collapse: bool,
    remarks: Vec<String>,
    /// Region of each hexahedron: 0 for the base material, else one more than the region's index in the file.
    region_of_hex: Vec<usize>,
    supports: Vec<Support>,
    loads: Vec<Load>,
    probes: Vec<Probe>,
}

/// A load at full strength.
#[derive(Debug, Clone)]
pub enum Load {
    /// Force per rest area \[Pa\] on faces.
    Traction(Vec<[NodeIdx; 4]>, Vector3<f64>),
    /// Pressure \[Pa\] on deformed faces.
    Pressure(Vec<[NodeIdx; 4]>, f64),
    /// Forces \[N\] at nodes.
    Forces(Vec<(NodeIdx, Vector3<f64>)>),
}

impl Problem {
    /// Generates or reads the mesh and resolves all selectors.
    ///
    /// # Errors
    /// [`ConfigError`]: a mesh that cannot be made or read, an empty selection, supports that contradict each other or leave a
    /// body free to move.
    pub fn new(case: &Case) -> Result<Self, ConfigError> {
        let document = &case.document;
        let mut mesh = case.mesh.load(document)?;
        let mut remarks = std::mem::take(&mut mesh.remarks);
        check_extents(case, &mesh.mesh, &mut remarks)?;
        let (solid, region_of_hex) = make_solid(case, &mesh)?;
        let supports = support::find(document, &case.supports, &mesh)?;
        held::check(document, &mesh.mesh, &supports)?;
        let loads = case.loads.iter().enumerate();
        let loads = loads.map(|(i, load)| find_load(document, &format!("loads.{i}"), load, &mesh));
        let loads = loads.collect::<Result<_, _>>()?;
        let probes = case.probes.iter().enumerate();
        let probes = probes.map(|(i, probe)| probe.resolve(document, &format!("probes.{i}"), &mesh));
        let probes = probes.collect::<Result<_, _>>()?;
        let is_linear = case.materials().all(|material| material.model == MaterialModel::Linear);
        let may_collapse = case.materials().any(|m| m.model == MaterialModel::CompressibleNeoHookean);
        Ok(Self { mesh, solid, is_linear, may_collapse, remarks, region_of_hex, supports, loads, probes })
    }

    /// The mesh at rest.
    pub fn mesh(&self) -> &HexMesh {
        &self.mesh.mesh
    }

    /// Elastic energy of the body.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// Whether all materials are linear, so that `det F` is no measure of the result.
    pub fn is_linear(&self) -> bool {
        self.is_linear
    }

    /// Whether a material resists collapse less than the stable Neo-Hookean one does.
    pub fn may_collapse(&self) -> bool {
        self.may_collapse
    }

    /// Sentences about the mesh that its user should read.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Region of each hexahedron: 0 for the base material, else one more than the region's index in the file.
    pub fn region_of_hex(&self) -> &[usize] {
        &self.region_of_hex
    }

    /// Supports in the order of the file.
    pub fn supports(&self) -> &[Support] {
        &self.supports
    }

    /// Loads in the order of the file.
    pub fn loads(&self) -> &[Load] {
        &self.loads
    }

    /// Probes in the order of the file.
    pub fn probes(&self) -> &[Probe] {
        &self.probes
    }

    /// Constraints under a share of the given displacements.
    pub(super) fn constraints_at(&self, share: f64) -> Constraints {
        let mut constraints = Constraints::none(self.mesh().n_nodes());
        for support in &self.supports {
            for (node, axes) in &support.nodes {
                let x = self.mesh().nodes()[node.index()];
                for k in (0..3).filter(|&k| axes[k]) {
                    constraints.give(node.index(), k, x[k] + share * support.displacement_m[k]);
                }
            }
        }
        constraints
    }

    /// A share of the loads.
    pub(super) fn loads_at(&self, share: f64) -> Vec<Box<dyn Energy>> {
        self.loads.iter().map(|load| load.at(self.mesh(), share)).collect()
    }

    /// Force of a support on the body at node positions `x` \[N\].
    pub(super) fn support_force(&self, support: usize, x: &[Vector3<f64>]) -> Vector3<f64> {
        let loads = self.loads_at(1.0);
        let forces = reactions(&energies(&self.solid, &loads), x);
        let held = self.supports[support].nodes.iter();
        held.map(|(node, axes)| Vector3::from_fn(|k, _| if axes[k] { forces[node.index()][k] } else { 0.0 })).sum()
    }
}

/// Elasticity and loads as energies of the solver.
pub(super) fn energies<'a>(solid: &'a Solid, loads: &'a [Box<dyn Energy>]) -> Vec<&'a dyn Energy> {
    std::iter::once(solid as &dyn Energy).chain(loads.iter().map(Box::as_ref)).collect()
}

/// Refuses a mesh of impossible extents, and tells unusual ones.
fn check_extents(case: &Case, mesh: &HexMesh, remarks: &mut Vec<String>) -> Result<(), ConfigError> {
    let [lower, upper] = mesh.bounds();
    let (key, is_file) = case.mesh.size_key();
    match extents::judge("the body", key, (upper - lower).into()) {
        Size::Impossible(problem) if is_file => {
            Err(case.document.error(key, problem, "give 1e-3 for a file in mm, 1 for one in m"))
        }
        Size::Doubtful(doubt) | Size::Impossible(doubt) => {
            remarks.push(doubt);
            Ok(())
        }
        Size::Plausible => Ok(()),
    }
}

fn make_solid(case: &Case, mesh: &NamedMesh) -> Result<(Solid, Vec<usize>), ConfigError> {
    let mut materials: Vec<Material> = vec![case.material; mesh.mesh.n_hexes()];
    let mut region_of_hex = vec![0; mesh.mesh.n_hexes()];
    for (i, region) in case.regions.iter().enumerate() {
        let hexes = region.selector.hexes(&mesh.mesh, &mesh.groups);
        let key = format!("regions.{i}.select");
        for hex in hexes.map_err(|e| select::explain(&case.document, &key, &mesh.mesh, &e))? {
            materials[hex.index()] = region.material;
            region_of_hex[hex.index()] = i + 1;
        }
    }
    let solid = Solid::new(&mesh.mesh, &materials);
    let refused =
        |e: plica_accurate::SolidError| case.document.error("material", e.to_string(), "change the constants");
    Ok((solid.map_err(refused)?, region_of_hex))
}

fn find_load(document: &Document, key: &str, spec: &LoadSpec, mesh: &NamedMesh) -> Result<Load, ConfigError> {
    let explain = |e| select::explain(document, &format!("{key}.select"), &mesh.mesh, &e);
    let faces = spec.selector.faces(&mesh.mesh, &mesh.groups);
    Ok(match (spec.kind, faces) {
        (LoadKind::Traction(traction), faces) => Load::Traction(faces.map_err(explain)?, traction.into()),
        (LoadKind::Pressure(pressure), faces) => Load::Pressure(faces.map_err(explain)?, pressure),
        (LoadKind::Force(force), Ok(faces)) => {
            let area: f64 = faces.iter().map(|quad| mesh.mesh.quad_area(quad)).sum();
            Load::Traction(faces, Vector3::from(force) / area)
        }
        (LoadKind::Force(force), Err(_)) => {
            let nodes = spec.selector.nodes(&mesh.mesh, &mesh.groups).map_err(explain)?;
            let share = Vector3::from(force) / nodes.len() as f64;
            Load::Forces(nodes.into_iter().map(|node| (node, share)).collect())
        }
    })
}

impl Load {
    fn at(&self, mesh: &HexMesh, share: f64) -> Box<dyn Energy> {
        match self {
            Self::Traction(quads, traction_pa) => Box::new(Traction::new(mesh, quads, traction_pa * share)),
            Self::Pressure(quads, pressure_pa) => Box::new(Pressure::new(quads.clone(), pressure_pa * share)),
            Self::Forces(forces) => {
                Box::new(NodalForces::new(forces.iter().map(|(node, force)| (*node, force * share)).collect()))
            }
        }
    }
}
