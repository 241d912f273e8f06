//! Scratch of a tick; means nothing between calls.

use nalgebra::Vector6;

use crate::contact::{ContactCoupling, ContactPoint, Detector, Placement, ProxyMotion, Rows};
use crate::lanes::{F, Mat3, Node};
use crate::model::Model;
use crate::solver::{CgScratch, WarpScratch};
use crate::tool::Target;

/// Scratch of a tick.
#[derive(Debug, Clone)]
pub struct Workspace {
    /// Element rotations of this step, by batch.
    pub(crate) rotations: Vec<Mat3>,
    /// Sums of element quaternions around each node.
    pub(crate) node_quaternions: Vec<Node>,
    pub(crate) warp: WarpScratch,
    pub(crate) cg: CgScratch,
    pub(crate) dv: Vec<Node>,
    pub(crate) residual: Vec<Node>,
    /// `dv` and `residual` before a solve, for the fall-back.
    pub(crate) dv_before: Vec<Node>,
    pub(crate) residual_before: Vec<Node>,
    pub(crate) detector: Detector,
    pub(crate) rows: Rows,
    pub(crate) coupling: ContactCoupling,
    /// One entry per tool.
    pub(crate) motions: Vec<ProxyMotion>,
    pub(crate) targets: Vec<Option<Target>>,
    /// One entry per tool.
    pub(crate) contact_points: Vec<Option<ContactPoint>>,
    /// Tools, then planes.
    pub(crate) placements: Vec<Placement>,
}

impl Workspace {
    /// Scratch for every state of a model.
    pub fn new(model: &Model) -> Self {
        let (n_nodes, n_free, n_batches) = (model.n_nodes(), model.n_free, model.elements.n_batches());
        let nodes = || vec![[0.0; 4]; n_nodes];
        let planes = model
            .description
            .planes
            .iter()
            .map(|p| Placement { rotation: nalgebra::Matrix3::identity(), origin: p.point_m.coords.cast() });
        let at_origin = Placement { rotation: nalgebra::Matrix3::identity(), origin: nalgebra::Vector3::zeros() };
        Self {
            rotations: vec![[[F::ZERO; 3]; 3]; n_batches],
            node_quaternions: nodes(),
            warp: WarpScratch::new(n_free, model.tridiagonal.as_ref()),
            cg: CgScratch::new(n_nodes, n_free),
            dv: nodes(),
            residual: nodes(),
            dv_before: nodes(),
            residual_before: nodes(),
            detector: Detector::new(model.n_skin()),
            rows: Rows::new(model.max_rows(), model.longest_row()),
            coupling: ContactCoupling::new(model.n_bodies(), model.max_rows()),
            motions: vec![ProxyMotion::prescribed(1.0, Vector6::zeros()); model.n_tools()],
            targets: vec![None; model.n_tools()],
            contact_points: vec![None; model.n_tools()],
            placements: std::iter::repeat_n(at_origin, model.n_tools()).chain(planes).collect(),
        }
    }
}
