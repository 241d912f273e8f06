//! A case with its selections resolved.

use nalgebra::Vector3;
use plica_accurate::{Constraints, Energy, MaterialModel, Solid, reactions};
use plica_geometry::import::NamedMesh;
use plica_geometry::{ElementKind, VolumeMesh};

use super::checked::Case;
use super::load::{self, Body, Load};
use super::material::MaterialSpec;
use super::probe::Probe;
use super::support::{self, Support};
use super::tool::Tool;
use super::tool_contact::ToolContact;
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
    /// Region of each element: 0 for the base material, else one more than the region's index in the file.
    region_of_element: Vec<usize>,
    supports: Vec<Support>,
    loads: Vec<Load>,
    tools: Vec<Tool>,
    tool_contact: Option<ToolContact>,
    probes: Vec<Probe>,
}

/// Solid with the region and the density of each element \[kg/m^3\].
struct Parts {
    solid: Solid,
    region_of_element: Vec<usize>,
    densities_kg_per_m3: Vec<f64>,
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
        remarks.extend(stiff_elements(&mesh.mesh));
        let Parts { solid, region_of_element, densities_kg_per_m3 } = make_solid(case, &mesh)?;
        let supports = support::find(document, &case.supports, &mesh)?;
        held::check(document, &mesh.mesh, &supports)?;
        let is_held = is_held(&supports, mesh.mesh.n_nodes());
        let body = Body { mesh: &mesh, densities_kg_per_m3: &densities_kg_per_m3, is_held: &is_held };
        let loads = case.loads.iter().enumerate();
        let loads = loads.map(|(i, spec)| load::find(document, &format!("loads.{i}"), spec, &body, &mut remarks));
        let loads = loads.collect::<Result<_, _>>()?;
        let probes = case.probes.iter().enumerate();
        let probes = probes.map(|(i, probe)| probe.resolve(document, &format!("probes.{i}"), &mesh));
        let probes = probes.collect::<Result<_, _>>()?;
        let is_linear = case.materials().all(|material| material.model == MaterialModel::Linear);
        let may_collapse =
            case.materials().any(|m| !matches!(m.model, MaterialModel::Linear | MaterialModel::StableNeoHookean));
        let tools = case.tools.clone();
        let mut problem = Self {
            mesh,
            solid,
            is_linear,
            may_collapse,
            remarks,
            region_of_element,
            supports,
            loads,
            tools,
            tool_contact: None,
            probes,
        };
        if !problem.tools.is_empty() {
            let softest = case.materials().map(|m| m.young_modulus_pa).fold(f64::INFINITY, f64::min);
            problem.tool_contact = Some(contact_with_tools(document, &problem, softest)?);
        }
        Ok(problem)
    }

    /// The mesh at rest.
    pub fn mesh(&self) -> &VolumeMesh {
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

    /// Region of each element: 0 for the base material, else one more than the region's index in the file.
    pub fn region_of_element(&self) -> &[usize] {
        &self.region_of_element
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

    /// Tools in the order of the file.
    pub fn tools(&self) -> &[Tool] {
        &self.tools
    }

    /// Contact with the tools, where there are any.
    pub(super) fn tool_contact(&self) -> Option<&ToolContact> {
        self.tool_contact.as_ref()
    }

    /// Whether loads follow the surface, so that equilibria have no energy.
    pub fn has_follower_loads(&self) -> bool {
        self.loads.iter().any(|load| matches!(load, Load::Pressure(..) | Load::Moment(..)))
    }

    /// Constraints under a share of the given displacements.
    pub(super) fn constraints_at(&self, share: f64) -> Constraints {
        let mut constraints = Constraints::none(self.mesh().n_nodes());
        for support in &self.supports {
            for (node, direction) in &support.rows {
                let position = support.position(&self.mesh().nodes()[node.index()], share);
                constraints.give_along(node.index(), direction, direction.dot(&position));
            }
        }
        constraints
    }

    /// A share of the loads.
    pub(super) fn loads_at(&self, share: f64) -> Vec<Box<dyn Energy>> {
        self.loads.iter().map(|load| load.at(self.mesh(), share)).collect()
    }

    /// Elasticity and loads as energies of the solver.
    pub(super) fn energies<'a>(&'a self, loads: &'a [Box<dyn Energy>]) -> Vec<&'a dyn Energy> {
        std::iter::once(&self.solid as &dyn Energy).chain(loads.iter().map(Box::as_ref)).collect()
    }

    /// Forces of a support on its nodes, in the order of its rows \[N\], given the force of all supports on each node. Where
    /// several directions of a node are held, `f = sum_i l_i d_i` splits it among them.
    pub(super) fn support_forces(&self, support: usize, forces: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut of_node = vec![Vec::new(); forces.len()];
        for (node, direction) in self.supports.iter().flat_map(|s| &s.rows) {
            of_node[node.index()].push(*direction);
        }
        let share = |(node, direction): &(plica_geometry::NodeIdx, Vector3<f64>)| {
            let directions = nalgebra::Matrix3xX::from_columns(&of_node[node.index()]);
            let which = of_node[node.index()].iter().position(|d| d == direction).unwrap_or_default();
            let normal = directions.transpose() * &directions;
            let sizes = normal.lu().solve(&(directions.transpose() * forces[node.index()]));
            direction * sizes.map_or(0.0, |sizes| sizes[which])
        };
        self.supports[support].rows.iter().map(share).collect()
    }

    /// Forces that hold the body at node positions `x` under a share of the loads, `[n_nodes]` \[N\]; at equilibrium 0 but at supports
    /// and, unless `contact` has the forces of the tools, where tools touch.
    pub(super) fn holding_forces(&self, x: &[Vector3<f64>], share: f64, contact: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let loads = self.loads_at(share);
        let mut forces = reactions(&self.energies(&loads), x);
        forces.iter_mut().zip(contact).for_each(|(force, contact)| *force -= contact);
        forces
    }
}

/// Contact with tools, which knows hexahedra only.
fn contact_with_tools(document: &Document, problem: &Problem, softest_pa: f64) -> Result<ToolContact, ConfigError> {
    let Some(hexes) = problem.mesh().hexahedra() else {
        let problem = format!("touch a mesh of {}", problem.mesh().kind().plural());
        return Err(document.error("tools", problem, "mesh the body with hexahedra, or press it by a displacement"));
    };
    Ok(ToolContact::new(hexes, &problem.constraints_at(1.0), softest_pa))
}

/// A sentence about elements that are stiffer than the body.
fn stiff_elements(mesh: &VolumeMesh) -> Option<String> {
    (mesh.kind() == ElementKind::LinearTetrahedron).then(|| {
        "4-node tetrahedra lock: they are too stiff in bending, and far too stiff near incompressibility; save the mesh with \
         10-node tetrahedra (in Gmsh Mesh.ElementOrder = 2, Mesh > Set order 2)"
            .to_owned()
    })
}

/// Whether all of a node's motion is held.
fn is_held(supports: &[Support], n_nodes: usize) -> Vec<bool> {
    let mut n_directions = vec![0; n_nodes];
    supports.iter().flat_map(|s| &s.rows).for_each(|(node, _)| n_directions[node.index()] += 1);
    n_directions.into_iter().map(|n| n == 3).collect()
}

/// Refuses a mesh of impossible extents, and tells unusual ones.
fn check_extents(case: &Case, mesh: &VolumeMesh, remarks: &mut Vec<String>) -> Result<(), ConfigError> {
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

fn make_solid(case: &Case, mesh: &NamedMesh) -> Result<Parts, ConfigError> {
    let mut specs: Vec<&MaterialSpec> = vec![&case.material; mesh.mesh.n_elements()];
    let mut region_of_element = vec![0; mesh.mesh.n_elements()];
    let mut densities_kg_per_m3 = vec![case.density_kg_per_m3.unwrap_or_default(); mesh.mesh.n_elements()];
    for (i, region) in case.regions.iter().enumerate() {
        let elements = region.selector.elements(&mesh.mesh, &mesh.groups);
        let key = format!("regions.{i}.select");
        for element in elements.map_err(|e| select::explain(&case.document, &key, &mesh.mesh, &e))? {
            specs[element.index()] = &region.material;
            region_of_element[element.index()] = i + 1;
            densities_kg_per_m3[element.index()] =
                region.density_kg_per_m3.or(case.density_kg_per_m3).unwrap_or_default();
        }
    }
    let materials = mesh.mesh.elements().zip(specs).map(|(element, spec)| spec.at(&case.document, mesh, element));
    let solid = Solid::of_volume(&mesh.mesh, &materials.collect::<Result<Vec<_>, _>>()?);
    let refused =
        |e: plica_accurate::SolidError| case.document.error("material", e.to_string(), "change the constants");
    Ok(Parts { solid: solid.map_err(refused)?, region_of_element, densities_kg_per_m3 })
}
