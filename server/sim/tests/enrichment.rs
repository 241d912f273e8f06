//! Enrichment methods on examples with a known solution. `-- --nocapture` prints the figures.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::sync::LazyLock;

use common::examples::{Bench, Press, examples, largest, median, presses, scene, size};
use plica_sim::enrichment::*;

const REGION: [[f64; 2]; 2] = [[0.02, 0.012], [0.08, 0.048]];

static TRAINING_SET: LazyLock<Vec<Press>> = LazyLock::new(|| presses(48, 1, REGION));
static HELD_OUT: LazyLock<Vec<Press>> = LazyLock::new(|| presses(16, 2, REGION));
static THIN_END: LazyLock<Vec<Press>> = LazyLock::new(|| presses(4, 3, [[0.1, 0.02], [0.11, 0.04]]));

fn default() -> EnrichmentOptions {
    EnrichmentOptions::default()
}

/// Lossless storage.
fn exact(interpolator: Interpolator, control_variate: bool) -> EnrichmentOptions {
    let field =
        FieldOptions { interpolator, control_variate, modes: usize::MAX, precision: Precision::F32, ..default().field };
    EnrichmentOptions { field, ..default() }
}

/// The paper's method.
fn paper(interpolator: Interpolator, options: Ssh12Options) -> EnrichmentOptions {
    EnrichmentOptions { correlator: Correlator::Ssh12(options), ..exact(interpolator, false) }
}

fn replication() -> Ssh12Options {
    Ssh12Options { null_weight: 0.0, ..Ssh12Options::default() }
}

fn all_correlators() -> [(&'static str, Correlator); 7] {
    [
        ("kriging", Correlator::Kriging),
        ("ssh12", Correlator::Ssh12(Ssh12Options::default())),
        ("regression", Correlator::Linear(LinearKind::Regression)),
        ("ridge", Correlator::Linear(LinearKind::Ridge)),
        ("harmonic", Correlator::Linear(LinearKind::Harmonic)),
        ("rbf", Correlator::Rbf { width_cells: 1.5 }),
        ("rescale", Correlator::Rescale),
    ]
}

fn median_error(bench: &mut Bench, presses: &[Press]) -> f64 {
    let error = |p: &Press| {
        bench.enrich(p, 1.0);
        bench.relative_error(p)
    };
    median(presses.iter().map(error).collect())
}

#[test]
fn an_example_reproduces_itself_on_all_faces() {
    for interpolator in [Interpolator::Vector, Interpolator::Blend, Interpolator::Warp] {
        for control_variate in [false, true] {
            let mut bench = Bench::new(&TRAINING_SET, exact(interpolator, control_variate));
            let mut worst: f64 = 0.0;
            for i in (0..TRAINING_SET.len()).step_by(7) {
                bench.reproduce(&TRAINING_SET, i);
                let miss = bench.misses(&TRAINING_SET[i]).into_iter().fold(0.0, f64::max);
                worst = worst.max(miss / largest(&TRAINING_SET[i]));
            }
            println!("{interpolator:?}, control variate {control_variate}: {worst:.1e} of the largest detail");
            assert!(worst < 1e-5, "{interpolator:?}: {worst:e}");
        }
    }
}

#[test]
fn a_stamp_reproduces_its_example_as_its_texels_allow() {
    let of_texels = |coordinates, texels| {
        let field = FieldOptions { texels, ..exact(Interpolator::Stamp, false).field };
        let mut bench = Bench::new(&TRAINING_SET, EnrichmentOptions { field, coordinates, ..default() });
        let radius = 0.7 * bench.enricher.radius_m();
        let positions: Vec<_> = bench.model.description().skin.positions().to_vec();
        let error = |i: usize| {
            bench.reproduce(&TRAINING_SET, i);
            let mut misses = bench.misses(&TRAINING_SET[i]);
            // The top, where the projection has a chart too.
            let centre = TRAINING_SET[i].touch.contact_point;
            for (miss, p) in misses.iter_mut().zip(&positions) {
                let is_in_chart = (p - centre).norm() < radius && (p.z - common::top(p.x)).abs() < 1e-6;
                *miss = if is_in_chart { *miss } else { 0.0 };
            }
            bench.rms(&misses) / largest(&TRAINING_SET[i])
        };
        (0..TRAINING_SET.len()).step_by(5).map(error).fold(0.0, f64::max)
    };
    for texels in [32, 64, 128, 256] {
        let [geodesic, projected] = [Coordinates::Exponential, Coordinates::Orthogonal].map(|c| of_texels(c, texels));
        println!(
            "{texels} texels: RMS {:.2} % of the largest detail; projected {:.2} %",
            1e2 * geodesic,
            1e2 * projected
        );
        assert!(geodesic < 0.03, "{texels} texels: {geodesic}");
    }
}

#[test]
fn the_default_beats_rescaling_and_ridge_on_unseen_presses() {
    let error = |name: &str, options| {
        let error = median_error(&mut Bench::new(&TRAINING_SET, options), &HELD_OUT);
        println!("{name}: {error:.3}");
        error
    };
    let best = error("default", default());
    let rescale = error("rescale", EnrichmentOptions { correlator: Correlator::Rescale, ..default() });
    let vector = exact(Interpolator::Vector, false);
    let ridge = error("ridge", EnrichmentOptions { correlator: Correlator::Linear(LinearKind::Ridge), ..vector });
    assert!(best < 0.7 * rescale.min(ridge), "{best} {rescale} {ridge}");
    let paper = error("ssh12", paper(Interpolator::Blend, replication()));
    assert!(paper < 1.0 && best < paper);
}

#[test]
fn correlation_of_the_paper_as_printed_keeps_opposing_examples() {
    let as_read = median_error(&mut Bench::new(&TRAINING_SET, paper(Interpolator::Vector, replication())), &HELD_OUT);
    let literal = Ssh12Options { literal: true, ..replication() };
    let mut bench = Bench::new(&TRAINING_SET, paper(Interpolator::Vector, literal));
    let printed = median_error(&mut bench, &HELD_OUT);
    println!("on 1 - r {as_read:.3}, on r as printed {printed:.3}");
    assert!(as_read < 0.8 && printed > 1.0, "{as_read} {printed}");
    // An example's own state is not recognised: its detail comes from the least similar examples.
    bench.enrich(&TRAINING_SET[0], 1.0);
    assert!(bench.relative_error(&TRAINING_SET[0]) > 0.9);
}

#[test]
fn what_was_not_trained_stays_coarse() {
    for options in [default(), paper(Interpolator::Vector, replication())] {
        let region = [[0.02, 0.012], [0.04, 0.048]];
        let mut bench = Bench::new(&presses(24, 4, region), options);
        for press in THIN_END.iter() {
            let confidence = bench.enrich(press, 1.0);
            assert!(confidence == 0.0 && bench.detail.iter().all(|d| d.iter().all(|c| *c == 0.0)), "{confidence}");
        }
    }
}

#[test]
fn without_deformation_there_is_no_detail() {
    for (name, correlator) in all_correlators() {
        let mut bench = Bench::new(&TRAINING_SET, EnrichmentOptions { correlator, ..default() });
        bench.enrich(&HELD_OUT[0], 0.0);
        let most = bench.detail.iter().map(|d| size(d)).fold(0.0, f64::max);
        // The position of the tool carries no information on the deformation: the weakness of the method.
        assert_eq!(most == 0.0, name != "rbf", "{name}: {most}");
        bench.enrich(&HELD_OUT[0], 1e-6);
        assert!(bench.detail.iter().flatten().all(|c| c.is_finite()), "{name}");
    }
}

#[test]
fn examples_that_are_there_twice_change_little() {
    let mut random = common::Random(5);
    let mut again = TRAINING_SET.clone();
    for u in again.iter_mut().flat_map(|press| press.displacements.iter_mut().flatten()) {
        *u *= 1.0 + 1e-4 * random.symmetric() as f32;
    }
    let twice = [TRAINING_SET.clone(), again].concat();
    for (name, options) in [("default", default()), ("ssh12", paper(Interpolator::Vector, Ssh12Options::default()))] {
        let once = median_error(&mut Bench::new(&TRAINING_SET, options), &HELD_OUT);
        let doubled = median_error(&mut Bench::new(&twice, options), &HELD_OUT);
        println!("{name}: {once:.3}, doubled {doubled:.3}");
        assert!((doubled - once).abs() < 0.1 * once.max(0.1), "{name}: {once} {doubled}");
    }
}

#[test]
fn detail_moves_smoothly_with_the_contact_point() {
    let mut bench = Bench::new(&TRAINING_SET, default());
    let press = &HELD_OUT[0];
    bench.set(press, 1.0);
    let mut before: Vec<Vec<[f32; 4]>> = Vec::new();
    let (mut most_step, mut most_bend): (f64, f64) = (0.0, 0.0);
    for k in 0..200 {
        let mut touch = press.touch;
        // 0.05 mm at a time along the top, over many anchors of the charts.
        touch.contact_point.x = 0.04 + 5e-5 * f64::from(k);
        touch.contact_point.z = common::top(touch.contact_point.x);
        bench.enrich_at(&touch);
        if let [.., first, second] = &before[..] {
            for ((a, b), c) in first.iter().zip(second).zip(&bench.detail) {
                most_step = most_step.max(size(&[c[0] - b[0], c[1] - b[1], c[2] - b[2]]));
                most_bend = most_bend.max(size(&[0, 1, 2].map(|i| c[i] - 2.0 * b[i] + a[i])));
            }
        }
        before.push(bench.detail.clone());
    }
    println!(
        "largest change per 0.05 mm {:.1} um, largest second difference {:.1} um",
        1e6 * most_step,
        1e6 * most_bend
    );
    assert!(most_step < 0.03 * largest(press), "{most_step}");
    assert!(most_bend < 0.01 * largest(press), "{most_bend}");
}

#[test]
fn examples_that_do_not_fit_are_refused() {
    let model = scene().run().model;
    let mut wrong = examples(&TRAINING_SET[..3]);
    wrong.details[1].pop();
    let error = Enricher::new(&model, &wrong, default()).unwrap_err().to_string();
    assert!(error.contains("example 1") && error.contains("skin vertices"), "{error}");
    assert!(
        Enricher::new(&model, &examples(&TRAINING_SET[..1]), default()).unwrap_err().to_string().contains("at least 2")
    );
    let mut shorter = examples(&TRAINING_SET[..3]);
    shorter.displacements.pop();
    assert!(Enricher::new(&model, &shorter, default()).is_err());
}
