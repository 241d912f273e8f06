//! The files that a demo leaves.

use std::path::{Path, PathBuf};

use anyhow::Context;
use nalgebra::{Isometry3, Point3};
use plica_geometry::export::write_glb;
use plica_geometry::{DisplaySurface, vertex_normals_into};
use plica_scene::Config;

use super::held_out::{Distance, HeldOut};
use super::path::Path as DemoPath;
use super::witness::Seen;
use crate::picture::{Contrast, Subject, Version, draw, draw_contrast};

/// Coarse, enriched and accurate skin of the held-out press.
pub(super) fn write_comparison(
    config: &Config,
    surface: &DisplaySurface,
    held_out: &HeldOut,
    n_examples: usize,
    out: &Path,
) -> anyhow::Result<PathBuf> {
    let file = out.join("demo.png");
    let errors = &held_out.errors;
    let title = format!("{}: a press that was not trained on", config.name());
    let subtitle = format!(
        "{:.1} mm deep, {n_examples} examples, confidence {:.2}. errors: rms over the skin, worst vertex",
        1e3 * held_out.depth_m,
        errors.confidence
    );
    let version = |name, positions, note| Version { name, note, positions };
    let hexes = |divisions: [usize; 3]| divisions.iter().product::<usize>();
    let reference = format!("{} hexahedra, quasi-static", hexes(config.object().accurate().mesh.divisions));
    let contrast = Contrast {
        title: &title,
        subtitle: &subtitle,
        surface,
        versions: [
            version("coarse", &held_out.coarse, in_millimetres(&errors.coarse)),
            version("enriched", &held_out.enriched, in_millimetres(&errors.enriched)),
            version("accurate", &held_out.accurate, reference),
        ],
        tool: (&config.tools()[held_out.tool].shape, held_out.tool_pose),
        focus: held_out.focus,
    };
    draw_contrast(&contrast).save(&file).with_context(|| format!("cannot write {}", file.display()))?;
    Ok(file)
}

fn in_millimetres(distance: &Distance) -> String {
    format!("error {:.3} mm, worst {:.2} mm", 1e3 * distance.rms_m, 1e3 * distance.worst_m)
}

/// What came over the bus at the deepest press.
pub(super) fn write_live_picture(
    config: &Config,
    path: &DemoPath,
    surface: &DisplaySurface,
    seen: &Seen,
    out: &Path,
) -> anyhow::Result<PathBuf> {
    let file = out.join("demo-live.png");
    let proxy = seen.proxy.unwrap_or_else(Isometry3::identity);
    let (time_s, force_n) = (seen.deepest_sim_time_s, seen.force_then_n);
    let subtitle = format!("t = {time_s:.2} s, force {force_n:.2} N, confidence {:.2}", seen.confidence_then);
    let title = format!("{}: deepest press", config.name());
    let subject = Subject {
        title: &title,
        subtitle: &subtitle,
        surface,
        positions: seen.deepest_or(surface),
        tools: vec![(&config.tools()[path.tool].shape, proxy)],
        focus: Point3::from(proxy.translation.vector),
    };
    draw(&subject).save(&file).with_context(|| format!("cannot write {}", file.display()))?;
    Ok(file)
}

/// The same as a mesh.
pub(super) fn write_mesh(surface: &DisplaySurface, seen: &Seen, out: &Path) -> anyhow::Result<PathBuf> {
    let file = out.join("demo.glb");
    let positions = seen.deepest_or(surface);
    let mut normals = vec![[0.0; 3]; positions.len()];
    vertex_normals_into(&surface.triangles, positions, &mut normals);
    let triangles: Vec<_> = surface.triangles.iter().map(|t| t.map(plica_geometry::VertexIdx)).collect();
    write_glb(&file, positions, &normals, &triangles).with_context(|| format!("cannot write {}", file.display()))?;
    Ok(file)
}
