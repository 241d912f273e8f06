//! Pixels in linear light with depth, and flat drawing on them.

use image::{Rgb, RgbImage};

use super::colour::{self, Linear};
use super::font;

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rect {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) w: u32,
    pub(super) h: u32,
}

impl Rect {
    pub(super) fn times(self, n: u32) -> Self {
        Self { x: n * self.x, y: n * self.y, w: n * self.w, h: n * self.h }
    }

    pub(super) fn centre(&self) -> [f64; 2] {
        [f64::from(self.x) + 0.5 * f64::from(self.w), f64::from(self.y) + 0.5 * f64::from(self.h)]
    }
}

/// Colours and depths.
#[derive(Debug, Clone)]
pub(super) struct Canvas {
    pub(super) w: u32,
    pub(super) h: u32,
    pub(super) colours: Vec<Linear>,
    pub(super) depths: Vec<f32>,
}

impl Canvas {
    pub(super) fn new(w: u32, h: u32) -> Self {
        let row = |y: u32| std::iter::repeat_n(colour::background(y as f32 / h as f32), w as usize);
        Self { w, h, colours: (0..h).flat_map(row).collect(), depths: vec![f32::INFINITY; (w * h) as usize] }
    }

    /// The pixel's place in the arrays.
    pub(super) fn at(&self, x: u32, y: u32) -> usize {
        (y * self.w + x) as usize
    }

    /// Mixes `share` of a colour in.
    pub(super) fn blend(&mut self, x: u32, y: u32, colour: Linear, share: f32) {
        if x < self.w && y < self.h {
            let i = self.at(x, y);
            self.colours[i] = colour::mix(self.colours[i], colour, share);
        }
    }

    pub(super) fn fill(&mut self, rect: Rect, colour: Linear) {
        for y in rect.y..rect.y + rect.h {
            for x in rect.x..rect.x + rect.w {
                self.blend(x, y, colour, 1.0);
            }
        }
    }

    /// Writes text whose upper left corner is at `x`, `y`; a letter is 5 x 7 dots of `dot` pixels.
    pub(super) fn text(&mut self, x: u32, y: u32, dot: u32, text: &str, colour: Linear) {
        for (i, letter) in text.chars().enumerate() {
            let left = x + i as u32 * 6 * dot;
            for (row, bits) in font::rows(letter).iter().enumerate() {
                for column in (0..5).filter(|c| bits >> (4 - c) & 1 == 1) {
                    self.fill(Rect { x: left + column * dot, y: y + row as u32 * dot, w: dot, h: dot }, colour);
                }
            }
        }
    }

    /// Each `n` x `n` samples become one pixel.
    pub(super) fn reduced(&self, n: u32) -> Self {
        let mut small = Self::new(self.w / n, self.h / n);
        let share = 1.0 / (n * n) as f32;
        for y in 0..small.h {
            for x in 0..small.w {
                let mut sum = [0.0; 3];
                for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
                    let sample = self.colours[self.at(n * x + i, n * y + j)];
                    sum = std::array::from_fn(|c| sum[c] + share * sample[c]);
                }
                let i = small.at(x, y);
                small.colours[i] = sum;
            }
        }
        small
    }

    pub(super) fn into_image(self) -> RgbImage {
        RgbImage::from_fn(self.w, self.h, |x, y| Rgb(colour::to_srgb(self.colours[self.at(x, y)])))
    }
}
