//! Checked cases.

use std::path::Path;

use plica_accurate::Material;
use plica_geometry::select::Selector;

use super::material::{self, Region};
use super::mesh::{self, MeshSource};
use super::probe::{self, ProbeSpec};
use super::raw::{RawCase, RawLoad, RawSolve, RawSupport};
use super::select;
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
    pub(super) material: Material,
    pub(super) regions: Vec<Region>,
    pub(super) supports: Vec<SupportSpec>,
    pub(super) loads: Vec<LoadSpec>,
    pub(super) probes: Vec<ProbeSpec>,
    solve: SolveOptions,
}

/// Support: nodes with given displacements along some axes.
#[derive(Debug, Clone)]
pub(super) struct SupportSpec {
    pub(super) name: String,
    pub(super) selector: Selector,
    pub(super) axes: [bool; 3],
    pub(super) displacement_m: [f64; 3],
}

/// A load and its selector.
#[derive(Debug, Clone)]
pub(super) struct LoadSpec {
    pub(super) selector: Selector,
    pub(super) kind: LoadKind,
}

/// Kinds of loads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum LoadKind {
    /// Force per rest area \[Pa\].
    Traction([f64; 3]),
    /// Pressure on the deformed surface \[Pa\].
    Pressure(f64),
    /// Total force \[N\].
    Force([f64; 3]),
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
            material,
            regions: material::check_regions(&check, &raw.regions, &raw.material, material)?,
            supports: check_supports(&check, &raw.supports)?,
            loads: check_loads(&check, &raw.loads)?,
            probes: probe::check(&check, &raw.probes, &raw.supports)?,
            solve: solve_options(&raw.solve),
            document,
        })
    }

    /// Name of the case: the file's name without its ending.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The base material and those of the regions.
    pub(super) fn materials(&self) -> impl Iterator<Item = &Material> {
        std::iter::once(&self.material).chain(self.regions.iter().map(|region| &region.material))
    }

    /// Load stepping and tolerance of the solver.
    pub fn solve(&self) -> SolveOptions {
        self.solve
    }
}

/// Refuses empty names, and names used twice in a list.
fn check_names(c: &Check<'_>, raw: &RawCase) -> Result<(), ConfigError> {
    let lists: [(&str, Vec<&str>); 4] = [
        ("regions", raw.regions.iter().map(|r| r.name.as_str()).collect()),
        ("supports", raw.supports.iter().map(|s| s.name.as_str()).collect()),
        ("loads", raw.loads.iter().map(|l| l.name.as_str()).collect()),
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

fn check_supports(c: &Check<'_>, raw: &[RawSupport]) -> Result<Vec<SupportSpec>, ConfigError> {
    let support = |(i, s): (usize, &RawSupport)| {
        let key = format!("supports.{i}");
        let mut axes = [false; 3];
        s.axes.iter().for_each(|axis| axes[*axis as usize] = true);
        if axes == [false; 3] {
            return Err(c.error(&format!("{key}.axes"), "holds nothing", "name at least one of \"x\", \"y\", \"z\""));
        }
        let displacement_m = s.displacement_m.unwrap_or_default();
        if let Some(axis) = (0..3).find(|&k| displacement_m[k] != 0.0 && !axes[k]) {
            let problem = format!("moves along {}, which is not among the axes", ["x", "y", "z"][axis]);
            return Err(c.error(&format!("{key}.displacement_m"), problem, "add the axis, or put 0 there"));
        }
        let selector = select::check(c, &format!("{key}.select"), &s.select)?;
        Ok(SupportSpec { name: s.name.clone(), selector, axes, displacement_m })
    };
    raw.iter().enumerate().map(support).collect()
}

fn check_loads(c: &Check<'_>, raw: &[RawLoad]) -> Result<Vec<LoadSpec>, ConfigError> {
    let load = |(i, l): (usize, &RawLoad)| {
        let key = format!("loads.{i}");
        let kind = match (l.traction_pa, l.pressure_pa, l.force_n) {
            (Some(t), None, None) => Ok(LoadKind::Traction(t)),
            (None, Some(p), None) => Ok(LoadKind::Pressure(p)),
            (None, None, Some(f)) => Ok(LoadKind::Force(f)),
            given => {
                let n = [given.0.is_some(), given.1.is_some(), given.2.is_some()].iter().filter(|g| **g).count();
                let advice = "give exactly one of traction_pa, pressure_pa and force_n";
                Err(c.error(&key, format!("has {n} of three kinds of load"), advice))
            }
        }?;
        Ok(LoadSpec { selector: select::check(c, &format!("{key}.select"), &l.select)?, kind })
    };
    raw.iter().enumerate().map(load).collect()
}

fn solve_options(raw: &RawSolve) -> SolveOptions {
    SolveOptions {
        steps: raw.steps,
        tolerance: raw.tolerance,
        max_iterations: raw.max_iterations,
        max_halvings: raw.max_halvings,
    }
}
