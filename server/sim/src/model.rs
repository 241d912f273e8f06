//! Constant tables of a scene, built from a [`ModelDescription`].

use nalgebra::{Point3, Vector3};
use plica_geometry::HexMesh;
use thiserror::Error;

use crate::contact::{SkinSurface, Solid, V3};
use crate::description::{Material, ModelDescription, Preconditioner};
use crate::element::{ElementBatches, lumped_mass};
use crate::embedding::SkinEmbedding;
use crate::lanes::Node;
use crate::solver::{BlockJacobi, BlockTridiagonal, NodeOrder, RestMatrix, WarpScratch};

/// Largest factorisation that [`Preconditioner::Auto`] keeps: with the stiffness it should stay in the second-level cache.
const AUTO_FACTOR_BYTES: usize = 1 << 21;

/// A step this long is dominated by stiffness: its inverse gives the static stiffness of skin points, with enough mass left
/// in it for an object that nothing holds \[s\].
const QUASI_STATIC_S: f64 = 0.1;

/// Least inverse mass of a skin point, as a share of the mean: points next to fixed nodes are not infinitely stiff.
const INVERSE_MASS_FLOOR: f32 = 0.05;

/// Error of building a model.
#[derive(Debug, Error)]
pub enum ModelError {
    /// An array of the description does not have the length of the mesh or skin.
    #[error("{what}: {found} entries, but {expected} are needed")]
    Length {
        /// The array.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Length needed.
        expected: usize,
    },
    /// Every node is fixed.
    #[error("all {n_nodes} nodes are fixed: nothing can move")]
    NothingFree {
        /// Nodes of the mesh.
        n_nodes: usize,
    },
    /// A number is outside its range.
    #[error("{what} is {value}, allowed is {range}")]
    Range {
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Allowed range.
        range: &'static str,
    },
    /// The points of a tool's hull do not span a volume.
    #[error("the shape of tool '{tool}' does not span a volume")]
    FlatTool {
        /// The tool.
        tool: String,
    },
    /// The rest matrix has a singular block.
    #[error("the rest matrix of {n_free} free nodes is singular: is a part of the mesh without stiffness?")]
    Singular {
        /// Free nodes.
        n_free: usize,
    },
}

/// Sizes and traffic of a tick, for `check` and for the roofline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Nodes of the coarse mesh.
    pub n_nodes: usize,
    /// Nodes that can move.
    pub n_free: usize,
    /// Hexahedra, padding included.
    pub n_hexes: usize,
    /// Skin vertices.
    pub n_skin: usize,
    /// Whether the solver uses the block-tridiagonal preconditioner.
    pub block_tridiagonal: bool,
    /// Bytes that a force evaluation or stiffness product reads \[B\].
    pub product_bytes: usize,
    /// Floating-point operations of it.
    pub product_flops: usize,
    /// Bytes that one application of the preconditioner reads \[B\].
    pub preconditioner_bytes: usize,
    /// Bytes that the embedding reads and writes \[B\].
    pub embedding_bytes: usize,
}

/// Half diagonals around an object that is held: a displacement beyond them is beyond recovery.
const HELD_ROOM: f64 = 10.0;
/// Half diagonals around an object that nothing holds: it falls and slides. Farther out `f32` positions are too coarse for contact.
const FREE_ROOM: f64 = 100.0;

/// One scene's constant tables.
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) description: ModelDescription,
    pub(crate) order: NodeOrder,
    pub(crate) n_free: usize,
    pub(crate) elements: ElementBatches,
    /// Lumped mass per free node \[kg\].
    pub(crate) node_mass: Vec<f32>,
    pub(crate) jacobi: BlockJacobi,
    pub(crate) tridiagonal: Option<BlockTridiagonal>,
    pub(crate) embedding: SkinEmbedding,
    pub(crate) surface: SkinSurface,
    /// Shapes of tools, then planes.
    pub(crate) solids: Vec<Solid>,
    /// Mean edge of the coarse mesh \[m\].
    pub(crate) cell_size: f32,
    /// Least and largest displacement of a node that stays in the room, along each axis \[m\].
    pub(crate) largest_displacements: [[f32; 3]; 2],
    /// Length of a sub-step \[s\].
    pub(crate) dt: f32,
}

impl Model {
    /// Precomputes all tables of a tick. Seconds for thousands of hexahedra, milliseconds for the wedge.
    pub fn new(description: ModelDescription) -> Result<Self, ModelError> {
        check(&description)?;
        let d = &description;
        let order = NodeOrder::new(&d.mesh, &d.fixed);
        let n_free = order.n_free();
        if n_free == 0 {
            return Err(ModelError::NothingFree { n_nodes: d.mesh.n_nodes() });
        }
        let h = d.timestep_s / f64::from(d.substeps);
        let mass = node_mass(&d.mesh, &order, &d.materials);
        let inverse = |h| RestInverse::new(d, &order, &mass, h).ok_or(ModelError::Singular { n_free });
        let RestInverse { tridiagonal, jacobi } = inverse(h)?;
        let embedding = SkinEmbedding::new(&d.skin, &d.embedding, &order.internal_of_mesh, n_free);
        let inverse_mass = inverse_masses(&embedding, n_free, tridiagonal.as_ref(), &jacobi);
        let slow = inverse(QUASI_STATIC_S)?;
        let slow_inverse_mass = inverse_masses(&embedding, n_free, slow.tridiagonal.as_ref(), &slow.jacobi);
        let stiffness = |w: &f32| 1.0 / (w * (QUASI_STATIC_S * QUASI_STATIC_S) as f32);
        let static_stiffness = slow_inverse_mass.iter().map(stiffness).collect();
        Ok(Self {
            elements: ElementBatches::new(&d.mesh, &order.internal_of_mesh, &d.materials, d.element),
            node_mass: mass[..n_free].iter().map(|&m| m as f32).collect(),
            surface: SkinSurface::new(&d.skin, inverse_mass, static_stiffness),
            solids: solids(d)?,
            cell_size: mean_edge(&d.mesh) as f32,
            largest_displacements: largest_displacements(d),
            dt: h as f32,
            jacobi,
            tridiagonal,
            embedding,
            order,
            n_free,
            description,
        })
    }

    /// Description of the scene.
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// Whether no node is held, so that the object may fall, slide and roll away.
    pub fn is_free(&self) -> bool {
        !self.description.fixed.contains(&true)
    }

    /// Lower and upper corner of the box that the object may move in \[m\]; once out, it is put back.
    pub fn room_m(&self) -> [Point3<f64>; 2] {
        room(&self.description)
    }

    /// Nodes of the coarse mesh.
    pub fn n_nodes(&self) -> usize {
        self.description.mesh.n_nodes()
    }

    /// Vertices of the skin.
    pub fn n_skin(&self) -> usize {
        self.embedding.n_skin()
    }

    /// Tools of the scene.
    pub fn n_tools(&self) -> usize {
        self.description.tools.len()
    }

    /// Length of a tick \[s\].
    pub fn timestep_s(&self) -> f64 {
        self.description.timestep_s
    }

    /// Sizes and traffic of a tick.
    pub fn cost(&self) -> Cost {
        Cost {
            n_nodes: self.n_nodes(),
            n_free: self.n_free,
            n_hexes: self.elements.n_batches() * crate::lanes::LANES,
            n_skin: self.n_skin(),
            block_tridiagonal: self.tridiagonal.is_some(),
            product_bytes: self.elements.bytes_per_product(),
            product_flops: self.elements.flops_per_product(),
            preconditioner_bytes: self.tridiagonal.as_ref().map_or(self.jacobi.bytes(), BlockTridiagonal::bytes),
            embedding_bytes: self.embedding.bytes(),
        }
    }

    pub(crate) fn n_bodies(&self) -> usize {
        self.solids.len()
    }

    /// Largest number of contact rows of one body.
    pub(crate) fn max_contacts(&self, body: usize) -> usize {
        let options = &self.description.contact;
        if body < self.n_tools() { options.max_contacts } else { options.max_support_contacts }
    }

    /// Largest number of contact rows of all bodies together.
    pub(crate) fn max_rows(&self) -> usize {
        (0..self.n_bodies()).map(|b| self.max_contacts(b)).sum()
    }

    /// Longest sparse row of the embedding.
    pub(crate) fn longest_row(&self) -> usize {
        (0..self.n_skin()).map(|v| self.embedding.row(v).0.len()).max().unwrap_or(0)
    }
}

fn check(d: &ModelDescription) -> Result<(), ModelError> {
    let lengths = [
        ("fixed", d.fixed.len(), d.mesh.n_nodes()),
        ("materials", d.materials.len(), d.mesh.n_hexes()),
        ("embedding rows", d.embedding.n_rows(), d.skin.n_vertices()),
    ];
    for (what, found, expected) in lengths {
        if found != expected {
            return Err(ModelError::Length { what, found, expected });
        }
    }
    let range =
        |what, value: f64, ok: bool, range| if ok { Ok(()) } else { Err(ModelError::Range { what, value, range }) };
    range("timestep_s", d.timestep_s, d.timestep_s > 0.0 && d.timestep_s <= 0.1, "(0, 0.1] s")?;
    range("substeps", f64::from(d.substeps), d.substeps >= 1, "1 or more")?;
    for m in &d.materials {
        range(
            "young_modulus_pa",
            m.young_modulus_pa,
            m.young_modulus_pa > 0.0 && m.young_modulus_pa.is_finite(),
            "above 0",
        )?;
        range("poisson_ratio", m.poisson_ratio, (0.0..=0.499).contains(&m.poisson_ratio), "[0, 0.499]")?;
        let density = m.density_kg_per_m3;
        range("density_kg_per_m3", density, density > 0.0 && density.is_finite(), "above 0")?;
    }
    Ok(())
}

/// Lumped mass in internal order, `[n_nodes]` \[kg\].
fn node_mass(mesh: &HexMesh, order: &NodeOrder, materials: &[Material]) -> Vec<f64> {
    let mut mass = vec![0.0; mesh.n_nodes()];
    for (hex, material) in mesh.hexes().iter().zip(materials) {
        let shares = lumped_mass(&hex.map(|n| mesh.nodes()[n.index()]), material.density_kg_per_m3);
        for (node, share) in hex.iter().zip(shares) {
            mass[order.internal_of_mesh[node.index()] as usize] += share;
        }
    }
    mass
}

/// Inverses of the rest matrix of a step, by the solver options.
struct RestInverse {
    tridiagonal: Option<BlockTridiagonal>,
    jacobi: BlockJacobi,
}

impl RestInverse {
    /// `None` if a block is singular.
    fn new(d: &ModelDescription, order: &NodeOrder, mass: &[f64], h: f64) -> Option<Self> {
        let matrix = RestMatrix::new(d, order, mass, h);
        let wants_factor = match d.solver.preconditioner {
            Preconditioner::Auto => BlockTridiagonal::bytes_for(order) <= AUTO_FACTOR_BYTES,
            Preconditioner::BlockTridiagonal => true,
            Preconditioner::BlockJacobi => false,
        };
        let tridiagonal = if wants_factor { Some(BlockTridiagonal::new(&matrix, order)?) } else { None };
        Some(Self { tridiagonal, jacobi: BlockJacobi::new(&matrix) })
    }
}

/// `tr(J A_0^-1 J^T) / 3` of each skin vertex \[1/kg\]: how far it yields to a unit impulse. Without a factorisation
/// computed from the diagonal blocks, which overstates the stiffness.
fn inverse_masses(
    embedding: &SkinEmbedding,
    n_free: usize,
    factor: Option<&BlockTridiagonal>,
    jacobi: &BlockJacobi,
) -> Vec<f32> {
    let mut scratch = WarpScratch::new(n_free, factor);
    let (mut load, mut response): (Vec<Node>, Vec<Node>) = (vec![[0.0; 4]; n_free], vec![[0.0; 4]; n_free]);
    let mut of_vertex = |v: usize| {
        let (nodes, weights) = embedding.row(v);
        let mut trace = 0.0;
        for axis in 0..3 {
            nodes.iter().zip(weights).for_each(|(&n, &w)| load[n as usize][axis] = w);
            match factor {
                Some(factor) => factor.apply_warped(&load, &mut response, &mut scratch),
                None => jacobi.apply(&load, &mut response),
            }
            trace += nodes.iter().zip(weights).map(|(&n, &w)| w * response[n as usize][axis]).sum::<f32>();
            nodes.iter().for_each(|&n| load[n as usize][axis] = 0.0);
        }
        trace / 3.0
    };
    let mut inverse_mass: Vec<f32> = (0..embedding.n_skin()).map(&mut of_vertex).collect();
    let floor = INVERSE_MASS_FLOOR * inverse_mass.iter().sum::<f32>() / inverse_mass.len() as f32;
    inverse_mass.iter_mut().for_each(|w| *w = w.max(floor));
    inverse_mass
}

fn solids(d: &ModelDescription) -> Result<Vec<Solid>, ModelError> {
    let tools =
        d.tools.iter().map(|t| Solid::new(&t.shape).ok_or_else(|| ModelError::FlatTool { tool: t.name.clone() }));
    let mut solids: Vec<Solid> = tools.collect::<Result<_, _>>()?;
    for plane in &d.planes {
        let normal: V3 = plane.normal.normalize().cast();
        solids.push(Solid::HalfSpace { normal });
    }
    Ok(solids)
}

fn mean_edge(mesh: &HexMesh) -> f64 {
    (mesh.volume() / mesh.n_hexes() as f64).cbrt()
}

/// Lower and upper corner of the object at rest \[m\].
fn extents(mesh: &HexMesh) -> [Point3<f64>; 2] {
    let start = [mesh.nodes()[0], mesh.nodes()[0]];
    mesh.nodes().iter().fold(start, |[low, high], p| [low.inf(p), high.sup(p)])
}

/// The bounds of the scene, or the object at rest with [`HELD_ROOM`] or [`FREE_ROOM`] half diagonals around it.
fn room(d: &ModelDescription) -> [Point3<f64>; 2] {
    let [low, high] = extents(&d.mesh);
    let share = if d.fixed.contains(&true) { HELD_ROOM } else { FREE_ROOM };
    let around = Vector3::repeat(share * (high - low).norm() / 2.0);
    d.bounds_m.unwrap_or([low - around, high + around])
}

/// Displacements that carry the object's rest box to the walls of its room.
fn largest_displacements(d: &ModelDescription) -> [[f32; 3]; 2] {
    let ([low, high], [least, most]) = (extents(&d.mesh), room(d));
    [(least - low).cast().into(), (most - high).cast().into()]
}
