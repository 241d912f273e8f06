//! Contact region: skin vertices that tie the accurate model to the coarse imprint, with their gaps.

use nalgebra::{Isometry3, Vector3};
use plica_accurate::contact::Obstacle;
use plica_accurate::{TieOptions, TieTarget};
use plica_geometry::VertexIdx;

use crate::suction::Disc;
use plica_geometry::ReferenceSkin;

/// Vertices nearer to the tool than the band, on the deformed coarse skin; `offsets: [n_skin]` \[m\].
pub(crate) fn around_tool(
    skin: &ReferenceSkin,
    offsets: &[Vector3<f64>],
    obstacle: &Obstacle,
    pose: &Isometry3<f64>,
    tie: &TieOptions,
) -> Vec<TieTarget> {
    targets(skin, offsets, tie, |_, position| obstacle.distance(pose, &(*position).into()))
}

/// Vertices of the disc under suction. The outer `band_m` of the disc is treated as a gap, so that the tie ramps down as it does
/// around a tool.
pub(crate) fn under_disc(
    skin: &ReferenceSkin,
    offsets: &[Vector3<f64>],
    disc: &Disc,
    tie: &TieOptions,
) -> Vec<TieTarget> {
    let inner = (disc.radius_m - tie.band_m).max(0.0);
    targets(skin, offsets, tie, |vertex, _| disc.distance(skin, vertex).map_or(f64::INFINITY, |r| r - inner))
}

fn targets(
    skin: &ReferenceSkin,
    offsets: &[Vector3<f64>],
    tie: &TieOptions,
    gap: impl Fn(usize, &Vector3<f64>) -> f64,
) -> Vec<TieTarget> {
    let rest = skin.skin().positions();
    let target = |vertex: usize| {
        let position = rest[vertex].coords + offsets[vertex];
        let gap_m = gap(vertex, &position);
        let area_m2 = skin.vertex_areas()[vertex];
        TieTarget { vertex: VertexIdx::from_index(vertex), gap_m, area_m2, position }
    };
    (0..rest.len()).map(target).filter(|t| t.gap_m < tie.band_m).collect()
}
