//! Trial of contact: each tool is pressed into the object from above, and the slowest tells the cost.

use nalgebra::{Isometry3, Point3};
use plica_scene::Config;
use plica_scene::scene::BenchConfig;
use plica_sim::{Model, ToolShape};

use crate::commands::bench::bench;

/// Ticks of the way down, and of the whole trial; the median falls into contact.
const TICKS: [u64; 2] = [50, 200];
/// Depth of the press as a share of the object's height below the tool.
const DEPTH: f64 = 0.1;
/// Height above the skin where the tool begins, as a share of the same.
const CLEARANCE: f64 = 0.05;

/// Tick with a tool in contact.
#[derive(Debug, Clone)]
pub(super) struct Press {
    pub(super) tool: String,
    pub(super) tick_us: f64,
}

/// The slowest tool; `None` without tools.
pub(super) fn slowest(config: &Config, model: &Model) -> anyhow::Result<Option<Press>> {
    let mut slowest: Option<Press> = None;
    for (tool, description) in config.tools().iter().enumerate() {
        let [start, end] = way_down(model, &description.shape);
        let [reached_s, end_s] = TICKS.map(|n| n as f64 * model.timestep_s());
        let motion = BenchConfig::press(tool, start, end, [reached_s, end_s]);
        let tick_us = bench(config, &motion, TICKS[1])?.tick_us.p50;
        if slowest.as_ref().is_none_or(|press| tick_us > press.tick_us) {
            slowest = Some(Press { tool: description.name.clone(), tick_us });
        }
    }
    Ok(slowest)
}

/// Poses above the middle of the object and in it, upright.
fn way_down(model: &Model, shape: &ToolShape) -> [Isometry3<f64>; 2] {
    let skin = model.description().skin.positions();
    let first = skin[0];
    let [low, high] = skin.iter().fold([first; 2], |[low, high], p| [low.inf(p), high.sup(p)]);
    let middle = nalgebra::center(&low, &high);
    let aside = |p: &&Point3<f64>| (p.xy() - middle.xy()).norm_squared();
    let nearest = skin.iter().map(|p| aside(&p)).fold(f64::INFINITY, f64::min);
    let above = skin.iter().filter(|p| aside(p) <= 1.000_001 * nearest).map(|p| p.z).fold(low.z, f64::max);
    let height = (above - low.z).max(1e-6);
    let tip = tip_m(shape);
    [CLEARANCE, -DEPTH].map(|share| Isometry3::translation(middle.x, middle.y, above + share * height + tip))
}

/// Distance from the tool's origin down to its lowest point \[m\].
fn tip_m(shape: &ToolShape) -> f64 {
    match shape {
        ToolShape::Ball { radius_m } | ToolShape::Capsule { radius_m, .. } => *radius_m,
        _ => {
            let polytopes = shape.polytopes().unwrap_or_default();
            let below = polytopes.iter().flat_map(|p| p.vertices()).map(|v| -v.z);
            below.reduce(f64::max).unwrap_or(0.0)
        }
    }
}
