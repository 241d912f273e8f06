//! Stress at a point, recovered from the elements around it.
//!
//! Inside an element of first order stress is accurate at the centre only \[ZZ92\]. A polynomial of second degree is fitted to the
//! accurate points of the elements around, by least squares, and read at the point: second order up to the boundary.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};
use plica_geometry::ElementIdx;

use super::element::Element;
use super::{Elements, Solid, with_elements};

/// Rings of elements around that of the point.
const N_RINGS: usize = 2;
/// Weights fall to `exp(-1/2)` over this distance, in units in which an edge is about 2 long.
const REACH: f64 = 1.5;
/// Elements of one layer lie closer together than this along an axis, in the same units.
const ONE_LAYER: f64 = 1.5;
/// A term of the polynomial is left out where lower ones explain all but this share of it: layers are too few for it.
const LEAST_SHARE: f64 = 0.1;
/// Terms of a polynomial of second degree.
const N_TERMS: usize = 10;

/// Stress at a point of an element, in local coordinates.
#[derive(Debug, Clone, Copy)]
struct Sample {
    at: Vector3<f64>,
    stress: Matrix3<f64>,
}

impl Solid {
    /// Cauchy stress \[Pa\] at reference coordinates `xi` of an element, fitted to the accurate points of the elements of the same
    /// material around it: centres, or Gauss points where the elements are second-order tetrahedra or lie in one layer.
    pub fn recovered_stress(&self, x: &[Vector3<f64>], element: impl Into<ElementIdx>, xi: [f64; 3]) -> Matrix3<f64> {
        let element = element.into().index();
        let (edge, at_gauss_points) = match &self.elements {
            Elements::Hexahedra(_) => (1.0, false),
            Elements::LinearTetrahedra(_) => (2.0, false),
            Elements::QuadraticTetrahedra(_) => (2.0, true),
        };
        with_elements!(&self.elements, list => {
            let local = list[element].jacobian_at_centre().try_inverse().unwrap_or_else(Matrix3::identity) * edge;
            let around = patch(list, element);
            let centres: Vec<Sample> =
                around.iter().map(|&i| sample(&list[i], x, list[i].reference().centre, &local)).collect();
            let samples = if at_gauss_points || is_one_layer(&centres) {
                let points = |&i: &usize| list[i].reference().points.map(|xi| sample(&list[i], x, xi, &local));
                around.iter().flat_map(points).collect()
            } else {
                centres
            };
            fitted(&samples, &(local * list[element].rest_at(xi)))
        })
    }
}

/// The element and rings of elements of like material around it, in increasing order.
fn patch<const N: usize, const Q: usize>(list: &[Element<N, Q>], element: usize) -> Vec<usize> {
    let mut patch = BTreeSet::from([element]);
    for _ in 0..N_RINGS {
        let nodes: BTreeSet<_> = patch.iter().flat_map(|&i| *list[i].nodes()).collect();
        let touches = |e: &Element<N, Q>| e.nodes().iter().any(|node| nodes.contains(node));
        let joined = list.iter().enumerate().filter(|(_, e)| e.law().is_like(list[element].law()) && touches(e));
        patch.extend(joined.map(|(i, _)| i).collect::<Vec<_>>());
    }
    patch.into_iter().collect()
}

fn sample<const N: usize, const Q: usize>(
    element: &Element<N, Q>,
    x: &[Vector3<f64>],
    xi: [f64; 3],
    local: &Matrix3<f64>,
) -> Sample {
    Sample { at: local * element.rest_at(xi), stress: element.cauchy_stress(x, xi) }
}

fn is_one_layer(samples: &[Sample]) -> bool {
    let lower = samples.iter().fold(Vector3::repeat(f64::INFINITY), |low, s| low.inf(&s.at));
    let upper = samples.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |high, s| high.sup(&s.at));
    (upper - lower).min() < ONE_LAYER
}

/// Value at `point` of the polynomial with the least weighted squares.
fn fitted(samples: &[Sample], point: &Vector3<f64>) -> Matrix3<f64> {
    let mean = samples.iter().map(|s| s.at).sum::<Vector3<f64>>() / samples.len() as f64;
    let roots: Vec<f64> =
        samples.iter().map(|s| (-0.25 * (s.at - point).norm_squared() / (REACH * REACH)).exp()).collect();
    let rows: Vec<[f64; N_TERMS]> = samples.iter().map(|s| terms(&(s.at - mean))).collect();
    let at_point = terms(&(point - mean));
    let mut basis: Vec<Term> = Vec::with_capacity(N_TERMS);
    for k in 0..N_TERMS {
        let values = rows.iter().zip(&roots).map(|(row, root)| row[k] * root).collect();
        let term = Term { values, at_point: at_point[k] };
        basis.extend(term.orthonormal_to(&basis));
    }
    let mut stress = Matrix3::zeros();
    for (s, (sample, root)) in samples.iter().zip(&roots).enumerate() {
        let share: f64 = basis.iter().map(|term| term.at_point * term.values[s]).sum();
        stress += sample.stress * (share * root);
    }
    stress
}

/// `1, x, y, z, x^2, y^2, z^2, x y, y z, z x`.
fn terms(r: &Vector3<f64>) -> [f64; N_TERMS] {
    [1.0, r.x, r.y, r.z, r.x * r.x, r.y * r.y, r.z * r.z, r.x * r.y, r.y * r.z, r.z * r.x]
}

/// A function by its weighted values at the samples and its value at the point.
struct Term {
    values: Vec<f64>,
    at_point: f64,
}

impl Term {
    /// Less its projections on `basis`, of unit length; `None` if too little is left. Gram-Schmidt \[GVL13, 5.2.8\], done twice.
    fn orthonormal_to(mut self, basis: &[Self]) -> Option<Self> {
        let norm = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
        let before = norm(&self.values);
        for other in basis.iter().chain(basis) {
            let along: f64 = self.values.iter().zip(&other.values).map(|(a, b)| a * b).sum();
            self.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a -= along * b);
            self.at_point -= along * other.at_point;
        }
        let left = norm(&self.values);
        (left > LEAST_SHARE * before).then(|| {
            self.values.iter_mut().for_each(|v| *v /= left);
            Self { at_point: self.at_point / left, ..self }
        })
    }
}
