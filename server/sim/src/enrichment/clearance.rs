//! Clearance of tools: a vertex that detail would push deeper into a tool than the coarse skin moves back to the coarse
//! depth.

use plica_geometry::CLUSTER_SIZE;

use crate::contact::{Placement, Solid, V3};
use crate::embedding::SkinPositions;

/// Moves enriched positions out of a solid. `coarse` is the skin without detail; `reach` is the length of the largest detail
/// \[m\].
pub(crate) fn keep_clear(
    solid: &Solid,
    placement: &Placement,
    coarse: &SkinPositions,
    reach: f32,
    enriched: &mut [[f32; 3]],
) {
    let [low, high] = solid.bounds(placement);
    for (cluster, ([least, most], positions)) in
        coarse.boxes().iter().zip(enriched.chunks_mut(CLUSTER_SIZE)).enumerate()
    {
        if !(0..3).all(|k| most[k] + reach > low[k] && least[k] - reach < high[k]) {
            continue;
        }
        for (lane, position) in positions.iter_mut().enumerate() {
            if !(0..3).all(|k| position[k] > low[k] && position[k] < high[k]) {
                continue;
            }
            let (gap, normal) = solid.distance(&placement.to_local(V3::from(*position)));
            if gap >= 0.0 {
                continue;
            }
            let coarse_position = V3::from(coarse.vertex(cluster * CLUSTER_SIZE + lane));
            let allowed = solid.distance(&placement.to_local(coarse_position)).0.min(0.0);
            if gap < allowed {
                let out = placement.rotation * normal * (allowed - gap);
                *position = (V3::from(*position) + out).into();
            }
        }
    }
}
