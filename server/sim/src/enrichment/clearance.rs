//! Detail never pushes the skin into a tool: what would end up deeper than the coarse skin is moved back to where that is.

use plica_geometry::CLUSTER_SIZE;

use crate::contact::{Placement, Solid, V3};

/// Moves enriched positions out of a solid. `boxes` hold the clusters of the coarse skin, detail reaches at most as far as
/// `reach` out of them; `coarse` are the positions without detail \[m\].
pub(crate) fn keep_clear(
    solid: &Solid,
    placement: &Placement,
    (boxes, reach): (&[[[f32; 3]; 2]], f32),
    coarse: impl Fn(usize) -> V3,
    enriched: &mut [[f32; 3]],
) {
    let [low, high] = solid.bounds(placement);
    for (cluster, ([least, most], positions)) in boxes.iter().zip(enriched.chunks_mut(CLUSTER_SIZE)).enumerate() {
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
            let allowed = solid.distance(&placement.to_local(coarse(cluster * CLUSTER_SIZE + lane))).0.min(0.0);
            if gap < allowed {
                let out = placement.rotation * normal * (allowed - gap);
                *position = (V3::from(*position) + out).into();
            }
        }
    }
}
