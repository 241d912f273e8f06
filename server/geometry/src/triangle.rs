//! Distance to a triangle.

use nalgebra::Point3;

/// Distance to a triangle: to its plane where the foot lies inside, else to its nearest edge \[m\].
pub(crate) fn distance_to_triangle(x: &Point3<f64>, corners: &[Point3<f64>; 3]) -> f64 {
    let [a, b, c] = corners;
    let across = (b - a).cross(&(c - a));
    let edges = [[a, b], [b, c], [c, a]];
    let is_inside = edges.iter().all(|[p, q]| across.cross(&(*q - *p)).dot(&(x - *p)) >= 0.0);
    match across.try_normalize(0.0) {
        Some(normal) if is_inside => normal.dot(&(x - a)).abs(),
        _ => edges.iter().map(|[p, q]| distance_to_segment(x, p, q)).fold(f64::INFINITY, f64::min),
    }
}

fn distance_to_segment(x: &Point3<f64>, p: &Point3<f64>, q: &Point3<f64>) -> f64 {
    let along = q - p;
    let squared = along.norm_squared();
    let t = if squared > 0.0 { ((x - p).dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (x - (p + along * t)).norm()
}
