//! Faces of the boundary that touch other hexahedra without sharing their nodes.

use nalgebra::{Point3, Vector3};

use super::grid::{Grid, TOUCH};
use crate::hex_mesh::{HEX_FACES, HexMesh};
use crate::triangle::distance_to_triangle;

/// Faces that look at each other across less than this share of the shortest edge are reported.
const NEAR: f64 = 0.1;
/// Faces look at each other when the cosine between their normals is below this.
const OPPOSED: f64 = -0.9;
/// A node looks at a face when the cosine between the normals is below this.
const FACING: f64 = -0.5;
/// Faces overlap when they share more than this part of the smaller one.
const OVERLAP: f64 = 1e-2;

/// A face of a hexahedron.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct FaceOfHex {
    /// First nodes at its corners, in increasing order.
    pub(super) nodes: [u32; 4],
    pub(super) hex: u32,
    /// Number in [`HEX_FACES`].
    face: u8,
}

/// All faces of all hexahedra, equal ones one after the other.
pub(super) fn faces(mesh: &HexMesh, first_of_node: &[u32]) -> Vec<FaceOfHex> {
    let mut faces = Vec::with_capacity(6 * mesh.n_hexes());
    for (hex, corners) in (0..).zip(mesh.hexes()) {
        for (face, numbers) in (0..).zip(HEX_FACES) {
            let mut nodes = numbers.map(|corner| first_of_node[corners[corner].index()]);
            nodes.sort_unstable();
            faces.push(FaceOfHex { nodes, hex, face });
        }
    }
    faces.sort_unstable();
    faces
}

/// Faces that belong to one hexahedron.
pub(super) struct Boundary<'a> {
    mesh: &'a HexMesh,
    sizes: &'a [f64],
    quads: Vec<Quad>,
    grid: Grid,
    /// Outward direction of each node of the boundary.
    outward: Vec<Option<Vector3<f64>>>,
}

struct Quad {
    /// In cyclic order, outward.
    nodes: [u32; 4],
    corners: [Point3<f64>; 4],
    centre: Point3<f64>,
    normal: Vector3<f64>,
    /// Shortest edge around its corners \[m\].
    size: f64,
}

/// Nodes and faces that touch others without being joined to them.
#[derive(Default)]
pub(super) struct Touching {
    pub(super) hanging: Vec<u32>,
    pub(super) near: Vec<u32>,
    pub(super) overlapping: Vec<Point3<f64>>,
}

impl<'a> Boundary<'a> {
    pub(super) fn new(mesh: &'a HexMesh, sizes: &'a [f64], first_of_node: &[u32]) -> Self {
        let faces = faces(mesh, first_of_node);
        let lone = faces.chunk_by(|a, b| a.nodes == b.nodes).filter(|shared| shared.len() == 1);
        let mut lone: Vec<FaceOfHex> = lone.flatten().copied().collect();
        lone.sort_unstable_by_key(|face| (face.hex, face.face));
        let quads: Vec<Quad> = lone.iter().map(|face| Quad::new(mesh, sizes, first_of_node, face)).collect();
        let (mut grid, mut outward) = (Grid::default(), vec![None; mesh.n_nodes()]);
        for (number, quad) in (0..).zip(&quads) {
            let [lower, upper] = quad.bounds();
            grid.insert(number, (upper - lower).amax(), &lower, &upper);
            for node in quad.nodes {
                *outward[node as usize].get_or_insert_with(Vector3::zeros) += quad.normal;
            }
        }
        Self { mesh, sizes, quads, grid, outward }
    }

    pub(super) fn touching(&self) -> Touching {
        let mut touching = Touching::default();
        let mut is_matched = vec![true; self.quads.len()];
        for (node, outward) in (0..).zip(&self.outward).filter_map(|(node, outward)| Some((node, outward.as_ref()?))) {
            match self.nearest_of(node, outward, &mut is_matched) {
                Some(true) => touching.hanging.push(node),
                Some(false) => touching.near.push(node),
                None => {}
            }
        }
        for (number, quad) in self.quads.iter().enumerate() {
            if is_matched[number] && self.is_overlapped(number, quad, &is_matched) {
                touching.overlapping.push(quad.centre);
            }
        }
        touching
    }

    /// Whether a node lies on a face that does not have it as a corner (`true`), or closely before one (`false`).
    fn nearest_of(&self, node: u32, outward: &Vector3<f64>, is_matched: &mut [bool]) -> Option<bool> {
        let x = self.mesh.nodes()[node as usize];
        let mut found = None;
        // Cubes of the smallest level on: the face may be smaller than the node's own.
        self.grid.near(0.0, &x, &x, |number| {
            let quad = &self.quads[number as usize];
            if quad.nodes.contains(&node) {
                return;
            }
            let size = quad.size.min(self.sizes[node as usize]);
            let distance = quad.distance(&x);
            if distance <= TOUCH * size {
                found = Some(true);
                is_matched[number as usize] = false;
            } else if distance <= NEAR * size && outward.dot(&quad.normal) < FACING * outward.norm() {
                found.get_or_insert(false);
            }
        });
        found
    }

    /// Whether another face lies on this one, crossing it.
    fn is_overlapped(&self, number: usize, quad: &Quad, is_matched: &[bool]) -> bool {
        let [lower, upper] = quad.bounds();
        let mut is_overlapped = false;
        // Of two faces the smaller one asks.
        self.grid.near((upper - lower).amax(), &lower, &upper, |other| {
            let (other, face) = (other as usize, &self.quads[other as usize]);
            if !is_overlapped && other != number && is_matched[other] && quad.normal.dot(&face.normal) < OPPOSED {
                is_overlapped = quad.overlaps(face);
            }
        });
        is_overlapped
    }
}

impl Quad {
    fn new(mesh: &HexMesh, sizes: &[f64], first_of_node: &[u32], face: &FaceOfHex) -> Self {
        let corners_of_hex = mesh.hexes()[face.hex as usize];
        let own = HEX_FACES[face.face as usize].map(|corner| corners_of_hex[corner].index());
        let corners = own.map(|node| mesh.nodes()[node]);
        let centre = Point3::from(corners.iter().map(|x| x.coords).sum::<Vector3<f64>>() / 4.0);
        let across = (corners[2] - corners[0]).cross(&(corners[3] - corners[1]));
        Self {
            nodes: own.map(|node| first_of_node[node]),
            corners,
            centre,
            normal: across.try_normalize(0.0).unwrap_or_default(),
            size: own.iter().map(|&node| sizes[node]).fold(f64::INFINITY, f64::min),
        }
    }

    /// Box around the face, with a margin for everything near.
    fn bounds(&self) -> [Point3<f64>; 2] {
        let [a, rest @ ..] = self.corners;
        let lower = rest.iter().fold(a, |lower, x| lower.inf(x));
        let upper = rest.iter().fold(a, |upper, x| upper.sup(x));
        let margin = Vector3::repeat(NEAR * self.size);
        [lower - margin, upper + margin]
    }

    /// Distance to the nearest of the triangles between two neighbouring corners and the centre \[m\].
    fn distance(&self, x: &Point3<f64>) -> f64 {
        let [a, b, c, d] = self.corners;
        let triangles = [[a, b], [b, c], [c, d], [d, a]];
        triangles.iter().map(|&[p, q]| distance_to_triangle(x, &[p, q, self.centre])).fold(f64::INFINITY, f64::min)
    }

    /// Whether the faces lie in one plane and share more than [`OVERLAP`] of the smaller one.
    fn overlaps(&self, other: &Self) -> bool {
        let reach = TOUCH * self.size.min(other.size);
        let mut piece: Vec<Point3<f64>> = other.corners.to_vec();
        for k in 0..4 {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 4]);
            piece = cut(&piece, &a, &self.normal.cross(&(b - a)));
        }
        let is_in_plane = piece.iter().all(|x| self.normal.dot(&(x - self.centre)).abs() <= reach);
        is_in_plane && area(&piece) > OVERLAP * area(&self.corners).min(area(&other.corners))
    }
}

/// The part of a polygon on the inner side of the plane through `a`.
fn cut(polygon: &[Point3<f64>], a: &Point3<f64>, inward: &Vector3<f64>) -> Vec<Point3<f64>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, p) in polygon.iter().enumerate() {
        let q = &polygon[(i + 1) % polygon.len()];
        let (height, next) = (inward.dot(&(p - a)), inward.dot(&(q - a)));
        if height >= 0.0 {
            kept.push(*p);
        }
        if (height >= 0.0) != (next >= 0.0) {
            kept.push(p + (q - p) * (height / (height - next)));
        }
    }
    kept
}

fn area(polygon: &[Point3<f64>]) -> f64 {
    let Some((first, rest)) = polygon.split_first() else { return 0.0 };
    let doubled: Vector3<f64> = rest.windows(2).map(|pair| (pair[0] - first).cross(&(pair[1] - first))).sum();
    0.5 * doubled.norm()
}
