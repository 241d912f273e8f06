//! Motion of a scripted tool, from the command line and the scene of the daemon.

use anyhow::Context;
use plica_client::Client;
use plica_client::mesh::rest_mesh;
use plica_client::pattern::Path;
use plica_trajectory::Terrain;

use super::choose;
use crate::args::Motion;

/// Start of a pattern above first touch \[m\].
const CLEARANCE_M: f64 = 0.015;
/// Default depth of a pattern \[m\].
const DEPTH_M: f64 = 0.004;

/// A tool, its pattern, and the surface below.
pub(crate) struct Plan {
    pub(crate) tool: String,
    pub(crate) path: Path,
    pub(crate) terrain: Terrain,
}

pub(crate) fn plan(client: &Client, motion: &Motion) -> anyhow::Result<Plan> {
    let status = client.status()?;
    let tool = choose("tool", motion.tool.as_deref(), &status.tools)?;
    let object = choose("object", motion.object.as_deref(), &status.objects)?;
    let mesh = rest_mesh(&client.mesh(&object)?).context("the daemon's mesh cannot be read")?;
    let terrain = Terrain::new(&mesh.positions_m, &mesh.triangles).context("the object has no triangles")?;
    let path = Path {
        surface_m: motion.at_m.unwrap_or_else(|| surface_above_middle(&terrain)),
        tip_radius_m: motion.tip_radius_m,
        depth_m: motion.depth_m.unwrap_or(DEPTH_M),
        clearance_m: CLEARANCE_M,
        span_m: motion.span_m,
        period_s: motion.period_s,
    };
    Ok(Plan { tool, path, terrain })
}

/// Top of the object in its middle; its highest point where it has a hole there.
fn surface_above_middle(terrain: &Terrain) -> [f64; 3] {
    let bounds = terrain.bounds();
    let [x, y] = [0, 1].map(|i| 0.5 * (bounds.min_m[i] + bounds.max_m[i]));
    [x, y, terrain.height_m([x, y]).unwrap_or(bounds.max_m[2])]
}
