//! Three versions of one deformed skin side by side, how far they are apart, and their sections in one.

use image::RgbImage;
use nalgebra::{Isometry3, Point3, Vector3};
use plica_geometry::DisplaySurface;
use plica_sim::ToolShape;

use super::camera::Camera;
use super::canvas::{Canvas, Rect};
use super::panel::{Panel, draw_panel};
use super::raster::line;
use super::{HEIGHT, Look, OVERSAMPLING, Subject, WIDTH, colour, distances, legend, scale_end};

/// Left ends of the columns \[pixels\].
const COLUMNS: [u32; 3] = [20, 547, 1073];
const COLUMN_WIDTH: u32 = 507;
/// Widths of the lines of a section \[samples\]: the last version lies below the others.
const LINES: [f64; 3] = [4.0, 4.0, 8.0];

/// A skin and what is said of it.
#[derive(Debug, Clone)]
pub struct Version<'a> {
    /// One word.
    pub name: &'a str,
    /// The line below it.
    pub note: String,
    /// World positions `[n_skin]` \[m\].
    pub positions: &'a [[f32; 3]],
}

/// What is drawn.
#[derive(Debug, Clone)]
pub struct Contrast<'a> {
    /// First line of the caption.
    pub title: &'a str,
    /// Second line of the caption.
    pub subtitle: &'a str,
    /// Rest shape.
    pub surface: &'a DisplaySurface,
    /// Versions of the skin; the others are measured against the last.
    pub versions: [Version<'a>; 3],
    /// Tool and where it is.
    pub tool: (&'a ToolShape, Isometry3<f64>),
    /// What the views turn towards \[m\].
    pub focus: Point3<f64>,
}

/// Draws the picture: three views in one scale, two maps of the distance from the last version, a section with all three.
pub fn draw_contrast(contrast: &Contrast<'_>) -> RgbImage {
    let mut canvas = Canvas::new(WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING);
    let displacement_end_m = draw_views(&mut canvas, contrast);
    let distance_end_m = draw_maps(&mut canvas, contrast);
    draw_sections(&mut canvas, contrast);
    let mut picture = canvas.reduced(OVERSAMPLING);
    caption(&mut picture, contrast);
    legend(&mut picture, [COLUMNS[2] + 20, 46], "DISPLACEMENT (MM)   GRID 10 MM", displacement_end_m);
    let title = format!("DISTANCE FROM {} (MM)", contrast.versions[2].name.to_uppercase());
    legend(&mut picture, [COLUMNS[0] + 20, 838], &title, distance_end_m);
    names(&mut picture, contrast);
    picture.into_image()
}

fn subject<'a>(contrast: &'a Contrast<'a>, positions: &'a [[f32; 3]], with_tool: bool) -> Subject<'a> {
    Subject {
        title: "",
        subtitle: "",
        surface: contrast.surface,
        positions,
        tools: if with_tool { vec![contrast.tool] } else { Vec::new() },
        focus: contrast.focus,
    }
}

/// Where the colour scale ends \[m\].
fn draw_views(canvas: &mut Canvas, contrast: &Contrast<'_>) -> f32 {
    let rest = &contrast.surface.rest;
    let all: Vec<_> = contrast.versions.iter().map(|v| distances(v.positions, rest)).collect();
    let end_m = scale_end(&all.concat());
    for ((version, lengths), x) in contrast.versions.iter().zip(all).zip(COLUMNS) {
        let subject = subject(contrast, version.positions, true);
        let look = Look::coloured(&subject, lengths, end_m);
        let rect = Rect { x, y: 164, w: COLUMN_WIDTH, h: 356 }.times(OVERSAMPLING);
        let [min, max] = look.bounds;
        let size = (max - min).norm();
        let centre = nalgebra::center(&min, &max);
        let eye = centre + size * Vector3::new(-0.62, -1.45, 1.25);
        let target = centre + Vector3::new(0.02 * size, 0.0, 0.02 * size);
        draw_panel(canvas, &look, &Panel { rect, camera: Camera::perspective(eye, target, 0.405, &rect), cut_y: None });
    }
    end_m
}

/// Where the colour scale ends \[m\].
fn draw_maps(canvas: &mut Canvas, contrast: &Contrast<'_>) -> f32 {
    let [coarse, enriched, reference] = &contrast.versions;
    let all = [coarse, enriched].map(|v| distances(v.positions, reference.positions));
    let end_m = scale_end(&all.concat());
    for ((version, lengths), x) in [coarse, enriched].into_iter().zip(all).zip(COLUMNS) {
        let subject = subject(contrast, version.positions, false);
        let look = Look::coloured(&subject, lengths, end_m);
        let rect = Rect { x, y: 548, w: COLUMN_WIDTH, h: 260 }.times(OVERSAMPLING);
        let [min, max] = look.bounds;
        let camera = Camera::orthographic(
            nalgebra::center(&min, &max),
            -Vector3::z(),
            Vector3::y(),
            (max.x - min.x) * 1.08,
            &rect,
        );
        draw_panel(canvas, &look, &Panel { rect, camera, cut_y: None });
    }
    end_m
}

/// The skins cut along x through the focus, near the tool.
fn draw_sections(canvas: &mut Canvas, contrast: &Contrast<'_>) {
    let rect = Rect { x: COLUMNS[2], y: 548, w: COLUMN_WIDTH, h: 260 }.times(OVERSAMPLING);
    let rest = &contrast.surface.rest;
    let length_m = rest.iter().map(|p| f64::from(p[0])).fold(0.0, f64::max);
    let centre = contrast.focus - Vector3::new(0.0, 0.0, 0.005 * length_m);
    let camera = Camera::orthographic(centre, Vector3::y(), Vector3::z(), 0.45 * length_m, &rect);
    let mut draw = |positions: &[[f32; 3]], width: f64, colour: colour::Linear, share: f32| {
        for ends in section(contrast.surface, positions, contrast.focus.y) {
            line(&rect, &camera, ends, width, |x, y, _| canvas.blend(x, y, colour, share));
        }
    };
    draw(rest, 2.0, colour::SOFT_INK, 0.35);
    for i in [2, 0, 1] {
        draw(contrast.versions[i].positions, LINES[i], colour::VERSIONS[i], 1.0);
    }
}

/// Where a surface crosses the plane of one y.
fn section(surface: &DisplaySurface, positions: &[[f32; 3]], y: f64) -> Vec<[Point3<f64>; 2]> {
    let crossing = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|v| Point3::from(positions[v as usize]).cast::<f64>());
        let share = (y - a.y) / (b.y - a.y);
        (0.0..1.0).contains(&share).then(|| a + (b - a) * share)
    };
    let of_triangle = |t: &[u32; 3]| {
        let ends: Vec<_> = [(0, 1), (1, 2), (2, 0)].into_iter().filter_map(|(i, j)| crossing(t[i], t[j])).collect();
        <[Point3<f64>; 2]>::try_from(ends).ok()
    };
    surface.triangles.iter().filter_map(of_triangle).collect()
}

fn caption(picture: &mut Canvas, contrast: &Contrast<'_>) {
    picture.text(40, 28, 3, &contrast.title.to_uppercase(), colour::INK);
    picture.text(40, 62, 2, &contrast.subtitle.to_uppercase(), colour::SOFT_INK);
    for (version, x) in contrast.versions.iter().zip(COLUMNS) {
        picture.text(x + 20, 106, 3, &version.name.to_uppercase(), colour::INK);
        picture.text(x + 20, 140, 2, &version.note.to_uppercase(), colour::SOFT_INK);
    }
}

/// Which line of the section is which.
fn names(picture: &mut Canvas, contrast: &Contrast<'_>) {
    let (x, y) = (COLUMNS[2] + 20, 838);
    picture.text(x, y - 24, 2, "SECTION THROUGH THE CONTACT", colour::SOFT_INK);
    let mut at = x;
    for (version, colour) in contrast.versions.iter().zip(colour::VERSIONS) {
        picture.fill(Rect { x: at, y: y + 7, w: 26, h: 4 }, colour);
        picture.text(at + 34, y + 2, 2, &version.name.to_uppercase(), colour::SOFT_INK);
        at += 34 + 12 * version.name.len() as u32 + 24;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_cut_where_the_plane_is() {
        let surface = DisplaySurface::new(&plica_geometry::shapes::block_skin([0.04, 0.02, 0.01], 0.003));
        let ends = section(&surface, &surface.rest, 0.0071);
        assert!(ends.iter().flatten().all(|p| (p.y - 0.0071).abs() < 1e-9));
        // Around the block once.
        let length: f64 = ends.iter().map(|[a, b]| (b - a).norm()).sum();
        assert!((length - 0.1).abs() < 1e-6, "{length}");
    }

    #[test]
    fn three_versions_are_drawn() {
        let surface = DisplaySurface::new(&plica_geometry::shapes::block_skin([0.12, 0.06, 0.03], 0.003));
        let dented = |depth: f32| -> Vec<[f32; 3]> {
            let dent = |p: &[f32; 3]| {
                let r_squared = (p[0] - 0.06).powi(2) + (p[1] - 0.03).powi(2);
                [p[0], p[1], p[2] - depth * p[2] / 0.03 * (-r_squared / 2e-4).exp()]
            };
            surface.rest.iter().map(dent).collect()
        };
        let positions = [0.005, 0.007, 0.008].map(dented);
        let version = |i: usize| Version { name: ["a", "b", "c"][i], note: String::new(), positions: &positions[i] };
        let shape = ToolShape::Ball { radius_m: 0.006 };
        let picture = draw_contrast(&Contrast {
            title: "test",
            subtitle: "",
            surface: &surface,
            versions: [0, 1, 2].map(version),
            tool: (&shape, Isometry3::translation(0.06, 0.03, 0.028)),
            focus: Point3::new(0.06, 0.03, 0.022),
        });
        assert_eq!((picture.width(), picture.height()), (WIDTH, HEIGHT));
        let distinct: std::collections::HashSet<_> = picture.pixels().map(|p| p.0).collect();
        assert!(distinct.len() > 5_000, "{} colours", distinct.len());
    }
}
