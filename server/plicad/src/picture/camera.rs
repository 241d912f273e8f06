//! From the world to pixels.

use nalgebra::{Point3, Vector3};

use super::canvas::Rect;

/// A view into a rectangle of the canvas.
#[derive(Debug, Clone)]
pub(super) struct Camera {
    eye: Point3<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
    forward: Vector3<f64>,
    /// Pixels per metre at distance 1 (perspective) or everywhere.
    pixels: f64,
    perspective: bool,
    centre: [f64; 2],
}

/// A point on the canvas.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projected {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Distance along the view \[m\].
    pub(super) depth: f64,
    /// What attributes are weighted by before they are interpolated over pixels.
    pub(super) weight: f64,
}

impl Camera {
    /// Looks from `eye` at `target`; `view` is the height of the picture over its distance.
    pub(super) fn perspective(eye: Point3<f64>, target: Point3<f64>, view: f64, rect: &Rect) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        let up = right.cross(&forward);
        let pixels = f64::from(rect.h) / view;
        Self { eye, right, up, forward, pixels, perspective: true, centre: rect.centre() }
    }

    /// Looks along `forward` without perspective; `width_m` fills the rectangle's width.
    pub(super) fn orthographic(
        centre: Point3<f64>,
        forward: Vector3<f64>,
        up: Vector3<f64>,
        width_m: f64,
        rect: &Rect,
    ) -> Self {
        let right = forward.cross(&up);
        let eye = centre - forward;
        let pixels = f64::from(rect.w) / width_m;
        Self { eye, right, up, forward, pixels, perspective: false, centre: rect.centre() }
    }

    pub(super) fn project(&self, p: &Point3<f64>) -> Projected {
        let d = p - self.eye;
        let depth = d.dot(&self.forward);
        let weight = if self.perspective { 1.0 / depth.max(1e-6) } else { 1.0 };
        let pixels = self.pixels * weight;
        Projected {
            x: self.centre[0] + pixels * d.dot(&self.right),
            y: self.centre[1] - pixels * d.dot(&self.up),
            depth,
            weight,
        }
    }

    /// Unit direction from a point to the viewer.
    pub(super) fn towards_viewer(&self, p: &Point3<f64>) -> Vector3<f64> {
        if self.perspective { (self.eye - p).normalize() } else { -self.forward }
    }

    /// Light from above, behind the viewer's left shoulder.
    pub(super) fn light(&self) -> Vector3<f64> {
        (-0.55 * self.right + 0.75 * self.up - 0.8 * self.forward).normalize()
    }
}
