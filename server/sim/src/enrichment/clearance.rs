//! Detail never pushes the skin into a tool: what would end up deeper than the coarse skin is moved back to where that is.

use super::situation::vector;
use crate::contact::{Placement, Solid, V3};
use crate::lanes::Node;

/// Moves enriched positions out of a solid; `coarse` are the positions without detail \[m\].
pub(crate) fn keep_clear(
    solid: &Solid,
    placement: &Placement,
    coarse: impl Fn(usize) -> V3,
    enriched: &mut [[f32; 3]],
) {
    let [low, high] = solid.bounds(placement);
    for (vertex, position) in enriched.iter_mut().enumerate() {
        if !(0..3).all(|k| position[k] > low[k] && position[k] < high[k]) {
            continue;
        }
        let (gap, normal) = solid.distance(&placement.to_local(V3::from(*position)));
        if gap >= 0.0 {
            continue;
        }
        let allowed = solid.distance(&placement.to_local(coarse(vertex))).0.min(0.0);
        if gap < allowed {
            let out = placement.rotation * normal * (allowed - gap);
            *position = [position[0] + out.x, position[1] + out.y, position[2] + out.z];
        }
    }
}

/// Rest position and offset, added.
pub(crate) fn position(rest: &[f32; 3], offset: &Node) -> V3 {
    V3::from(*rest) + vector(offset)
}
