//! Frictionless contact with a rigid ball, exact: every skin triangle near the ball keeps its nearest point outside, and the
//! pressures solve a complementarity problem in contact space.
//!
//! `0 <= lambda  _|_  W lambda + b >= 0`, `W = J A^-1 J^T`.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Point3, Vector3};

use super::{Reference, Step};

/// Points nearer to the ball than this are constraints [m].
const BAND_M: f64 = 1.5e-3;

/// A rigid ball.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    pub center: Point3<f64>,
    pub radius: f64,
}

/// Skin vertices that carry a point of the skin; equal keys are the same corner, edge or triangle.
type Key = Vec<usize>;

/// A point of the skin and how far outside the ball it is.
struct Constraint {
    /// Row of `J`: nodes, each with its weight times the normal, as degrees of freedom.
    row: Vec<(usize, Vector3<f64>)>,
    gap: f64,
    pressure: f64,
    normal: Vector3<f64>,
}

impl Reference {
    /// Moves towards static equilibrium with the ball by at most `max_iterations` Newton steps. Returns the force on the ball [N]
    /// and the last step's largest displacement [m].
    ///
    /// The steps leave out the geometric stiffness of the contact, so that they descend to stable equilibria only.
    pub fn press(&mut self, ball: Ball, max_iterations: usize, tolerance: f64) -> (Vector3<f64>, f64) {
        let mut last = (Vector3::zeros(), f64::INFINITY);
        for _ in 0..max_iterations {
            let rotations = self.rotations();
            let step = Step {
                factor: self.matrix(&rotations, 0.0, 1.0).factor(),
                residual: self.to_dofs(&self.forces(&self.u, &rotations)),
            };
            let mut constraints = self.constraints(ball, &self.u);
            let du = solve(&step, &mut constraints, 1.0, None);
            let longest = du.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
            let share = (1e-3 / longest).min(1.0);
            for (u, dof) in self.u.iter_mut().zip(&self.dof_of_node) {
                if let Some(dof) = *dof {
                    *u += Vector3::new(du[dof], du[dof + 1], du[dof + 2]) * share;
                }
            }
            last = (-total(&constraints), longest);
            if longest < tolerance {
                break;
            }
        }
        last
    }

    /// One implicit step at whose end nothing is inside the ball. Returns the force on the ball [N].
    pub fn step_with_ball(&mut self, ball: Ball) -> Vector3<f64> {
        const LINEARISATIONS: usize = 3;
        let h = self.description.timestep_s;
        let step = self.prepare();
        let mut dv = vec![0.0; self.n_dofs];
        let mut force = Vector3::zeros();
        for _ in 0..LINEARISATIONS {
            let ahead: Vec<Vector3<f64>> = (0..self.u.len())
                .map(|n| {
                    let change =
                        self.dof_of_node[n].map_or(Vector3::zeros(), |d| Vector3::new(dv[d], dv[d + 1], dv[d + 2]));
                    self.u[n] + (self.v[n] + change) * h
                })
                .collect();
            let mut constraints = self.constraints(ball, &ahead);
            dv = solve(&step, &mut constraints, h, Some(&dv));
            force = -total(&constraints);
        }
        self.advance(&dv);
        force
    }

    /// The nearest point of every triangle within the band, each once.
    fn constraints(&self, ball: Ball, u: &[Vector3<f64>]) -> Vec<Constraint> {
        let d = &self.description;
        let offsets = d.embedding.apply(u);
        let skin: Vec<Point3<f64>> = d.skin.positions().iter().zip(&offsets).map(|(x, o)| x + o).collect();
        let mut found: BTreeMap<Key, Constraint> = BTreeMap::new();
        let reach = ball.radius + BAND_M;
        for triangle in d.skin.triangles() {
            let vertices = triangle.map(|v| v.index());
            let corners = vertices.map(|v| skin[v]);
            if (0..3).any(|k| {
                corners.iter().all(|c| {
                    (c[k] - ball.center[k]).abs() > reach && (c[k] > ball.center[k]) == (corners[0][k] > ball.center[k])
                })
            }) {
                continue;
            }
            let weights = nearest_weights(ball.center, &corners);
            let point: Vector3<f64> = corners.iter().zip(weights).map(|(c, w)| c.coords * w).sum();
            let apart = point - ball.center.coords;
            let gap = apart.norm() - ball.radius;
            if gap > BAND_M {
                continue;
            }
            let mut key: Key = (0..3).filter(|&k| weights[k] > 0.0).map(|k| vertices[k]).collect();
            key.sort_unstable();
            let normal = apart.normalize();
            let carriers: Vec<(usize, f64)> = vertices.into_iter().zip(weights).filter(|c| c.1 > 0.0).collect();
            found.entry(key).or_insert_with(|| Constraint {
                row: self.row(&carriers, &normal),
                gap,
                pressure: 0.0,
                normal,
            });
        }
        found.into_values().collect()
    }

    fn row(&self, carriers: &[(usize, f64)], normal: &Vector3<f64>) -> Vec<(usize, Vector3<f64>)> {
        let mut weights: BTreeMap<usize, f64> = BTreeMap::new();
        for &(vertex, share) in carriers {
            for &(node, weight) in self.description.embedding.row(vertex) {
                *weights.entry(node.index()).or_insert(0.0) += weight * share;
            }
        }
        weights.into_iter().filter_map(|(node, w)| self.dof_of_node[node].map(|dof| (dof, normal * w))).collect()
    }
}

fn total(constraints: &[Constraint]) -> Vector3<f64> {
    constraints.iter().map(|c| c.normal * c.pressure).sum()
}

/// `x` with `A x = r + h J^T lambda` and `0 <= lambda _|_ gap + h J (x - x_0) >= 0`; pressures are left in the constraints.
fn solve(step: &Step, constraints: &mut [Constraint], h: f64, start: Option<&[f64]>) -> Vec<f64> {
    let mut x = step.residual.clone();
    step.factor.solve(&mut x);
    let n = constraints.len();
    let responses: Vec<Vec<f64>> = constraints
        .iter()
        .map(|c| {
            let mut load = vec![0.0; x.len()];
            for (dof, w) in &c.row {
                (0..3).for_each(|k| load[dof + k] = h * w[k]);
            }
            step.factor.solve(&mut load);
            load
        })
        .collect();
    let product = |c: &Constraint, y: &[f64]| -> f64 {
        h * c.row.iter().map(|(dof, w)| (0..3).map(|k| w[k] * y[dof + k]).sum::<f64>()).sum::<f64>()
    };
    let w = DMatrix::from_fn(n, n, |i, k| product(&constraints[i], &responses[k]));
    let past = |c: &Constraint| start.map_or(0.0, |s| product(c, s));
    let b = DVector::from_fn(n, |i, _| constraints[i].gap + product(&constraints[i], &x) - past(&constraints[i]));
    let lambda = complementarity(&w, &b);
    for i in 0..n {
        constraints[i].pressure = lambda[i];
        x.iter_mut().zip(&responses[i]).for_each(|(x, r)| *x += r * lambda[i]);
    }
    x
}

/// `0 <= lambda _|_ W lambda + b >= 0` by active sets [LH74, ch. 23], until no gap is violated by more than a nanometre.
fn complementarity(w: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    const TOLERANCE_M: f64 = 1e-9;
    let mut lambda = DVector::zeros(b.len());
    let mut active: Vec<usize> = Vec::new();
    for _ in 0..10 * b.len() {
        let gaps = w * &lambda + b;
        let closed = (0..b.len()).filter(|i| !active.contains(i));
        let Some(worst) = closed.min_by(|&i, &k| gaps[i].total_cmp(&gaps[k])).filter(|&i| gaps[i] < -TOLERANCE_M)
        else {
            return lambda;
        };
        active.push(worst);
        while let Some(wanted) = only(w, b, &active) {
            let steps = active.iter().zip(wanted.iter()).filter(|(_, s)| **s <= 0.0);
            let share = steps.map(|(&i, s)| lambda[i] / (lambda[i] - s)).fold(1.0, f64::min);
            active.iter().zip(wanted.iter()).for_each(|(&i, s)| lambda[i] += share * (s - lambda[i]));
            if share >= 1.0 {
                break;
            }
            active.retain(|&i| lambda[i] > 1e-12);
            (0..b.len()).filter(|i| !active.contains(i)).for_each(|i| lambda[i] = 0.0);
        }
    }
    lambda
}

/// Pressures that close exactly the active gaps; `None` if there are none.
fn only(w: &DMatrix<f64>, b: &DVector<f64>, active: &[usize]) -> Option<DVector<f64>> {
    let n = active.len();
    let block = DMatrix::from_fn(n, n, |i, k| w[(active[i], active[k])] * if i == k { 1.0 + 1e-10 } else { 1.0 });
    (n > 0).then(|| block.cholesky().unwrap().solve(&DVector::from_fn(n, |i, _| -b[active[i]])))
}

/// Weights of the triangle's point nearest to `p` [Ericson05, 5.1.5]; exactly zero for corners without a share.
fn nearest_weights(p: Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> [f64; 3] {
    let normal = (b - a).cross(&(c - a));
    let area = |q: &Point3<f64>, r: &Point3<f64>| (q - p).cross(&(r - p)).dot(&normal) / normal.norm_squared();
    let inside = [area(b, c), area(c, a), area(a, b)];
    if inside.iter().all(|w| *w > 0.0) {
        return inside;
    }
    let corners = [a, b, c];
    let on_edge = |i: usize| {
        let (j, edge) = ((i + 1) % 3, corners[(i + 1) % 3] - corners[i]);
        let t = ((p - corners[i]).dot(&edge) / edge.norm_squared()).clamp(0.0, 1.0);
        let mut weights = [0.0; 3];
        (weights[i], weights[j]) = (1.0 - t, t);
        ((corners[i] + edge * t - p).norm(), weights)
    };
    (0..3).map(on_edge).min_by(|x, y| x.0.total_cmp(&y.0)).unwrap().1
}
