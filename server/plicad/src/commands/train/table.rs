//! Report of a finished job, for people.

use std::path::Path;

use plica_training::{Solves, Spread, TrainingReport, Worth};

pub(super) fn print(report: &TrainingReport, database: &Path, file: &Path) {
    let (result, run) = (&report.result, &report.run);
    let kinds: Vec<_> = result.kinds.iter().map(|(kind, n)| format!("{n} {kind}")).collect();
    println!("{}", database.display());
    println!("examples      {} of {} interactions: {}", result.examples, result.interactions, kinds.join(", "));
    for rejected in &result.rejected {
        let place = rejected.contact_point_m.map(|x| format!("{:.1}", 1e3 * x)).join(", ");
        println!("rejected      {} ({}) at ({place}) mm: {}", rejected.index, rejected.kind, rejected.message);
        if let Some(w) = &rejected.worth {
            println!(
                "              residual {:.1e}, smallest J {:.3} {}",
                w.residual,
                w.smallest_jacobian,
                place_of(w)
            );
        }
    }
    for guarded in &result.guarded {
        let w = &guarded.unguarded;
        let away = w.to_accepted.map(|d| format!("; skin {:.4} mm RMS away", 1e3 * d.rms_m)).unwrap_or_default();
        println!(
            "guarded       {} {}: without, smallest J {:.3} {}{away}",
            guarded.index,
            guarded.reference,
            w.smallest_jacobian,
            place_of(w)
        );
    }
    println!(
        "accurate      {} hexahedra, {} unknowns, {:.1} million values in the factor",
        result.accurate_hexes,
        result.accurate_unknowns,
        1e-6 * result.factor_values as f64
    );
    println!("{:<13} {:>10} {:>10} {:>10} {:>10}", "", "min", "median", "mean", "max");
    solves("tied", &result.tied);
    solves("independent", &result.independent);
    row("settled [s]", &result.settle_s, 1.0, 2);
    row("moving [um]", &result.residual_motion_m, 1e6, 2);
    row("tied vertices", &result.n_tied, 1.0, 1);
    row("|d| rms [mm]", &result.detail_rms_m, 1e3, 3);
    row("|d| max [mm]", &result.detail_max_m, 1e3, 3);
    row("indep. [mm]", &result.independent_rms_m, 1e3, 3);
    let of_each = run.mean_s.zip(run.max_s).map(|(mean, max)| format!("; {mean:.1} s each, {max:.1} s at most"));
    println!(
        "time          {:.0} s on {} thread(s){}, {} of them from earlier runs",
        run.wall_s,
        run.threads,
        of_each.unwrap_or_default(),
        run.resumed
    );
    println!("report        {}", file.display());
}

fn place_of(worth: &Worth) -> String {
    format!("at ({}) mm", worth.worst_m.map(|x| format!("{:.1}", 1e3 * x)).join(", "))
}

fn solves(name: &str, solves: &Option<Solves>) {
    let Some(s) = solves else { return };
    println!("{name}: {} indefinite steps in all", s.indefinite_steps);
    row("  Newton", &Some(s.iterations), 1.0, 1);
    row("  smallest J", &Some(s.smallest_jacobian), 1.0, 3);
}

fn row(name: &str, spread: &Option<Spread>, factor: f64, digits: usize) {
    let Some(s) = spread else { return };
    let [min, median, mean, max] = [s.min, s.median, s.mean, s.max].map(|x| format!("{:.digits$}", factor * x));
    println!("{name:<13} {min:>10} {median:>10} {mean:>10} {max:>10}");
}
