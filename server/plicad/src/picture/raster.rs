//! Triangles to pixels, with depth and perspective-correct attributes.

use nalgebra::Point3;

use super::camera::Camera;
use super::canvas::{Canvas, Rect};

/// A corner of a triangle with `N` attributes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner<const N: usize> {
    pub(super) position: Point3<f64>,
    pub(super) attributes: [f32; N],
}

/// A sample of a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fragment<const N: usize> {
    pub(super) pixel: usize,
    pub(super) depth: f32,
    pub(super) attributes: [f32; N],
    /// Whether the triangle is seen from its outside.
    pub(super) front: bool,
}

/// Calls `paint` for each sample of a triangle inside `rect`, nearer or not.
pub(super) fn triangle<const N: usize>(
    canvas: &mut Canvas,
    rect: &Rect,
    camera: &Camera,
    corners: [Corner<N>; 3],
    mut paint: impl FnMut(&mut Canvas, Fragment<N>),
) {
    let p = corners.map(|c| camera.project(&c.position));
    let area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
    if area.abs() < 1e-9 {
        return;
    }
    let span = |of: fn(&super::camera::Projected) -> f64, start: u32, length: u32| {
        let low = p.iter().map(of).fold(f64::INFINITY, f64::min).floor().max(f64::from(start));
        let high = p.iter().map(of).fold(f64::NEG_INFINITY, f64::max).ceil().min(f64::from(start + length));
        low as u32..high.max(0.0) as u32
    };
    for y in span(|q| q.y, rect.y, rect.h) {
        for x in span(|q| q.x, rect.x, rect.w) {
            let (cx, cy) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
            let side = |a: usize, b: usize| (p[b].x - p[a].x) * (cy - p[a].y) - (p[b].y - p[a].y) * (cx - p[a].x);
            let share = [side(1, 2) / area, side(2, 0) / area, side(0, 1) / area];
            if share.iter().any(|s| *s < 0.0) {
                continue;
            }
            let weights: [f64; 3] = std::array::from_fn(|i| share[i] * p[i].weight);
            let sum: f64 = weights.iter().sum();
            let mean = |value: &dyn Fn(usize) -> f64| (0..3).map(|i| weights[i] * value(i)).sum::<f64>() / sum;
            let fragment = Fragment {
                pixel: canvas.at(x, y),
                depth: mean(&|i| p[i].depth) as f32,
                attributes: std::array::from_fn(|k| mean(&|i| f64::from(corners[i].attributes[k])) as f32),
                // The y of pixels points down, so outside is where the turn is negative.
                front: area < 0.0,
            };
            paint(canvas, fragment);
        }
    }
}

/// Calls `paint` for each sample along a line of `width` pixels: pixel coordinates and depth.
pub(super) fn line(
    rect: &Rect,
    camera: &Camera,
    ends: [Point3<f64>; 2],
    width: f64,
    mut paint: impl FnMut(u32, u32, f32),
) {
    let [a, b] = ends.map(|e| camera.project(&e));
    let n = (b.x - a.x).abs().max((b.y - a.y).abs()).ceil().max(1.0);
    let reach = (0.5 * width).ceil() as i64;
    for k in 0..=n as u64 {
        let t = k as f64 / n;
        let (x, y) = (a.x + t * (b.x - a.x), a.y + t * (b.y - a.y));
        let weight = (1.0 - t) * a.weight + t * b.weight;
        let depth = ((1.0 - t) * a.weight * a.depth + t * b.weight * b.depth) / weight;
        // A dot across the line's main direction, so that no pixel is painted twice.
        let steep = (b.y - a.y).abs() > (b.x - a.x).abs();
        for d in -reach..reach {
            let (dx, dy) = if steep { (d, 0) } else { (0, d) };
            let (px, py) = (x.floor() as i64 + dx, y.floor() as i64 + dy);
            let inside = px >= i64::from(rect.x)
                && py >= i64::from(rect.y)
                && px < i64::from(rect.x + rect.w)
                && py < i64::from(rect.y + rect.h);
            if inside {
                paint(px as u32, py as u32, depth as f32);
            }
        }
    }
}
