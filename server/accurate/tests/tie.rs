//! Tie to a coarse imprint: meaning of its parameters, smooth release of vertices.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use common::{assert_close, distance, material, rest, sides, solve};
use nalgebra::{Point3, Vector3};
use plica_accurate::{Constraints, Energy, MaterialModel, Params, Solid, TIE_VERSION, Tie, TieOptions, TieTarget};
use plica_geometry::shapes::block;
use plica_geometry::{Embedding, EmbeddingKind, HexMesh, VertexIdx};

const SIZE: [f64; 3] = [0.04, 0.04, 0.02];
const E: f64 = 3e4;
const RADIUS_M: f64 = 7e-3;

/// A block held at its bottom and tied at points of its top.
struct Scene {
    mesh: HexMesh,
    solid: Solid,
    constraints: Constraints,
    embedding: Embedding,
    points: Vec<Point3<f64>>,
    spacing_m: f64,
}

impl Scene {
    fn new(spacing_m: f64) -> Self {
        let mesh = block(SIZE, [10, 10, 5]);
        let solid = Solid::uniform(&mesh, material(MaterialModel::StableNeoHookean, E, 0.48)).unwrap();
        let mut constraints = Constraints::none(mesh.n_nodes());
        for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| sides(x, SIZE)[2][0]) {
            constraints.hold(node, &x.coords);
        }
        let n = (SIZE[0] / spacing_m).round() as usize;
        let at = |i: usize| (i as f64 + 0.5) * spacing_m;
        let points: Vec<_> = (0..n * n).map(|i| Point3::new(at(i % n), at(i / n), SIZE[2])).collect();
        let embedding = Embedding::new(&mesh, &points, EmbeddingKind::Trilinear).unwrap();
        Self { mesh, solid, constraints, embedding, points, spacing_m }
    }

    /// The surface that a ball at `x` on the middle line leaves in a half space, 2 mm deep.
    fn targets(&self, x: f64) -> Vec<TieTarget> {
        let depth = 2e-3;
        let target = |(v, point): (usize, &Point3<f64>)| {
            let r_squared = (point.x - x).powi(2) + (point.y - 0.5 * SIZE[1]).powi(2);
            let sink = depth * hertz(r_squared / (RADIUS_M * depth));
            TieTarget {
                vertex: VertexIdx::from_index(v),
                gap_m: r_squared / (2.0 * RADIUS_M) - depth + sink,
                area_m2: self.spacing_m.powi(2),
                position: point.coords - Vector3::new(0.0, 0.0, sink),
            }
        };
        self.points.iter().enumerate().map(target).collect()
    }

    fn solve(&self, targets: &[TieTarget], options: &TieOptions) -> (Vec<Vector3<f64>>, Tie) {
        let tie = Tie::new(&self.embedding, targets, options);
        let energies: [&dyn Energy; 2] = [&self.solid, &tie];
        let mut x = rest(&self.mesh);
        solve(&energies, &self.constraints, &Params::default(), &mut x).unwrap();
        (x, tie)
    }

    fn surface(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        self.embedding.apply(x)
    }
}

/// Sink over depth under a paraboloid at `ratio = r^2 / a^2`, `a` being the radius of the contact.
fn hertz(ratio: f64) -> f64 {
    if ratio <= 1.0 {
        return 1.0 - 0.5 * ratio;
    }
    ((2.0 - ratio) * (1.0 / ratio.sqrt()).asin() + (ratio - 1.0).sqrt()) / std::f64::consts::PI
}

#[test]
fn share_falls_by_equal_factors() {
    let options = TieOptions::for_modulus(E);
    assert_eq!((options.share(-1.0), options.share(0.0)), (1.0, 1.0));
    assert_eq!(options.share(options.band_m), 0.0);
    let shares: Vec<f64> = (0..10).map(|i| options.share(i as f64 / 10.0 * options.band_m)).collect();
    for pair in shares.windows(2) {
        assert_close(pair[1] / pair[0], options.rim_floor.powf(0.1), 1e-12, "factor");
    }
    assert_close(options.share(options.band_m * (1.0 - 1e-9)), options.rim_floor, 1e-6, "at the rim");
}

/// A change of the numbers below changes every database: raise the version too.
#[test]
fn version_1_is_this() {
    let options = TieOptions::for_modulus(E);
    let expected = TieOptions { young_modulus_pa: E, compliance_m: 2e-5, band_m: 1e-3, rim_floor: 1e-4 };
    assert_eq!((TIE_VERSION, options), (1, expected));
    let scene = Scene::new(2e-3);
    let mut target = scene.targets(0.02)[0];
    target.position = scene.points[0].coords + Vector3::new(0.0, 0.0, 1e-3);
    for (gap_m, share) in [(-1e-3, 1.0), (5e-4, 1e-2)] {
        let tie = Tie::new(&scene.embedding, &[TieTarget { gap_m, ..target }], &options);
        let stiffness = E / 2e-5 * 4e-6 * share;
        assert_close(tie.value(&rest(&scene.mesh)), 0.5 * stiffness * 1e-6, 1e-9, "energy");
        assert_close(tie.force(&rest(&scene.mesh)).z, stiffness * 1e-3, 1e-9, "force");
    }
}

#[test]
fn the_surface_follows_the_imprint() {
    let scene = Scene::new(2e-3);
    let (x, tie) = scene.solve(&scene.targets(0.02), &TieOptions::for_modulus(E));
    let full = tie.misses(&x).map(|(_, k)| k).fold(0.0, f64::max);
    let worst = tie.misses(&x).filter(|(_, k)| *k == full).map(|(miss, _)| miss).fold(0.0, f64::max);
    println!("{} vertices tied; those in contact miss by {:.3} mm at most", tie.n_tied(), worst * 1e3);
    assert!(worst <= 2e-4, "{worst}");
    assert!(tie.force(&x).z < -0.1, "the tie pushes down: {}", tie.force(&x));
}

/// A surface with four times the vertices, each with a quarter of the area, is the same tie.
#[test]
fn the_answer_does_not_depend_on_the_density_of_vertices() {
    let options = TieOptions::for_modulus(E);
    let [(coarse, a), (fine, b)] = [1e-3, 5e-4].map(|spacing_m| {
        let scene = Scene::new(spacing_m);
        scene.solve(&scene.targets(0.02), &options)
    });
    let force = a.force(&coarse).z / b.force(&fine).z;
    println!(
        "1 mm against 0.5 mm: nodes differ by {:.3} mm, forces by a factor of {force:.4}",
        distance(&coarse, &fine) * 1e3
    );
    assert!(distance(&coarse, &fine) <= 1e-4 && (force - 1.0).abs() <= 0.03);
}

/// The imprint slides by a vertex spacing in small steps, while vertices enter and leave. Largest second difference of the
/// surface against that of a tie whose stiffness falls linearly over the same band: the study's jumps.
#[test]
fn vertices_enter_and_leave_gently() {
    let scene = Scene::new(2e-3);
    let options = TieOptions::for_modulus(E);
    let jump = |tie: &dyn Fn(&[TieTarget]) -> Vec<Vector3<f64>>| {
        let path: Vec<_> = (0..=20).map(|i| tie(&scene.targets(0.019 + 1e-4 * i as f64))).collect();
        let second = |i: usize, v: usize| (path[i - 1][v] - path[i][v] * 2.0 + path[i + 1][v]).norm();
        (1..20)
            .flat_map(|i| (0..scene.points.len()).map(move |v| (i, v)))
            .map(|(i, v)| second(i, v))
            .fold(0.0, f64::max)
    };
    let by_log = jump(&|targets| scene.surface(&scene.solve(targets, &options).0));
    let by_line = jump(&|targets| {
        let linear = targets.iter().map(|t| {
            let share = (1.0 - t.gap_m.max(0.0) / options.band_m).max(0.0);
            TieTarget { area_m2: t.area_m2 * share, gap_m: if share > 0.0 { 0.0 } else { 1.0 }, ..*t }
        });
        scene.surface(&scene.solve(&linear.collect::<Vec<_>>(), &options).0)
    });
    println!(
        "largest second difference on a slide: {:.4} mm with the logarithm, {:.4} mm linear",
        by_log * 1e3,
        by_line * 1e3
    );
    assert!(by_log < 0.5 * by_line, "{by_log} against {by_line}");
}
