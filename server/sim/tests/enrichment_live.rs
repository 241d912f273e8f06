//! Enrichment of a running simulation: windows follow, are held, hand over and share; tools stay outside.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod common;

use std::sync::{Arc, LazyLock};

use common::examples::{Bench, Press, RADIUS, examples, press_of, presses, scene, size};
use common::{Run, at, ball, top, top_normal};
use nalgebra::{Point3, Vector3};
use plica_sim::Model;
use plica_sim::enrichment::*;

static TRAINING_SET: LazyLock<Vec<Press>> = LazyLock::new(|| presses(32, 1, [[0.02, 0.012], [0.08, 0.048]]));

/// A run with enrichment after every tick.
struct Enriched {
    run: Run,
    live: LiveEnrichment,
    before: Vec<[f32; 3]>,
    skin: Vec<[f32; 3]>,
}

impl Enriched {
    fn new(n_tools: usize) -> Self {
        Self::with(n_tools, EnrichmentOptions::default())
    }

    fn with(n_tools: usize, options: EnrichmentOptions) -> Self {
        let model = (1..n_tools).fold(scene(), |scene, _| scene.tool(ball(RADIUS))).run().model;
        let enricher = Enricher::new(&model, &examples(&TRAINING_SET), options).unwrap();
        let run = Run::new(model);
        let live = LiveEnrichment::new(&run.model, Arc::new(enricher));
        let skin = vec![[0.0; 3]; run.model.n_skin()];
        let mut this = Self { run, live, before: skin.clone(), skin };
        this.look();
        this
    }

    /// A tick with the tools at these poses; the skin before and after it.
    fn tick(&mut self, places: &[Point3<f64>]) {
        let poses: Vec<_> = places.iter().enumerate().map(|(tool, p)| (tool, at(*p))).collect();
        self.run.tick(&poses);
        self.live.follow(&self.run.model, &self.run.state);
        self.look();
    }

    fn look(&mut self) {
        std::mem::swap(&mut self.before, &mut self.skin);
        self.live.write_skin(&self.run.model, &self.run.state, &mut self.skin);
    }

    fn glide(&mut self, from: Point3<f64>, to: Point3<f64>, ticks: usize, mut each: impl FnMut(&Self)) {
        for k in 1..=ticks {
            self.tick(&[from + (to - from) * (k as f64 / ticks as f64)]);
            each(self);
        }
    }

    fn coarse(&self) -> Vec<[f32; 3]> {
        let mut coarse = vec![[0.0; 3]; self.run.model.n_skin()];
        self.run.state.write_skin(&self.run.model, &mut coarse);
        coarse
    }

    /// Largest detail on the skin [m].
    fn detail(&self) -> f64 {
        apart(&self.skin, &self.coarse())
    }

    /// Largest change of the skin in the last tick [m].
    fn change(&self) -> f64 {
        apart(&self.skin, &self.before)
    }
}

fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    a.iter().zip(b).map(|(a, b)| size(&[a[0] - b[0], a[1] - b[1], a[2] - b[2]])).fold(0.0, f64::max)
}

/// The ball this deep in the top at `x`, `y`.
fn deep(x: f64, y: f64, depth: f64) -> Point3<f64> {
    Point3::new(x, y, top(x)) + top_normal() * (RADIUS - depth)
}

#[test]
fn detail_follows_a_press_and_is_held_at_release() {
    let mut it = Enriched::new(1);
    assert_eq!((it.detail(), it.live.least_confidence()), (0.0, 0.0));
    it.glide(deep(0.05, 0.03, 0.0), deep(0.05, 0.03, 0.005), 200, |_| ());
    it.glide(deep(0.05, 0.03, 0.005), deep(0.05, 0.03, 0.005), 100, |_| ());
    let pressed = it.detail();
    assert!(pressed > 1e-3 && it.live.least_confidence() > 0.9 && it.live.confidence(0) > 0.9, "{pressed}");
    // Sudden release: the coarse skin recovers over time, and detail fades with it, without a step of its own.
    let away = Point3::new(0.05, 0.03, 0.2);
    let (mut previous, mut most_drop, mut ticks) = (pressed, 0.0_f64, 0);
    while it.detail() > 0.01 * pressed && ticks < 3000 {
        let coarse_before = it.coarse();
        it.tick(&[away]);
        let own = (it.detail() - previous).abs();
        let coarse_step = apart(&it.coarse(), &coarse_before);
        most_drop = most_drop.max(own - 2.0 * coarse_step);
        previous = it.detail();
        ticks += 1;
    }
    println!("{:.2} mm of detail; gone {ticks} ticks after release", 1e3 * pressed);
    assert!(ticks > 5 && ticks < 3000, "{ticks}");
    assert!(most_drop < 0.02 * pressed, "detail changes by {most_drop} m more than the skin under it");
    (0..1000).for_each(|_| it.tick(&[away]));
    assert_eq!(it.detail(), 0.0, "the window is over");
}

#[test]
fn a_window_hands_over_to_another_place_without_a_jump() {
    let mut it = Enriched::new(1);
    it.glide(deep(0.035, 0.03, 0.0), deep(0.035, 0.03, 0.005), 200, |_| ());
    let own = it.detail();
    // Jumps to another contact point on the recovering skin.
    let mut largest: f64 = 0.0;
    it.glide(deep(0.065, 0.03, 0.0005), deep(0.065, 0.03, 0.005), 200, |it| largest = largest.max(it.change()));
    println!("{:.2} mm of detail, largest change in a tick {:.2} mm", 1e3 * own, 1e3 * largest);
    assert!(largest < 0.5 * own, "{largest} of {own}");
}

#[test]
fn two_tools_share_the_skin() {
    let place = |y: f64, depth: f64| deep(0.05, y, depth);
    let press = |it: &mut Enriched, places: [Option<f64>; 2]| {
        for k in 0..400 {
            let depth = 0.004 * (f64::from(k) / 200.0).min(1.0);
            let at = |y: Option<f64>| y.map_or(Point3::new(0.05, 0.03, 0.3), |y| place(y, depth));
            it.tick(&places.map(at));
        }
    };
    let mut both = Enriched::new(2);
    press(&mut both, [Some(0.018), Some(0.042)]);
    let (mut left, mut right) = (Enriched::new(2), Enriched::new(2));
    press(&mut left, [Some(0.018), None]);
    press(&mut right, [None, Some(0.042)]);
    let detail = |it: &Enriched| -> Vec<Vector3<f64>> {
        let coarse = it.coarse();
        it.skin.iter().zip(coarse).map(|(s, c)| Vector3::from_fn(|k, _| f64::from(s[k] - c[k]))).collect()
    };
    let [both_detail, left_detail, right_detail] = [&both, &left, &right].map(detail);
    let skin = &both.run.model.description().skin;
    let around = |y: f64, d: &[Vector3<f64>]| -> f64 {
        let centre = Point3::new(0.05, y, top(0.05));
        let near = |p: &Point3<f64>| (p - centre).norm() < 0.01;
        skin.positions().iter().zip(d).filter(|(p, _)| near(p)).map(|(_, d)| d.norm()).fold(0.0, f64::max)
    };
    assert!(both.live.confidence(0) > 0.3 && both.live.confidence(1) > 0.3);
    assert!(left.live.confidence(1) == 0.0 && right.live.confidence(0) == 0.0);
    for (y, alone) in [(0.018, &left_detail), (0.042, &right_detail)] {
        let ratio = around(y, &both_detail) / around(y, alone);
        println!("at y {y}: {:.2} mm, {ratio:.2} of what the tool has alone", 1e3 * around(y, &both_detail));
        assert!((0.6..1.7).contains(&ratio), "the near tool decides: {ratio}");
    }
    assert!(around(0.042, &both_detail) > 1.3 * around(0.042, &left_detail), "the other tool adds its own");
}

#[test]
fn windows_come_and_go_without_a_jump() {
    let mut it = Enriched::new(2);
    let away = Point3::new(0.05, 0.03, 0.3);
    let detail = |it: &Enriched| -> Vec<[f32; 3]> {
        let coarse = it.coarse();
        it.skin.iter().zip(coarse).map(|(s, c)| std::array::from_fn(|k| s[k] - c[k])).collect()
    };
    // The first tool rests in the skin; the second makes contact, leaves, and returns elsewhere while its window is
    // still held.
    let second = |k: i32| match k {
        400..600 => deep(0.065, 0.04, 0.003 * f64::from(k - 400) / 200.0),
        650..850 => deep(0.065, 0.022, 0.003 * f64::from(k - 650) / 200.0),
        _ => away,
    };
    let (mut before, mut coarse_before) = (detail(&it), it.coarse());
    let (mut most, mut largest) = ((0.0_f64, 0), 0.0_f64);
    for k in 0..1100 {
        it.tick(&[deep(0.05, 0.03, 0.004 * (f64::from(k) / 300.0).min(1.0)), second(k)]);
        let (now, coarse_now) = (detail(&it), it.coarse());
        let alone = apart(&now, &before) - 2.0 * apart(&coarse_now, &coarse_before);
        most = if alone > most.0 { (alone, k) } else { most };
        largest = largest.max(it.detail());
        for (tool, reading) in it.run.state.tools().iter().enumerate().filter(|(_, r)| r.in_contact) {
            let apart = (reading.contact_point_m - Point3::from(reading.proxy.translation.vector)).norm();
            assert!(reading.contact_point_is_new && apart < 1.5 * RADIUS, "tick {k}, tool {tool}: {apart}");
        }
        (before, coarse_before) = (now, coarse_now);
    }
    println!("largest change of its own {:.0} um of {:.2} mm, tick {}", 1e6 * most.0, 1e3 * largest, most.1);
    // Detail at vertices kept clear returns in the tick in which the tool leaves.
    assert!(most.0 < 0.1 * largest, "{most:?} of {largest}");
}

/// Largest change of any confidence from tick to tick, and how often one went from below 0.1 to above 0.9 or back.
#[derive(Debug, Default)]
struct Flicker {
    before: Option<[f32; 3]>,
    largest: f32,
    /// Whether each was last above 0.9 rather than below 0.1.
    is_high: [bool; 3],
    n_turns: usize,
}

impl Flicker {
    fn watch(&mut self, it: &Enriched) {
        let now = [it.live.confidence(0), it.live.confidence(1), it.live.least_confidence()];
        for (before, now) in self.before.iter().flatten().zip(now) {
            self.largest = self.largest.max((now - before).abs());
        }
        for (is_high, now) in self.is_high.iter_mut().zip(now) {
            let turns = if *is_high { now < 0.1 } else { now > 0.9 };
            self.n_turns += usize::from(turns);
            *is_high ^= turns;
        }
        self.before = Some(now);
    }
}

#[test]
fn confidence_moves_as_steadily_as_detail_does() {
    let away = Point3::new(0.05, 0.03, 0.3);
    let still = deep(0.05, 0.03, 0.004);
    // Presses, slides out of what was trained on, and is taken away; then trembles on the skin, jumps elsewhere, and is taken away
    // while another tool comes, goes, and comes again.
    let first = |k: i32| match k {
        0..200 => deep(0.05, 0.03, 0.004 * f64::from(k) / 200.0),
        200..600 => deep(0.05 + 0.05 * f64::from(k - 200) / 400.0, 0.03, 0.004),
        1000..1300 => deep(0.05, 0.03, 0.0008 * (f64::from(k) * 0.7).sin()),
        1300..1400 => still,
        1400..1500 => deep(0.065, 0.022, 0.003),
        _ => away,
    };
    let second = |k: i32| if (1600..2200).contains(&k) && k % 150 < 75 { deep(0.04, 0.03, 0.003) } else { away };
    let (mut it, mut flicker) = (Enriched::new(2), Flicker::default());
    for (phase, ticks) in
        [("press", 0..200), ("slide", 200..600), ("release", 600..1000), ("tremble", 1000..1300), ("rest", 1300..3500)]
    {
        (flicker.largest, flicker.n_turns) = (0.0, 0);
        for k in ticks {
            it.tick(&[first(k), second(k)]);
            flicker.watch(&it);
        }
        println!("{phase}: largest change per tick {:.4}, {} turns", flicker.largest, flicker.n_turns);
        assert!(flicker.largest < 0.0201, "{phase}: {}", flicker.largest);
        assert!(phase != "tremble" || flicker.n_turns <= 3, "{}", flicker.n_turns);
    }
    assert_eq!(it.live.least_confidence(), 0.0, "nothing touches any more");
}

/// Frames are written more seldom than ticks are taken.
#[test]
fn confidence_is_as_steady_when_frames_are_rare() {
    let (mut it, mut flicker) = (Enriched::new(1), Flicker::default());
    let mut skin = it.skin.clone();
    for k in 0..400 {
        let place = if k < 300 { deep(0.05, 0.03, 0.004) } else { Point3::new(0.05, 0.03, 0.3) };
        it.run.tick(&[(0, at(place))]);
        it.live.follow(&it.run.model, &it.run.state);
        if k % 11 == 0 {
            it.live.write_skin(&it.run.model, &it.run.state, &mut skin);
        }
        let now = it.live.confidence(0);
        let before = flicker.before.map_or(now, |b| b[0]);
        flicker.largest = flicker.largest.max((now - before).abs());
        flicker.before = Some([now; 3]);
        assert!(k != 150 || now > 0.5, "{now} in a press that is held");
    }
    assert!(flicker.largest < 0.0201, "{}", flicker.largest);
}

#[test]
fn detail_never_pushes_the_skin_into_the_tool() {
    let mut it = Enriched::new(1);
    let deepest = |skin: &[[f32; 3]], centre: Point3<f64>| {
        let gap = |p: &[f32; 3]| (Point3::new(p[0] as f64, p[1] as f64, p[2] as f64) - centre).norm() - RADIUS;
        skin.iter().map(gap).fold(f64::INFINITY, f64::min)
    };
    let mut most: f64 = 0.0;
    it.glide(deep(0.05, 0.03, 0.0), deep(0.05, 0.03, 0.006), 300, |it| {
        let centre = Point3::from(it.run.state.tools()[0].proxy.translation.vector);
        most = most.max(deepest(&it.coarse(), centre).min(0.0) - deepest(&it.skin, centre));
    });
    assert!(it.detail() > 1e-3);
    assert!(most < 1e-6, "{most} m deeper than the coarse skin");
}

#[test]
fn other_examples_take_over_what_is_held() {
    let mut it = Enriched::new(1);
    it.glide(deep(0.05, 0.03, 0.0), deep(0.05, 0.03, 0.005), 200, |_| ());
    it.tick(&[Point3::new(0.05, 0.03, 0.2)]);
    let held = it.detail();
    let mut other = LiveEnrichment::new(&it.run.model, Arc::clone(it.live.enricher()));
    other.adopt(&it.live);
    it.live = other;
    it.look();
    assert!(held > 1e-3 && it.change() < 1e-9, "{held} {}", it.change());
}

#[test]
fn a_reset_forgets() {
    let mut it = Enriched::new(1);
    it.glide(deep(0.05, 0.03, 0.0), deep(0.05, 0.03, 0.005), 200, |_| ());
    it.live.forget();
    it.look();
    assert_eq!((it.detail(), it.live.least_confidence()), (0.0, 0.0));
}

#[test]
fn the_same_twice_is_the_same() {
    let run = || {
        let mut it = Enriched::new(1);
        it.glide(deep(0.05, 0.03, 0.0), deep(0.055, 0.03, 0.005), 100, |_| ());
        it.skin
    };
    assert_eq!(run(), run());
}

#[test]
fn an_enricher_knows_its_model() {
    let model = scene().run().model;
    let enricher = Enricher::new(&model, &examples(&TRAINING_SET), EnrichmentOptions::default()).unwrap();
    assert!(enricher.fits(&model));
    let other: Model = common::Scene::block(common::E, 0.45).run().model;
    assert!(!enricher.fits(&other));
}

/// The detail of a running simulation equals an evaluation of the same state, for every method: to 0.1 um, except
/// vertices moved by the clearance.
#[test]
fn every_method_serves_what_it_is_measured_by() {
    let axes = [Vector3::x(), Vector3::y()];
    for method in METHODS {
        let mut it = Enriched::with(1, method.options(axes));
        it.glide(deep(0.05, 0.03, 0.0), deep(0.05, 0.03, 0.005), 100, |_| ());
        it.live.forget();
        it.tick(&[deep(0.05, 0.03, 0.005)]);
        for _ in 0..60 {
            it.run.tick(&[(0, at(deep(0.05, 0.03, 0.005)))]);
            it.live.follow(&it.run.model, &it.run.state);
        }
        it.tick(&[deep(0.05, 0.03, 0.005)]);
        let mut bench = Bench::new(&TRAINING_SET, method.options(axes));
        let confidence = bench.enrich(&press_of(&it.run), 1.0);
        let centre = Point3::from(it.run.state.tools()[0].proxy.translation.vector).cast::<f32>();
        let (mut largest, mut worst, mut compared) = (0.0_f64, 0.0_f64, 0);
        for ((served, coarse), detail) in it.skin.iter().zip(it.coarse()).zip(&bench.detail) {
            let measured = [0, 1, 2].map(|k| coarse[k] + detail[k]);
            if (Point3::from(measured) - centre).norm() > RADIUS as f32 {
                worst = worst.max(size(&[0, 1, 2].map(|k| served[k] - measured[k])));
                largest = largest.max(size(detail));
                compared += 1;
            }
        }
        println!(
            "{:25} {:.2} mm of detail, {:.1e} m apart, confidence {confidence:.2}",
            method.name,
            1e3 * largest,
            worst
        );
        assert!(10 * compared > 9 * it.skin.len() && largest > 3e-4, "{}: {compared} {largest}", method.name);
        assert!(worst < 1e-7, "{}: {worst} m apart", method.name);
        assert!((it.live.confidence(0) - confidence).abs() < 1e-4, "{}", method.name);
    }
}
