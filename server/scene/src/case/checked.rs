//! Checked cases.

use std::path::Path;

use plica_accurate::Material;

use super::load::{self, LoadSpec};
use super::material::{self, MaterialSpec, Region};
use super::mesh::{self, MeshSource};
use super::probe::{self, ProbeSpec};
use super::raw::{RawCase, RawSolve};
use super::support::{self, SupportSpec};
use super::tool::{self, Tool};
use crate::checks::Check;
use crate::document::Document;
use crate::error::ConfigError;
use crate::ranges;

/// Advice that names the documentation of all keys.
const EXAMPLE: &str = "configs/cases/cantilever.toml explains every key";

/// A checked case: every number is within its range. Its selections are resolved by [`Problem`](super::Problem).
#[derive(Debug)]
pub struct Case {
    pub(super) document: Document,
    pub(super) name: String,
    pub(super) mesh: MeshSource,
    pub(super) material: MaterialSpec,
    /// Density of everything that no region claims [kg/m3].
    pub(super) density_kg_per_m3: Option<f64>,
    pub(super) regions: Vec<Region>,
    pub(super) supports: Vec<SupportSpec>,
    pub(super) loads: Vec<LoadSpec>,
    pub(super) tools: Vec<Tool>,
    pub(super) probes: Vec<ProbeSpec>,
    solve: SolveOptions,
}

/// Load stepping and tolerance of the solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolveOptions {
    /// Number of equal parts of loads and displacements.
    pub steps: u32,
    /// Largest force left, as a share of the largest nodal force.
    pub tolerance: f64,
    /// Most Newton steps per part.
    pub max_iterations: u32,
    /// Most successive halvings of a part that fails.
    pub max_halvings: u32,
    /// Arc length in place of equal parts of the loads.
    pub arc_length: Option<ArcLength>,
    /// Whether unstable equilibria are left along their softest mode.
    pub follow_stable: bool,
}

/// Steps along the path of equilibria.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcLength {
    /// Largest motion of any node in a step \[m\].
    pub step_m: f64,
    /// Steps after which the path ends.
    pub max_steps: u32,
}

impl Case {
    /// Reads and checks a case file.
    ///
    /// # Errors
    /// [`ConfigError`] with file, line, key and advice.
    pub fn from_file(file: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(file).map_err(|e| ConfigError {
            file: file.to_owned(),
            line: None,
            key: String::new(),
            problem: format!("cannot be read: {e}"),
            advice: "check the path; configs/cases holds examples".into(),
        })?;
        Self::parse(file, &text)
    }

    /// Checks the text of a case file. `file` names it in messages and resolves relative paths.
    ///
    /// # Errors
    /// [`ConfigError`] with file, line, key and advice.
    pub fn parse(file: &Path, text: &str) -> Result<Self, ConfigError> {
        let explain = |e| ConfigError { advice: EXAMPLE.into(), ..e };
        let document = Document::parse(file, text).map_err(explain)?;
        let raw: RawCase = document.read().map_err(explain)?;
        ranges::check(&document, super::schema().as_value())?;
        let check = Check::new(&document);
        let material = material::check(&check, &raw.material)?;
        check_names(&check, &raw)?;
        Ok(Self {
            name: file.file_stem().map_or_else(|| "case".into(), |s| s.to_string_lossy().into_owned()),
            mesh: mesh::check(&check, &raw.mesh)?,
            regions: material::check_regions(&check, &raw.regions, &raw.material, &material)?,
            material,
            density_kg_per_m3: raw.material.density_kg_per_m3,
            supports: support::check(&check, &raw.supports)?,
            loads: load::check(&check, &raw)?,
            tools: tool::check(&check, &raw.tools)?,
            probes: probe::check(&check, &raw)?,
            solve: solve_options(&check, &raw)?,
            document,
        })
    }

    /// Name of the case: the file's name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The base material and those of the regions.
    pub(super) fn materials(&self) -> impl Iterator<Item = &Material> {
        let regions = self.regions.iter().map(|region| &region.material);
        std::iter::once(&self.material).chain(regions).map(|spec| &spec.material)
    }

    /// Load stepping and tolerance of the solver.
    pub fn solve(&self) -> SolveOptions {
        self.solve
    }
}

/// Refuses empty names, and names used twice in a list.
fn check_names(c: &Check<'_>, raw: &RawCase) -> Result<(), ConfigError> {
    let lists: [(&str, Vec<&str>); 5] = [
        ("regions", raw.regions.iter().map(|r| r.name.as_str()).collect()),
        ("supports", raw.supports.iter().map(|s| s.name.as_str()).collect()),
        ("loads", raw.loads.iter().map(|l| l.name.as_str()).collect()),
        ("tools", raw.tools.iter().map(|t| t.name.as_str()).collect()),
        ("probes", raw.probes.iter().map(|p| p.name.as_str()).collect()),
    ];
    for (list, names) in lists {
        for (i, name) in names.iter().enumerate() {
            let key = format!("{list}.{i}.name");
            if name.trim().is_empty() {
                return Err(c.error(&key, "is empty", "give a name"));
            }
            if names[..i].contains(name) {
                return Err(c.error(
                    &key,
                    format!("`{name}` is taken"),
                    format!("give each of the {list} its own name"),
                ));
            }
        }
    }
    Ok(())
}

fn solve_options(c: &Check<'_>, case: &RawCase) -> Result<SolveOptions, ConfigError> {
    let raw: &RawSolve = &case.solve;
    if raw.arc_length.is_some() {
        let moves = |s: &super::raw::RawSupport| s.turn.is_some() || s.displacement_m.is_some_and(|d| d != [0.0; 3]);
        let because = "the share of the loads is unknown, so that only loads may grow";
        if case.supports.iter().any(moves) || !case.tools.is_empty() {
            let problem = format!("has no meaning with supports that move or tools: {because}");
            return Err(c.error("solve.arc_length", problem, "remove the key, or load the body by forces"));
        }
        if case.loads.is_empty() {
            return Err(c.error("solve.arc_length", "has no meaning without loads", "add [[loads]]"));
        }
    }
    Ok(SolveOptions {
        steps: raw.steps,
        tolerance: raw.tolerance,
        max_iterations: raw.max_iterations,
        max_halvings: raw.max_halvings,
        arc_length: raw.arc_length.map(|arc| ArcLength { step_m: arc.step_m, max_steps: arc.max_steps }),
        follow_stable: false,
    })
}
