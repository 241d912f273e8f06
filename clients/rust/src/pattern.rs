//! Scripted motions of a tool: pure functions of time.

use std::f64::consts::TAU;

/// Place and size of a scripted motion. The tool's z axis points up, its origin is the centre of its tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Point on the surface under which the tool presses, in metres.
    pub surface_m: [f64; 3],
    /// Radius of the tip in metres, the height of the tool's origin above the surface at first touch.
    pub tip_radius_m: f64,
    /// Depth of the press, in metres.
    pub depth_m: f64,
    /// Start of the tip above first touch, in metres.
    pub clearance_m: f64,
    /// Length of a slide, diameter of a circle, in metres.
    pub span_m: f64,
    /// Duration of one cycle, in seconds.
    pub period_s: f64,
}

/// The shape of a scripted motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pattern {
    /// Down and up again.
    Press,
    /// Down, along x and back, up.
    Slide,
    /// Down, once around, up.
    Circle,
}

impl Pattern {
    /// Position of the tool's origin after `time_s`; cycles repeat. It starts and ends above the surface.
    ///
    /// ```text
    /// lower(p)  = smoothstep up over the first quarter, 1, smoothstep down over the last   (press: one cosine)
    /// z = surface_z + radius + clearance - (clearance + depth) lower(p)
    /// ```
    pub fn position_m(self, path: &Path, time_s: f64) -> [f64; 3] {
        let phase = (time_s / path.period_s).rem_euclid(1.0);
        let along = ((phase - 0.25) / 0.5).clamp(0.0, 1.0);
        let [lower, x, y] = match self {
            Self::Press => [0.5 - 0.5 * (TAU * phase).cos(), 0.0, 0.0],
            Self::Slide => [plateau(phase), 0.5 * path.span_m * (TAU * smoothstep(along)).sin(), 0.0],
            Self::Circle => {
                let (sin, cos) = (TAU * smoothstep(along)).sin_cos();
                [plateau(phase), 0.5 * path.span_m * cos, 0.5 * path.span_m * sin]
            }
        };
        let top_m = path.surface_m[2] + path.tip_radius_m + path.clearance_m;
        let down_m = (path.clearance_m + path.depth_m) * lower;
        [path.surface_m[0] + x, path.surface_m[1] + y, top_m - down_m]
    }
}

/// 0 at both ends of a cycle, 1 in its middle half.
fn plateau(phase: f64) -> f64 {
    smoothstep((phase / 0.25).min((1.0 - phase) / 0.25).min(1.0))
}

fn smoothstep(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATH: Path = Path {
        surface_m: [0.06, 0.03, 0.025],
        tip_radius_m: 0.007,
        depth_m: 0.005,
        clearance_m: 0.02,
        span_m: 0.02,
        period_s: 2.0,
    };

    #[test]
    fn all_start_above_and_press_in_the_middle() {
        for pattern in [Pattern::Press, Pattern::Slide, Pattern::Circle] {
            let (start, middle) = (pattern.position_m(&PATH, 0.0), pattern.position_m(&PATH, 1.0));
            assert!((start[2] - 0.052).abs() < 1e-12, "{pattern:?} {start:?}");
            assert!((middle[2] - 0.027).abs() < 1e-12, "{pattern:?} {middle:?}");
            assert!((pattern.position_m(&PATH, 2.5)[2] - pattern.position_m(&PATH, 0.5)[2]).abs() < 1e-12);
        }
    }

    #[test]
    fn none_jumps() {
        for pattern in [Pattern::Press, Pattern::Slide, Pattern::Circle] {
            for step in 0..4000 {
                let [a, b] = [step, step + 1].map(|n| pattern.position_m(&PATH, f64::from(n) * 1e-3));
                let moved_m = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
                assert!(moved_m < 2e-4, "{pattern:?} moves {moved_m} m in 1 ms");
            }
        }
    }
}
