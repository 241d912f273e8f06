//! `plicad evaluate`.

mod databases;
mod table;

use std::ops::ControlFlow;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use plica_training::evaluation::{Evaluation, EvaluationProgress, Evaluator, Method, evaluate, methods, slide};

use crate::cli::EvaluateArgs;
pub(super) use databases::{Databases, read};
use plica_scene::setup::setup;

/// Evaluates methods and prints their errors.
pub fn run(args: &EvaluateArgs, json: bool) -> anyhow::Result<()> {
    let config = super::scene(&args.scene)?;
    let setup = setup(&config)?;
    let methods = chosen(methods(setup.stamp_axes), &args.methods)?;
    let Databases { training, held_out } = read(&config, &setup, &args.databases)?;
    let evaluator = Evaluator::new(&setup, &training, &held_out)?;
    let n_examples = args.examples.map_or(usize::MAX, |n| n as usize);
    let bar = bar();
    let mut observer = |p: EvaluationProgress<'_>| {
        show(&bar, p);
        ControlFlow::Continue(())
    };
    let mut found = evaluate(&evaluator, &methods, n_examples, &mut observer)?;
    if args.slide {
        found.slide = Some(slide(&setup, &evaluator, &methods, n_examples, &mut observer)?);
    }
    bar.finish_and_clear();
    table::print(config.name(), &found);
    if json {
        println!("{}", summary(config.name(), &found)?);
    }
    Ok(())
}

/// The methods that `names` lists, in the order of `all`; without names, all of them.
fn chosen(all: Vec<Method>, names: &[String]) -> anyhow::Result<Vec<Method>> {
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|m| m.name != **name)) {
        let known: Vec<&str> = all.iter().map(|m| m.name.as_str()).collect();
        anyhow::bail!("--methods: there is no method `{unknown}`; there are {}", known.join(", "));
    }
    Ok(all.into_iter().filter(|m| names.is_empty() || names.contains(&m.name)).collect())
}

/// Progress bar on the terminal.
pub(super) fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}").expect("the template is fixed");
    let bar = ProgressBar::new(1).with_style(style).with_message("builds the model");
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

/// Shows the progress of an evaluation.
pub(super) fn show(bar: &ProgressBar, progress: EvaluationProgress<'_>) {
    bar.set_length(progress.all as u64);
    bar.set_position(progress.done as u64);
    bar.set_message(progress.part.to_owned());
}

fn summary(scene: &str, found: &Evaluation) -> Result<String, serde_json::Error> {
    let mut value = serde_json::to_value(found)?;
    value["scene"] = scene.into();
    serde_json::to_string(&value)
}
