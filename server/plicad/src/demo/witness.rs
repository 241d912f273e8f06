//! Keeps what a client receives: counts, the frame at the deepest press, the tool's proxy then.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context;
use nalgebra::{Isometry3, Vector3};
use plica_client::{Client, SkinMessage, SourceClock, Subscription, WrenchMessage};
use plica_geometry::DisplaySurface;

use super::isometry;

/// Wrenches that may wait while a frame is looked at.
const WRENCHES: usize = 8192;

/// What was received.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    pub(super) frames: u64,
    pub(super) frames_missed: u64,
    /// Frames with detail.
    pub(super) frames_enriched: u64,
    pub(super) wrenches: u64,
    pub(super) peak_force_n: f64,
    pub(super) peak_displacement_m: f32,
    /// Positions at the deepest press \[m\].
    pub(super) deepest: Vec<[f32; 3]>,
    pub(super) deepest_sim_time_s: f64,
    deepest_tick: u64,
    pub(super) confidence_then: f32,
    pub(super) proxy: Option<Isometry3<f64>>,
    pub(super) force_then_n: f64,
    /// Proxies and forces by tick, newest last.
    recent: Vec<(u64, Isometry3<f64>, f64)>,
    answers: Vec<WrenchMessage>,
    /// Median from a pose leaving to the first wrench that answers it \[us\].
    motion_to_force_us: f64,
}

pub(super) struct Witness {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Seen>,
}

impl Witness {
    pub(super) fn start(client: &Client, object: &str, tool: &str, surface: &DisplaySurface) -> anyhow::Result<Self> {
        let skins = client.subscribe_skin(object)?;
        let wrenches = client.subscribe_wrenches(tool, WRENCHES)?;
        let stop = Arc::new(AtomicBool::new(false));
        let (flag, rest) = (Arc::clone(&stop), surface.rest.clone());
        let thread = std::thread::Builder::new()
            .name("demo-witness".into())
            .spawn(move || watch(&skins, &wrenches, &rest, &flag))?;
        Ok(Self { stop, thread })
    }

    pub(super) fn finish(self, clock: SourceClock) -> anyhow::Result<Seen> {
        self.stop.store(true, Relaxed);
        let mut seen = self.thread.join().ok().context("the receiving thread of the demo panicked")?;
        seen.motion_to_force_us = median(seen.answers.iter().map(|m| {
            let received_ns = clock.at_ns(m.received);
            1e-3 * received_ns.saturating_sub(m.wrench.pose_source_time_ns) as f64
        }));
        Ok(seen)
    }
}

fn watch(
    skins: &Subscription<SkinMessage>,
    wrenches: &Subscription<WrenchMessage>,
    rest: &[[f32; 3]],
    stop: &AtomicBool,
) -> Seen {
    let mut seen = Seen::default();
    while !stop.load(Relaxed) {
        let frame = skins.next(Duration::from_millis(5));
        while let Some(message) = wrenches.try_next() {
            seen.note_wrench(&message);
        }
        if let Some(message) = frame {
            seen.note_frame(&message, rest);
        }
    }
    seen.frames = skins.stats().received;
    seen.frames_missed = skins.stats().missed;
    seen.wrenches = wrenches.stats().received;
    seen
}

impl Seen {
    pub(super) fn motion_to_force_us(&self) -> f64 {
        self.motion_to_force_us
    }

    /// Positions at the deepest press; at rest if there was none \[m\].
    pub(super) fn deepest_or<'a>(&'a self, surface: &'a DisplaySurface) -> &'a [[f32; 3]] {
        if self.deepest.is_empty() { &surface.rest } else { &self.deepest }
    }

    fn note_wrench(&mut self, message: &WrenchMessage) {
        let w = &message.wrench;
        let force_n = Vector3::from(w.force_n).norm();
        self.peak_force_n = self.peak_force_n.max(force_n);
        let answered = self.answers.last().map(|m| m.wrench.pose_sequence);
        if answered != Some(w.pose_sequence) {
            self.answers.push(*message);
        }
        let proxy = isometry(w.proxy_position_m, w.proxy_orientation_xyzw);
        self.recent.push((w.tick, proxy, force_n));
        if self.recent.len() > 2 * WRENCHES {
            self.recent.drain(..WRENCHES);
        }
        self.match_proxy();
    }

    fn note_frame(&mut self, message: &SkinMessage, rest: &[[f32; 3]]) {
        let Some(positions) = message.frame().ok().and_then(|f| f.positions_m(rest)) else { return };
        self.frames_enriched += u64::from(message.header.flags.enriched);
        let squared = |(p, r): (&[f32; 3], &[f32; 3])| (0..3).map(|i| (p[i] - r[i]).powi(2)).sum::<f32>();
        let largest = positions.iter().zip(rest).map(squared).fold(0.0, f32::max).sqrt();
        if largest > self.peak_displacement_m {
            self.peak_displacement_m = largest;
            self.deepest = positions;
            self.deepest_tick = message.header.tick;
            self.confidence_then = message.header.confidence;
            self.deepest_sim_time_s = message.header.sim_time_s;
            self.match_proxy();
        }
    }

    /// The tool as it was at the tick of the deepest frame, or as near to it as a wrench has come.
    fn match_proxy(&mut self) {
        let off = |tick: &u64| tick.abs_diff(self.deepest_tick);
        let start = self.recent.len().saturating_sub(200);
        if let Some((_, proxy, force_n)) = self.recent[start..].iter().min_by_key(|(tick, ..)| off(tick)) {
            let newest = self.recent.last().map_or(0, |(tick, ..)| *tick);
            if newest <= self.deepest_tick + 100 {
                self.proxy = Some(*proxy);
                self.force_then_n = *force_n;
            }
        }
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
