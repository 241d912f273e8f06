//! Acceptance of a recorded motion: picks states of it, solves each with both references, and prints what is rejected and why.
//!
//! ```text
//! cargo run --release -p plica-scene --example accept_motion -- SCENE MOTION [--from S] [--to S] [--states N] [--seed N]
//!     [--reference tied|independent]
//! ```
//!
//! SCENE is a file, or `wedge`; MOTION a TUM file. The cut between two times is fitted above the object, as `plicad simulate --fit`
//! does with a file; states are chosen from it as `plicad train` does, among poses that press the object at rest. Each follows
//! the motion from the last pose that was clear of the object.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use plica_scene::Config;
use plica_scene::motion::{self, MotionOptions};
use plica_scene::setup::setup;
use plica_training::{AccurateResult, InteractionSet, RecordedPose, Setup, Source, Stop, Tandem, plan};

const REFERENCES: [&str; 2] = ["tied", "independent"];

/// What is asked for.
struct Options {
    scene: String,
    motion: PathBuf,
    from_s: f64,
    to_s: f64,
    n_states: usize,
    seed: u64,
    references: Vec<String>,
}

/// Accepted and solved states of one reference.
#[derive(Default)]
struct Count {
    accepted: usize,
    /// Accepted with a guard against elements that turn over.
    guarded: usize,
    solved: usize,
    seconds: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    let config = match options.scene.as_str() {
        "wedge" => Config::built_in()?,
        file => Config::from_file(Path::new(file))?,
    };
    let setup = setup(&config)?;
    let set = recorded_set(&config, &setup, &options)?;
    let interactions = plan(&setup, &[set], options.seed)?;
    println!("{} states between {} and {} s", interactions.len(), options.from_s, options.to_s);
    let mut tandem = Tandem::new(&setup)?;
    let areas = tandem.skin().vertex_areas().to_vec();
    let mut go_on = || ControlFlow::Continue(());
    let mut counts = [Count::default(), Count::default()];
    let mut coarse_s = 0.0;
    for (index, interaction) in interactions.iter().enumerate() {
        let begin = Instant::now();
        let half = tandem.solve_coarse(interaction, &mut go_on);
        coarse_s += begin.elapsed().as_secs_f64();
        let half = match half {
            Ok(half) => half,
            Err(stop) => {
                counts.iter_mut().for_each(|count| count.solved += 1);
                println!("{index:>4} coarse       rejected: {stop}");
                continue;
            }
        };
        for (name, count) in REFERENCES.iter().zip(&mut counts).filter(|(name, _)| options.solves(name)) {
            let begin = Instant::now();
            let result = match *name {
                "tied" => tandem.solve_tied(&half, &mut go_on),
                _ => tandem.solve_independent(interaction, &half, &mut go_on),
            };
            count.add(index, name, &result, begin.elapsed().as_secs_f64(), &areas);
        }
    }
    println!("coarse       {:.2} s per state", coarse_s / interactions.len() as f64);
    for (name, count) in REFERENCES.iter().zip(counts).filter(|(name, _)| options.solves(name)) {
        let Count { accepted, guarded, solved, seconds } = count;
        println!(
            "{name:<12} {accepted} of {solved} accepted ({guarded} with the guard), {:.2} s per state",
            seconds / solved.max(1) as f64
        );
    }
    Ok(())
}

impl Count {
    fn add(&mut self, index: usize, name: &str, result: &Result<AccurateResult, Stop>, seconds: f64, areas: &[f64]) {
        self.solved += 1;
        self.seconds += seconds;
        match result {
            Ok(AccurateResult { solve, tool_force, unguarded, .. }) => {
                self.accepted += 1;
                let (steps, j, force) = (solve.iterations, solve.smallest_jacobian, tool_force.norm());
                print!(
                    "{index:>4} {name:<12} accepted: {steps:>4} Newton steps, smallest J {j:.3}, {force:.3} N, {seconds:.2} s"
                );
                if let Some(unguarded) = unguarded {
                    self.guarded += 1;
                    let worth = unguarded.worth(areas);
                    let [x, y, z] = worth.worst_m.map(|c| 1e3 * c);
                    let (residual, j) = (worth.residual, worth.smallest_jacobian);
                    print!("; without the guard: residual {residual:.1e}, J {j:.3} at {x:.0} {y:.0} {z:.0} mm");
                    if let Some(distance) = worth.to_accepted {
                        print!(", skin {:.4} mm RMS away", 1e3 * distance.rms_m);
                    }
                }
                println!();
            }
            Err(stop) => println!("{index:>4} {name:<12} rejected: {stop}; {seconds:.2} s"),
        }
    }
}

impl Options {
    fn solves(&self, reference: &str) -> bool {
        self.references.iter().any(|name| name == reference)
    }
}

/// The poses of the cut as a set of interactions.
fn recorded_set(config: &Config, setup: &Setup, options: &Options) -> Result<InteractionSet, Box<dyn Error>> {
    let tool = &config.tools()[setup.training.tool];
    let fitted = MotionOptions { tool: Some(&tool.name), fit: true, ..MotionOptions::default() };
    let file = std::env::temp_dir().join(format!("accept_motion-{}.tum", std::process::id()));
    std::fs::write(&file, cut(&std::fs::read_to_string(&options.motion)?, options.from_s, options.to_s))?;
    let read = motion::read(&file, config, fitted);
    std::fs::remove_file(&file)?;
    let poses = read?.poses;
    let poses = poses.iter().map(|timed| RecordedPose {
        time_s: timed.time_s,
        tool: timed.tool,
        pose: plica_sim::world_from_tool(&config.tools()[timed.tool], &timed.sample.pose),
    });
    Ok(InteractionSet {
        name: "recorded".to_owned(),
        count: options.n_states,
        source: Source::Recorded(poses.collect()),
        ..setup.training.clone()
    })
}

/// The rows of a TUM file between two times after its first row.
fn cut(text: &str, from_s: f64, to_s: f64) -> String {
    let time = |row: &str| row.split_whitespace().next().and_then(|first| first.parse::<f64>().ok());
    let origin = text.lines().find_map(time).unwrap_or(0.0);
    let is_kept = |row: &&str| time(row).is_some_and(|t| (from_s..to_s).contains(&(t - origin)));
    text.lines().filter(is_kept).flat_map(|row| [row, "\n"]).collect()
}

fn options() -> Result<Options, Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let usage = "SCENE MOTION [--from S] [--to S] [--states N] [--seed N] [--reference tied|independent]";
    let (scene, motion) = (words.next().ok_or(usage)?, words.next().ok_or(usage)?.into());
    let mut options = Options {
        scene,
        motion,
        from_s: 0.0,
        to_s: f64::INFINITY,
        n_states: 40,
        seed: 1,
        references: REFERENCES.map(String::from).to_vec(),
    };
    while let Some(word) = words.next() {
        let value = words.next().ok_or(usage)?;
        match word.as_str() {
            "--from" => options.from_s = value.parse()?,
            "--to" => options.to_s = value.parse()?,
            "--states" => options.n_states = value.parse()?,
            "--seed" => options.seed = value.parse()?,
            "--reference" => options.references = vec![value],
            _ => return Err(usage.into()),
        }
    }
    Ok(options)
}
