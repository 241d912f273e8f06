//! Where a scripted tool moves: asked from the daemon, unless the command line says it.

use anyhow::Context;
use plica_client::Client;
use plica_client::mesh::rest_positions;
use plica_client::pattern::Path;
use plica_client::trajectory::Workspace;

use super::choose;
use crate::args::Motion;

/// How far above first touch a pattern starts.
const CLEARANCE_M: f64 = 0.015;

/// A tool and its way.
pub(crate) struct Plan {
    pub(crate) tool: String,
    pub(crate) path: Path,
    pub(crate) workspace: Workspace,
}

pub(crate) fn plan(client: &Client, motion: &Motion) -> anyhow::Result<Plan> {
    let status = client.status()?;
    let tool = choose("tool", motion.tool.as_deref(), &status.tools)?;
    let object = choose("object", motion.object.as_deref(), &status.objects)?;
    let skin = skin(client, &object)?;
    let bounds = bounds(&skin).context("the object has no vertices")?;
    let path = Path {
        surface_m: motion.at_m.unwrap_or_else(|| surface_above_middle(&skin, &bounds)),
        tip_radius_m: motion.tip_radius_m,
        depth_m: motion.depth_m,
        clearance_m: CLEARANCE_M,
        span_m: motion.span_m,
        period_s: motion.period_s,
    };
    let workspace = room_above(&bounds, &path);
    Ok(Plan { tool, path, workspace })
}

fn skin(client: &Client, object: &str) -> anyhow::Result<Vec<[f64; 3]>> {
    let positions = rest_positions(&client.mesh(object)?).context("the daemon's mesh cannot be read")?;
    Ok(positions.into_iter().map(|p| p.map(f64::from)).collect())
}

fn bounds(points: &[[f64; 3]]) -> Option<Workspace> {
    let first = *points.first()?;
    let start = Workspace { min_m: first, max_m: first };
    Some(points.iter().fold(start, |b, p| Workspace {
        min_m: std::array::from_fn(|i| b.min_m[i].min(p[i])),
        max_m: std::array::from_fn(|i| b.max_m[i].max(p[i])),
    }))
}

/// The highest vertex among those near the middle of the object, seen from above.
fn surface_above_middle(points: &[[f64; 3]], bounds: &Workspace) -> [f64; 3] {
    let middle: [f64; 2] = std::array::from_fn(|i| 0.5 * (bounds.min_m[i] + bounds.max_m[i]));
    let off_middle = |p: &[f64; 3]| (p[0] - middle[0]).hypot(p[1] - middle[1]);
    let nearest = points.iter().map(off_middle).fold(f64::INFINITY, f64::min);
    let near = points.iter().filter(|p| off_middle(p) <= nearest + 1e-3);
    let top_m = near.map(|p| p[2]).fold(bounds.min_m[2], f64::max);
    [middle[0], middle[1], top_m]
}

/// The box that `--fit` maps into: the middle half of the object, from `depth` under the surface to the clearance.
fn room_above(bounds: &Workspace, path: &Path) -> Workspace {
    let quarter = |i: usize| 0.25 * (bounds.max_m[i] - bounds.min_m[i]);
    let touch_m = path.surface_m[2] + path.tip_radius_m;
    Workspace {
        min_m: [bounds.min_m[0] + quarter(0), bounds.min_m[1] + quarter(1), touch_m - path.depth_m],
        max_m: [bounds.max_m[0] - quarter(0), bounds.max_m[1] - quarter(1), touch_m + path.clearance_m],
    }
}
