//! Interactions are drawn as asked, and the same ones every time.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use nalgebra::{Isometry3, Point3, Vector3};
use plica_training::*;

fn wedge() -> Setup {
    common::wedge_scene([8, 4, 2], 4e-3)
}

fn presses(setup: &Setup, count: usize, seed: u64) -> Vec<Interaction> {
    let set = InteractionSet { count, ..setup.training.clone() };
    plan(setup, &[set], seed).unwrap()
}

#[test]
fn a_seed_is_a_plan() {
    let setup = wedge();
    let first = presses(&setup, 40, 1);
    assert_eq!(first, presses(&setup, 40, 1));
    let text: Vec<_> = first.iter().map(fingerprint).collect();
    let other: Vec<_> = presses(&setup, 40, 2).iter().map(fingerprint).collect();
    assert!(text.iter().all(|t| !other.contains(t)), "two seeds share an interaction");
    // A plan is part of what a database means: if this changes, TANDEM_VERSION does.
    println!("{}", fingerprint(&first));
}

#[test]
fn presses_keep_to_their_ranges() {
    let setup = wedge();
    let height = |x: f64| 0.04 - 0.25 * x;
    let all = presses(&setup, 300, 1);
    let mut dragged = 0;
    for i in &all {
        let c = i.contact_point();
        assert!((0.02..=0.08).contains(&c.x) && (0.012..=0.048).contains(&c.y), "{c}");
        assert!((c.z - height(c.x)).abs() < 1e-9, "on the top: {c}");
        let Action::Press { approach, orientation_xyzw, depth_m, .. } = &i.action else { panic!("{i:?}") };
        assert_eq!((approach, orientation_xyzw), (&[0.0, 0.0, -1.0], &[0.0, 0.0, 0.0, 1.0]));
        assert!((0.1..=0.35).contains(&(depth_m / height(c.x))), "{depth_m} at {c}");
        assert!(i.drag().norm() <= 0.005 && i.drag().dot(&i.normal()).abs() < 1e-12, "{i:?}");
        dragged += u32::from(i.drag().norm() > 0.0);
    }
    // Farthest-point sampling prefers what is rare: no bound from the share itself, but both must be there.
    assert!((150..=290).contains(&dragged), "{dragged} of 300 drag");
}

#[test]
fn random_interactions_are_uniform_where_they_should_be() {
    let mut setup = wedge();
    setup.training.candidates_per_example = 1;
    let all = presses(&setup, 2000, 3);
    let share = |is: &dyn Fn(&Interaction) -> bool| all.iter().filter(|i| is(i)).count() as f64 / 2000.0;
    let near = |found: f64, expected: f64| {
        let deviation = (expected * (1.0 - expected) / 2000.0).sqrt();
        assert!((found - expected).abs() < 4.0 * deviation, "{found} instead of {expected}");
    };
    near(share(&|i| i.contact_point().x < 0.035), 0.25);
    near(share(&|i| i.contact_point().y < 0.03), 0.5);
    near(share(&|i| i.drag().norm() > 0.0), 2.0 / 3.0);
    near(share(&|i| i.drag().norm() > 0.0025), 1.0 / 3.0);
    near(share(&|i| i.drag().y > 0.0), 1.0 / 3.0);
    let relative = |i: &Interaction| i.depth_m() / i.contact_point().z;
    near(share(&|i| relative(i) < 0.1 + 0.25 * 0.2), 0.2);
}

/// Random points leave holes and heaps; farthest points do not.
#[test]
fn farthest_points_spread_better_than_random_ones() {
    let mut setup = wedge();
    let nearest = |all: &[Interaction]| {
        let feature = |i: &Interaction| (i.contact_point().coords / 0.012, i.drag() / 0.004, i.depth_m() / 0.004);
        let features: Vec<_> = all.iter().map(feature).collect();
        let distance = |a: &(Vector3<f64>, Vector3<f64>, f64), b: &(Vector3<f64>, Vector3<f64>, f64)| {
            ((a.0 - b.0).norm_squared() + (a.1 - b.1).norm_squared() + (a.2 - b.2).powi(2)).sqrt()
        };
        let closest = |i: usize| {
            let others = (0..features.len()).filter(|&j| j != i);
            others.map(|j| distance(&features[i], &features[j])).fold(f64::INFINITY, f64::min)
        };
        (0..features.len()).map(closest).fold(f64::INFINITY, f64::min)
    };
    let farthest = nearest(&presses(&setup, 64, 1));
    setup.training.candidates_per_example = 1;
    let random = nearest(&presses(&setup, 64, 1));
    println!("closest pair: {farthest:.3} farthest-point, {random:.3} random");
    assert!(farthest > 2.0 * random);
}

#[test]
fn lifts_and_sides_are_drawn_where_they_belong() {
    let setup = wedge();
    let all = plan(&setup, &setup.evaluation, 2).unwrap();
    let kinds: Vec<_> = all.iter().map(|i| i.kind.as_str()).collect();
    assert_eq!(kinds, ["in_region", "in_region", "lift", "side"]);
    assert!(matches!(all[2].action, Action::Lift { height_m, radius_m } if height_m > 0.0 && radius_m == 0.007));
    let Action::Press { approach, .. } = &all[3].action else { panic!("{:?}", all[3]) };
    assert!((Vector3::from(*approach) + all[3].normal()).norm() < 1e-12);
}

#[test]
fn a_region_without_skin_is_named() {
    let mut setup = wedge();
    let Source::Press(ranges) = &mut setup.training.source else { panic!() };
    ranges.region = vec![[Point3::new(5.0, 5.0, 5.0), Point3::new(6.0, 6.0, 6.0)]];
    let message = plan(&setup, &[setup.training.clone()], 1).unwrap_err().to_string();
    assert!(message.contains("`in_region`") && message.contains("region"), "{message}");
}

/// A motion that comes down, presses, drags and leaves.
fn recorded() -> Vec<RecordedPose> {
    let z = |k: usize| 0.045 - 0.018 * (std::f64::consts::PI * k as f64 / 200.0).sin();
    let pose = |k: usize| Isometry3::translation(0.04 + 1e-4 * k as f64, 0.03, z(k));
    (0..=200).map(|k| RecordedPose { time_s: 0.01 * k as f64, tool: 0, pose: pose(k) }).collect()
}

#[test]
fn recorded_states_bring_their_way_along() {
    let setup = wedge();
    let set = InteractionSet { count: 6, source: Source::Recorded(recorded()), ..setup.training.clone() };
    let all = plan(&setup, std::slice::from_ref(&set), 1).unwrap();
    assert_eq!(all.len(), 6);
    assert_eq!(all, plan(&setup, &[set], 1).unwrap());
    for i in &all {
        let Action::Follow { poses } = &i.action else { panic!("{i:?}") };
        assert!(poses.len() > 2 && poses.first().unwrap()[2] > poses.last().unwrap()[2] - 0.01);
        assert!((i.contact_point().z - (0.04 - 0.25 * i.contact_point().x)).abs() < 1e-6, "touched on top: {i:?}");
    }
    let away: Vec<_> = recorded()
        .into_iter()
        .map(|p| RecordedPose { pose: Isometry3::translation(0.0, 0.0, 1.0) * p.pose, ..p })
        .collect();
    let set = InteractionSet { source: Source::Recorded(away), ..setup.training.clone() };
    assert!(plan(&setup, &[set], 1).unwrap_err().to_string().contains("none of 201 recorded poses"));
}
