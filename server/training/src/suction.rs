//! Suction, which unilateral contact cannot exert; the same load for both models.
//!
//! A smooth traction along the outward normal `n` at the contact point acts on a disc around it, and keeps its direction:
//! `t(r) = p (1 - (r / R)^2)^2 n` for `r < R`, `r` the distance on the skin at rest. It is lumped at skin vertices, `f_v =
//! t(r_v) A_v`, and either model bears it through its own interpolation, `A^T f`. The pressure `p` is found so that the
//! contact point of the coarse skin rises by the height that was drawn.

use nalgebra::{Point3, Vector3};

use crate::coarse::{Coarse, CoarseResult, Interrupted, SolveObserver};
use crate::setup::DriveOptions;
use plica_geometry::{ReferenceSkin, SurfacePoint};

/// Largest error of the height, as a share of it.
const HEIGHT_TOLERANCE: f64 = 2e-3;
/// Loads tried at most.
const MAX_TRIES: u32 = 12;
/// Vertices whose normal leans farther than this from the disc's are on another face (cosine).
const SAME_FACE: f64 = 0.7;

/// A disc on the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Disc {
    /// Centre \[m\].
    pub centre: Point3<f64>,
    /// Outward unit normal.
    pub normal: Vector3<f64>,
    /// Radius \[m\].
    pub radius_m: f64,
}

impl Disc {
    /// Distance of a skin vertex from the centre \[m\], if it lies on the disc.
    pub(crate) fn distance(&self, skin: &ReferenceSkin, vertex: usize) -> Option<f64> {
        let distance = (skin.skin().positions()[vertex] - self.centre).norm();
        let faces = skin.vertex_normals()[vertex].dot(&self.normal) > SAME_FACE;
        (faces && distance < self.radius_m).then_some(distance)
    }

    /// Forces at skin vertices under a pressure of 1 Pa at the centre, `[n_skin]` \[N\].
    pub(crate) fn unit_forces(&self, skin: &ReferenceSkin) -> Vec<Vector3<f64>> {
        let force = |(vertex, area): (usize, &f64)| match self.distance(skin, vertex) {
            Some(r) => self.normal * (1.0 - (r / self.radius_m).powi(2)).powi(2) * *area,
            None => Vector3::zeros(),
        };
        skin.vertex_areas().iter().enumerate().map(force).collect()
    }
}

/// The coarse model lifted to a height.
#[derive(Debug, Clone)]
pub(crate) struct Lifted {
    /// The state.
    pub state: CoarseResult,
    /// Forces of the suction at skin vertices, `[n_skin]` \[N\].
    pub skin_forces: Vec<Vector3<f64>>,
    /// Height reached \[m\].
    pub height_m: f64,
    /// Whether the target height was reached.
    pub reached: bool,
}

/// Where and how far suction raises the coarse skin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LiftTarget<'a> {
    /// Disc under the suction.
    pub disc: &'a Disc,
    /// Point of the skin that is raised.
    pub at: &'a SurfacePoint,
    /// Height \[m\].
    pub height_m: f64,
    /// Young's modulus for the first guess of the pressure \[Pa\].
    pub young_modulus_pa: f64,
}

/// From rest: finds the suction that reaches `target`.
///
/// # Errors
/// [`Interrupted`].
pub(crate) fn lift(
    coarse: &mut Coarse,
    skin: &ReferenceSkin,
    target: LiftTarget<'_>,
    drive: &DriveOptions,
    observer: SolveObserver<'_>,
) -> Result<Lifted, Interrupted> {
    let LiftTarget { disc, at, height_m, young_modulus_pa } = target;
    coarse.restart();
    let unit = disc.unit_forces(skin);
    let unit_nodal = coarse.model().description().embedding.apply_transpose(&unit);
    // A stiff guess, F = 8/3 E R h with F = p R^2 pi / 3: what a rigid disc on a half-space of nu = 1/2 takes. The true skin is
    // softer or stiffer by some factor, which the next tries find.
    let mut pressure_pa = 8.0 / std::f64::consts::PI * young_modulus_pa * height_m / disc.radius_m;
    let mut tries = 0;
    loop {
        let forces: Vec<_> = unit_nodal.iter().map(|f| f * pressure_pa).collect();
        let state = coarse.load(&forces, drive, observer)?;
        let reached_m = skin.interpolate(at, &state.offsets).dot(&disc.normal);
        tries += 1;
        let reached = (reached_m - height_m).abs() <= HEIGHT_TOLERANCE * height_m;
        if reached || tries == MAX_TRIES || reached_m <= 0.0 {
            let skin_forces = unit.iter().map(|f| f * pressure_pa).collect();
            return Ok(Lifted { state, skin_forces, height_m: reached_m, reached });
        }
        pressure_pa *= height_m / reached_m;
    }
}
