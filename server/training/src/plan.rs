//! Which interactions a job makes: drawn from a seed, or picked from recorded poses.

use nalgebra::{Isometry3, Vector3};

use crate::error::PlanError;
use crate::farthest::farthest_points;
use crate::interaction::{Action, Interaction, orientation};
use crate::obstacle::radius_m;
use crate::random::Draws;
use crate::recorded;
use crate::setup::{Approach, FeatureScales, InteractionSet, PressRanges, Setup, Source};
use plica_geometry::{ReferenceSkin, SurfacePoint};

/// Points drawn before a region counts as free of skin.
const MAX_TRIES: usize = 10_000;
/// Skin whose normal is turned this far against the approach faces the tool (cosine).
const FACING: f64 = 0.2;

/// All interactions of `sets`, one set after the other.
///
/// # Errors
/// A set has no place on the skin, or no recorded pose that touches.
pub fn plan(setup: &Setup, sets: &[InteractionSet], seed: u64) -> Result<Vec<Interaction>, PlanError> {
    let skin = ReferenceSkin::new(&setup.coarse.skin);
    let mut all = Vec::new();
    for (index, set) in sets.iter().enumerate() {
        all.extend(draw_set(setup, &skin, set, seed, index as u32)?);
    }
    Ok(all)
}

fn draw_set(
    setup: &Setup,
    skin: &ReferenceSkin,
    set: &InteractionSet,
    seed: u64,
    set_index: u32,
) -> Result<Vec<Interaction>, PlanError> {
    let n_candidates = set.count * set.candidates_per_example.max(1);
    let candidates = match &set.source {
        Source::Press(ranges) | Source::Lift(ranges) => {
            let region = Region::new(skin, set, ranges)?;
            (0..n_candidates)
                .map(|i| region.draw(setup, &mut Draws::new(seed, set_index, i as u32)))
                .collect::<Result<_, _>>()?
        }
        Source::Recorded(poses) => recorded::candidates(setup, skin, set, poses, seed)?,
    };
    if candidates.len() <= set.count || set.candidates_per_example <= 1 {
        return Ok(candidates.into_iter().take(set.count).collect());
    }
    let features: Vec<_> = candidates.iter().map(|c| features(c, &setup.features)).collect();
    let chosen = farthest_points(&features, set.count);
    Ok(chosen.into_iter().map(|i| candidates[i].clone()).collect())
}

/// Features that measure the similarity of interactions: `(c / 12 mm, press / 4 mm, drag / 4 mm)` with the default scales.
fn features(interaction: &Interaction, scales: &FeatureScales) -> Vec<f64> {
    let (press, drag) = match &interaction.action {
        Action::Press { approach, depth_m, drag_m, .. } => {
            (Vector3::from(*approach) * *depth_m, Vector3::from(*drag_m))
        }
        Action::Lift { height_m, .. } => (interaction.normal() * *height_m, Vector3::zeros()),
        Action::Follow { poses } => (recorded::travel(poses), Vector3::zeros()),
    };
    let contact = interaction.contact_point().coords / scales.contact_m;
    let motion = [press, drag].into_iter().flat_map(|v| <[f64; 3]>::from(v / scales.motion_m));
    <[f64; 3]>::from(contact).into_iter().chain(motion).collect()
}

/// The part of the skin that a set draws contact points from.
struct Region<'a> {
    skin: &'a ReferenceSkin,
    set: &'a InteractionSet,
    ranges: &'a PressRanges,
    eligible: Vec<(plica_geometry::TriangleIdx, f64)>,
}

impl<'a> Region<'a> {
    fn new(skin: &'a ReferenceSkin, set: &'a InteractionSet, ranges: &'a PressRanges) -> Result<Self, PlanError> {
        let faces = |normal: &Vector3<f64>| match &ranges.approach {
            Approach::Along(direction) => normal.dot(direction) < -FACING,
            Approach::Normal => true,
        };
        let eligible = skin.eligible(&ranges.region, faces);
        if eligible.is_empty() {
            return Err(PlanError::NoSkin { set: set.name.clone() });
        }
        Ok(Self { skin, set, ranges, eligible })
    }

    fn draw(&self, setup: &Setup, draws: &mut Draws) -> Result<Interaction, PlanError> {
        let at = self.contact_point(draws)?;
        let normal = match self.ranges.approach {
            // The face's own normal: a press on a side is not tilted by the rim.
            Approach::Normal => self.skin.triangle_normal(at.triangle),
            Approach::Along(_) => self.skin.normal(&at),
        };
        let approach = match self.ranges.approach {
            Approach::Along(direction) => direction,
            Approach::Normal => -normal,
        };
        let thickness = self.skin.thickness(&at.position, &approach).unwrap_or(0.0);
        let depth_m = thickness * draws.between(self.ranges.depth_share);
        let drag = self.drag(&normal, setup, draws);
        let action = match self.set.source {
            Source::Lift(_) => {
                let radius_m = radius_m(&setup.coarse.tools[self.set.tool].shape);
                Action::Lift { height_m: depth_m, radius_m }
            }
            _ => Action::Press {
                approach: approach.into(),
                orientation_xyzw: orientation(&approach),
                depth_m,
                drag_m: drag.into(),
            },
        };
        Ok(Interaction {
            kind: self.set.name.clone(),
            tool: self.set.tool as u32,
            contact_point_m: at.position.coords.into(),
            normal: normal.into(),
            action,
        })
    }

    /// Uniform by area over the part of the eligible skin that lies in the region.
    fn contact_point(&self, draws: &mut Draws) -> Result<SurfacePoint, PlanError> {
        let boxes = &self.ranges.region;
        let is_inside = |p: &SurfacePoint| {
            let within = |[l, h]: &[nalgebra::Point3<f64>; 2]| (0..3).all(|k| (l[k]..=h[k]).contains(&p.position[k]));
            boxes.is_empty() || boxes.iter().any(within)
        };
        let mut points = (0..MAX_TRIES).filter_map(|_| self.skin.draw(&self.eligible, || draws.unit()));
        points.find(is_inside).ok_or_else(|| PlanError::NoSkin { set: self.set.name.clone() })
    }

    /// Tangential: in the plane that touches the skin at the contact point. The numbers are drawn whether it drags or not.
    fn drag(&self, normal: &Vector3<f64>, setup: &Setup, draws: &mut Draws) -> Vector3<f64> {
        let drags = draws.unit() < self.ranges.drag_share;
        let [x, y] = draws.direction();
        let length = draws.between(self.ranges.drag_m);
        let [tau, theta] = tangents(normal, &setup.stamp_axes);
        if drags { (tau * x + theta * y) * length } else { Vector3::zeros() }
    }
}

fn tangents(normal: &Vector3<f64>, axes: &[Vector3<f64>; 2]) -> [Vector3<f64>; 2] {
    let frame = plica_geometry::frame_around(normal, axes);
    [frame.tau, frame.theta]
}

/// The pose at which a tool of a press touches first is on this line: its origin over the contact point.
pub(crate) fn line_of_approach(interaction: &Interaction, distance_m: f64) -> Option<(Isometry3<f64>, Vector3<f64>)> {
    let Action::Press { approach, orientation_xyzw, .. } = &interaction.action else { return None };
    let approach = Vector3::from(*approach);
    let origin = interaction.contact_point() - approach * distance_m;
    Some((Isometry3::from_parts(origin.coords.into(), crate::interaction::rotation(*orientation_xyzw)), approach))
}
