//! The tools of the simulation as obstacles of the accurate model: signed distances in `f64`.

use nalgebra::{Isometry3, Point3, Vector3};
use plica_accurate::contact::Obstacle;
use plica_geometry::{ConvexPolytope, HullError};
use plica_sim::ToolShape;

/// Closer than this is touching \[m\].
const TOUCH_M: f64 = 1e-7;
const MAX_STEPS: usize = 200;

/// Obstacle of the same shape, with distances in `f64`.
///
/// # Errors
/// [`HullError`]: a cuboid without a volume.
pub(crate) fn obstacle(shape: &ToolShape) -> Result<Obstacle, HullError> {
    Ok(match shape {
        ToolShape::Ball { radius_m } => Obstacle::Ball { radius_m: *radius_m },
        ToolShape::Capsule { radius_m, length_m } => Obstacle::Capsule { radius_m: *radius_m, length_m: *length_m },
        ToolShape::Cuboid { .. } | ToolShape::ConvexHull { .. } | ToolShape::Compound { .. } => {
            union(shape.polytopes()?.into_owned())
        }
    })
}

fn union(mut parts: Vec<ConvexPolytope>) -> Obstacle {
    if parts.len() == 1 {
        Obstacle::Polytope(parts.remove(0))
    } else {
        Obstacle::Union(parts.into_iter().map(Obstacle::Polytope).collect())
    }
}

/// Radius of the disc that a tool covers: its own, or half of the smaller lateral extent \[m\].
pub(crate) fn radius_m(shape: &ToolShape) -> f64 {
    let lateral = |points: &mut dyn Iterator<Item = &Point3<f64>>| {
        let (low, high) = points
            .fold((Point3::from(Vector3::repeat(f64::MAX)), Point3::from(Vector3::repeat(f64::MIN))), |(l, h), p| {
                (l.inf(p), h.sup(p))
            });
        0.5 * (high.x - low.x).min(high.y - low.y)
    };
    match shape {
        ToolShape::Ball { radius_m } | ToolShape::Capsule { radius_m, .. } => *radius_m,
        ToolShape::Cuboid { half_extents_m } => half_extents_m[0].min(half_extents_m[1]),
        ToolShape::ConvexHull { polytope } => lateral(&mut polytope.points().iter()),
        ToolShape::Compound { polytopes } => lateral(&mut polytopes.iter().flat_map(|p| p.points())),
    }
}

/// Smallest signed distance from the obstacle at `pose` to `points` \[m\].
pub(crate) fn clearance(obstacle: &Obstacle, pose: &Isometry3<f64>, points: &[Point3<f64>]) -> f64 {
    points.iter().map(|p| obstacle.distance(pose, p)).fold(f64::INFINITY, f64::min)
}

/// How far the obstacle can move from `start` along the unit vector `direction` until it touches one of `points`, at most
/// `reach` \[m\]. Each step is the distance that is clear, so that nothing is passed.
pub(crate) fn first_touch(
    obstacle: &Obstacle,
    start: &Isometry3<f64>,
    direction: &Vector3<f64>,
    points: &[Point3<f64>],
    reach: f64,
) -> Option<f64> {
    let mut moved = 0.0;
    for _ in 0..MAX_STEPS {
        let mut pose = *start;
        pose.translation.vector += direction * moved;
        let clear = clearance(obstacle, &pose, points);
        if clear < TOUCH_M {
            return Some(moved);
        }
        moved += clear;
        if moved > reach {
            return None;
        }
    }
    Some(moved)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;

    #[test]
    fn a_rod_stops_where_it_touches() {
        let rod = obstacle(&ToolShape::Capsule { radius_m: 0.007, length_m: 0.1 }).unwrap();
        let floor: Vec<_> = (-20..=20)
            .flat_map(|i| (-20..=20).map(move |j| (i, j)))
            .map(|(i, j)| Point3::new(f64::from(i) * 1e-3, f64::from(j) * 1e-3, 0.0))
            .collect();
        let start = Isometry3::translation(0.0, 0.0, 0.05);
        let moved = first_touch(&rod, &start, &-Vector3::z(), &floor, 0.1).unwrap();
        assert!((moved - 0.043).abs() < 1e-6, "{moved}");
        assert_eq!(first_touch(&rod, &start, &Vector3::x(), &floor, 0.1), None);
    }

    #[test]
    fn radii_are_those_of_the_tip() {
        let hull: Vec<_> = [(0.0, 0.0, 0.0), (0.004, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.02)]
            .iter()
            .map(|(x, y, z)| Point3::new(*x, *y, *z))
            .collect();
        let polytope = ConvexPolytope::hull(hull).unwrap();
        assert_eq!(radius_m(&ToolShape::ConvexHull { polytope }), 0.002);
        assert_eq!(radius_m(&ToolShape::Cuboid { half_extents_m: [0.01, 0.003, 0.02] }), 0.003);
    }
}
