//! `plicad bench`.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use plica_daemon::database_loader::{self, Enrichment, Ready};
use plica_daemon::realtime::StageTimer;
use plica_daemon::replay::Replay;
use plica_scene::Config;
use plica_scene::model;
use plica_scene::motion::TimedPose;
use plica_scene::scene::BenchConfig;
use plica_sim::{ElementKind, Model, PoseSample, Stage};
use serde::Serialize;

use crate::cli::{BenchArgs, Element};
use crate::roofline::Roofline;
use crate::work::{table_bytes, work};

/// What a tick does after the simulation's own stages: poses in, wrenches and frame out.
const HAND_OVER: &str = "hand_over";

/// Warm-up of a whole pass of the motion, however long it is.
pub const WHOLE_MOTION: u64 = u64::MAX;

/// What `bench` prints as JSON. Times in microseconds.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Name of the scene.
    pub scene: String,
    /// Element that was used.
    pub element: &'static str,
    /// Ticks that were timed.
    pub ticks: u64,
    /// The whole tick.
    pub tick_us: Spread,
    /// Each stage.
    pub stages: std::collections::BTreeMap<String, Spread>,
    /// Median tick over `limit_us`.
    pub roofline_ratio: f64,
    /// Least time for the bytes and operations of a mean tick at the rates measured in this run.
    pub limit_us: f64,
    /// Read bandwidth measured in this run, for a buffer as large as the tables.
    pub read_gb_per_s: f64,
    /// Multiply-adds measured in this run (two operations each).
    pub gflop_per_s: f64,
    /// Solver iterations of a mean tick.
    pub mean_iterations: f64,
    /// Ticks that repeated a solve.
    pub fallback_ticks: u64,
    /// Deepest penetration \[m\].
    pub max_penetration_m: f64,
    /// Force on the first tool at full press \[N\], in the first pass of the motion.
    pub full_press_force_n: Option<[f64; 3]>,
}

/// Least, median and 99th percentile.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Spread {
    /// Least.
    pub min: f64,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
}

/// Times a scene and prints the result.
pub fn run(args: &BenchArgs, json: bool) -> anyhow::Result<()> {
    let mut config = super::scene_with(&args.scene, &args.database)?;
    if let Some(element) = args.element {
        config.set_element(match element {
            Element::EnhancedStrain => ElementKind::EnhancedStrain,
            Element::FullIntegration => ElementKind::FullIntegration,
        });
    }
    let motion = config.bench().ok_or_else(|| {
        anyhow::anyhow!(
            "{}: has no [bench] table; add one with `motion` keyframes, as configs/scenes/wedge.toml has",
            config.file().display()
        )
    })?;
    let report = bench(&config, motion, args.ticks, WHOLE_MOTION)?;
    print_table(&report);
    if json {
        println!("{}", serde_json::to_string(&report)?);
    }
    Ok(())
}

/// Times `n_ticks` ticks of a scene, starting its motion anew each time it is through. Before, one pass of at most
/// `most_warm` ticks is not timed.
pub fn bench(config: &Config, motion: &BenchConfig, n_ticks: u64, most_warm: u64) -> anyhow::Result<Report> {
    let model = Arc::new(model::build(config)?);
    let enrichment = database_loader::at_start(config, &model)?;
    let scene = Scene { config, model: &model, motion, enrichment: enrichment.as_ref() };
    let mut timings = Timings::new(n_ticks);
    let per_pass = 1 + (motion.duration_s() / model.timestep_s()).round() as u64;
    let mut full_press = None;
    // One pass is not counted: it brings tables and branch predictors up to temperature.
    let n_warm = per_pass.min(most_warm);
    run_pass(&scene, &mut Timings::new(n_warm), n_warm, &mut full_press);
    while (timings.total_ns.len() as u64) < n_ticks {
        let left = n_ticks - timings.total_ns.len() as u64;
        run_pass(&scene, &mut timings, per_pass.min(left), &mut full_press);
    }
    Ok(timings.report(&scene, full_press))
}

/// What is timed.
struct Scene<'a> {
    config: &'a Config,
    model: &'a Arc<Model>,
    motion: &'a BenchConfig,
    enrichment: Option<&'a (Enrichment, Ready)>,
}

fn run_pass(scene: &Scene<'_>, timings: &mut Timings, n_ticks: u64, full_press: &mut Option<[f64; 3]>) {
    let Scene { model, motion, .. } = *scene;
    let mut replay = Replay::new(Arc::clone(model), poses(model, scene.config, motion, n_ticks));
    if let Some((enrichment, ready)) = scene.enrichment {
        replay.enrich(enrichment.live(ready));
    }
    replay.ports().frames.listening.store(true, Relaxed);
    let mut timer = StageTimer::new();
    for _ in 0..n_ticks {
        replay.deliver();
        let begin = Instant::now();
        let report = replay.turn(&mut timer);
        let total_ns = begin.elapsed().as_nanos() as u64;
        timings.note(total_ns, &timer.take_ns(), &report);
        let time_s = replay.core().state().sim_time_s();
        let pressed = motion.full_press_s().is_some_and(|t| (time_s - t).abs() < 0.5 * model.timestep_s());
        if pressed && full_press.is_none() {
            *full_press = replay.core().state().tools().first().map(|t| t.force_n.into());
        }
    }
}

/// The motion, one pose per tool and tick.
fn poses(model: &Model, config: &Config, motion: &BenchConfig, n_ticks: u64) -> Vec<TimedPose> {
    let tools = 0..config.tools().len();
    let at = |tick: u64| {
        let time_s = tick as f64 * model.timestep_s();
        tools.clone().filter_map(move |tool| {
            // A pose drawn at `time_s` is where the tool is at the end of that tick.
            let pose = motion.pose(tool, time_s + model.timestep_s())?;
            let source_time_ns = Some((time_s * 1e9) as u64).filter(|ns| *ns != 0);
            let sample = PoseSample { sequence: tick + 1, source_time_ns, valid: true, pose };
            Some(TimedPose { time_s, tool, sample })
        })
    };
    (0..n_ticks).flat_map(at).collect()
}

struct Timings {
    total_ns: Vec<u64>,
    stages_ns: [Vec<u64>; Stage::ALL.len()],
    hand_over_ns: Vec<u64>,
    iterations: u64,
    passes: u64,
    fallback_ticks: u64,
    max_penetration_m: f32,
}

impl Timings {
    fn new(n_ticks: u64) -> Self {
        let room = || Vec::with_capacity(n_ticks as usize);
        Self {
            total_ns: room(),
            stages_ns: std::array::from_fn(|_| room()),
            hand_over_ns: room(),
            iterations: 0,
            passes: 0,
            fallback_ticks: 0,
            max_penetration_m: 0.0,
        }
    }

    fn note(&mut self, total_ns: u64, stages_ns: &[u64], report: &plica_sim::TickReport) {
        self.total_ns.push(total_ns);
        self.stages_ns.iter_mut().zip(stages_ns).for_each(|(all, ns)| all.push(*ns));
        self.hand_over_ns.push(total_ns.saturating_sub(stages_ns.iter().sum()));
        self.iterations += u64::from(report.iterations);
        self.passes += u64::from(report.passes);
        self.fallback_ticks += u64::from(report.fallbacks > 0);
        self.max_penetration_m = self.max_penetration_m.max(report.max_penetration_m);
    }

    fn report(self, scene: &Scene<'_>, full_press_force_n: Option<[f64; 3]>) -> Report {
        let Scene { config, model, enrichment, .. } = *scene;
        let ticks = self.total_ns.len() as u64;
        let mean_iterations = self.iterations as f64 / ticks as f64;
        let (bytes, flops) = work(model, mean_iterations, self.passes as f64 / ticks as f64);
        let roofline = Roofline::measure(table_bytes(model));
        let limit_us = 1e6 * roofline.limit_s(bytes, flops);
        let tick_us = spread(self.total_ns);
        let stages = Stage::ALL.iter().zip(self.stages_ns);
        let stages = stages.filter(|(s, _)| **s != Stage::Enrichment || enrichment.is_some());
        let stages = stages.map(|(s, ns)| (s.name().to_owned(), spread(ns)));
        let stages = stages.chain([(HAND_OVER.to_owned(), spread(self.hand_over_ns))]).collect();
        Report {
            scene: config.name().to_owned(),
            element: match config.object().element() {
                ElementKind::EnhancedStrain => "enhanced_strain",
                ElementKind::FullIntegration => "full_integration",
            },
            ticks,
            tick_us,
            stages,
            roofline_ratio: tick_us.p50 / limit_us,
            limit_us,
            read_gb_per_s: 1e-9 * roofline.bytes_per_s,
            gflop_per_s: 1e-9 * roofline.flops_per_s,
            mean_iterations,
            fallback_ticks: self.fallback_ticks,
            max_penetration_m: self.max_penetration_m.into(),
            full_press_force_n,
        }
    }
}

fn spread(mut ns: Vec<u64>) -> Spread {
    ns.sort_unstable();
    let us =
        |share: f64| ns.get(((ns.len() as f64 - 1.0) * share).round() as usize).map_or(0.0, |ns| *ns as f64 * 1e-3);
    Spread { min: us(0.0), p50: us(0.5), p99: us(0.99) }
}

fn print_table(r: &Report) {
    println!("{} ({}), {} ticks, one thread; microseconds", r.scene, r.element, r.ticks);
    println!("{:<12} {:>9} {:>9} {:>9}", "stage", "min", "p50", "p99");
    let row = |name: &str, s: &Spread| println!("{name:<12} {:>9.1} {:>9.1} {:>9.1}", s.min, s.p50, s.p99);
    let order = Stage::ALL.iter().map(|s| s.name()).chain([HAND_OVER]);
    order.filter_map(|name| r.stages.get_key_value(name)).for_each(|(name, s)| row(name, s));
    row("tick", &r.tick_us);
    println!(
        "limit {:.1} us for a mean tick of {:.1} iterations at {:.1} GB/s and {:.0} GFLOP/s (measured now); median tick / limit = {:.1}",
        r.limit_us, r.mean_iterations, r.read_gb_per_s, r.gflop_per_s, r.roofline_ratio
    );
    println!(
        "deepest penetration {:.3} mm, {} ticks with a repeated solve",
        1e3 * r.max_penetration_m,
        r.fallback_ticks
    );
    if let Some([x, y, z]) = r.full_press_force_n {
        println!("force at full press: {x:.3} {y:.3} {z:.3} N (Fz = {z:.3} N)");
    }
}
