//! Whether a recorded motion is likely the one that is meant: where it starts, and how near it comes.

use nalgebra::{Isometry3, Matrix3, Point3, Quaternion, UnitQuaternion, Vector3};
use plica_geometry::DisplaySurface;
use plica_sim::{ToolDescription, ToolShape, world_from_tool};

use crate::model;
use crate::scene::Config;
use crate::timed_pose::TimedPose;

/// Cosine of the tilt beyond which a tool hangs.
const HANGING: f64 = -0.5;
/// Cosine of the tilt below which a tool stands.
const STANDING: f64 = 0.7;
/// A motion that never comes nearer than this many sizes of the object is not about it.
const FAR: f64 = 5.0;
/// Factors by which a unit of length may be taken for another.
const FACTORS: [f64; 2] = [1e-3, 1e3];
/// A motion of less than this share of the object's size is no motion around it.
const SMALL: f64 = 0.03;
/// Share of a tool's extents that must be inside: a tool may start in touch.
const INSIDE: f64 = 0.9;

/// The first tool that starts upside down, and upright with `w` taken from the first of its four components.
pub(crate) fn tool_with_w_first(config: &Config, poses: &[TimedPose]) -> Option<usize> {
    let suits = |start: &&TimedPose| {
        let tool = &config.tools()[start.tool];
        let q = start.sample.pose.rotation.quaternion();
        let w_first = UnitQuaternion::from_quaternion(Quaternion::new(q.i, q.j, q.k, q.w));
        let other = Isometry3::from_parts(start.sample.pose.translation, w_first);
        uprightness(&world_from_tool(tool, &start.sample.pose)) < 0.0
            && uprightness(&world_from_tool(tool, &other)) > STANDING
    };
    starts(config, poses).find(suits).map(|start| start.tool)
}

/// Sentences on a motion that is likely not meant. A fitted one starts upright and near.
pub(crate) fn remarks(config: &Config, poses: &[TimedPose], is_fitted: bool) -> Vec<String> {
    let surface = DisplaySurface::new(&model::skin(config));
    let mut remarks = Vec::new();
    for start in starts(config, poses) {
        let tool = &config.tools()[start.tool];
        let pose = world_from_tool(tool, &start.sample.pose);
        if uprightness(&pose) < HANGING && !is_fitted {
            remarks.push(format!(
                "`{}` starts upside down: its z axis points down; does `w` come first in the file \
                 (--quaternion-order), or is tool_from_marker missing?",
                tool.name
            ));
        }
        if points_of(&tool.shape).iter().any(|p| is_inside(&surface, &(pose * p))) {
            let [x, y, z]: [f64; 3] = pose.translation.vector.into();
            remarks.push(format!(
                "`{}` starts inside the object, at [{x:.4}, {y:.4}, {z:.4}] m: the first contact pushes it out; is the \
                 motion where the object is? --fit moves it there",
                tool.name
            ));
        }
    }
    remarks.extend(far_away(config, &surface, poses));
    remarks
}

/// The first pose of each tool.
fn starts<'a>(config: &Config, poses: &'a [TimedPose]) -> impl Iterator<Item = &'a TimedPose> {
    (0..config.tools().len()).filter_map(|tool| poses.iter().find(|p| p.tool == tool))
}

/// Cosine of the angle between the tool's z axis and the world's.
fn uprightness(pose: &Isometry3<f64>) -> f64 {
    (pose.rotation * Vector3::z()).z
}

/// A motion that never comes near the object, with the unit that would bring it there.
fn far_away(config: &Config, surface: &DisplaySurface, poses: &[TimedPose]) -> Option<String> {
    let corner =
        |of: fn(f32, f32) -> f32| surface.rest.iter().copied().reduce(|a, b| [0, 1, 2].map(|i| of(a[i], b[i])));
    let (low, high) = corner(f32::min).zip(corner(f32::max))?;
    let [low, high] = [low, high].map(|corner| Point3::from(corner.map(f64::from)));
    let size_m = (high - low).norm();
    let places = |factor: f64| -> Vec<Point3<f64>> {
        let tools: Vec<_> = config.tools().iter().map(|tool| scaled(tool, factor)).collect();
        let place = |p: &TimedPose| world_from_tool(&tools[p.tool], &p.sample.pose).translation.vector;
        poses.iter().map(|p| Point3::from(place(p))).collect()
    };
    let nearest_m = |places: &[Point3<f64>]| {
        places.iter().map(|p| (p - p.sup(&low).inf(&high)).norm()).fold(f64::INFINITY, f64::min)
    };
    let extent_m = |places: &[Point3<f64>]| {
        let corner =
            |of: fn(&Point3<f64>, &Point3<f64>) -> Point3<f64>| places.iter().copied().reduce(|a, b| of(&a, &b));
        corner(Point3::sup).zip(corner(Point3::inf)).map_or(0.0, |(high, low)| (high - low).norm())
    };
    let is_around = |factor: &f64| {
        let places = places(*factor);
        nearest_m(&places) < size_m && (SMALL..FAR).contains(&(extent_m(&places) / size_m))
    };
    let distance_m = nearest_m(&places(1.0));
    if distance_m <= FAR * size_m {
        return None;
    }
    let far =
        format!("the motion never comes nearer than {distance_m:.3} m to the object, which is {size_m:.3} m across");
    let advice = match FACTORS.into_iter().find(is_around) {
        Some(factor) => {
            let tool = &config.tools()[poses.first()?.tool];
            let unit = if factor < 1.0 { "millimetres" } else { "metres" };
            let scale = tool.position_scale * factor;
            format!("positions in {unit}? position_scale = {scale} in [tools.{}] brings it there", tool.name)
        }
        None => "world_from_tracker, or --fit, brings it there".to_owned(),
    };
    Some(format!("{far}; {advice}"))
}

fn scaled(tool: &ToolDescription, factor: f64) -> ToolDescription {
    ToolDescription { position_scale: tool.position_scale * factor, ..tool.clone() }
}

/// Points of a tool, a little inside of its surface.
fn points_of(shape: &ToolShape) -> Vec<Point3<f64>> {
    match shape {
        ToolShape::Ball { radius_m } => around(Point3::origin(), *radius_m),
        ToolShape::Capsule { radius_m, length_m } => {
            (0..=8).flat_map(|k| around(Point3::new(0.0, 0.0, length_m * f64::from(k) / 8.0), *radius_m)).collect()
        }
        ToolShape::Cuboid { half_extents_m } => {
            let places = (0..27).map(|n: u32| [n % 3, n / 3 % 3, n / 9]);
            let side = |place: u32| INSIDE * (f64::from(place) - 1.0);
            places.map(|place| Point3::from(std::array::from_fn(|i| side(place[i]) * half_extents_m[i]))).collect()
        }
        ToolShape::ConvexHull { polytope } => towards_centre(polytope.points()),
        ToolShape::Compound { polytopes } => polytopes.iter().flat_map(|p| towards_centre(p.points())).collect(),
    }
}

fn around(centre: Point3<f64>, radius_m: f64) -> Vec<Point3<f64>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let ends = axes.iter().flat_map(|axis| [-1.0, 1.0].map(|side| centre + axis * (side * INSIDE * radius_m)));
    std::iter::once(centre).chain(ends).collect()
}

/// The centre of some points, and those of them that are at most a few dozen, moved towards it.
fn towards_centre(points: &[Point3<f64>]) -> Vec<Point3<f64>> {
    const MOST: usize = 64;
    let centre = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64);
    let every = points.len().div_ceil(MOST);
    let moved = points.iter().step_by(every.max(1)).map(|p| centre + (p - centre) * INSIDE);
    std::iter::once(centre).chain(moved).collect()
}

/// Whether a closed surface winds around a point: the sum of the solid angles of its triangles is 4 pi inside and 0 outside.
///
/// ```text
/// tan(omega / 2) = det(a, b, c) / (|a||b||c| + a.b |c| + b.c |a| + c.a |b|)     a, b, c: corners seen from the point
/// ```
fn is_inside(surface: &DisplaySurface, p: &Point3<f64>) -> bool {
    let corner = |v: u32| Point3::from(surface.rest[v as usize].map(f64::from)) - p;
    let half_angle = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [corner(a), corner(b), corner(c)];
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let det = Matrix3::from_columns(&[a, b, c]).determinant();
        det.atan2(la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb)
    };
    surface.triangles.iter().map(half_angle).sum::<f64>().abs() > std::f64::consts::PI
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

    use std::fmt::Write as _;

    use crate::motion::{MotionError, MotionOptions, read};
    use crate::scene::Config;

    /// Remarks on a motion of the wedge's rod up from `start`, of 20 rows with a quaternion as it stands in a file.
    fn remarks(start: [f64; 3], quaternion: &str, fit: bool) -> Result<Vec<String>, MotionError> {
        let [x, y, z] = start;
        let mut text = String::new();
        for k in 0..20 {
            let z = if fit { z - 0.01 * f64::from(k) } else { z * (1.0 + 0.02 * f64::from(k)) };
            writeln!(text, "{} {x} {y} {z} {quaternion}", f64::from(k) / 60.0).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tum");
        std::fs::write(&path, text).unwrap();
        let config = Config::built_in().unwrap();
        read(&path, &config, MotionOptions { fit, ..MotionOptions::default() }).map(|motion| motion.remarks)
    }

    const ABOVE: [f64; 3] = [0.05, 0.03, 0.04];

    #[test]
    fn a_start_above_the_object_is_not_remarked_on() {
        assert_eq!(remarks(ABOVE, "0 0 0 1", false).unwrap(), [""; 0]);
        assert_eq!(remarks([0.05, 0.03, 0.0345], "0 0 0 1", false).unwrap(), [""; 0], "in touch");
        assert_eq!(remarks([1.3, 0.6, 1.6], "0.6132 0.5962 -0.3311 -0.3986", true).unwrap(), [""; 0]);
    }

    #[test]
    fn a_tool_that_starts_upright_only_with_w_first_is_asked_about() {
        for quaternion in ["1 0 0 0", "0.9 0 0 0.43589", "0.95 0.2 0.1 0.216795"] {
            let question = remarks(ABOVE, quaternion, false).unwrap_err().to_string();
            for part in ["a.tum: `probe` starts upside down", "--quaternion-order wxyz", "--quaternion-order xyzw"] {
                assert!(question.contains(part), "{question}");
            }
            assert!(remarks(ABOVE, quaternion, true).is_ok(), "a fitted motion starts upright");
        }
    }

    #[test]
    fn a_start_upside_down_or_inside_is_said() {
        // Half a turn about y: upside down in either order of components.
        let said = remarks([0.05, 0.03, 0.2], "0 1 0 0", false).unwrap();
        assert!(said.len() == 1 && said[0].starts_with("`probe` starts upside down"), "{said:?}");
        for inside in [[0.05, 0.03, 0.01], [0.02, 0.03, 0.03]] {
            let said = remarks(inside, "0 0 0 1", false).unwrap();
            assert!(said.len() == 1 && said[0].starts_with("`probe` starts inside the object"), "{said:?}");
        }
    }

    #[test]
    fn millimetres_taken_for_metres_are_said_with_the_remedy() {
        let said = remarks(ABOVE.map(|c| 1e3 * c), "0 0 0 1", false).unwrap();
        assert!(said.len() == 1 && said[0].contains("position_scale = 0.001 in [tools.probe]"), "{said:?}");
        let said = remarks([1.3, 0.6, 1.6], "0 0 0 1", false).unwrap();
        assert!(said.len() == 1 && said[0].contains("--fit"), "{said:?}");
    }
}
