//! Sensitivity of `d`: how far the accurate skin moves with mesh, tie stiffness and reference.
//!
//! Interactions are drawn as for evaluation. The coarse model settles once at each; the accurate skin is then found on finer
//! and coarser meshes, with softer and stiffer ties, and with contact of its own.

use std::ops::ControlFlow;
use std::sync::Mutex;

use nalgebra::Vector3;
use plica_accurate::TieOptions;
use rayon::prelude::*;
use serde::Serialize;

use crate::accurate::AccurateResult;
use crate::coarse::SolveObserver;
use crate::error::TrainingError;
use crate::interaction::Interaction;
use crate::plan::plan;
use crate::report::Spread;
use crate::setup::{AccurateDescription, InteractionSet, Setup};
use crate::tandem::{CoarseHalf, Stop, Tandem};
use plica_geometry::ReferenceSkin;

/// Vertices with this share of the tie's stiffness or more count as the imprint.
const HELD: f64 = 0.01;

/// Variations to compare.
#[derive(Debug, Clone)]
pub struct Variations {
    /// Interactions.
    pub n_interactions: usize,
    /// Accurate meshes with names, the finest last.
    pub meshes: Vec<(String, AccurateDescription)>,
    /// Factors on the stiffness of the tie.
    pub tie_factors: Vec<f64>,
    /// Whether to solve with contact of its own on every mesh, not only on the scene's.
    pub independent_on_all_meshes: bool,
}

/// Differences of skins.
#[derive(Debug, Clone, Serialize)]
pub struct Sensitivity {
    /// The scene.
    pub scene_hash: String,
    /// Interactions that were compared.
    pub interactions: usize,
    /// Interactions left out, because a solve was rejected: which solve, and why.
    pub left_out: Vec<String>,
    /// Differences of skins.
    pub differences: Vec<Difference>,
    /// Size of the force on the tool \[N\]: coarse, tied, independent.
    pub forces: Vec<Force>,
}

/// Distance of one skin from another, over the interactions.
#[derive(Debug, Clone, Serialize)]
pub struct Difference {
    /// Variations to compare.
    pub group: String,
    /// One skin.
    pub of: String,
    /// The other.
    pub from: String,
    /// Area-weighted RMS distance \[m\].
    pub rms_m: Spread,
    /// Distance of the worst vertex \[m\].
    pub worst_m: Spread,
}

/// Forces over the interactions.
#[derive(Debug, Clone, Serialize)]
pub struct Force {
    /// Model.
    pub of: String,
    /// Size \[N\].
    pub size_n: Spread,
    /// Size over that of the independent model.
    pub over_independent: Spread,
}

/// One skin per interaction, `[n][n_skin]`, with the force on the tool.
struct Variant {
    name: String,
    skins: Vec<Option<AccurateResult>>,
}

/// Runs all variations on `n_threads` threads. `observer` is called with the name of the variant before its first solve and
/// before every Newton step; `Break` ends the run.
///
/// # Errors
/// See [`TrainingError`].
pub fn sensitivity(
    setup: &Setup,
    variations: &Variations,
    n_threads: usize,
    observer: &mut (dyn FnMut(&str) -> ControlFlow<()> + Send),
) -> Result<Sensitivity, TrainingError> {
    let set = InteractionSet { count: variations.n_interactions, ..setup.evaluation[0].clone() };
    let interactions = plan(setup, &[set], setup.evaluation_seed)?;
    let threads = |e: rayon::ThreadPoolBuildError| TrainingError::Threads { n_threads, reason: e.to_string() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads.max(1)).build().map_err(threads)?;
    let bench = Bench { setup, interactions: &interactions, observer: Mutex::new(observer), pool: &pool };
    let mut left_out = Vec::new();
    let halves = bench.halves(&mut left_out)?;
    let one = &|tandem: &mut Tandem<'_>, half: &CoarseHalf, _: &Interaction, observer: SolveObserver<'_>| {
        tandem.solve_tied(half, observer)
    };
    let own = &|tandem: &mut Tandem<'_>, half: &CoarseHalf, at: &Interaction, observer: SolveObserver<'_>| {
        tandem.solve_independent(at, half, observer)
    };
    let tied = bench.variant("tied", setup, &halves, one, &mut left_out)?;
    let independent = bench.variant("independent", setup, &halves, own, &mut left_out)?;
    let mut ties = Vec::new();
    for factor in variations.tie_factors.iter().filter(|f| **f != 1.0) {
        let mut other = setup.clone();
        other.tie.compliance_m /= factor;
        ties.push(bench.variant(&format!("tie x {factor}"), &other, &halves, one, &mut left_out)?);
    }
    let (mut meshes, mut own_meshes) = (Vec::new(), Vec::new());
    for (name, accurate) in &variations.meshes {
        let other = Setup { accurate: accurate.clone(), ..setup.clone() };
        meshes.push(bench.variant(&format!("tied, {name}"), &other, &halves, one, &mut left_out)?);
        if variations.independent_on_all_meshes {
            own_meshes.push(bench.variant(&format!("independent, {name}"), &other, &halves, own, &mut left_out)?);
        }
    }
    let skin = ReferenceSkin::new(&setup.coarse.skin);
    let compared = Comparison { tie: &setup.tie, areas: skin.vertex_areas(), halves: &halves };
    let mut differences = compared.to_last("accurate mesh", &meshes);
    differences.extend(compared.to_last("accurate mesh", &own_meshes));
    differences.extend(ties.iter().filter_map(|tie| compared.between("tie stiffness", tie, &tied, false)));
    differences.extend(compared.between("reference", &tied, &independent, false));
    differences.extend(compared.coarse("coarse skin", &tied, false));
    differences.extend(compared.coarse("coarse skin", &independent, false));
    differences.extend(compared.coarse("coarse imprint (contact band)", &tied, true));
    differences.extend(compared.coarse("coarse imprint (contact band)", &independent, true));
    differences.extend(compared.between("imprint (contact band)", &tied, &independent, true));
    let forces = compared.forces(&tied, &independent);
    let n = halves.iter().flatten().count();
    Ok(Sensitivity { scene_hash: setup.scene_hash.clone(), interactions: n, left_out, differences, forces })
}

type Solve<'a> =
    &'a (dyn Fn(&mut Tandem<'_>, &CoarseHalf, &Interaction, SolveObserver<'_>) -> Result<AccurateResult, Stop> + Sync);

/// Called with the name of a variant.
type Observer<'a> = &'a mut (dyn FnMut(&str) -> ControlFlow<()> + Send);

/// Inputs of all variants.
struct Bench<'a> {
    setup: &'a Setup,
    interactions: &'a [Interaction],
    observer: Mutex<Observer<'a>>,
    pool: &'a rayon::ThreadPool,
}

impl Bench<'_> {
    fn observe(&self, variant: &str) -> ControlFlow<()> {
        let mut observer = self.observer.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        observer(variant)
    }

    /// Announces a variant.
    fn begin(&self, variant: &str) -> Result<(), TrainingError> {
        if self.observe(variant).is_break() { Err(TrainingError::Interrupted) } else { Ok(()) }
    }

    fn halves(&self, left_out: &mut Vec<String>) -> Result<Vec<Option<CoarseHalf>>, TrainingError> {
        let name = "coarse model";
        self.begin(name)?;
        let mut tandem = Tandem::new(self.setup)?;
        let halves = self.interactions.iter().map(|at| tandem.solve_coarse(at, &mut || self.observe(name)));
        halves.enumerate().map(|(i, half)| keep("coarse", i, half, left_out)).collect()
    }

    fn variant(
        &self,
        name: &str,
        setup: &Setup,
        halves: &[Option<CoarseHalf>],
        solve: Solve<'_>,
        left_out: &mut Vec<String>,
    ) -> Result<Variant, TrainingError> {
        self.begin(name)?;
        let per_thread = halves.len().div_ceil(self.pool.current_num_threads()).max(1);
        let solve_chunk = |(first, chunk): (usize, &[Option<CoarseHalf>])| -> Result<Vec<_>, TrainingError> {
            let mut tandem = Tandem::new(setup)?;
            let at = |i: usize| &self.interactions[first * per_thread + i];
            let solved = chunk.iter().enumerate();
            let mut observe = || self.observe(name);
            Ok(solved
                .map(|(i, half)| half.as_ref().map(|half| solve(&mut tandem, half, at(i), &mut observe)))
                .collect())
        };
        let chunks: Vec<_> = self.pool.install(|| halves.par_chunks(per_thread).enumerate().map(solve_chunk).collect());
        let mut skins = Vec::with_capacity(halves.len());
        for result in chunks.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
            let index = skins.len();
            skins.push(match result {
                Some(result) => keep(name, index, result, left_out)?,
                None => None,
            });
        }
        Ok(Variant { name: name.to_owned(), skins })
    }
}

fn keep<T>(
    name: &str,
    index: usize,
    result: Result<T, Stop>,
    left_out: &mut Vec<String>,
) -> Result<Option<T>, TrainingError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Stop::Interrupted) => Err(TrainingError::Interrupted),
        Err(Stop::Rejected(_, message, _)) => {
            left_out.push(format!("{index}, {name}: {message}"));
            Ok(None)
        }
    }
}

/// Names of two skins, and the group of their difference.
struct Compared<'a> {
    group: &'a str,
    of: &'a str,
    from: &'a str,
}

/// Compares skins.
struct Comparison<'a> {
    tie: &'a TieOptions,
    areas: &'a [f64],
    halves: &'a [Option<CoarseHalf>],
}

impl Comparison<'_> {
    /// All variants from the last one.
    fn to_last(&self, group: &str, variants: &[Variant]) -> Vec<Difference> {
        let Some((last, others)) = variants.split_last() else { return Vec::new() };
        others.iter().filter_map(|v| self.between(group, v, last, false)).collect()
    }

    fn between(&self, group: &str, a: &Variant, b: &Variant, in_band: bool) -> Option<Difference> {
        let pairs = a.skins.iter().zip(&b.skins).zip(self.halves);
        let skins =
            pairs.filter_map(|((a, b), half)| Some((&a.as_ref()?.offsets, &b.as_ref()?.offsets, half.as_ref()?)));
        self.difference(Compared { group, of: &a.name, from: &b.name }, skins, in_band)
    }

    fn coarse(&self, group: &str, b: &Variant, in_band: bool) -> Option<Difference> {
        let pairs = self.halves.iter().zip(&b.skins);
        let skins =
            pairs.filter_map(|(half, b)| Some((&half.as_ref()?.state.offsets, &b.as_ref()?.offsets, half.as_ref()?)));
        self.difference(Compared { group, of: "coarse", from: &b.name }, skins, in_band)
    }

    fn difference<'b>(
        &self,
        compared: Compared<'_>,
        skins: impl Iterator<Item = (&'b Vec<Vector3<f64>>, &'b Vec<Vector3<f64>>, &'b CoarseHalf)>,
        in_band: bool,
    ) -> Option<Difference> {
        let (mut rms, mut worst) = (Vec::new(), Vec::new());
        for (a, b, half) in skins {
            let held = half.targets.iter().filter(|t| self.tie.share(t.gap_m) >= HELD);
            let vertices: Vec<usize> =
                if in_band { held.map(|t| t.vertex.index()).collect() } else { (0..a.len()).collect() };
            let area: f64 = vertices.iter().map(|&v| self.areas[v]).sum();
            let squared: f64 = vertices.iter().map(|&v| self.areas[v] * (a[v] - b[v]).norm_squared()).sum();
            rms.push((squared / area).sqrt());
            worst.push(vertices.iter().map(|&v| (a[v] - b[v]).norm()).fold(0.0, f64::max));
        }
        Some(Difference {
            group: compared.group.to_owned(),
            of: compared.of.to_owned(),
            from: compared.from.to_owned(),
            rms_m: Spread::of(rms.into_iter())?,
            worst_m: Spread::of(worst.into_iter())?,
        })
    }

    fn forces(&self, tied: &Variant, independent: &Variant) -> Vec<Force> {
        let size = |v: &Variant, i: usize| v.skins[i].as_ref().map(|r| r.tool_force.norm());
        let triple = |i: usize| {
            let coarse = self.halves[i].as_ref()?.state.tool_force.norm();
            Some([coarse, size(tied, i)?, size(independent, i)?])
        };
        let triples: Vec<[f64; 3]> = (0..self.halves.len()).filter_map(triple).collect();
        let force = |(k, of): (usize, &str)| {
            Some(Force {
                of: of.to_owned(),
                size_n: Spread::of(triples.iter().map(|t| t[k]))?,
                over_independent: Spread::of(triples.iter().map(|t| t[k] / t[2]))?,
            })
        };
        ["coarse", "tied", "independent"].into_iter().enumerate().filter_map(force).collect()
    }
}
