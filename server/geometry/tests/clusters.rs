//! Clusters: a permutation of the skin whose runs of 64 vertices are compact.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::collections::HashSet;

use common::{default_skin, default_wedge};
use nalgebra::Point3;
use plica_geometry::shapes::block_skin;
use plica_geometry::{CLUSTER_SIZE, Embedding, EmbeddingKind, Skin};

fn bits(x: &Point3<f64>) -> [u64; 3] {
    [x.x.to_bits(), x.y.to_bits(), x.z.to_bits()]
}

/// Triangles by the positions of their corners, the least corner first: independent of any vertex order.
fn triangles_by_position(skin: &Skin) -> HashSet<[[u64; 3]; 3]> {
    let turned = |mut corners: [[u64; 3]; 3]| {
        let least = (0..3).min_by_key(|&k| corners[k]).unwrap();
        corners.rotate_left(least);
        corners
    };
    skin.triangles().iter().map(|t| turned(t.map(|v| bits(&skin.positions()[v.index()])))).collect()
}

#[test]
fn clusters_hold_every_vertex_once_and_leave_the_surface_as_it_is() {
    let skin = default_skin();
    let clustered = skin.clone().clustered();
    let positions = |skin: &Skin| skin.positions().iter().map(bits).collect::<HashSet<_>>();
    assert_eq!(positions(&skin).len(), skin.n_vertices(), "no two vertices coincide");
    assert_eq!(clustered.n_vertices(), skin.n_vertices());
    assert_eq!(positions(&clustered), positions(&skin));
    assert_eq!(triangles_by_position(&clustered), triangles_by_position(&skin));
    assert_ne!(clustered.positions(), skin.positions());
    Skin::new(clustered.positions().to_vec(), clustered.triangles().to_vec()).unwrap();
}

#[test]
fn clustering_is_repeatable() {
    assert_eq!(default_skin().clustered(), default_skin().clustered());
}

#[test]
fn a_skin_of_one_cluster_keeps_its_order() {
    let skin = block_skin([0.01, 0.01, 0.01], 0.008);
    assert!(skin.n_vertices() <= CLUSTER_SIZE, "{} vertices", skin.n_vertices());
    assert_eq!(skin.clone().clustered().positions(), skin.positions());
}

/// Mean and greatest number of nodes per cluster.
fn node_list_lengths(skin: &Skin, kind: EmbeddingKind) -> (f64, usize) {
    let embedding = Embedding::new(&default_wedge(), skin.positions(), kind).unwrap();
    let lengths: Vec<usize> = embedding.node_lists(CLUSTER_SIZE).iter().map(Vec::len).collect();
    (lengths.iter().sum::<usize>() as f64 / lengths.len() as f64, *lengths.iter().max().unwrap())
}

#[test]
fn clustering_shortens_the_node_lists_of_the_wedge() {
    let (mean_before, max_before) = node_list_lengths(&default_skin(), EmbeddingKind::default());
    let (mean, max) = node_list_lengths(&default_skin().clustered(), EmbeddingKind::default());
    let (mean_trilinear, max_trilinear) = node_list_lengths(&default_skin().clustered(), EmbeddingKind::Trilinear);
    println!("nodes per cluster, mean / max: {mean:.1} / {max} (grid order {mean_before:.1} / {max_before})");
    println!("the same, trilinear: {mean_trilinear:.1} / {max_trilinear}");
    assert!(mean < 46.0 && max < 90, "moving least squares: {mean} / {max}");
    assert!(mean_trilinear < 16.0, "trilinear: {mean_trilinear}");
}

/// Clusters that hold both vertices facing up and vertices facing down.
#[test]
fn clusters_keep_top_and_bottom_apart() {
    let skin = default_skin().clustered();
    let normals = skin.vertex_normals();
    let mixed =
        |normals: &[nalgebra::Vector3<f64>]| normals.iter().any(|n| n.z > 0.5) && normals.iter().any(|n| n.z < -0.5);
    let n_mixed = normals.chunks(CLUSTER_SIZE).filter(|run| mixed(run)).count();
    let n_clusters = normals.len().div_ceil(CLUSTER_SIZE);
    assert!(n_mixed <= 3, "{n_mixed} of {n_clusters} clusters mix top and bottom");
}
