//! `status` and `rpc`.

use std::collections::BTreeMap;

use anyhow::Context;
use plica_client::Client;
use plica_client::protocol::status::{Distribution, ObjectStatus, STAGES, Status, ToolStatus};
use serde_json::Value;

use crate::args::Rpc;
use crate::output::Output;

/// Share of the force that a change within a tick is felt from.
const ROUGH: f64 = 0.05;

pub(crate) fn status(client: &Client, output: Output) -> anyhow::Result<()> {
    let value = client.status_json()?;
    let status: Status =
        serde_json::from_value(value.clone()).context("the daemon's status does not have the expected form")?;
    output.result(&value, &table(&status));
    Ok(())
}

pub(crate) fn rpc(client: &Client, rpc: &Rpc, output: Output) -> anyhow::Result<()> {
    let arguments: Value = serde_json::from_str(&rpc.arguments)
        .with_context(|| format!("`{}` is not JSON; quote it for the shell: '{{\"ticks\": 1}}'", rpc.arguments))?;
    let reply = client.rpc(&rpc.method, &arguments)?;
    output.result(&reply, &reply.to_string());
    Ok(())
}

fn table(status: &Status) -> String {
    let state = if status.paused { "paused" } else { "running" };
    let mut lines = vec![
        format!("scene {}, session {}, {state}, up {:.1} s", status.scene, status.session, status.uptime_s),
        format!("tick {} at {:.3} s, scheduling {}", status.tick, status.sim_time_s, status.realtime.scheduling.name()),
        line("tick", &status.tick_us),
    ];
    lines.extend(in_order_of_a_tick(&status.stages).map(|(name, stage)| line(&format!("  {name}"), stage)));
    lines.push(line("lateness", &status.lateness_us));
    lines.push(format!("overruns {}, skipped ticks {}", status.overruns, status.skipped_ticks));
    for (name, object) in &status.objects {
        let state = if object.sleeping { "sleeping" } else { "awake" };
        lines.push(format!(
            "object {name}: {} vertices, {state}, {}, {} frames, worst penetration {:.4} mm, {} contacts left out",
            object.n_vertices,
            enrichment(object),
            object.frames_published,
            1e3 * object.max_penetration_m,
            object.dropped_contacts
        ));
    }
    for (name, tool) in &status.tools {
        let state = match (tool.pose_age_s, tool.stale, tool.in_contact) {
            (None, ..) => "no pose yet",
            (_, true, _) => "stale",
            (_, _, true) => "in contact",
            _ => "free",
        };
        let [x, y, z] = tool.force_n;
        let accepted = tool.poses_accepted;
        let step = force_step(tool);
        lines.push(format!("tool {name}: {state}, force [{x:.3}, {y:.3}, {z:.3}] N{step}, {accepted} poses"));
        lines.extend(tool.poses_rejected.iter().map(|(kind, n)| format!("  rejected {kind}: {n}")));
    }
    lines.extend(status.rejected.iter().map(|(kind, n)| format!("rejected {kind}: {n}")));
    for job in &status.jobs {
        let rejected = if job.rejected == 0 { String::new() } else { format!(", {} rejected", job.rejected) };
        lines.push(format!("job {}: {}, {} of {}{rejected}", job.id, job.state.name(), job.done, job.total));
    }
    lines.extend(status.jobs_unavailable.iter().map(|why| format!("no jobs: {why}")));
    lines.extend(status.realtime.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.join("\n")
}

/// Stages in the order in which a tick runs them; stages of later versions at the end.
fn in_order_of_a_tick(stages: &BTreeMap<String, Distribution>) -> impl Iterator<Item = (&String, &Distribution)> {
    let known = STAGES.iter().filter_map(|name| stages.get_key_value(*name));
    known.chain(stages.iter().filter(|(name, _)| !STAGES.contains(&name.as_str())))
}

/// How rough the force lately is, and the remedy where poses that come slower than ticks make it so.
fn force_step(tool: &ToolStatus) -> String {
    if tool.force_step_n == 0.0 {
        return String::new();
    }
    let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let is_rough = tool.in_contact && tool.force_step_n > ROUGH * norm(&tool.force_n) && tool.sampling == "latest";
    let remedy = if is_rough { "; sampling = \"interpolate\" has no steps from slow poses" } else { "" };
    format!(" (steps of up to {:.3} N a tick{remedy})", tool.force_step_n)
}

fn enrichment(object: &ObjectStatus) -> String {
    let confidence = object.confidence.map_or_else(String::new, |confidence| format!(", confidence {confidence:.2}"));
    match object.database_generation {
        _ if !object.enriched => "coarse skin".to_owned(),
        0 => format!("enriched{confidence}"),
        generation => format!("enriched (generation {generation}){confidence}"),
    }
}

fn line(name: &str, d: &Distribution) -> String {
    format!("{name:<16} p50 {:8.1}  p99 {:8.1}  p99.9 {:8.1}  max {:8.1} us", d.p50, d.p99, d.p999, d.max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plica_client::protocol::status::Realtime;
    use plica_client::protocol::status::Scheduling;

    #[test]
    fn the_text_of_a_status_follows_the_tick_and_says_how_the_skin_is_enriched() {
        let mut status =
            Status { realtime: Realtime { scheduling: Scheduling::Fifo, ..Realtime::default() }, ..Status::default() };
        for name in STAGES.iter().rev().copied().chain(["a_later_stage"]) {
            status.stages.insert(name.to_owned(), Distribution::default());
        }
        let object =
            ObjectStatus { enriched: true, database_generation: 3, confidence: Some(0.875), ..ObjectStatus::default() };
        status.objects.insert("wedge".to_owned(), object);
        status.objects.insert("plain".to_owned(), ObjectStatus::default());
        let text = table(&status);
        let stages: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("  ")?.split(' ').next()).collect();
        assert_eq!(stages, [&STAGES[..], &["a_later_stage"]].concat(), "{text}");
        assert!(text.contains("scheduling fifo"), "{text}");
        assert!(text.contains("object wedge: 0 vertices, awake, enriched (generation 3), confidence 0.88,"), "{text}");
        assert!(text.contains("object plain: 0 vertices, awake, coarse skin,"), "{text}");
    }
}
