//! Embedding: partition of unity, linear fields, transpose, gaps, smoothness, fall-back, errors of bad points.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{Random, default_skin, default_wedge, distorted_block, u_shape};
use nalgebra::{Matrix3, Point3, Vector3};
use plica_geometry::shapes::block;
use plica_geometry::{DEFAULT_SUPPORT_CELLS, Embedding, EmbeddingError, EmbeddingKind, HexMesh, NodeIdx, VertexIdx};
use proptest::prelude::*;

const KINDS: [EmbeddingKind; 2] =
    [EmbeddingKind::MovingLeastSquares { support_cells: DEFAULT_SUPPORT_CELLS }, EmbeddingKind::Trilinear];

fn support(support_cells: f64) -> EmbeddingKind {
    EmbeddingKind::MovingLeastSquares { support_cells }
}

/// Worst errors over the rows: of `sum_a phi_a = 1`, and of `sum_a phi_a x_a = x` in metres.
fn reproduction_errors(mesh: &HexMesh, points: &[Point3<f64>], embedding: &Embedding) -> (f64, f64) {
    let sums = (0..points.len()).map(|v| embedding.row(v).iter().map(|&(_, w)| w).sum::<f64>());
    let unity = sums.map(|sum| (sum - 1.0).abs()).fold(0.0, f64::max);
    let nodal: Vec<_> = mesh.nodes().iter().map(|x| x.coords).collect();
    let images = embedding.apply(&nodal);
    let linear = images.iter().zip(points).map(|(s, x)| (s - x.coords).norm()).fold(0.0, f64::max);
    (unity, linear)
}

#[test]
fn rows_sum_to_one_and_reproduce_linear_fields_on_the_wedge() {
    let (mesh, skin) = (default_wedge(), default_skin());
    for kind in KINDS {
        let embedding = Embedding::new(&mesh, skin.positions(), kind).unwrap();
        let (unity, linear) = reproduction_errors(&mesh, skin.positions(), &embedding);
        assert!(unity < 1e-12 && linear < 1e-12 * 0.12, "{kind:?}: {unity:e}, {linear:e}");
        assert_eq!(embedding.fallbacks(), []);
        assert_eq!((embedding.n_rows(), embedding.n_nodes()), (skin.n_vertices(), 225));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Random points in a distorted mesh, random supports and affine maps.
    #[test]
    fn affine_maps_are_reproduced_anywhere(
        share in prop::array::uniform3(0.0..1.0_f64),
        support_cells in 1.2..3.0_f64,
        seed in any::<u64>(),
    ) {
        let mesh = distorted_block();
        let mut random = Random(seed);
        let (matrix, shift) = (Matrix3::from_fn(|_, _| random.number()), random.vector());
        let point = Point3::new(0.001 + 0.038 * share[0], 0.001 + 0.028 * share[1], 0.001 + 0.028 * share[2]);
        let nodal: Vec<_> = mesh.nodes().iter().map(|x| matrix * x.coords + shift).collect();
        for kind in [support(support_cells), EmbeddingKind::Trilinear] {
            let image = Embedding::new(&mesh, &[point], kind).unwrap().apply(&nodal)[0];
            prop_assert!((image - (matrix * point.coords + shift)).norm() < 1e-12);
        }
    }
}

#[test]
fn the_transpose_is_consistent() {
    let (mesh, skin) = (default_wedge(), default_skin());
    let mut random = Random(5);
    for kind in KINDS {
        let embedding = Embedding::new(&mesh, skin.positions(), kind).unwrap();
        let (x, y) = (random.vectors(mesh.n_nodes()), random.vectors(skin.n_vertices()));
        let dot = |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        let (forward, backward) = (dot(&embedding.apply(&x), &y), dot(&x, &embedding.apply_transpose(&y)));
        assert!((forward - backward).abs() < 1e-11 * skin.n_vertices() as f64, "{forward} against {backward}");
    }
}

#[test]
fn forces_keep_their_sum_and_moment_through_the_transpose() {
    let (mesh, skin) = (default_wedge(), default_skin());
    let embedding = Embedding::new(&mesh, skin.positions(), EmbeddingKind::default()).unwrap();
    let forces = Random(6).vectors(skin.n_vertices());
    let nodal = embedding.apply_transpose(&forces);
    let sum = |forces: &[Vector3<f64>]| forces.iter().sum::<Vector3<f64>>();
    let moment = |at: &[Point3<f64>], forces: &[Vector3<f64>]| {
        at.iter().zip(forces).map(|(x, f)| x.coords.cross(f)).sum::<Vector3<f64>>()
    };
    assert!((sum(&nodal) - sum(&forces)).norm() < 1e-10);
    assert!((moment(mesh.nodes(), &nodal) - moment(skin.positions(), &forces)).norm() < 1e-11);
}

#[test]
fn a_rigid_motion_moves_the_skin_rigidly() {
    let (mesh, skin) = (default_wedge(), default_skin());
    let embedding = Embedding::new(&mesh, skin.positions(), EmbeddingKind::default()).unwrap();
    let motion = nalgebra::Isometry3::new(Vector3::new(0.3, -0.1, 0.2), Vector3::new(1.0, 2.0, -0.5));
    let moved: Vec<_> = mesh.nodes().iter().map(|x| (motion * x).coords).collect();
    let skinned = embedding.apply(&moved);
    let errors = skinned.iter().zip(skin.positions()).map(|(s, x)| (s - (motion * x).coords).norm());
    assert!(errors.fold(0.0, f64::max) < 1e-13);
}

#[test]
fn weights_per_row_stay_few_and_bounded() {
    let embedding = Embedding::new(&default_wedge(), default_skin().positions(), EmbeddingKind::default()).unwrap();
    let rows = || (0..embedding.n_rows()).map(|v| embedding.row(v));
    let mean = rows().map(<[_]>::len).sum::<usize>() as f64 / embedding.n_rows() as f64;
    let (least, most) = (rows().map(<[_]>::len).min().unwrap(), rows().map(<[_]>::len).max().unwrap());
    let magnitude = rows().map(|row| row.iter().map(|(_, w)| w.abs()).sum::<f64>()).fold(0.0, f64::max);
    println!("weights per row, mean / least / most: {mean:.1} / {least} / {most}; sum |phi| <= {magnitude:.2}");
    assert!(mean < 30.0 && least >= 4 && most < 60);
    assert!(magnitude < 1.6, "{magnitude}");
}

fn arm(x: &Point3<f64>) -> i32 {
    if x.x < 0.0201 { -1 } else { 1 }
}

/// On the U-shaped mesh (gap of one cell, support of 1.75 cells) a plain distance would bleed across the gap.
#[test]
fn a_gap_is_not_bridged() {
    let mesh = u_shape();
    let points = [Point3::new(0.02, 0.01, 0.045), Point3::new(0.03, 0.01, 0.045), Point3::new(0.018, 0.003, 0.06)];
    let embedding = Embedding::new(&mesh, &points, EmbeddingKind::default()).unwrap();
    let radius_m = DEFAULT_SUPPORT_CELLS * mesh.mean_longest_edge();
    for (v, x) in points.iter().enumerate() {
        let across = |node: NodeIdx| arm(&mesh.nodes()[node.index()]) != arm(x);
        let near = mesh.nodes().iter().filter(|node| (*node - x).norm() < radius_m && arm(node) != arm(x)).count();
        assert!(near > 0, "the other arm is within the radius of {x}");
        assert!(!embedding.row(v).iter().any(|&(node, _)| across(node)), "row {v} crosses the gap");
    }
    assert_eq!(embedding.fallbacks(), []);
}

/// The greatest change of any weight between neighbouring points of a line.
fn worst_jump(mesh: &HexMesh, from: Point3<f64>, to: Point3<f64>, n: usize, kind: EmbeddingKind) -> f64 {
    let points: Vec<_> = (0..=n).map(|i| from + (to - from) * (i as f64 / n as f64)).collect();
    let embedding = Embedding::new(mesh, &points, kind).unwrap();
    let dense = |v: usize| {
        let mut row = vec![0.0; mesh.n_nodes()];
        embedding.row(v).iter().for_each(|&(node, w)| row[node.index()] = w);
        row
    };
    let rows: Vec<_> = (0..=n).map(dense).collect();
    let change = |pair: &[Vec<f64>]| pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    rows.windows(2).map(change).fold(0.0, f64::max)
}

/// Weights change in proportion to the step, everywhere: a jump at an element border would not shrink with it.
#[test]
fn weights_are_continuous_across_element_borders() {
    let top = |x: f64, y: f64| Point3::new(x, y, 0.9 * (0.04 - 0.25 * x));
    let lines = [
        (default_wedge(), top(0.001, 0.003), top(0.119, 0.058)),
        (default_wedge(), Point3::new(0.1, 0.03, 0.0), Point3::new(0.1, 0.03, 0.0149)),
        (distorted_block(), Point3::new(0.003, 0.003, 0.003), Point3::new(0.037, 0.027, 0.027)),
        (u_shape(), Point3::new(0.019, 0.01, 0.059), Point3::new(0.019, 0.01, 0.001)),
        (u_shape(), Point3::new(0.001, 0.01, 0.009), Point3::new(0.049, 0.011, 0.009)),
    ];
    for (mesh, from, to) in lines {
        for kind in KINDS {
            let (coarse, fine) = (worst_jump(&mesh, from, to, 500, kind), worst_jump(&mesh, from, to, 5000, kind));
            println!("{kind:?}: greatest change per step {coarse:.2e}, ten times finer {fine:.2e}");
            assert!(fine < 0.13 * coarse, "{kind:?} {from} -> {to}: {coarse:e}, then {fine:e}");
        }
    }
}

/// Slopes of the weights are continuous too for moving least squares (and not for trilinear, which has kinks).
#[test]
fn moving_least_squares_has_no_kinks() {
    let mesh = default_wedge();
    let kink = |kind: EmbeddingKind| {
        let at = |x: f64| Point3::new(0.03 + x, 0.022, 0.03);
        let points: Vec<_> = [-2e-6, -1e-6, 0.0, 1e-6, 2e-6].map(at).to_vec();
        let embedding = Embedding::new(&mesh, &points, kind).unwrap();
        let nodal: Vec<_> = mesh.nodes().iter().map(|x| Vector3::new((90.0 * x.x).sin(), 0.0, 0.0)).collect();
        let s: Vec<_> = embedding.apply(&nodal).iter().map(|s| s.x).collect();
        ((s[3] - s[2]) - (s[2] - s[1])).abs() / 1e-6
    };
    let (smooth, kinked) = (kink(KINDS[0]), kink(KINDS[1]));
    println!("change of slope at an element border: {smooth:.1e} / m, trilinear {kinked:.1e} / m");
    assert!(smooth < 1e-2 && kinked > 1.0, "{smooth} and {kinked}");
}

#[test]
fn a_support_that_is_too_small_falls_back_to_trilinear_and_is_listed() {
    let mesh = block([0.04; 3], [4, 4, 4]);
    let points = [Point3::new(0.02, 0.02, 0.02), Point3::new(0.015, 0.015, 0.015), Point3::new(0.001, 0.02, 0.02)];
    let embedding = Embedding::new(&mesh, &points, support(0.9)).unwrap();
    assert_eq!(embedding.fallbacks(), [VertexIdx(0), VertexIdx(2)]);
    let trilinear = Embedding::new(&mesh, &points, EmbeddingKind::Trilinear).unwrap();
    assert_eq!(embedding.row(0), trilinear.row(0));
    assert_eq!(embedding.row(2), trilinear.row(2));
    assert_ne!(embedding.row(1), trilinear.row(1));
    let (unity, linear) = reproduction_errors(&mesh, &points, &embedding);
    assert!(unity < 1e-12 && linear < 1e-13);
}

/// At a node whose neighbours lie just within the radius the moment matrix is nearly singular.
#[test]
fn an_ill_conditioned_row_falls_back_too() {
    let mesh = block([0.04; 3], [4, 4, 4]);
    let node = [Point3::new(0.02, 0.02, 0.02)];
    let fallbacks = |cells: f64| Embedding::new(&mesh, &node, support(cells)).unwrap().fallbacks().len();
    assert_eq!([1.005, 1.3].map(fallbacks), [1, 0]);
}

#[test]
fn points_slightly_outside_are_embedded_and_reproduced() {
    let mesh = default_wedge();
    let points = [Point3::new(0.05, 0.03, -0.002), Point3::new(-0.003, 0.01, 0.02), Point3::new(0.121, 0.061, 0.004)];
    for kind in KINDS {
        let embedding = Embedding::new(&mesh, &points, kind).unwrap();
        let (unity, linear) = reproduction_errors(&mesh, &points, &embedding);
        assert!(unity < 1e-12 && linear < 1e-13, "{kind:?}: {unity:e}, {linear:e}");
    }
}

#[test]
fn points_far_outside_are_refused_with_their_numbers() {
    let mesh = block([0.1; 3], [5, 5, 5]);
    let points = [Point3::new(0.05, 0.05, 0.05), Point3::new(0.05, 0.05, 0.125)];
    for kind in KINDS {
        let error = Embedding::new(&mesh, &points, kind).unwrap_err();
        let EmbeddingError::Outside { point, position, limit_m } = error else { panic!("{error}") };
        assert_eq!((point, position), (VertexIdx(1), [0.05, 0.05, 0.125]));
        assert!((limit_m - 0.01).abs() < 1e-15);
    }
}

#[test]
fn bad_numbers_are_refused() {
    let mesh = block([0.1; 3], [5, 5, 5]);
    let points = [Point3::new(f64::NAN, 0.0, 0.0)];
    let error = Embedding::new(&mesh, &points, EmbeddingKind::Trilinear).unwrap_err();
    assert!(matches!(error, EmbeddingError::NonFinite { point: VertexIdx(0), .. }), "{error}");
    for support_cells in [0.0, -1.0, f64::INFINITY] {
        let error = Embedding::new(&mesh, &[], support(support_cells)).unwrap_err();
        assert_eq!(error, EmbeddingError::Support { support_cells });
    }
}

#[test]
fn node_lists_cover_their_rows() {
    let (mesh, skin) = (default_wedge(), default_skin());
    let embedding = Embedding::new(&mesh, skin.positions(), EmbeddingKind::default()).unwrap();
    let lists = embedding.node_lists(64);
    assert_eq!(lists.len(), skin.n_vertices().div_ceil(64));
    for v in 0..embedding.n_rows() {
        assert!(embedding.row(v).iter().all(|(node, _)| lists[v / 64].binary_search(node).is_ok()));
    }
}
