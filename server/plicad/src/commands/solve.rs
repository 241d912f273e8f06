//! `plicad solve`.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use plica_accurate::SolveError;
use plica_geometry::VolumeMesh;
use plica_scene::case::{
    Case, Failure, LoadStep, News, Problem, Reading, Solution, SolveOptions, Stability, StepError, follow, write_result,
};
use plica_scene::extents;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::cli::SolveArgs;

/// Below this an element is nearly turned over, and what is found there is no reference.
const LEAST_JACOBIAN: f64 = 0.05;
/// Parts of the progress bar.
const BAR_PARTS: u64 = 1000;

/// What `solve` prints as JSON.
#[derive(Debug, Serialize)]
struct Report {
    case: String,
    probes: Map<String, Value>,
    info: Info,
    warnings: Vec<String>,
    wall_s: f64,
    out: Option<String>,
}

/// How the solve went.
#[derive(Debug, Serialize)]
struct Info {
    /// Kind of the elements.
    elements: &'static str,
    n_elements: usize,
    n_nodes: usize,
    n_unknowns: usize,
    extents_m: [f64; 3],
    n_factor_values: usize,
    iterations: u32,
    indefinite_steps: u32,
    failed_load_steps: u32,
    smallest_jacobian: Option<f64>,
    /// Share of the loads that the result bears.
    load: f64,
    /// Shares at which the loads turned, along an arc length.
    limit_loads: Vec<f64>,
    /// Negative eigenvalues of the final tangent; absent where it does not tell.
    negative_directions: Option<usize>,
    /// Unstable equilibria that were left along their softest mode.
    unstable_left: u32,
    load_steps: Vec<LoadStep>,
}

/// Solves a case and prints what its probes tell.
pub fn run(args: &SolveArgs, json: bool) -> anyhow::Result<()> {
    let begin = Instant::now();
    let case = Case::from_file(&args.case)?;
    let problem = Problem::new(&case)?;
    if let Some(out) = &args.out {
        check_writable(out)?;
    }
    let bar = bar()?;
    let options = SolveOptions { follow_stable: args.follow_stable, ..case.solve() };
    let solution = follow(&problem, &options, &mut |news| show(&bar, news));
    bar.finish_and_clear();
    let solution = solution.map_err(|failure| advise(failure, &problem, &args.case))?;
    if let Some(out) = &args.out {
        write_result(out, &problem, &solution)?;
    }
    let readings = problem.probes().iter().map(|probe| (probe.name.clone(), probe.read(&problem, &solution)));
    let readings: Vec<(String, Reading)> = readings.collect();
    let as_json = |(name, reading): &(String, Reading)| Ok((name.clone(), serde_json::to_value(reading)?));
    let report = Report {
        case: case.name().to_owned(),
        probes: readings.iter().map(as_json).collect::<anyhow::Result<_>>()?,
        info: Info::new(&problem, &solution),
        warnings: warnings(&problem, &solution, &options),
        wall_s: begin.elapsed().as_secs_f64(),
        out: args.out.as_ref().map(|out| out.display().to_string()),
    };
    print(&report, &readings);
    if json {
        println!("{}", serde_json::to_string(&report)?);
    }
    Ok(())
}

/// Refuses before minutes are spent.
fn check_writable(out: &Path) -> anyhow::Result<()> {
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    anyhow::ensure!(folder.is_dir(), "{}: there is no folder {}; make it first", out.display(), folder.display());
    anyhow::ensure!(!out.is_dir(), "{}: is a folder; give --out a file name that ends in .vtu", out.display());
    Ok(())
}

fn bar() -> anyhow::Result<ProgressBar> {
    let style = ProgressStyle::with_template("load {bar:30} {msg}")?;
    Ok(ProgressBar::new(BAR_PARTS).with_style(style))
}

fn show(bar: &ProgressBar, news: News) -> ControlFlow<()> {
    let News { reached, target, iteration, residual } = news;
    tracing::debug!(reached, target, iteration, residual, "Newton step");
    bar.set_position((BAR_PARTS as f64 * reached) as u64);
    bar.set_message(format!("{reached:.3} to {target:.3}: Newton step {iteration}, residual {residual:.1e}"));
    ControlFlow::Continue(())
}

/// What helps in this case; nothing that it has already.
fn advise(failure: Failure, problem: &Problem, case: &Path) -> anyhow::Error {
    let advice = match &failure {
        Failure::Stuck { error: StepError::Solve(SolveError::Singular { .. }), .. } => "hold more nodes or axes",
        Failure::Stuck { error: StepError::Contact(_), .. } => {
            "raise solve.steps, refine the mesh where the tool touches, or move the tool less far"
        }
        Failure::Stuck { .. } if problem.is_linear() => {
            "a linear case needs one Newton step: loosen solve.tolerance, and look for elements of extreme shape or stiffness"
        }
        Failure::Stuck { .. } if problem.may_collapse() => {
            "look at the state with smaller loads, raise solve.steps or solve.max_halvings, refine the mesh where it folds, \
             or take the stable Neo-Hookean material"
        }
        Failure::Stuck { .. } => {
            "look at the state with smaller loads, raise solve.steps or solve.max_halvings, or refine the mesh where it folds"
        }
        Failure::Solve(_) => "use fewer elements",
    };
    anyhow::anyhow!("{}: {failure}; {advice}", case.display())
}

impl Info {
    fn new(problem: &Problem, solution: &Solution) -> Self {
        Self {
            elements: problem.mesh().kind().plural(),
            n_elements: problem.mesh().n_elements(),
            n_nodes: problem.mesh().n_nodes(),
            n_unknowns: solution.n_unknowns,
            extents_m: extents_m(problem.mesh()),
            n_factor_values: solution.n_factor_values,
            iterations: solution.iterations(),
            indefinite_steps: solution.indefinite_steps(),
            failed_load_steps: solution.n_failed,
            smallest_jacobian: solution.smallest_jacobian(),
            load: solution.share,
            limit_loads: solution.limit_loads.clone(),
            negative_directions: match solution.stability {
                Stability::Stable => Some(0),
                Stability::Unstable(n) => Some(n),
                Stability::Unknown => None,
            },
            unstable_left: solution.n_left,
            load_steps: solution.steps.clone(),
        }
    }
}

fn extents_m(mesh: &VolumeMesh) -> [f64; 3] {
    let [lower, upper] = mesh.bounds();
    (upper - lower).into()
}

fn warnings(problem: &Problem, solution: &Solution, options: &SolveOptions) -> Vec<String> {
    let mut warnings = problem.remarks().to_vec();
    warnings.extend(instability(problem, solution, options));
    if solution.share < 1.0 {
        warnings.push(format!(
            "the arc length ends at {:.4} of the loads: raise solve.arc_length.max_steps to go on",
            solution.share
        ));
    }
    match solution.smallest_jacobian() {
        Some(j) if j < LEAST_JACOBIAN && !problem.is_linear() => {
            warnings.push(format!(
                "an element is squeezed to det F = {j:.3}: below {LEAST_JACOBIAN} the result is not to be trusted"
            ));
        }
        _ => {}
    }
    warnings
}

/// What the signs of the final tangent say, unless the equilibrium is stable.
fn instability(problem: &Problem, solution: &Solution, options: &SolveOptions) -> Option<String> {
    let n = match solution.stability {
        Stability::Stable => return None,
        Stability::Unknown => {
            return Some(
                "the final tangent is too near to a singular one to tell whether the equilibrium is stable".into(),
            );
        }
        Stability::Unstable(n) => n,
    };
    let directions = if n == 1 { "1 direction".to_owned() } else { format!("{n} directions") };
    if problem.has_follower_loads() {
        return Some(format!(
            "the symmetric part of the final tangent is negative in {directions}: under loads that follow the surface the \
             equilibrium may be unstable"
        ));
    }
    let advice = if options.arc_length.is_some() || !problem.tools().is_empty() {
        "a small disturbance leads elsewhere"
    } else if options.follow_stable {
        "--follow-stable found no way down"
    } else {
        "--follow-stable leaves it for a stable one"
    };
    Some(format!("the equilibrium is unstable: its tangent is negative in {directions}; {advice}"))
}

fn print(report: &Report, readings: &[(String, Reading)]) {
    let Info { elements, n_elements, n_nodes, n_unknowns, .. } = report.info;
    println!("case       {}: {n_elements} {elements}, {n_nodes} nodes, {n_unknowns} unknowns", report.case);
    let info = &report.info;
    println!("extents    {}", extents::in_mm(info.extents_m));
    println!(
        "solve      {} load steps ({} more failed and were halved), {} Newton steps, {} of them indefinite",
        info.load_steps.len(),
        info.failed_load_steps,
        info.iterations,
        info.indefinite_steps
    );
    let residual = info.load_steps.last().and_then(|step| step.residuals.last());
    println!("residual   {:.1e} of the largest nodal force", residual.unwrap_or(&0.0));
    if !info.limit_loads.is_empty() {
        let shares: Vec<String> = info.limit_loads.iter().map(|share| format!("{share:.5}")).collect();
        println!("limits     the loads turn at {} of their full size", shares.join(", "));
    }
    if info.unstable_left > 0 {
        println!("unstable   {} equilibria were left along their softest mode", info.unstable_left);
    }
    println!("elements   smallest det F {:.4}", info.smallest_jacobian.unwrap_or(1.0));
    println!("time       {:.2} s", report.wall_s);
    if let Some(out) = &report.out {
        println!("written    {out}");
    }
    let width = readings.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    for (name, reading) in readings {
        let numbers: Vec<String> = reading.value.components().iter().map(|v| format!("{v:>14.6e}")).collect();
        println!("probe      {name:width$}  {:12}{} {}", reading.quantity, numbers.join(" "), reading.unit);
    }
    report.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
}
