//! Colours, in linear light.

/// Red, green, blue from 0 to 1, proportional to light.
pub(super) type Linear = [f32; 3];

/// Text.
pub(super) const INK: Linear = [0.016, 0.019, 0.026];
/// Lesser text.
pub(super) const SOFT_INK: Linear = [0.075, 0.085, 0.105];
/// Tools.
pub(super) const STEEL: Linear = [0.16, 0.27, 0.42];
/// Lines of three versions of a skin in one section; the last is the one that the others are measured against.
pub(super) const VERSIONS: [Linear; 3] = [[0.05, 0.20, 0.52], [0.80, 0.10, 0.02], INK];
/// The inside of a section.
pub(super) const CUT: Linear = [0.58, 0.36, 0.31];

/// Stops of the displacement scale as sRGB: pale where nothing moves, then through orange to a dark red.
const STOPS: [[f32; 3]; 6] = [
    [0.925, 0.905, 0.875],
    [0.973, 0.835, 0.650],
    [0.957, 0.655, 0.420],
    [0.890, 0.420, 0.310],
    [0.690, 0.190, 0.290],
    [0.360, 0.075, 0.270],
];

/// Colour of a share of the scale.
pub(super) fn scale(share: f32) -> Linear {
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let below = (at as usize).min(STOPS.len() - 2);
    let [a, b] = [STOPS[below], STOPS[below + 1]];
    mix(a, b, at - below as f32).map(to_linear)
}

/// White paper, a little darker towards the bottom.
pub(super) fn background(height: f32) -> Linear {
    mix([0.945, 0.955, 0.965], [0.80, 0.825, 0.85], height)
}

/// `share` of `b` in `a`.
pub(super) fn mix(a: Linear, b: Linear, share: f32) -> Linear {
    std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
}

/// Every component times `factor`.
pub(super) fn times(colour: Linear, factor: f32) -> Linear {
    colour.map(|c| c * factor)
}

fn to_linear(srgb: f32) -> f32 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// Bytes of a picture file.
pub(super) fn to_srgb(colour: Linear) -> [u8; 3] {
    colour.map(|c| {
        let c = c.clamp(0.0, 1.0);
        let srgb = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        (255.0 * srgb).round() as u8
    })
}
