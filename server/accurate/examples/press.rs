//! Times the accurate solver on the wedge pressed by an imprint of a ball, and counts its Newton steps:
//!
//! `cargo run --release -p plica-accurate --example press [nx ny nz]`

use std::ops::ControlFlow;
use std::time::Instant;

use nalgebra::{Point3, Vector3};
use plica_accurate::{
    Constraints, Energy, Hessian, Material, MaterialModel, Params, Projection, Solid, Solver, Tie, TieOptions,
    TieTarget,
};
use plica_geometry::shapes::{Wedge, wedge};
use plica_geometry::{Embedding, EmbeddingKind, HexMesh, VertexIdx};

const RADIUS_M: f64 = 7e-3;
const SPACING_M: f64 = 2e-3;
const MODELS: [MaterialModel; 3] =
    [MaterialModel::Linear, MaterialModel::CompressibleNeoHookean, MaterialModel::StableNeoHookean];

/// Where the ball presses, how deep and how far it drags.
#[derive(Debug, Clone, Copy)]
struct Press {
    at_m: [f64; 2],
    depth_share: f64,
    drag_m: [f64; 2],
}

const PRESSES: [Press; 6] = [
    Press { at_m: [0.05, 0.03], depth_share: 0.10, drag_m: [0.0, 0.0] },
    Press { at_m: [0.05, 0.03], depth_share: 0.20, drag_m: [0.003, 0.0] },
    Press { at_m: [0.03, 0.02], depth_share: 0.25, drag_m: [0.0, -0.004] },
    Press { at_m: [0.07, 0.04], depth_share: 0.30, drag_m: [0.005, 0.0] },
    Press { at_m: [0.03, 0.04], depth_share: 0.35, drag_m: [0.0, 0.0] },
    Press { at_m: [0.06, 0.03], depth_share: 0.35, drag_m: [-0.003, 0.004] },
];

fn main() {
    let numbers: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let divisions = <[usize; 3]>::try_from(numbers).unwrap_or([32, 16, 8]);
    let mesh = wedge(&Wedge::default(), divisions);
    println!("wedge {divisions:?}: {} hexahedra, {} nodes", mesh.n_hexes(), mesh.n_nodes());
    for model in MODELS {
        time(&mesh, model);
    }
}

fn time(mesh: &HexMesh, model: MaterialModel) {
    let material = Material { model, young_modulus_pa: 3e4, poisson_ratio: 0.48 };
    let solid = Solid::uniform(mesh, material).expect("a valid material");
    let constraints = bottom_held(mesh);
    let start = Instant::now();
    let mut solver = Solver::new(&constraints, &[&solid]).expect("memory for the factor");
    let (n_unknowns, n_values) = solver.size();
    println!("{model:?}: {n_unknowns} unknowns, {n_values} values of the factor, analysed in {:.0} ms", ms(start));
    let rest: Vec<_> = mesh.nodes().iter().map(|x| x.coords).collect();
    let pressed: Vec<_> = rest.iter().map(|x| x.component_mul(&Vector3::new(1.0, 1.0, 0.9))).collect();
    for projection in [Projection::Exact, Projection::PositiveSemidefinite] {
        let start = Instant::now();
        let hessian = Hessian::assemble(&[&solid], &constraints, &pressed, projection);
        println!("  assembly, {projection:?}, with its pattern: {:.0} ms", ms(start));
        drop(hessian);
    }
    for press in PRESSES {
        let tie = imprint(mesh, &press, &TieOptions::for_modulus(material.young_modulus_pa));
        let mut x = rest.clone();
        let start = Instant::now();
        let mut history = Vec::new();
        let energies: [&dyn Energy; 2] = [&solid, &tie];
        let result = solver.minimise(&energies, &constraints, &Params::default(), &mut x, &mut |progress| {
            history.push(format!("{:.0e}", progress.residual));
            ControlFlow::Continue(())
        });
        let name = format!("depth {:.0} %, drag {:?}", 100.0 * press.depth_share, press.drag_m);
        match result {
            Ok(info) => println!(
                "  {name}: {} tied, {} steps, {} indefinite, {} halvings, smallest J {:.3}, {:.0} ms; {}",
                tie.n_tied(),
                info.iterations,
                info.indefinite_steps,
                info.halvings,
                info.smallest_jacobian.unwrap_or(f64::NAN),
                ms(start),
                history.join(" ")
            ),
            Err(error) => println!("  {name}: {error}; {}", history.join(" ")),
        }
    }
}

fn bottom_held(mesh: &HexMesh) -> Constraints {
    let mut constraints = Constraints::none(mesh.n_nodes());
    for (node, x) in mesh.nodes().iter().enumerate().filter(|(_, x)| x.z == 0.0) {
        constraints.hold(node, &x.coords);
    }
    constraints
}

/// A tie to the surface that a ball leaves in a half space [Hertz], moved along by the drag.
fn imprint(mesh: &HexMesh, press: &Press, options: &TieOptions) -> Tie {
    let wedge = Wedge::default();
    let depth = press.depth_share * wedge.height_m(press.at_m[0]);
    let radius_squared = RADIUS_M * depth;
    let count = |extent: f64| (extent / SPACING_M) as usize;
    let (mut points, mut targets) = (Vec::new(), Vec::new());
    for j in 0..=count(wedge.width_m) {
        for i in 0..=count(wedge.length_m) {
            let (x, y) = (i as f64 * SPACING_M, j as f64 * SPACING_M);
            let r_squared = (x - press.at_m[0]).powi(2) + (y - press.at_m[1]).powi(2);
            let ratio = r_squared / radius_squared;
            let sink = if ratio <= 1.0 { depth - r_squared / (2.0 * RADIUS_M) } else { depth * outside(ratio) };
            let gap_m = r_squared / (2.0 * RADIUS_M) - depth + sink;
            let point = Point3::new(x, y, wedge.height_m(x));
            let position = point.coords + Vector3::new(press.drag_m[0], press.drag_m[1], -sink);
            let vertex = VertexIdx::from_index(points.len());
            targets.push(TieTarget { vertex, gap_m, area_m2: SPACING_M * SPACING_M, position });
            points.push(point);
        }
    }
    let embedding = Embedding::new(mesh, &points, EmbeddingKind::Trilinear).expect("points on the wedge");
    Tie::new(&embedding, &targets, options)
}

/// Sink over depth outside the contact, at `ratio = r^2 / a^2`.
fn outside(ratio: f64) -> f64 {
    ((2.0 - ratio) * (1.0 / ratio.sqrt()).asin() + (ratio - 1.0).sqrt()) / std::f64::consts::PI
}

fn ms(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
