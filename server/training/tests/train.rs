//! Small jobs from plan to database.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::fs;
use std::ops::ControlFlow;

use nalgebra::Point3;
use plica_geometry::ReferenceSkin;
use plica_training::*;
use tempfile::TempDir;

/// Collects reports of progress, and ends the job after a number of calls.
struct Counting {
    calls_left: usize,
    reports: Vec<TrainingProgress>,
}

impl Counting {
    fn patient() -> Self {
        Self::until(usize::MAX)
    }

    fn until(calls: usize) -> Self {
        Self { calls_left: calls, reports: Vec::new() }
    }

    fn observe(&mut self, progress: TrainingProgress) -> ControlFlow<()> {
        if self.reports.last() != Some(&progress) {
            self.reports.push(progress);
        }
        match self.calls_left.checked_sub(1) {
            Some(left) => {
                self.calls_left = left;
                ControlFlow::Continue(())
            }
            None => ControlFlow::Break(()),
        }
    }
}

fn job(kind: DatabaseKind, examples: Option<u32>) -> TrainingJob {
    TrainingJob {
        id: "test".into(),
        client_id: "test".into(),
        kind,
        scene_name: "tiny".into(),
        examples,
        seed: None,
        threads: None,
        submitted_unix_s: 0,
    }
}

fn train(
    setup: &Setup,
    folder: &TempDir,
    kind: DatabaseKind,
    n_threads: usize,
    watch: &mut Counting,
) -> Result<TrainingReport, TrainingError> {
    run(setup, &job(kind, None), n_threads, &TrainingFolder::open(folder.path()).unwrap(), &mut |p| watch.observe(p))
}

fn bytes(folder: &TempDir) -> Vec<u8> {
    fs::read(folder.path().join("database.safetensors")).unwrap()
}

#[test]
fn the_database_depends_on_neither_threads_nor_interruptions() {
    let setup = common::tiny();
    let (one, two, broken) = (TempDir::new().unwrap(), TempDir::new().unwrap(), TempDir::new().unwrap());
    let mut watch = Counting::patient();
    let report = train(&setup, &one, DatabaseKind::Training, 1, &mut watch).unwrap();
    assert_eq!((report.result.interactions, report.result.examples), (4, 4), "{:?}", report.result.rejected);
    assert!(watch.reports.len() >= 6, "start, every example, end");
    let counts: Vec<u32> = watch.reports.iter().map(|p| p.done).collect();
    assert!(counts.is_sorted() && counts.last() == Some(&4), "{counts:?}");
    train(&setup, &two, DatabaseKind::Training, 2, &mut Counting::patient()).unwrap();
    assert!(bytes(&one) == bytes(&two), "one thread and two differ");

    let mut stops = 0;
    for questions in [5, 40, 75, 100, 130, 1_000_000] {
        match train(&setup, &broken, DatabaseKind::Training, 1, &mut Counting::until(questions)) {
            Err(TrainingError::Interrupted) => stops += 1,
            other => drop(other.unwrap()),
        }
    }
    assert!(stops >= 3, "interrupted {stops} times");
    assert!(bytes(&one) == bytes(&broken), "an interrupted job differs");
    let again = train(&setup, &broken, DatabaseKind::Training, 1, &mut Counting::patient()).unwrap();
    assert_eq!((again.run.solved, again.run.resumed), (0, 4), "finished examples are not repeated");
    assert!(bytes(&one) == bytes(&broken));
}

#[test]
fn an_example_is_what_it_says() {
    let setup = common::tiny();
    let folder = TempDir::new().unwrap();
    train(&setup, &folder, DatabaseKind::Training, 2, &mut Counting::patient()).unwrap();
    let database = Database::read(&folder.path().join("database.safetensors"), Some(&setup.scene_hash)).unwrap();
    let skin = ReferenceSkin::new(&setup.coarse.skin);
    for example in &database.examples {
        assert_eq!(example.displacements.len(), setup.coarse.mesh.n_nodes());
        assert_eq!(example.detail.len(), setup.coarse.skin.n_vertices());
        let fixed = setup.coarse.fixed.iter().zip(&example.displacements).filter(|(fixed, _)| **fixed);
        assert!(fixed.into_iter().all(|(_, u)| *u == [0.0; 3]));
        let c = nalgebra::Point3::from(example.contact_point);
        assert!((skin.nearest(&c).position - c).norm() < 1e-6, "the contact point lies on the reference skin");
        let [tau, theta, n] = example.contact_frame.map(nalgebra::Vector3::from);
        assert!((tau.cross(&theta) - n).norm() < 1e-9 && (n.norm() - 1.0).abs() < 1e-9);
        assert!(n.z > 0.9, "pressed on top");
        assert!(example.coarse_force[2] > 0.0 && example.tied_force[2] > 0.0, "the object pushes the tool up");
        assert!(example.record.tied.smallest_jacobian >= SMALLEST_JACOBIAN);
        // The tied skin follows the imprint: the detail at the contact point is small against the press.
        let away = |v: &usize| (setup.coarse.skin.positions()[*v] - c).norm();
        let nearest = (0..example.detail.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap();
        let miss = nalgebra::Vector3::from(example.detail[nearest]).norm();
        println!("{miss:.1e} m of {:.1e} m", example.record.depth_m);
        assert!(f64::from(miss) < 0.2 * example.record.depth_m);
    }
}

#[test]
fn an_evaluation_holds_both_references_of_every_kind() {
    let setup = common::tiny();
    let folder = TempDir::new().unwrap();
    let report = train(&setup, &folder, DatabaseKind::Evaluation, 2, &mut Counting::patient()).unwrap();
    let database = Database::read(&folder.path().join("database.safetensors"), None).unwrap();
    println!("{}", serde_json::to_string_pretty(&report.result).unwrap());
    let kinds: Vec<_> = database.examples.iter().map(|e| e.record.kind.as_str()).collect();
    assert_eq!(kinds, ["in_region", "in_region", "lift", "side"], "{:?}", database.rejected);
    for example in &database.examples {
        let independent = example.independent_detail.as_ref().unwrap();
        assert_eq!(independent.len(), example.detail.len());
        assert!(independent != &example.detail);
        let (tied, own) = (example.tied_force, example.independent_force.unwrap());
        let along = |f: [f64; 3]| nalgebra::Vector3::from(f).dot(&nalgebra::Vector3::from(example.contact_frame[2]));
        let pulls = example.record.kind == "lift";
        assert!(
            (along(tied) < 0.0) == pulls && (along(own) < 0.0) == pulls,
            "{}: {tied:?} {own:?}",
            example.record.kind
        );
    }
    let lift = &database.examples[2];
    let raised = nalgebra::Vector3::from(lift.coarse_force).norm();
    assert!(raised > 0.0 && lift.coarse_force == lift.independent_force.unwrap(), "the same suction");
}

/// Suction cannot raise a face that is held.
#[test]
fn what_cannot_be_solved_is_listed_and_not_stored() {
    let mut setup = common::tiny();
    let Source::Press(ranges) = &setup.training.source else { panic!() };
    let bottom = [Point3::new(0.012, 0.012, -1.0), Point3::new(0.028, 0.028, 1e-6)];
    let absurd = PressRanges {
        region: vec![bottom],
        approach: Approach::Normal,
        depth_share: [0.93, 0.95],
        drag_share: 0.0,
        ..ranges.clone()
    };
    let set =
        |count, source: Source| InteractionSet { count, candidates_per_example: 1, source, ..setup.training.clone() };
    setup.evaluation = vec![set(1, Source::Lift(absurd)), set(1, Source::Press(ranges.clone()))];
    let folder = TempDir::new().unwrap();
    let report = train(&setup, &folder, DatabaseKind::Evaluation, 1, &mut Counting::patient()).unwrap();
    assert_eq!((report.result.examples, report.result.rejected.len()), (1, 1));
    let rejected = &report.result.rejected[0];
    println!("{:?}: {}", rejected.reason, rejected.message);
    assert_eq!(rejected.index, 0);
    let expected = [Reason::HeightNotReached, Reason::NotSettled, Reason::CoarseUnstable];
    assert!(expected.contains(&rejected.reason) && !rejected.message.is_empty(), "{rejected:?}");
    let database = Database::read(&folder.path().join("database.safetensors"), None).unwrap();
    assert_eq!(database.examples[0].record.index, 1);
    assert_eq!(database.rejected, report.result.rejected);
    assert!(folder.path().join("examples/00000.rejected.json").exists());
    let again = train(&setup, &folder, DatabaseKind::Evaluation, 1, &mut Counting::patient()).unwrap();
    assert_eq!((again.run.solved, again.run.resumed), (0, 2), "a rejection is not tried again");
}

/// Deep presses turn elements over at the rim of the tie, unless a guard holds them.
#[test]
fn elements_that_turn_over_are_held_and_the_record_says_so() {
    let mut setup = common::tiny();
    let Source::Press(ranges) = &setup.training.source else { panic!() };
    let deep = PressRanges { depth_share: [0.5, 0.6], drag_m: [0.004, 0.005], drag_share: 1.0, ..ranges.clone() };
    setup.training.source = Source::Press(deep);
    let folder = TempDir::new().unwrap();
    let report = train(&setup, &folder, DatabaseKind::Training, 1, &mut Counting::patient()).unwrap();
    println!("{:?}\n{:?}", report.result.guarded, report.result.rejected);
    let database = Database::read(&folder.path().join("database.safetensors"), None).unwrap();
    let guarded = database.examples.iter().filter_map(|e| Some((&e.record.tied, e.record.tied_unguarded?)));
    assert!(guarded.clone().count() > 0, "no element turned over");
    for (tied, unguarded) in guarded {
        assert!(unguarded.smallest_jacobian < SMALLEST_JACOBIAN && tied.smallest_jacobian >= SMALLEST_JACOBIAN);
        assert!(tied.residual <= 1e-8, "{tied:?}");
        let distance = unguarded.to_accepted.expect("the accepted skin is at hand");
        assert!(distance.rms_m > 0.0 && distance.worst_m < 5e-3, "{distance:?}");
        assert!(unguarded.worst_m.iter().zip([0.04, 0.04, 0.02]).all(|(x, size)| (0.0..size).contains(x)));
    }
}

#[test]
fn a_job_without_an_example_fails_and_says_why() {
    let mut setup = common::tiny();
    setup.drive.patience_s = 0.01;
    setup.drive.window_s = 0.01;
    (setup.drive.settled_m, setup.drive.tolerated_m) = (0.0, 0.0);
    let folder = TempDir::new().unwrap();
    let message = train(&setup, &folder, DatabaseKind::Training, 1, &mut Counting::patient()).unwrap_err().to_string();
    assert!(message.contains("all 4 interactions were rejected") && message.contains("moves by"), "{message}");
    assert!(!folder.path().join("database.safetensors").exists());
}

#[test]
fn a_folder_of_another_scene_or_plan_is_refused() {
    let setup = common::tiny();
    let folder = TempDir::new().unwrap();
    train(&setup, &folder, DatabaseKind::Training, 2, &mut Counting::patient()).unwrap();
    let refused =
        |setup: &Setup, kind| train(setup, &folder, kind, 1, &mut Counting::patient()).unwrap_err().to_string();
    let other = Setup { scene_hash: "1".repeat(64), ..setup.clone() };
    let message = refused(&other, DatabaseKind::Training);
    assert!(message.contains("another scene") && message.contains("00000.safetensors"), "{message}");
    let other = Setup { training_seed: 9, ..setup.clone() };
    assert!(refused(&other, DatabaseKind::Training).contains("another plan"));
    assert!(refused(&setup, DatabaseKind::Evaluation).contains("another plan"));
    let locked = TrainingFolder::open(folder.path()).unwrap();
    assert!(
        TrainingFolder::open(folder.path()).unwrap_err().to_string().contains("another process works in this folder")
    );
    drop(locked);
}

/// A damaged example is made again; the job ends with the same database.
#[test]
fn damaged_examples_are_made_again() {
    let setup = common::tiny();
    let folder = TempDir::new().unwrap();
    train(&setup, &folder, DatabaseKind::Training, 2, &mut Counting::patient()).unwrap();
    let first = bytes(&folder);
    let path = folder.path().join("examples/00001.safetensors");
    let example = fs::read(&path).unwrap();
    fs::write(&path, &example[..example.len() - 7]).unwrap();
    fs::write(folder.path().join("examples/.00002.safetensors.tmp"), b"half").unwrap();
    let report = train(&setup, &folder, DatabaseKind::Training, 1, &mut Counting::patient()).unwrap();
    assert_eq!((report.run.solved, report.run.resumed), (1, 3));
    assert!(bytes(&folder) == first);
    assert!(!folder.path().join("examples/.00002.safetensors.tmp").exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let message = TrainingFolder::open(&folder.path().join("file/job")).unwrap_err().to_string();
    assert!(message.contains("file/job"), "{message}");
    // The examples of a folder that breaks while the job runs: what is finished stays.
    let setup = common::tiny();
    let job_folder = TrainingFolder::open(folder.path()).unwrap();
    fs::remove_dir(folder.path().join("examples")).unwrap();
    fs::write(folder.path().join("examples"), "no folder").unwrap();
    let error = run(&setup, &job(DatabaseKind::Training, None), 1, &job_folder, &mut |_| ControlFlow::Continue(()))
        .unwrap_err();
    assert!(matches!(error, TrainingError::Io { .. }), "{error}");
}

/// How a pose is driven to is no part of the scene's hash, but an example depends on it.
#[test]
fn examples_that_were_driven_otherwise_are_not_taken_over() {
    let setup = common::tiny();
    let folder = TempDir::new().unwrap();
    train(&setup, &folder, DatabaseKind::Training, 2, &mut Counting::patient()).unwrap();
    let mut other = setup.clone();
    other.drive.speed_m_per_s *= 2.0;
    let message = train(&other, &folder, DatabaseKind::Training, 1, &mut Counting::patient()).unwrap_err().to_string();
    assert!(message.contains("another plan"), "{message}");
}
