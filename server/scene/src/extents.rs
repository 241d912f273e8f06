//! Extents in millimetres, and whether they can be meant: a file in millimetres taken for metres is the commonest mistake.

/// Largest extents that an object or a tool may well have \[m\].
const PLAUSIBLE_M: [f64; 2] = [1e-3, 3.0];
/// Largest extents beyond which a file's unit is certainly wrong \[m\].
const POSSIBLE_M: [f64; 2] = [1e-6, 1e3];

/// Judgement of extents.
#[derive(Debug, Clone, PartialEq)]
pub enum Size {
    /// Nothing to say.
    Plausible,
    /// A sentence of doubt.
    Doubtful(String),
    /// A sentence of certainty.
    Impossible(String),
}

/// `120 x 60 x 40 mm`.
pub fn in_mm(extents_m: [f64; 3]) -> String {
    // Four digits; what is left of a smaller number is none.
    let shown = extents_m.map(|m| format!("{:.3e}", 1e3 * m).parse::<f64>().unwrap_or(1e3 * m).to_string());
    format!("{} mm", shown.join(" x "))
}

/// Judges the extents of `body`, whose size `key` sets.
pub fn judge(body: &str, key: &str, extents_m: [f64; 3]) -> Size {
    let largest = extents_m.iter().copied().fold(0.0, f64::max);
    let sentence = |range: [f64; 2], word: &str| {
        let side = if largest > range[1] { "large" } else { "small" };
        format!("{body} spans {}, which is {word} {side}: look at {key}", in_mm(extents_m))
    };
    let is_within = |[least, most]: [f64; 2]| (least..=most).contains(&largest);
    match (is_within(PLAUSIBLE_M), is_within(POSSIBLE_M)) {
        (true, _) => Size::Plausible,
        (false, true) => Size::Doubtful(sentence(PLAUSIBLE_M, "unusually")),
        (false, false) => Size::Impossible(sentence(POSSIBLE_M, "impossibly")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_organ_of_100_m_or_a_tenth_of_a_millimetre_is_doubted_and_one_of_100_km_refused() {
        let size = |factor: f64| judge("the body", "mesh.metres_per_unit", [0.12, 0.06, 0.04].map(|m| m * factor));
        assert_eq!(size(1.0), Size::Plausible);
        let doubt = "the body spans 120000 x 60000 x 40000 mm, which is unusually large: look at mesh.metres_per_unit";
        assert_eq!(size(1e3), Size::Doubtful(doubt.into()));
        assert!(matches!(size(1e-3), Size::Doubtful(text) if text.contains("0.12 x 0.06 x 0.04 mm")));
        assert!(matches!(size(1e6), Size::Impossible(text) if text.contains("impossibly large")));
        assert!(matches!(size(1e-6), Size::Impossible(text) if text.contains("impossibly small")));
    }
}
