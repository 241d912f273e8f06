//! Motion of a scripted tool, from the command line and the scene of the daemon.

use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use plica_client::mesh::rest_mesh;
use plica_client::pattern::Path;
use plica_client::{Client, ClientError};
use plica_trajectory::Terrain;

use super::choose;
use crate::args::Motion;

/// Start of a pattern above first touch \[m\].
const CLEARANCE_M: f64 = 0.015;
/// Time in which a tool is lifted at the end \[s\].
const LIFT_S: f64 = 0.4;
/// Poses per second of a lift.
const LIFT_HZ: f64 = 250.0;
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

impl Plan {
    /// Height to which a tool is lifted at the end: above the whole object \[m\].
    fn top_m(&self) -> f64 {
        self.terrain.bounds().max_m[2].max(self.path.surface_m[2]) + self.path.tip_radius_m + self.path.clearance_m
    }

    /// Lifts a tool straight up from its last position, so that no command leaves it pressed into the object. A tool above
    /// the object stays. Goes on after Ctrl-C: it takes less than half a second.
    pub(crate) fn lift(
        &self,
        last_m: [f64; 3],
        mut publish: impl FnMut([f64; 3]) -> Result<(), ClientError>,
    ) -> Result<(), ClientError> {
        let [x, y, z] = last_m;
        let (start, height_m) = (Instant::now(), self.top_m() - z);
        if height_m <= 0.0 {
            return Ok(());
        }
        let n_poses = (LIFT_S * LIFT_HZ).ceil() as u32;
        for n in 1..=n_poses {
            let share = f64::from(n) / f64::from(n_poses);
            let due = start + Duration::from_secs_f64(share * LIFT_S);
            thread::sleep(due.saturating_duration_since(Instant::now()));
            publish([x, y, z + height_m * share * share * (3.0 - 2.0 * share)])?;
        }
        Ok(())
    }
}

/// Top of the object in its middle; its highest point where it has a hole there.
fn surface_above_middle(terrain: &Terrain) -> [f64; 3] {
    let bounds = terrain.bounds();
    let [x, y] = [0, 1].map(|i| 0.5 * (bounds.min_m[i] + bounds.max_m[i]));
    [x, y, terrain.height_m([x, y]).unwrap_or(bounds.max_m[2])]
}
