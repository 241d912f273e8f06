//! All methods on a scene that trains in seconds.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::error::Error as _;
use std::ops::ControlFlow;

use plica_training::evaluation::*;
use plica_training::*;
use tempfile::TempDir;

fn train(setup: &Setup, kind: DatabaseKind) -> Database {
    let folder = TempDir::new().unwrap();
    let job = TrainingJob {
        id: "test".into(),
        client_id: "test".into(),
        kind,
        scene_name: "tiny".into(),
        examples: None,
        seed: None,
        threads: None,
        submitted_unix_s: 0,
    };
    run(setup, &job, 2, &TrainingFolder::open(folder.path()).unwrap(), &mut |_| ControlFlow::Continue(())).unwrap();
    Database::read(&folder.path().join("database.safetensors"), Some(&setup.scene_hash)).unwrap()
}

/// More examples than the other tests of training need: 20, and 10 held out.
fn setup() -> Setup {
    let mut setup = common::tiny();
    setup.training.count = 20;
    setup.evaluation[0].count = 6;
    setup.evaluation.iter_mut().skip(1).for_each(|set| set.count = 2);
    setup
}

#[test]
fn every_method_is_evaluated_on_the_same_states() {
    let setup = setup();
    let (training, held_out) = (train(&setup, DatabaseKind::Training), train(&setup, DatabaseKind::Evaluation));
    let n_examples = training.examples.len();
    assert!(n_examples >= 18, "{:?}", training.rejected);
    let evaluator = Evaluator::new(&setup, &training, &held_out).unwrap();
    assert_eq!((evaluator.n_states(), evaluator.n_left_out(), evaluator.n_examples()), ([6, 4], 0, n_examples));
    let methods = methods(setup.stamp_axes);
    let mut parts = Vec::new();
    let found = evaluate(&evaluator, &methods, usize::MAX, &mut |progress| {
        parts.push((progress.done, progress.all));
        ControlFlow::Continue(())
    });
    let found = found.unwrap();
    for m in &found.methods {
        let (v, outside) = (&m.evaluation, m.evaluation.outside.unwrap());
        println!(
            "{:26} {:.3} {:.3} | {:.3} {:.3}",
            v.name, v.in_region.median, v.in_region.worst, outside.median, outside.worst
        );
    }

    let names: Vec<&str> = found.methods.iter().map(|m| m.evaluation.name.as_str()).collect();
    let expected: Vec<&str> = std::iter::once(COARSE).chain(methods.iter().map(|m| m.name.as_str())).collect();
    assert_eq!(names, expected);
    for m in &found.methods {
        let v = &m.evaluation;
        assert_eq!((v.in_region.states, v.near_contact.states, v.outside.unwrap().states), (6, 6, 4), "{}", v.name);
        assert_eq!(
            v.kinds.iter().map(|(k, g)| (k.as_str(), g.states)).collect::<Vec<_>>(),
            [("in_region", 6), ("lift", 2), ("side", 2)]
        );
        let q = v.in_region;
        assert!(q.median <= q.p95 && q.p95 <= q.worst && q.worst.is_finite(), "{}: {q:?}", v.name);
        assert!(q.independent_median_mm.unwrap() > 0.0 && q.median_mm > 0.0);
    }
    let of = |name: &str| found.methods.iter().find(|m| m.evaluation.name == name).unwrap();
    let coarse = &of(COARSE).evaluation;
    assert_eq!((coarse.in_region.median, coarse.in_region.worst, coarse.outside.unwrap().worst), (1.0, 1.0, 1.0));
    // A lift or a side press looks like no example: the paper's kernel is zero there, and nothing is added.
    let outside = of("ssh12-vector").evaluation.outside.unwrap();
    assert_eq!((outside.median, outside.worst), (1.0, 1.0));
    assert!(of(DEFAULT_METHOD).evaluation.in_region.median < 0.6);

    let default = of(DEFAULT_METHOD).degenerate.as_ref().unwrap();
    assert_eq!(default.at_rest.worst, 0.0, "no deformation, no detail");
    assert_eq!(of(COARSE).degenerate, None);
    let ridge = of("ridge-vector").degenerate.as_ref().unwrap();
    assert!((ridge.doubled.median / ridge.reversed.median - 2.0).abs() < 1e-3, "a linear map is linear: {ridge:?}");

    let counts: Vec<_> = found.by_examples.iter().map(|v| (v.name.as_str(), v.examples)).collect();
    assert_eq!(counts, [(DEFAULT_METHOD, 16), ("ridge-vector", 16), ("ssh12-blend", 16)]);
    let n = methods.len() + 3;
    assert_eq!(parts, (0..n).map(|i| (i, n)).collect::<Vec<_>>());
    let stopped = evaluate(&evaluator, &methods, usize::MAX, &mut |_| ControlFlow::Break(())).unwrap_err().to_string();
    assert!(stopped.contains("interrupted"), "{stopped}");
}

#[test]
fn databases_of_another_model_and_empty_regions_are_refused() {
    let setup = setup();
    let mut small = setup.clone();
    small.training.count = 2;
    small.evaluation[0].count = 1;
    small.evaluation.truncate(2);
    let (training, held_out) = (train(&small, DatabaseKind::Training), train(&small, DatabaseKind::Evaluation));
    let mut cut = held_out.clone();
    cut.examples[1].detail.pop();
    let message = Evaluator::new(&setup, &training, &cut).err().unwrap().to_string();
    assert!(message.contains("held-out example 1") && message.contains("skin vertices"), "{message}");
    let mut outside = held_out.clone();
    outside.examples.retain(|e| e.record.kind != IN_REGION);
    let message = Evaluator::new(&setup, &training, &outside).err().unwrap().to_string();
    assert!(message.contains("none of 2 held-out examples"), "{message}");
    let evaluator = Evaluator::new(&setup, &training, &held_out).unwrap();
    let default = &methods(setup.stamp_axes)[0];
    let error = evaluator.evaluate(default, 1).err().unwrap();
    let cause = error.source().unwrap().to_string();
    assert!(error.to_string().contains("kriging-stamp") && cause.contains("at least 2"), "{error}: {cause}");
}

/// The scene's own model driven anew is as far from the accurate one as the database says; a finer one is nearer.
#[test]
fn another_coarse_model_is_compared_with_the_same_accurate_skins() {
    let mut setup = setup();
    setup.training.count = 2;
    let (training, held_out) = (train(&setup, DatabaseKind::Training), train(&setup, DatabaseKind::Evaluation));
    let coarse = Evaluator::new(&setup, &training, &held_out).unwrap().coarse().unwrap();
    let mut progress = Vec::new();
    let own = other_coarse(&setup, &held_out, &setup, 2, &mut |p| {
        progress.push((p.done, p.all));
        ControlFlow::Continue(())
    });
    let own = own.unwrap();
    assert_eq!((own.states, own.failed), (6, 0));
    progress.dedup();
    assert_eq!(progress, (0..=6).map(|i| (i, 6)).collect::<Vec<_>>());
    let expected = coarse.in_region.independent_mm.unwrap();
    assert!((own.independent_mm.median - expected.median).abs() < 1e-5, "{own:?} {expected:?}");
    assert!((own.independent_mm.worst - expected.worst).abs() < 1e-5, "{own:?} {expected:?}");

    let finer = common::setup(common::Shape {
        coarse: plica_geometry::shapes::block([0.04, 0.04, 0.02], [6, 6, 4]),
        accurate: setup.accurate.mesh.clone(),
        skin: setup.coarse.skin.clone(),
        region: vec![],
        radius_m: 0.006,
    });
    let finer = Setup {
        coarse: plica_sim::ModelDescription { skin: setup.coarse.skin.clone(), ..finer.coarse },
        ..setup.clone()
    };
    let found = other_coarse(&setup, &held_out, &finer, 1, &mut |_| ControlFlow::Continue(())).unwrap();
    println!("{own:?} {found:?}");
    assert!(found.independent_mm.median < 0.8 * own.independent_mm.median);

    let elsewhere = Setup { evaluation_seed: 9, drive: DriveOptions { window_s: 0.2, ..setup.drive }, ..setup.clone() };
    let message =
        other_coarse(&elsewhere, &held_out, &setup, 1, &mut |_| ControlFlow::Continue(())).unwrap_err().to_string();
    assert!(message.contains("another interaction"), "{message}");
    let stopped = other_coarse(&setup, &held_out, &setup, 1, &mut |_| ControlFlow::Break(())).unwrap_err().to_string();
    assert!(stopped.contains("interrupted"), "{stopped}");
}

#[test]
fn a_slide_is_smooth_where_the_accurate_solution_is() {
    let mut setup = setup();
    setup.evaluation.truncate(1);
    setup.evaluation[0].count = 1;
    let (training, held_out) = (train(&setup, DatabaseKind::Training), train(&setup, DatabaseKind::Evaluation));
    let evaluator = Evaluator::new(&setup, &training, &held_out).unwrap();
    let chosen: Vec<Method> = methods(setup.stamp_axes).into_iter().filter(|m| m.name != "rbf-vector").collect();
    let found = slide(&setup, &evaluator, &chosen, usize::MAX, &mut |_| ControlFlow::Continue(())).unwrap();
    println!("{} states, {} rejected, {:?}", found.states, found.rejected, found.accurate);
    found.methods.iter().for_each(|m| println!("{:26} {:?} {:?}", m.name, m.roughness, m.error));
    // 16 mm to go at most, and the way down and up.
    assert!((15..40).contains(&found.states), "{}", found.states);
    assert_eq!(found.methods.len(), chosen.len());
    let default = &found.methods[0];
    assert!(default.error.unwrap().median < 0.6);
    assert!(
        default.roughness.max_mm < 2.0 * found.accurate.max_mm,
        "no jump that the accurate solution knows nothing of"
    );
    let stopped =
        slide(&setup, &evaluator, &chosen, usize::MAX, &mut |_| ControlFlow::Break(())).unwrap_err().to_string();
    assert!(stopped.contains("interrupted"), "{stopped}");
}
