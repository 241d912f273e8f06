//! A press that was never trained on, solved by the accurate model, for comparison.

use std::ops::ControlFlow;

use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use nalgebra::{Isometry3, Point3, Vector3};
use plica_daemon::database_loader::Enrichment;
use plica_scene::Config;
use plica_scene::{model, setup};
use plica_sim::enrichment::Contact;
use plica_sim::{Model, State};
use plica_training::{Example, Interaction, Outcome, Setup, Tandem, largest, plan, rms};
use serde::Serialize;

use super::isometry;

/// Of so many held-out presses the one nearest to the middle of the object is shown.
const N_CANDIDATES: usize = 8;

/// One press, three skins.
#[derive(Debug, Clone)]
pub(super) struct HeldOut {
    pub(super) coarse: Vec<[f32; 3]>,
    pub(super) enriched: Vec<[f32; 3]>,
    pub(super) accurate: Vec<[f32; 3]>,
    pub(super) tool: usize,
    pub(super) tool_pose: Isometry3<f64>,
    /// Where the skin is touched, deformed \[m\].
    pub(super) focus: Point3<f64>,
    pub(super) depth_m: f64,
    pub(super) errors: Errors,
}

/// How far the skins are from the accurate one.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Errors {
    /// The plain coarse skin.
    pub coarse: Distance,
    /// With detail.
    pub enriched: Distance,
    /// What enrichment thinks of itself, 0 to 1.
    pub confidence: f32,
}

/// Over all of a skin.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Distance {
    /// Weighted by area \[m\].
    pub rms_m: f64,
    /// At the worst vertex \[m\].
    pub worst_m: f64,
}

/// Solves the press and enriches it with a database.
pub(super) fn held_out(config: &Config, database: &Path) -> anyhow::Result<HeldOut> {
    let setup = setup::setup(config)?;
    let interaction = most_central(&setup)?;
    let example = solve(&setup, &interaction)?;
    let model = Arc::new(model::build(config)?);
    let enrichment = Enrichment::new(config, &model)?;
    let enricher = enrichment.read(database)?.enricher;

    let mut state = State::new(&model);
    let nodes: Vec<_> = example.displacements.iter().map(|d| Vector3::from(d.map(f64::from))).collect();
    state.set_node_displacements(&model, &nodes);
    let mut offsets = vec![[0.0; 4]; model.n_skin()];
    state.write_padded_offsets(&model, &mut offsets);
    let mut detail = vec![[0.0; 4]; model.n_skin()];
    let touch = example.touch();
    let confidence =
        enricher.evaluate(&Contact::new(&model, &state, &offsets, &touch), &mut enricher.scratch(), &mut detail);

    let mut coarse = vec![[0.0; 3]; model.n_skin()];
    state.write_skin(&model, &mut coarse);
    let added = |p: &[f32; 3], d: [f32; 3]| [p[0] + d[0], p[1] + d[1], p[2] + d[2]];
    let enriched: Vec<_> = coarse.iter().zip(&detail).map(|(p, d)| added(p, [d[0], d[1], d[2]])).collect();
    let accurate: Vec<_> = coarse.iter().zip(&example.detail).map(|(p, d)| added(p, *d)).collect();
    let errors = Errors {
        coarse: distance(&model, &coarse, &accurate),
        enriched: distance(&model, &enriched, &accurate),
        confidence,
    };
    let [x, y, z, q @ ..] = example.tool_pose;
    Ok(HeldOut {
        focus: lowest_near(&accurate, &touch.tool_origin),
        tool: interaction.tool as usize,
        tool_pose: isometry([x, y, z], q),
        depth_m: interaction.depth_m(),
        coarse,
        enriched,
        accurate,
        errors,
    })
}

/// Among the first of the interactions that an evaluation of the scene holds out.
fn most_central(setup: &Setup) -> anyhow::Result<Interaction> {
    let mut in_region = setup.evaluation.first().context("the scene has no held-out interactions")?.clone();
    in_region.count = N_CANDIDATES;
    let all = plan(setup, &[in_region], setup.evaluation_seed)?;
    let skin = setup.coarse.skin.positions();
    let first = skin.first().context("the skin has no vertices")?;
    let [min, max] = skin.iter().fold([*first; 2], |[min, max], p| [min.inf(p), max.sup(p)]);
    let off = |i: &Interaction| (i.contact_point() - nalgebra::center(&min, &max)).xy().norm();
    all.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).context("no held-out interaction")
}

fn solve(setup: &Setup, interaction: &Interaction) -> anyhow::Result<Example> {
    match Tandem::new(setup)?.solve(0, interaction, false, &mut || ControlFlow::Continue(())) {
        Ok(Outcome::Accepted(example)) => Ok(*example),
        Ok(Outcome::Rejected(rejection)) => anyhow::bail!("the held-out press is rejected: {}", rejection.message),
        Err(_) => anyhow::bail!("the held-out press was interrupted"),
    }
}

fn distance(model: &Model, skin: &[[f32; 3]], from: &[[f32; 3]]) -> Distance {
    let between = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| a[k] - b[k]);
    let field: Vec<[f32; 3]> = skin.iter().zip(from).map(between).collect();
    Distance { rms_m: rms(&field, &model.description().skin.vertex_areas()), worst_m: largest(&field) }
}

/// The vertex of a skin that is nearest to a point.
fn lowest_near(skin: &[[f32; 3]], p: &Point3<f64>) -> Point3<f64> {
    let points = skin.iter().map(|v| Point3::from(*v).cast::<f64>());
    points.min_by(|a, b| (a - p).norm_squared().total_cmp(&(b - p).norm_squared())).unwrap_or(*p)
}
