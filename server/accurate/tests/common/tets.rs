//! Tetrahedra made from hexahedra.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3, center};
use plica_accurate::{Constraints, Material, Solid};
use plica_geometry::tetrahedron::EDGES;
use plica_geometry::{HexMesh, NodeIdx, TetMesh, Tets};

/// Corners of the six tetrahedra of a hexahedron along the diagonal from corner 0 to 6: neighbours of a block share whole faces.
const SIX: [[usize; 4]; 6] = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]];

/// Six 4-node tetrahedra per hexahedron of a block.
pub fn linear(mesh: &HexMesh) -> TetMesh {
    let tets = mesh.hexes().iter().flat_map(|hex| SIX.map(|corners| corners.map(|corner| hex[corner])));
    TetMesh::new(mesh.nodes().to_vec(), Tets::Linear(tets.collect())).unwrap()
}

/// Six 10-node tetrahedra per hexahedron of a block; all nodes, those on edges too, are then moved.
pub fn quadratic(mesh: &HexMesh, place: impl Fn(&Point3<f64>) -> Point3<f64>) -> TetMesh {
    let Tets::Linear(corners) = linear(mesh).tets().clone() else { panic!("4 nodes each") };
    let mut nodes = mesh.nodes().to_vec();
    let mut middles: HashMap<[NodeIdx; 2], NodeIdx> = HashMap::new();
    let mut middle = |a: NodeIdx, b: NodeIdx| {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            nodes.push(center(&nodes[a.index()], &nodes[b.index()]));
            NodeIdx::from_index(nodes.len() - 1)
        })
    };
    let mut tets = Vec::with_capacity(corners.len());
    for tet in corners {
        let on_edges = EDGES.map(|[a, b]| middle(tet[a], tet[b]));
        tets.push(std::array::from_fn(|k| if k < 4 { tet[k] } else { on_edges[k - 4] }));
    }
    TetMesh::new(nodes.iter().map(place).collect(), Tets::Quadratic(tets)).unwrap()
}

pub fn solid(mesh: &TetMesh, material: Material) -> Solid {
    Solid::of_tetrahedra(mesh, &vec![material; mesh.n_tets()]).unwrap()
}

pub fn rest(mesh: &TetMesh) -> Vec<Vector3<f64>> {
    mesh.nodes().iter().map(|x| x.coords).collect()
}

/// Holds the nodes that `is_held` accepts at their `positions`.
pub fn hold(mesh: &TetMesh, positions: &[Vector3<f64>], is_held: impl Fn(&Point3<f64>) -> bool) -> Constraints {
    let mut constraints = Constraints::none(mesh.n_nodes());
    let held = mesh.nodes().iter().enumerate().filter(|(_, x)| is_held(x));
    held.for_each(|(node, _)| constraints.hold(node, &positions[node]));
    constraints
}
