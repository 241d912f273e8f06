//! A picture of a deformed skin and the tool at its proxy: a small software renderer, so that a machine without
//! display or GPU can make one.

mod camera;
mod canvas;
mod colour;
mod contrast;
mod creased;
mod font;
mod panel;
mod raster;
mod tool_mesh;

use image::RgbImage;
use nalgebra::{Isometry3, Point3, Vector3};
use plica_sim::ToolShape;

use camera::Camera;
use canvas::{Canvas, Rect};
pub use contrast::{Contrast, Version, draw_contrast};
use panel::{Panel, draw_panel};
use plica_geometry::DisplaySurface;

/// Width of the picture \[pixels\].
pub const WIDTH: u32 = 1600;
/// Height of the picture \[pixels\].
pub const HEIGHT: u32 = 900;
/// Samples per pixel along each axis.
const OVERSAMPLING: u32 = 2;

/// What is drawn.
#[derive(Debug, Clone)]
pub struct Subject<'a> {
    /// First line of the caption.
    pub title: &'a str,
    /// Second line of the caption.
    pub subtitle: &'a str,
    /// Rest shape.
    pub surface: &'a DisplaySurface,
    /// Deformed world positions `[n_skin]` \[m\].
    pub positions: &'a [[f32; 3]],
    /// Tools and where their proxies are.
    pub tools: Vec<(&'a ToolShape, Isometry3<f64>)>,
    /// What the views turn towards \[m\].
    pub focus: Point3<f64>,
}

/// Everything about the skin that the views share.
struct Look<'a> {
    subject: &'a Subject<'a>,
    /// Normals of each triangle's corners, not smoothed over the edges of the outline.
    normals: Vec<[[f32; 3]; 3]>,
    /// Length that each vertex's colour shows \[m\].
    lengths: Vec<f32>,
    /// Where the colour scale ends \[m\].
    scale_end_m: f32,
    /// Edges of the rest shape where it turns sharply.
    outline: Vec<[Point3<f64>; 2]>,
    /// Corners of the rest shape's bounding box \[m\].
    bounds: [Point3<f64>; 2],
}

/// Draws the picture: a perspective view, a section through the focus, and a view from above.
pub fn draw(subject: &Subject<'_>) -> RgbImage {
    let look = Look::new(subject);
    let mut canvas = Canvas::new(WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING);
    for panel in panels(&look) {
        draw_panel(&mut canvas, &look, &panel);
    }
    let mut picture = canvas.reduced(OVERSAMPLING);
    caption(&mut picture, &look);
    picture.into_image()
}

fn panels(look: &Look<'_>) -> [Panel; 3] {
    let [min, max] = look.bounds;
    let centre = nalgebra::center(&min, &max);
    let size = (max - min).norm();
    let rect = |x, y, w, h| Rect { x, y, w, h }.times(OVERSAMPLING);
    let (main, section, above) = (rect(0, 0, 1060, 900), rect(1080, 90, 500, 360), rect(1080, 520, 500, 350));
    // What the main view shows ends below the caption and above the legend.
    let between_texts = rect(0, 96, 1060, 710);
    let eye = centre + size * Vector3::new(-0.62, -1.45, 1.12);
    let target = centre + Vector3::new(0.02 * size, 0.0, 0.01 * size);
    let along_x = (max.x - min.x) * 1.12;
    let (y, up) = (Vector3::y(), Vector3::z());
    let section_centre = Point3::new(centre.x, look.subject.focus.y, centre.z + 0.18 * (max.x - min.x));
    [
        Panel { rect: between_texts, camera: Camera::perspective(eye, target, 0.53, &main), cut_y: None },
        Panel {
            rect: section,
            camera: Camera::orthographic(section_centre, y, up, along_x, &section),
            cut_y: Some(look.subject.focus.y as f32),
        },
        Panel { rect: above, camera: Camera::orthographic(centre, -up, y, along_x, &above), cut_y: None },
    ]
}

fn caption(picture: &mut Canvas, look: &Look<'_>) {
    picture.text(40, 32, 3, &look.subject.title.to_uppercase(), colour::INK);
    picture.text(40, 66, 2, &look.subject.subtitle.to_uppercase(), colour::SOFT_INK);
    picture.text(1084, 62, 2, "SECTION THROUGH THE CONTACT", colour::SOFT_INK);
    picture.text(1084, 492, 2, "FROM ABOVE", colour::SOFT_INK);
    legend(picture, [40, 838], "DISPLACEMENT (MM)   GRID 10 MM   LINES: REST SHAPE", look.scale_end_m);
}

/// A bar of the colour scale with five marks in millimetres.
fn legend(picture: &mut Canvas, [x, y]: [u32; 2], title: &str, end_m: f32) {
    let (w, h) = (420, 18);
    for i in 0..w {
        picture.fill(Rect { x: x + i, y, w: 1, h }, colour::scale(i as f32 / (w - 1) as f32));
    }
    picture.text(x, y - 24, 2, title, colour::SOFT_INK);
    for mark in 0..=4 {
        let share = mark as f32 / 4.0;
        let at = x + (share * (w - 1) as f32) as u32;
        picture.fill(Rect { x: at, y: y + h, w: 1, h: 6 }, colour::SOFT_INK);
        let label = format!("{:.1}", 1e3 * end_m * share);
        picture.text(at.saturating_sub(6 * label.len() as u32), y + h + 10, 2, &label, colour::SOFT_INK);
    }
}

impl<'a> Look<'a> {
    /// Coloured by displacement.
    fn new(subject: &'a Subject<'a>) -> Self {
        let lengths = distances(subject.positions, &subject.surface.rest);
        let scale_end_m = scale_end(&lengths);
        Self::coloured(subject, lengths, scale_end_m)
    }

    /// Coloured by lengths, on a scale up to `scale_end_m`.
    fn coloured(subject: &'a Subject<'a>, lengths: Vec<f32>, scale_end_m: f32) -> Self {
        let surface = subject.surface;
        let points = surface.rest.iter().map(|p| Point3::from(*p).cast::<f64>());
        let bounds =
            points.fold([Point3::from([f64::MAX; 3]), Point3::from([f64::MIN; 3])], |[a, b], p| [a.inf(&p), b.sup(&p)]);
        Self {
            subject,
            normals: creased::corner_normals(surface, subject.positions),
            lengths,
            scale_end_m,
            outline: creased::sharp_edges(surface),
            bounds,
        }
    }
}

/// Distance of each point of one skin from the same point of another \[m\].
fn distances(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<f32> {
    let distance = |(p, q): (&[f32; 3], &[f32; 3])| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f32>().sqrt();
    a.iter().zip(b).map(distance).collect()
}

/// Where a scale ends that shows all of them.
fn scale_end(lengths: &[f32]) -> f32 {
    round_up(lengths.iter().copied().fold(1e-4, f32::max))
}

/// The next of 1, 1.2, 1.6, 2, 2.4, 3.2, 4, 6, 8 times a power of ten: quarters of it are short numbers.
fn round_up(value: f32) -> f32 {
    let power = 10.0_f32.powf(value.log10().floor());
    let steps = [1.0, 1.2, 1.6, 2.0, 2.4, 3.2, 4.0, 6.0, 8.0, 10.0];
    steps.iter().map(|s| s * power).find(|s| *s >= value).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dent_is_drawn_in_colour_and_the_rest_is_not_blank() {
        let skin = plica_geometry::shapes::block_skin([0.12, 0.06, 0.03], 0.003);
        let surface = DisplaySurface::new(&skin);
        let dent = |p: &[f32; 3]| {
            let r_squared = (p[0] - 0.06).powi(2) + (p[1] - 0.03).powi(2);
            [p[0], p[1], p[2] - 0.008 * p[2] / 0.03 * (-r_squared / 2e-4).exp()]
        };
        let positions: Vec<_> = surface.rest.iter().map(dent).collect();
        let shape = ToolShape::Ball { radius_m: 0.006 };
        let picture = draw(&Subject {
            title: "test",
            subtitle: "",
            surface: &surface,
            positions: &positions,
            tools: vec![(&shape, Isometry3::translation(0.06, 0.03, 0.028))],
            focus: Point3::new(0.06, 0.03, 0.022),
        });
        assert_eq!((picture.width(), picture.height()), (WIDTH, HEIGHT));
        let distinct: std::collections::HashSet<_> = picture.pixels().map(|p| p.0).collect();
        assert!(distinct.len() > 5_000, "{} colours", distinct.len());
    }

    #[test]
    fn the_scale_ends_at_a_short_number() {
        assert!((round_up(0.0083) - 0.01).abs() < 1e-7);
        assert!((round_up(0.0031) - 0.0032).abs() < 1e-7);
    }
}
