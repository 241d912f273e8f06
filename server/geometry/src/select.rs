//! Parts of a mesh: nodes, boundary faces or elements by box, face of the bounding box, group or condition.

use nalgebra::Point3;

use crate::face::Face;
use crate::import::{Group, Groups};
use crate::index::{ElementIdx, NodeIdx};
use crate::predicate::Predicate;
use crate::volume_mesh::{ElementKind, VolumeMesh};

/// Tolerance of a face of the bounding box, as a share of the box's diagonal.
const FACE_TOLERANCE: f64 = 1e-6;
/// Tolerance of boxes against rounding, as a share of the mesh's diagonal.
const BOX_TOLERANCE: f64 = 1e-9;

/// Conditions that must all hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selector {
    /// A box by its lower and upper corner \[m\]: nodes in it; faces and elements whose centre is in it.
    pub within: Option<[Point3<f64>; 2]>,
    /// A face of the mesh's bounding box, by axis and end: nodes on it; faces with all corners on it.
    pub side: Option<Side>,
    /// A named group: its nodes, faces or elements; where a group has no faces, those with all corners in it.
    pub group: Option<String>,
    /// A condition on nodes, or on the centres (means of the corners) of faces and elements.
    pub condition: Option<Predicate>,
}

/// A face of a bounding box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Side {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Whether it is the end of largest coordinate.
    pub upper: bool,
}

/// Error of a selection.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SelectError {
    /// No group of that name.
    #[error("no group `{name}`; the mesh has {}", list(known))]
    UnknownGroup {
        /// The name.
        name: String,
        /// Names in the mesh.
        known: Vec<String>,
    },
    /// The group has no volumes.
    #[error("group `{name}` has no {kind}: it is a group of {}", ["points", "curves", "faces"][usize::from(*dimension)])]
    NoVolume {
        /// The name.
        name: String,
        /// Kind of the mesh's elements.
        kind: &'static str,
        /// Dimension of the group, 0 to 2.
        dimension: u8,
    },
    /// Nothing fulfils all conditions.
    #[error("selects none of {n} {of}")]
    Empty {
        /// Number of candidates.
        n: usize,
        /// Kind of the candidates.
        of: &'static str,
    },
}

fn list(known: &[String]) -> String {
    if known.is_empty() { "none".to_owned() } else { format!("`{}`", known.join("`, `")) }
}

impl Selector {
    /// Nodes, in increasing order; at least one.
    ///
    /// # Errors
    /// [`SelectError`].
    pub fn nodes(&self, mesh: &VolumeMesh, groups: &Groups) -> Result<Vec<NodeIdx>, SelectError> {
        let frame = Frame::new(mesh);
        let group = self.group(groups, Groups::nodes)?;
        let in_group = |node: NodeIdx| group.is_none_or(|group| group.nodes.binary_search(&node).is_ok());
        let nodes = (0..mesh.n_nodes()).map(NodeIdx::from_index).filter(|&node| {
            let x = &mesh.nodes()[node.index()];
            in_group(node) && self.side.is_none_or(|side| frame.is_on(side, x)) && self.holds_at(&frame, x)
        });
        not_empty(nodes.collect(), mesh.n_nodes(), "nodes")
    }

    /// Boundary faces, outward; at least one.
    ///
    /// # Errors
    /// [`SelectError`].
    pub fn faces(&self, mesh: &VolumeMesh, groups: &Groups) -> Result<Vec<Face>, SelectError> {
        let frame = Frame::new(mesh);
        let group = self.group(groups, |groups, name| groups.surface(name).or_else(|| groups.nodes(name)))?;
        let faces = mesh.boundary_faces();
        let n = faces.len();
        let selected = faces.into_iter().filter(|face| {
            let corners: Vec<_> = face.corners().iter().map(|node| mesh.nodes()[node.index()]).collect();
            let is_on_side = self.side.is_none_or(|side| corners.iter().all(|x| frame.is_on(side, x)));
            is_on_side && group.is_none_or(|group| has_face(group, face)) && self.holds_at(&frame, &mean(&corners))
        });
        not_empty(selected.collect(), n, "boundary faces")
    }

    /// Elements, in increasing order; at least one. A side of the bounding box selects those with a face on it.
    ///
    /// # Errors
    /// [`SelectError`].
    pub fn elements(&self, mesh: &VolumeMesh, groups: &Groups) -> Result<Vec<ElementIdx>, SelectError> {
        let frame = Frame::new(mesh);
        let kind = mesh.kind();
        let group = self.group(groups, |groups, name| groups.volume(name).or_else(|| groups.nodes(name)))?;
        if let Some(Group { name, dimension: dimension @ 0..=2, .. }) = group {
            return Err(SelectError::NoVolume { name: name.clone(), kind: kind.plural(), dimension: *dimension });
        }
        let n_of_face = if kind == ElementKind::Hexahedron { 4 } else { 3 };
        let elements = mesh.elements().filter(|&element| {
            let corners = mesh.corners_of(element);
            let n_on = |side| corners.iter().filter(|x| frame.is_on(side, x)).count();
            let is_on_side = self.side.is_none_or(|side| n_on(side) >= n_of_face);
            let in_group = group.is_none_or(|group| group.elements.binary_search(&element).is_ok());
            is_on_side && in_group && self.holds_at(&frame, &mean(&corners))
        });
        not_empty(elements.collect(), mesh.n_elements(), kind.plural())
    }

    /// Box and condition at a point.
    fn holds_at(&self, frame: &Frame, x: &Point3<f64>) -> bool {
        self.within.as_ref().is_none_or(|corners| frame.is_within(corners, x))
            && self.condition.as_ref().is_none_or(|condition| condition.holds(x))
    }

    fn group<'g>(
        &self,
        groups: &'g Groups,
        find: impl Fn(&'g Groups, &str) -> Option<&'g Group>,
    ) -> Result<Option<&'g Group>, SelectError> {
        let Some(name) = &self.group else { return Ok(None) };
        let unknown = || {
            let mut known: Vec<_> = groups.iter().map(|group| group.name.clone()).collect();
            known.dedup();
            SelectError::UnknownGroup { name: name.clone(), known }
        };
        find(groups, name).ok_or_else(unknown).map(Some)
    }
}

fn not_empty<T>(selected: Vec<T>, n: usize, of: &'static str) -> Result<Vec<T>, SelectError> {
    if selected.is_empty() { Err(SelectError::Empty { n, of }) } else { Ok(selected) }
}

fn has_face(group: &Group, face: &Face) -> bool {
    if group.faces.is_empty() {
        return face.corners().iter().all(|node| group.nodes.binary_search(node).is_ok());
    }
    group.faces.binary_search(&face.sorted_corners()).is_ok()
}

fn mean(points: &[Point3<f64>]) -> Point3<f64> {
    Point3::from(points.iter().map(|x| x.coords).sum::<nalgebra::Vector3<f64>>() / points.len() as f64)
}

/// The mesh's bounding box \[m\].
struct Frame {
    lower: Point3<f64>,
    upper: Point3<f64>,
}

impl Frame {
    fn new(mesh: &VolumeMesh) -> Self {
        let [lower, upper] = mesh.bounds();
        Self { lower, upper }
    }

    fn diagonal(&self) -> f64 {
        (self.upper - self.lower).norm()
    }

    fn is_on(&self, side: Side, x: &Point3<f64>) -> bool {
        let end = if side.upper { self.upper } else { self.lower };
        (x[side.axis] - end[side.axis]).abs() <= FACE_TOLERANCE * self.diagonal()
    }

    fn is_within(&self, [lower, upper]: &[Point3<f64>; 2], x: &Point3<f64>) -> bool {
        let slack = BOX_TOLERANCE * self.diagonal();
        (0..3).all(|k| x[k] >= lower[k] - slack && x[k] <= upper[k] + slack)
    }
}
