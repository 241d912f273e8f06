//! One view: skin, rest outline, tools.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::Look;
use super::camera::Camera;
use super::canvas::{Canvas, Rect};
use super::colour::{self, Linear};
use super::raster::{Corner, Fragment, line, triangle};
use super::tool_mesh::{ToolMesh, tessellate};

/// Distance of the lines drawn on the skin, along its rest shape \[m\].
const GRID_M: f32 = 0.01;
/// Half the width of a grid line \[m\].
const GRID_LINE_M: f32 = 1.7e-4;
/// How much of what is behind a tool it hides.
const TOOL_OPACITY: f32 = 0.72;
/// Rows of samples over which a tool fades out at a view's upper end.
const TOOL_FADE: f32 = 120.0;

/// A view and where it goes.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    pub(super) rect: Rect,
    pub(super) camera: Camera,
    /// Everything in front of this y is cut away \[m\].
    pub(super) cut_y: Option<f32>,
}

pub(super) fn draw_panel(canvas: &mut Canvas, look: &Look<'_>, panel: &Panel) {
    draw_skin(canvas, look, panel);
    draw_outline(canvas, look, panel);
    for (shape, pose) in &look.subject.tools {
        draw_tool(canvas, panel, &tessellate(shape, pose));
    }
}

fn draw_skin(canvas: &mut Canvas, look: &Look<'_>, panel: &Panel) {
    let Look { subject, normals, lengths, scale_end_m, .. } = look;
    for (t, corner_normals) in subject.surface.triangles.iter().zip(normals) {
        let corner = |k: usize| {
            let v = t[k] as usize;
            let (p, n, r) = (subject.positions[v], corner_normals[k], subject.surface.rest[v]);
            let attributes = [p[0], p[1], p[2], n[0], n[1], n[2], r[0], r[1], r[2], lengths[v] / scale_end_m];
            Corner { position: point(p), attributes }
        };
        triangle(canvas, &panel.rect, &panel.camera, [0, 1, 2].map(corner), |canvas, f| {
            let cut = panel.cut_y.is_some_and(|y| f.attributes[1] < y);
            if !cut && f.depth < canvas.depths[f.pixel] {
                canvas.depths[f.pixel] = f.depth;
                canvas.colours[f.pixel] = skin_colour(&panel.camera, &f);
            }
        });
    }
}

/// The colour scale under a light, with a grid that moves with the skin; the inside of a section is flat.
fn skin_colour(camera: &Camera, f: &Fragment<10>) -> Linear {
    let [px, py, pz, nx, ny, nz, rx, ry, rz, share] = f.attributes;
    let normal = vector([nx, ny, nz]).normalize();
    if !f.front {
        return colour::CUT;
    }
    let base = colour::scale(share);
    let on_line = on_grid(rx, nx) || on_grid(ry, ny) || (rz > 0.1 * GRID_M && on_grid(rz, nz));
    let base = if on_line { colour::times(base, 0.62) } else { base };
    lit(camera, &point([px, py, pz]), &normal, base, 0.10, 24.0)
}

/// Lines across a surface that does not face along their axis.
fn on_grid(rest: f32, normal: f32) -> bool {
    let off = (rest / GRID_M - (rest / GRID_M).round()).abs() * GRID_M;
    off < GRID_LINE_M && normal.abs() < 0.9
}

fn lit(camera: &Camera, p: &Point3<f64>, normal: &Vector3<f64>, base: Linear, gloss: f32, sharpness: f64) -> Linear {
    let (light, viewer) = (camera.light(), camera.towards_viewer(p));
    let sky = 0.5 + 0.5 * normal.z;
    let diffuse = normal.dot(&light).max(0.0);
    let half = (light + viewer).normalize();
    let shine = gloss * normal.dot(&half).max(0.0).powf(sharpness) as f32;
    let brightness = (0.33 + 0.20 * sky + 0.62 * diffuse) as f32;
    colour::mix(colour::times(base, brightness), [1.0; 3], shine)
}

/// Edges of the rest shape, faint where the skin hides them.
fn draw_outline(canvas: &mut Canvas, look: &Look<'_>, panel: &Panel) {
    for ends in &look.outline {
        if panel.cut_y.is_some_and(|y| ends.iter().all(|e| (e.y as f32) < y - 1e-6)) {
            continue;
        }
        line(&panel.rect, &panel.camera, *ends, 2.0, |x, y, depth| {
            let i = canvas.at(x, y);
            let hidden = depth > canvas.depths[i] + 5e-4;
            canvas.blend(x, y, colour::SOFT_INK, if hidden { 0.10 } else { 0.55 });
        });
    }
}

/// Tools let the dent shine through: their nearest surface is mixed over the skin. Long ones end in a fade.
fn draw_tool(canvas: &mut Canvas, panel: &Panel, tool: &ToolMesh) {
    let mut layer: HashMap<usize, (f32, Linear)> = HashMap::new();
    for t in &tool.triangles {
        let corner = |v: usize| {
            let (p, n) = (tool.positions[v], tool.normals[v]);
            let attributes = [p.x, p.y, p.z, n.x, n.y, n.z].map(|x| x as f32);
            Corner { position: p, attributes }
        };
        triangle(canvas, &panel.rect, &panel.camera, t.map(corner), |canvas, f| {
            let nearest = layer.get(&f.pixel).map_or(f32::INFINITY, |(depth, _)| *depth);
            if f.front && f.depth < nearest.min(canvas.depths[f.pixel]) {
                let [px, py, pz, nx, ny, nz] = f.attributes;
                let (p, n) = (point([px, py, pz]), vector([nx, ny, nz]).normalize());
                layer.insert(f.pixel, (f.depth, lit(&panel.camera, &p, &n, colour::STEEL, 0.55, 60.0)));
            }
        });
    }
    for (pixel, (_, steel)) in layer {
        let below_end = pixel as f32 / canvas.w as f32 - panel.rect.y as f32;
        let t = (below_end / TOOL_FADE).min(1.0);
        let share = TOOL_OPACITY * t * t * (3.0 - 2.0 * t);
        canvas.colours[pixel] = colour::mix(canvas.colours[pixel], steel, share);
    }
}

fn point(p: [f32; 3]) -> Point3<f64> {
    Point3::from(p).cast()
}

fn vector(v: [f32; 3]) -> Vector3<f64> {
    Vector3::from(v).cast()
}
