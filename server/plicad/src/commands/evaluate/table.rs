//! Tables of an evaluation, for people.

use plica_training::evaluation::{Evaluation, Group, MethodEvaluation, MethodReport, Quantiles, Roughness, Slide};

pub(super) fn print(scene: &str, found: &Evaluation) {
    let n = found.held_out;
    println!("{scene}: {} held-out states in the trained region, {} outside", n.in_region, n.outside);
    if n.left_out > 0 {
        println!("{} more are left out: the coarse skin misses next to nothing there", n.left_out);
    }
    println!("E: error over the coarse skin's own; median/p95/worst. mm: median RMS over the skin. * is the default");
    println!(
        "{:<27} {:>4} {:^17} {:>6} {:>6} {:^17} {:^17} {:^17} {:>6}",
        "method", "n", "E in region", "tied", "indep.", "E near contact", "worst vertex", "E outside", "us"
    );
    found.methods.iter().for_each(|m| row(&m.evaluation, &found.default));
    println!("outside, by kind: E");
    found.methods.iter().for_each(|m| kinds(&m.evaluation));
    println!(
        "degenerate inputs: RMS of the detail over that of d[i], median; E in region with the training set taken twice"
    );
    println!("{:<27} {:>8} {:>8} {:>8} {:>8}   twice", "method", "u = 0", "-u[i]", "2 u[i]", "4 u[i]");
    found.methods.iter().for_each(degenerate);
    println!("rank correlation of 1 - confidence with E");
    println!("{:<27} {:>10} {:>10}", "method", "in region", "all");
    let ranked = found.methods.iter().map(|m| &m.evaluation).filter(|v| v.confidence_rank.is_some());
    ranked.for_each(|v| {
        println!("{:<27} {:>10} {:>10}", v.name, rank(v.confidence_rank_in_region), rank(v.confidence_rank))
    });
    if !found.by_examples.is_empty() {
        println!("fewer examples");
        found.by_examples.iter().for_each(|v| row(v, &found.default));
    }
    found.slide.iter().for_each(print_slide);
}

fn print_slide(slide: &Slide) {
    let row =
        |name: &str, r: &Roughness, error: &str| println!("{name:<27} {:>8.4} {:>8.3}   {error}", r.rms_mm, r.max_mm);
    println!(
        "slide: {} states {:.1} mm apart ({} rejected); second difference of d [mm], RMS and largest; E",
        slide.states, slide.step_mm, slide.rejected
    );
    slide.first_rejection.iter().for_each(|why| println!("the first rejection: {why}"));
    row("accurate (tied)", &slide.accurate, "");
    slide.methods.iter().for_each(|m| row(&m.name, &m.roughness, &m.error.as_ref().map_or_else(String::new, three)));
}

fn row(v: &MethodEvaluation, default: &str) {
    let mark = if v.name == default { "*" } else { "" };
    let independent = v.in_region.independent_median_mm.map_or("-".into(), |mm| format!("{mm:.3}"));
    println!(
        "{:<27} {:>4} {:>17} {:>6.3} {:>6} {:>17} {:>17} {:>17} {:>6.0}",
        format!("{}{mark}", v.name),
        v.examples,
        ratios(&v.in_region),
        v.in_region.median_mm,
        independent,
        ratios(&v.near_contact),
        three(&v.in_region.worst_vertex),
        v.outside.as_ref().map_or("-".into(), ratios),
        v.tick_us
    );
}

fn kinds(v: &MethodEvaluation) {
    let of_kind = |(kind, group): (&String, &Group)| format!("{kind} {}", ratios(group));
    let outside = v.kinds.iter().filter(|(kind, _)| *kind != plica_training::IN_REGION);
    println!("{:<27} {}", v.name, outside.map(of_kind).collect::<Vec<_>>().join("  "));
}

fn degenerate(m: &MethodReport) {
    let Some(d) = &m.degenerate else { return };
    let [at_rest, reversed, doubled, quadrupled] =
        [d.at_rest, d.reversed, d.doubled, d.quadrupled].map(|q| format!("{:.2}", q.median));
    println!(
        "{:<27} {at_rest:>8} {reversed:>8} {doubled:>8} {quadrupled:>8}   {}",
        m.evaluation.name,
        ratios(&d.duplicated)
    );
}

fn ratios(g: &Group) -> String {
    three(&Quantiles { median: g.median, p95: g.p95, worst: g.worst })
}

fn three(q: &Quantiles) -> String {
    format!("{:.3}/{:.3}/{:.3}", q.median, q.p95, q.worst)
}

fn rank(rank: Option<f64>) -> String {
    rank.map_or("-".into(), |r| format!("{r:.2}"))
}
