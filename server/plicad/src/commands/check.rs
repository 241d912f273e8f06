//! `plicad check`.

mod press;

use plica_daemon::limits::{check_frame, frame_bytes};
use plica_scene::Config;
use plica_scene::extents;
use plica_scene::model;
use serde::Serialize;

use crate::cli::CheckArgs;
use crate::commands::bench::bench;
use crate::run_cost::typical_tick_s;
use crate::sampling_cost::{SamplingCost, sampling_cost};
use crate::work::table_bytes;

/// Ticks that are timed for the estimate.
const TRIAL_TICKS: u64 = 500;

/// What a scene costs.
#[derive(Debug, Serialize)]
struct Report {
    scene: String,
    object: String,
    tools: Vec<String>,
    n_nodes: usize,
    n_free_nodes: usize,
    n_hexes: usize,
    n_skin: usize,
    n_triangles: usize,
    embedding_fallbacks: usize,
    block_tridiagonal: bool,
    is_free: bool,
    room_min_mm: [f64; 3],
    room_max_mm: [f64; 3],
    table_bytes: usize,
    frame_bytes: u64,
    skin_bytes_per_s: f64,
    wrench_bytes_per_s: f64,
    /// What each tool makes of a tracker's poses.
    poses: Vec<SamplingCost>,
    estimated_tick_us: f64,
    estimate: String,
    extents_m: [f64; 3],
    warnings: Vec<String>,
    budget_us: f64,
}

/// Prints what a scene will cost; fails where it cannot be served.
pub fn run(args: &CheckArgs, json: bool) -> anyhow::Result<()> {
    let config = super::scene(&args.scene)?;
    let report = check(&config)?;
    print(&report);
    if json {
        println!("{}", serde_json::to_string(&report)?);
    }
    Ok(())
}

fn check(config: &Config) -> anyhow::Result<Report> {
    let model = model::build(config)?;
    check_frame(config, model.n_skin())?;
    let cost = model.cost();
    let room_mm = model.room_m().map(|corner| (corner.coords * 1e3).into());
    let publish = config.object().publish();
    let frame_bytes = frame_bytes(config, model.n_skin());
    let (estimated_tick_us, estimate) = match config.bench() {
        Some(motion) => {
            (bench(config, motion, TRIAL_TICKS, TRIAL_TICKS)?.tick_us.p50, "median of a trial of the [bench] motion")
        }
        None => (1e6 * typical_tick_s(&model), "from bytes and operations; a [bench] table gives a better one"),
    };
    let (estimated_tick_us, estimate) = match press::slowest(config, &model)? {
        Some(press) if press.tick_us > estimated_tick_us => (
            press.tick_us,
            format!("median of a trial that presses `{}`, the slowest tool, into the object", press.tool),
        ),
        _ => (estimated_tick_us, estimate.to_owned()),
    };
    Ok(Report {
        scene: config.name().to_owned(),
        object: config.object().name().to_owned(),
        tools: config.tools().iter().map(|t| t.name.clone()).collect(),
        n_nodes: model.n_nodes(),
        n_free_nodes: cost.n_free,
        n_hexes: model.description().mesh.n_hexes(),
        n_skin: model.n_skin(),
        n_triangles: model.description().skin.n_triangles(),
        embedding_fallbacks: model.description().embedding.fallbacks().len(),
        block_tridiagonal: cost.block_tridiagonal,
        is_free: model.is_free(),
        room_min_mm: room_mm[0],
        room_max_mm: room_mm[1],
        table_bytes: table_bytes(&model),
        frame_bytes,
        skin_bytes_per_s: frame_bytes as f64 * publish.publish_hz,
        wrench_bytes_per_s: plica_protocol::wrench::BYTES as f64 * publish.wrench_hz * config.tools().len() as f64,
        poses: config.tools().iter().map(sampling_cost).collect(),
        estimated_tick_us,
        estimate,
        extents_m: config.object().mesh().extents_m(),
        warnings: config.remarks().to_vec(),
        budget_us: 1e6 * config.runtime().timestep_s(),
    })
}

fn print(r: &Report) {
    let tools = if r.tools.is_empty() { "none".into() } else { r.tools.join(", ") };
    let solver = if r.block_tridiagonal { "block tridiagonal" } else { "block Jacobi" };
    println!("scene      {} with object `{}`, tools: {tools}", r.scene, r.object);
    println!("extents    {}", extents::in_mm(r.extents_m));
    println!(
        "coarse     {} hexahedra, {} nodes, {} of them free; preconditioner: {solver}",
        r.n_hexes, r.n_nodes, r.n_free_nodes
    );
    println!(
        "skin       {} vertices, {} triangles, {} vertices embedded trilinearly",
        r.n_skin, r.n_triangles, r.embedding_fallbacks
    );
    let axis = |k: usize| format!("{} {:.0} to {:.0}", ["x", "y", "z"][k], r.room_min_mm[k], r.room_max_mm[k]);
    let (held, end) = match r.is_free {
        true => ("no node is held, so that the object falls and slides", "where it began"),
        false => ("held", "the last good state"),
    };
    println!(
        "room       {} mm ({held}); once out, the object is put back to {end}, and counted",
        [0, 1, 2].map(axis).join(", ")
    );
    println!("tables     {:.0} KiB read per tick or more often", r.table_bytes as f64 / 1024.0);
    println!("frame      {} bytes, {:.1} MB/s to each listener", r.frame_bytes, 1e-6 * r.skin_bytes_per_s);
    println!("wrenches   {:.2} MB/s to each listener", 1e-6 * r.wrench_bytes_per_s);
    r.poses.iter().for_each(|poses| println!("poses      {poses}"));
    println!("tick       about {:.0} of {:.0} us ({})", r.estimated_tick_us, r.budget_us, r.estimate);
    if r.estimated_tick_us > 0.8 * r.budget_us {
        println!(
            "           too slow for this machine: use fewer divisions, fewer substeps, a longer runtime.timestep_s, or a \
             coarser skin or simpler tool where contact is the slow part"
        );
    }
}
