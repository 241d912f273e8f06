//! Scenes and drivers shared by the tests of the run-time phase.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "each test binary uses a part of this, and a broken scene should fail loudly"
)]

pub mod examples;
pub mod forces;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use plica_geometry::shapes::{Wedge, block, block_skin, wedge, wedge_skin};
use plica_geometry::{Embedding, EmbeddingKind, HexMesh, Skin};
use plica_sim::*;

/// A scene under construction: the wedge of the design unless changed.
#[derive(Clone)]
pub struct Scene {
    pub description: ModelDescription,
}

pub const E: f64 = 3e4;

pub fn material(young_modulus_pa: f64, poisson_ratio: f64) -> Material {
    Material { young_modulus_pa, poisson_ratio, density_kg_per_m3: 1000.0 }
}

pub fn ball(radius_m: f64) -> ToolDescription {
    tool("ball", ToolShape::Ball { radius_m })
}

/// A rigid, frictionless tool that follows every pose at once.
pub fn tool(name: &str, shape: ToolShape) -> ToolDescription {
    ToolDescription {
        name: name.into(),
        shape,
        coupling: Coupling::Rigid,
        friction: 0.0,
        sampling: Sampling::Latest,
        max_tool_speed_m_per_s: 10.0,
        stale_after_s: 0.2,
        world_from_tracker: Isometry3::identity(),
        tool_from_marker: Isometry3::identity(),
        position_scale: 1.0,
    }
}

pub fn spring() -> SpringCoupling {
    SpringCoupling::default()
}

impl Scene {
    pub fn on(mesh: HexMesh, skin: Skin, young_modulus_pa: f64, poisson_ratio: f64) -> Self {
        let skin = skin.clustered();
        let embedding =
            Embedding::new(&mesh, skin.positions(), EmbeddingKind::MovingLeastSquares { support_cells: 1.75 }).unwrap();
        let fixed = mesh.nodes().iter().map(|p| p.z < 1e-9).collect();
        let materials = vec![material(young_modulus_pa, poisson_ratio); mesh.n_hexes()];
        let description = ModelDescription {
            mesh,
            skin,
            embedding,
            fixed,
            materials,
            mass_damping_per_s: 1.0,
            gravity_m_per_s2: Vector3::zeros(),
            element: ElementKind::EnhancedStrain,
            timestep_s: 1e-3,
            substeps: 1,
            solver: SolverOptions::default(),
            contact: ContactOptions::default(),
            sleep: SleepOptions { enabled: false, ..SleepOptions::default() },
            tools: Vec::new(),
            planes: Vec::new(),
            bounds_m: None,
        };
        Self { description }
    }

    pub fn wedge(young_modulus_pa: f64, poisson_ratio: f64) -> Self {
        let shape = Wedge::default();
        Self::on(wedge(&shape, [8, 4, 4]), wedge_skin(&shape, 1.22e-3), young_modulus_pa, poisson_ratio)
    }

    /// 80 x 40 x 40 mm, 8 x 4 x 4.
    pub fn block(young_modulus_pa: f64, poisson_ratio: f64) -> Self {
        let size = [0.08, 0.04, 0.04];
        Self::on(block(size, [8, 4, 4]), block_skin(size, 1.5e-3), young_modulus_pa, poisson_ratio)
    }

    pub fn with(mut self, change: impl FnOnce(&mut ModelDescription)) -> Self {
        change(&mut self.description);
        self
    }

    pub fn tool(self, tool: ToolDescription) -> Self {
        self.with(|d| d.tools.push(tool))
    }

    pub fn timestep(self, h: f64) -> Self {
        self.with(|d| d.timestep_s = h)
    }

    pub fn run(self) -> Run {
        Run::new(Model::new(self.description).unwrap())
    }
}

/// A model with its state and clock.
pub struct Run {
    pub model: Model,
    pub state: State,
    pub workspace: Workspace,
    pub clock_s: f64,
    pub sequence: u64,
}

impl Run {
    pub fn new(model: Model) -> Self {
        let (state, workspace) = (State::new(&model), Workspace::new(&model));
        Self { model, state, workspace, clock_s: 0.0, sequence: 0 }
    }

    /// One tick with the tools at these poses.
    pub fn tick(&mut self, poses: &[(usize, Isometry3<f64>)]) -> TickReport {
        self.sequence += 1;
        let source_time_ns = Some((self.clock_s * 1e9) as u64);
        let sample = |pose| PoseSample { sequence: self.sequence, source_time_ns, valid: true, pose };
        let poses: Vec<ToolPose> = poses.iter().map(|&(tool, pose)| ToolPose { tool, sample: sample(pose) }).collect();
        let input = TickInput { clock_s: self.clock_s, poses: &poses };
        let report = tick(&self.model, input, &mut self.state, &mut self.workspace, &mut NoProbe);
        self.clock_s += self.model.timestep_s();
        report
    }

    /// Moves tool 0 along a straight line within `seconds`, without turning.
    pub fn glide(&mut self, from: Point3<f64>, to: Point3<f64>, seconds: f64, mut each: impl FnMut(&Run, &TickReport)) {
        let n = (seconds / self.model.timestep_s()).round() as usize;
        for k in 1..=n {
            let p = from + (to - from) * (k as f64 / n as f64);
            let report = self.tick(&[(0, at(p))]);
            each(self, &report);
        }
    }

    pub fn hold(&mut self, p: Point3<f64>, seconds: f64, each: impl FnMut(&Run, &TickReport)) {
        self.glide(p, p, seconds, each);
    }

    pub fn skin(&self) -> Vec<Point3<f64>> {
        let mut out = vec![[0.0; 3]; self.model.n_skin()];
        self.state.write_skin(&self.model, &mut out);
        out.iter().map(|p| Point3::new(p[0] as f64, p[1] as f64, p[2] as f64)).collect()
    }

    pub fn offsets(&self) -> Vec<Vector3<f64>> {
        let mut out = vec![[0.0; 3]; self.model.n_skin()];
        self.state.write_skin_offsets(&self.model, &mut out);
        out.iter().map(|p| Vector3::new(p[0] as f64, p[1] as f64, p[2] as f64)).collect()
    }

    pub fn force(&self) -> Vector3<f64> {
        self.state.tools()[0].contact_force_n
    }

    /// Depth of the deepest point of the skin's triangles below a ball's surface, sampled finely [m].
    pub fn ball_penetration(&self, center: Point3<f64>, radius: f64) -> f64 {
        let skin = self.skin();
        let triangles = self.model.description().skin.triangles();
        triangles
            .iter()
            .map(|t| radius - (closest_on_triangle(center, t.map(|v| skin[v.index()])) - center).norm())
            .fold(0.0, f64::max)
    }
}

pub fn at(p: Point3<f64>) -> Isometry3<f64> {
    Isometry3::translation(p.x, p.y, p.z)
}

pub fn turned(p: Point3<f64>, axis_angle: Vector3<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(p.into(), UnitQuaternion::from_scaled_axis(axis_angle))
}

/// Height of the wedge's top face at `x` [m].
pub fn top(x: f64) -> f64 {
    Wedge::default().height_m(x)
}

/// Outward normal of the wedge's top face.
pub fn top_normal() -> Vector3<f64> {
    Vector3::new(0.030, 0.0, 0.120).normalize()
}

/// [Ericson05, 5.1.5], by clamping onto the plane and then onto each edge.
pub fn closest_on_triangle(p: Point3<f64>, [a, b, c]: [Point3<f64>; 3]) -> Point3<f64> {
    let n = (b - a).cross(&(c - a));
    let inside = |q: &Point3<f64>| [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (e - s).cross(&(q - s)).dot(&n) >= 0.0);
    let foot = p - n * ((p - a).dot(&n) / n.norm_squared());
    if inside(&foot) {
        return foot;
    }
    let on_edge =
        |s: Point3<f64>, e: Point3<f64>| s + (e - s) * ((p - s).dot(&(e - s)) / (e - s).norm_squared()).clamp(0.0, 1.0);
    [on_edge(a, b), on_edge(b, c), on_edge(c, a)]
        .into_iter()
        .min_by(|x, y| (x - p).norm().total_cmp(&(y - p).norm()))
        .unwrap()
}

/// Relative difference of two displacement fields in the 2-norm.
pub fn relative(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum();
    (difference / b.iter().map(|b| b.norm_squared()).sum::<f64>()).sqrt()
}

/// Elastic nodal forces of the corotated elements in `f64`, rotations by singular value decomposition, `[n_nodes]` [N].
pub fn elastic_forces(run: &Run) -> Vec<Vector3<f64>> {
    let d = run.model.description();
    let u = run.state.node_displacements(&run.model);
    let mut forces = vec![Vector3::zeros(); d.mesh.n_nodes()];
    for (hex, material) in d.mesh.hexes().iter().zip(&d.materials) {
        let rest = hex.map(|n| d.mesh.nodes()[n.index()]);
        let stiffness = rest_stiffness(&rest, material, d.element);
        let now: [Vector3<f64>; 8] = std::array::from_fn(|a| rest[a].coords + u[hex[a].index()]);
        let r = center_rotation(&rest, &now);
        let mut local = nalgebra::SVector::<f64, 24>::zeros();
        for a in 0..8 {
            local.fixed_rows_mut::<3>(3 * a).copy_from(&(r.transpose() * now[a] - rest[a].coords));
        }
        let f = stiffness * local;
        for a in 0..8 {
            forces[hex[a].index()] -= r * f.fixed_rows::<3>(3 * a);
        }
    }
    forces
}

/// Polar rotation of the deformation gradient at the element's centre.
pub fn center_rotation(rest: &[Point3<f64>; 8], now: &[Vector3<f64>; 8]) -> nalgebra::Matrix3<f64> {
    let gradients = plica_geometry::isoparametric::shape_gradients([0.0; 3]);
    let by = |x: &dyn Fn(usize) -> Vector3<f64>| -> nalgebra::Matrix3<f64> {
        (0..8).map(|a| x(a) * Vector3::from(gradients[a]).transpose()).sum()
    };
    let f = by(&|a| now[a]) * by(&|a| rest[a].coords).try_inverse().unwrap();
    let svd = f.svd(true, true);
    let (u, v_t) = (svd.u.unwrap(), svd.v_t.unwrap());
    let sign = (u * v_t).determinant().signum();
    u * nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t
}

/// Force that the fixed nodes exert on the object [N].
pub fn reaction(run: &Run) -> Vector3<f64> {
    let forces = elastic_forces(run);
    let fixed = &run.model.description().fixed;
    forces.iter().zip(fixed).filter(|(_, fixed)| **fixed).map(|(f, _)| -f).sum()
}

/// Elastic plus kinetic energy, `f64` [J].
pub fn energy(run: &Run) -> f64 {
    let d = run.model.description();
    let (u, v) = (run.state.node_displacements(&run.model), run.state.node_velocities(&run.model));
    let mut total = 0.0;
    for (hex, material) in d.mesh.hexes().iter().zip(&d.materials) {
        let rest = hex.map(|n| d.mesh.nodes()[n.index()]);
        let now: [Vector3<f64>; 8] = std::array::from_fn(|a| rest[a].coords + u[hex[a].index()]);
        let r = center_rotation(&rest, &now);
        let mut local = nalgebra::SVector::<f64, 24>::zeros();
        for a in 0..8 {
            local.fixed_rows_mut::<3>(3 * a).copy_from(&(r.transpose() * now[a] - rest[a].coords));
        }
        total += 0.5 * local.dot(&(rest_stiffness(&rest, material, d.element) * local));
        let mass = lumped_mass(&rest, material.density_kg_per_m3);
        total += (0..8).map(|a| 0.5 * mass[a] * v[hex[a].index()].norm_squared()).sum::<f64>();
    }
    total
}

/// Deepest point of the skin's triangles below the surface of a convex tool given by its half-spaces `n . x <= o` in the
/// world, sampled at barycentric steps of 1/8 [m].
pub fn polytope_penetration(run: &Run, planes: &[(Vector3<f64>, f64)]) -> f64 {
    let skin = run.skin();
    let mut deepest: f64 = 0.0;
    for t in run.model.description().skin.triangles() {
        let [a, b, c] = t.map(|v| skin[v.index()].coords);
        for i in 0..=8 {
            for j in 0..=8 - i {
                let (s, t) = (i as f64 / 8.0, j as f64 / 8.0);
                let p = a + (b - a) * s + (c - a) * t;
                let outside = planes.iter().map(|(n, o)| n.dot(&p) - o).fold(f64::NEG_INFINITY, f64::max);
                deepest = deepest.max(-outside);
            }
        }
    }
    deepest
}

/// A small generator of repeatable numbers (an LCG, upper bits).
pub struct Random(pub u64);

impl Random {
    /// Uniform in [-1, 1).
    pub fn symmetric(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 30) as f64 - 1.0
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.symmetric(), self.symmetric(), self.symmetric())
    }
}

/// A block whose nodes are moved by up to `share` of a cell, the same way every time; those of its faces stay in them, so that
/// a regular skin fits.
pub fn distorted_block(size_m: [f64; 3], divisions: [usize; 3], share: f64) -> HexMesh {
    let mesh = block(size_m, divisions);
    let mut random = Random(7);
    let moved = |x: &Point3<f64>| {
        let step = random.vector() * share;
        x + Vector3::from_fn(|k, _| match x[k] < 1e-9 || x[k] > size_m[k] - 1e-9 {
            true => 0.0,
            false => step[k] * size_m[k] / divisions[k] as f64,
        })
    };
    HexMesh::new(mesh.nodes().iter().map(moved).collect(), mesh.hexes().to_vec()).unwrap()
}

/// Points of the golden spiral on the unit sphere.
pub fn golden_spiral(n: usize) -> impl Iterator<Item = Vector3<f64>> {
    (0..n).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / n as f64;
        let (sin, cos) = (2.399_963_229_728_653 * i as f64).sin_cos();
        Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    })
}
