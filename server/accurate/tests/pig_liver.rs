//! A ball pressed into pig liver by a robot, beside the exponential and the Neo-Hookean law.
//!
//! Modulus, exponent and the depth at which the ball had touched already are fitted on every other press of a region; the error
//! is that of the force on the presses in between. Forces of the laws are solutions of the accurate model: a rigid ball on a block
//! ten radii wide and deep, nearly incompressible, without friction. They are stored in `pig_liver.json`, which
//! `cargo test --release -p plica-accurate --test pig_liver -- --ignored` writes anew.
#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

mod contact;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use contact::YOUNG_MODULUS_PA;
use contact::quarter::{Quarter, graded};
use plica_accurate::{Material, MaterialModel};
use serde_json::{Value, json};

const RADIUS_M: f64 = 4e-3;
const POISSON_RATIO: f64 = 0.495;
/// Depths over the ball's radius at which forces are solved.
const DEPTHS: [f64; 12] = [0.04, 0.07, 0.11, 0.16, 0.22, 0.29, 0.37, 0.46, 0.55, 0.64, 0.73, 0.82];
/// Exponents; 0 is the Neo-Hookean law.
const EXPONENTS: [f64; 6] = [0.0, 3.0, 12.0, 36.0, 90.0, 200.0];
/// Forces below it are noise of the sensor \[N\].
const LEAST_FORCE_N: f64 = 0.02;

/// First touch lies at most this many steps before the first row, which is "contact"; exponent and touch trade off against each other.
const N_TOUCHED: u32 = 20;
const TOUCHED_STEP_M: f64 = 2.5e-5;

/// One press: depths \[m\] and forces \[N\].
type Press = Vec<(f64, f64)>;

/// Law of a region: `F = E R^2 phi((d + touched)/R; b)`.
#[derive(Debug, Clone, Copy)]
struct Fit {
    young_modulus_pa: f64,
    exponent_number: f64,
    touched_m: f64,
    /// Root mean square of `ln(F_law/F)`.
    misfit: f64,
}

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pig_liver.json");

/// Forces `F/(E R^2)` at some depths over the ball's radius.
fn forces(exponent: f64, depths: &[f64]) -> Vec<f64> {
    let (n_fine, n_growing) = (8, 7);
    let coordinates = graded(1.1 * RADIUS_M / n_fine as f64, n_fine, n_growing, 10.0 * RADIUS_M);
    let depths_m: Vec<f64> = depths.iter().map(|depth| depth * RADIUS_M).collect();
    let model = match exponent {
        0.0 => MaterialModel::CompressibleNeoHookean,
        exponent => MaterialModel::Exponential { exponent },
    };
    let material = Material { model, young_modulus_pa: YOUNG_MODULUS_PA, poisson_ratio: POISSON_RATIO };
    let forces = Quarter::new(&coordinates, &coordinates, material).press(RADIUS_M, &depths_m);
    forces.iter().map(|(force_n, _)| force_n / (YOUNG_MODULUS_PA * RADIUS_M * RADIUS_M)).collect()
}

/// `ln(F/(E R^2))` by exponent and depth.
struct Table {
    rows: Vec<Vec<f64>>,
}

impl Table {
    fn stored() -> Self {
        let file: Value = serde_json::from_str(&std::fs::read_to_string(FILE).unwrap()).unwrap();
        let numbers = |list: &Value| list.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect::<Vec<_>>();
        assert_eq!((numbers(&file["exponents"]), numbers(&file["depths"])), (EXPONENTS.to_vec(), DEPTHS.to_vec()));
        let rows = file["forces"].as_array().unwrap().iter();
        Self { rows: rows.map(|row| numbers(row).iter().map(|force| force.ln()).collect()).collect() }
    }

    /// Interpolated linearly in the number of the exponent and in the logarithm of the depth.
    fn log_force(&self, exponent_number: f64, depth: f64) -> f64 {
        let (row, share) = place(exponent_number, EXPONENTS.len());
        let log = depth.max(1e-6).ln();
        let above = DEPTHS.iter().position(|d| d.ln() > log).unwrap_or(DEPTHS.len() - 1).max(1);
        let [low, high] = [above - 1, above].map(|k| DEPTHS[k].ln());
        let along = (log - low) / (high - low);
        let at = |row: usize| self.rows[row][above - 1] * (1.0 - along) + self.rows[row][above] * along;
        at(row) * (1.0 - share) + at(row + 1) * share
    }

    /// Best of all exponents (or of none) and first touches; the modulus is the mean of logarithms.
    fn fit(&self, presses: &[Press], has_exponent: bool) -> Fit {
        let n_steps = if has_exponent { 20 * (EXPONENTS.len() - 1) } else { 0 };
        let trials =
            (0..=n_steps).flat_map(|b| (0..=N_TOUCHED).map(move |t| (b as f64 / 20.0, f64::from(t) * TOUCHED_STEP_M)));
        let all = trials.map(|(exponent_number, touched_m)| {
            let trial = Fit { young_modulus_pa: 1.0, exponent_number, touched_m, misfit: 0.0 };
            let misses: Vec<f64> = presses.iter().flatten().map(|point| self.miss(&trial, point)).collect();
            let mean = misses.iter().sum::<f64>() / misses.len() as f64;
            let square = misses.iter().map(|miss| (miss - mean).powi(2)).sum::<f64>() / misses.len() as f64;
            Fit { young_modulus_pa: (-mean).exp(), misfit: square.sqrt(), ..trial }
        });
        all.min_by(|a, b| a.misfit.total_cmp(&b.misfit)).unwrap()
    }

    /// `ln(F_law/F)`.
    fn miss(&self, fit: &Fit, &(depth_m, force_n): &(f64, f64)) -> f64 {
        let depth = (depth_m + fit.touched_m) / RADIUS_M;
        (fit.young_modulus_pa * RADIUS_M * RADIUS_M).ln() + self.log_force(fit.exponent_number, depth) - force_n.ln()
    }

    /// Median and 90th percentile of `|F_law/F - 1|` over presses; with `is_scaled` the modulus of each press is its own.
    fn errors(&self, fit: &Fit, presses: &[Press], is_scaled: bool) -> [f64; 2] {
        let mut errors = Vec::new();
        for press in presses.iter().filter(|press| !press.is_empty()) {
            let misses: Vec<f64> = press.iter().map(|point| self.miss(fit, point)).collect();
            let mean = if is_scaled { misses.iter().sum::<f64>() / misses.len() as f64 } else { 0.0 };
            errors.extend(misses.iter().map(|miss| ((miss - mean).exp() - 1.0).abs()));
        }
        errors.sort_unstable_by(f64::total_cmp);
        [0.5, 0.9].map(|share| errors[(share * (errors.len() - 1) as f64) as usize])
    }
}

fn place(number: f64, n: usize) -> (usize, f64) {
    let row = (number as usize).min(n - 2);
    (row, number - row as f64)
}

fn exponent(number: f64) -> f64 {
    let (row, share) = place(number, EXPONENTS.len());
    EXPONENTS[row] * (1.0 - share) + EXPONENTS[row + 1] * share
}

/// Measured presses by region, beside the repository.
fn measured() -> Option<BTreeMap<String, Vec<Press>>> {
    let file: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/measured/pig_liver.csv");
    let Ok(text) = std::fs::read_to_string(&file) else {
        println!("skipped: {} is absent", file.display());
        return None;
    };
    let mut presses: BTreeMap<(String, u32), Press> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let words: Vec<&str> = line.split(',').collect();
        let number = |k: usize| words[k].parse::<f64>().unwrap();
        let press = presses.entry((words[0].to_owned(), words[1].parse().unwrap())).or_default();
        if number(3) >= LEAST_FORCE_N {
            press.push((number(2) * 1e-3, number(3)));
        }
    }
    let mut regions: BTreeMap<String, Vec<Press>> = BTreeMap::new();
    presses.into_iter().for_each(|((region, _), press)| regions.entry(region).or_default().push(press));
    Some(regions)
}

#[test]
fn an_exponential_law_foretells_the_force_on_liver_better_than_a_neo_hookean_one() {
    let Some(regions) = measured() else { return };
    let table = Table::stored();
    for (region, presses) in &regions {
        let half = |odd: usize| presses.iter().skip(odd).step_by(2).cloned().collect::<Vec<_>>();
        let (fitted, others) = (half(0), half(1));
        let [plain, stiffening] = [false, true].map(|has_exponent| table.fit(&fitted, has_exponent));
        let mut medians = Vec::new();
        for (name, fit) in [("Neo-Hookean", plain), ("exponential", stiffening)] {
            let [all, shape] = [false, true].map(|is_scaled| table.errors(&fit, &others, is_scaled));
            println!(
                "{region}, {} presses, {name}: E {:.2} kPa, exponent {:.2}, touched {:.2} mm before; held-out force off by {:.0} % \
                 (90 %: {:.0} %), with the modulus of each press {:.0} % ({:.0} %)",
                others.len(),
                fit.young_modulus_pa * 1e-3,
                exponent(fit.exponent_number),
                fit.touched_m * 1e3,
                100.0 * all[0],
                100.0 * all[1],
                100.0 * shape[0],
                100.0 * shape[1]
            );
            medians.push([all[0], shape[0]]);
        }
        assert!(medians[1][0] < medians[0][0], "{region}: {medians:?}");
        assert!(medians[1][1] < medians[0][1], "{region}: {medians:?}");
    }
}

/// Small depths of one exponent, solved again; four decimals are stored.
#[test]
fn stored_forces_are_those_of_the_solver() {
    let stored = Table::stored();
    let n = 3;
    for (force, log) in forces(EXPONENTS[3], &DEPTHS[..n]).iter().zip(&stored.rows[3]) {
        assert!((force / log.exp() - 1.0).abs() < 5e-3, "{force} is not {}", log.exp());
    }
}

#[test]
#[ignore = "minutes: presses a ball into six materials, writes pig_liver.json"]
fn write_stored_forces() {
    let rounded = |force: f64| (force * 1e4).round() / 1e4;
    let row = |exponent: &f64| forces(*exponent, &DEPTHS).into_iter().map(rounded).collect();
    let rows: Vec<Vec<f64>> = EXPONENTS.iter().map(row).collect();
    let file = json!({"exponents": EXPONENTS, "depths": DEPTHS, "poisson_ratio": POISSON_RATIO, "forces": rows});
    std::fs::write(FILE, format!("{file:#}\n")).unwrap();
}
