//! Input of an enricher: the coarse state, and the skin laid out around the contact point.

use nalgebra::{Matrix3, Point3, Vector3};

use super::groups::Planar;
use super::surface::FramedPoint;
use crate::embedding::SkinPositions;
use crate::lanes::{F, LANES, Node};
use crate::model::Model;
use crate::state::State;

/// Contact point and tool of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Contact point on the reference skin \[m\].
    pub contact_point: Point3<f64>,
    /// Origin of the tool \[m\].
    pub tool_origin: Point3<f64>,
}

/// Offsets of the coarse skin from rest, `[n_skin]` \[m\].
#[derive(Debug, Clone, Copy)]
pub(crate) enum Offsets<'a> {
    /// Stored, padded to four components.
    Padded(&'a [Node]),
    /// Deformed less rest positions, in a running simulation.
    Between(&'a SkinPositions, &'a Planar),
}

impl Offsets<'_> {
    #[inline(always)]
    fn of(&self, vertex: usize) -> Vector3<f32> {
        match self {
            Self::Padded(offsets) => vector(&offsets[vertex]),
            Self::Between(deformed, rest) => {
                let (group, lane) = (vertex / LANES, vertex % LANES);
                let rest = Vector3::from_fn(|k, _| bytemuck::cast_ref::<F, [f32; LANES]>(&rest.axis(k)[group])[lane]);
                Vector3::from(deformed.vertex(vertex)) - rest
            }
        }
    }

    /// Offsets of sixteen vertices; values beyond the last vertex are undefined.
    #[inline(always)]
    pub(crate) fn group(&self, group: usize) -> [Node; LANES] {
        match self {
            Self::Padded(offsets) => {
                let all = &offsets[group * LANES..];
                std::array::from_fn(|lane| all.get(lane).copied().unwrap_or_default())
            }
            Self::Between(deformed, rest) => {
                let [x, y, z]: [[f32; LANES]; 3] =
                    std::array::from_fn(|k| (deformed.group(k, group) - rest.axis(k)[group]).to_array());
                std::array::from_fn(|lane| [x[lane], y[lane], z[lane], 0.0])
            }
        }
    }
}

/// One contact: the coarse state, the contact point and the tool.
#[derive(Debug, Clone, Copy)]
pub struct Contact<'a> {
    /// Displacements of free nodes, in internal order \[m\].
    pub(crate) displacements: &'a [Node],
    pub(crate) offsets: Offsets<'a>,
    pub(crate) touch: &'a Touch,
}

impl<'a> Contact<'a> {
    /// `offsets` are those of the coarse skin from rest, as [`State::write_padded_offsets`] leaves them.
    pub fn new(model: &Model, state: &'a State, offsets: &'a [Node], touch: &'a Touch) -> Self {
        Self { displacements: &state.u[..model.n_free], offsets: Offsets::Padded(offsets), touch }
    }

    /// The contact with the skin laid out around its contact point.
    #[inline(always)]
    pub(crate) fn at(&self, framed: &FramedPoint, layout: &'a [[F; 2]]) -> Situation<'a> {
        let frame = &framed.frame;
        let rows = [frame.tau.transpose(), frame.theta.transpose(), frame.normal.transpose()];
        Situation {
            displacements: self.displacements,
            offsets: self.offsets,
            layout,
            contact_point: framed.point.position.coords.cast(),
            frame: Matrix3::from_rows(&rows).cast(),
            tool_origin: self.touch.tool_origin.coords.cast(),
        }
    }
}

/// One contact with frame and layout.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Situation<'a> {
    /// Displacements of free nodes, in internal order \[m\].
    pub(crate) displacements: &'a [Node],
    pub(crate) offsets: Offsets<'a>,
    /// Coordinates of skin vertices around the contact point, `[groups][axis]` \[m\].
    pub(crate) layout: &'a [[F; 2]],
    /// Contact point on the reference skin \[m\].
    pub(crate) contact_point: Vector3<f32>,
    /// Rows are `tau`, `theta` and the normal at the contact point.
    pub(crate) frame: Matrix3<f32>,
    /// Origin of the tool \[m\].
    pub(crate) tool_origin: Vector3<f32>,
}

impl Situation<'_> {
    /// Coordinates of a vertex \[m\].
    #[inline(always)]
    pub(crate) fn coordinates(&self, vertex: usize) -> [f32; 2] {
        coordinates(self.layout, vertex)
    }

    /// Offset of a vertex from rest \[m\].
    #[inline(always)]
    pub(crate) fn offset(&self, vertex: usize) -> Vector3<f32> {
        self.offsets.of(vertex)
    }
}

/// The first three components.
#[inline(always)]
pub(crate) fn vector(node: &Node) -> Vector3<f32> {
    Vector3::new(node[0], node[1], node[2])
}

/// Coordinates of a vertex in a layout \[m\].
#[inline(always)]
pub(crate) fn coordinates(layout: &[[F; 2]], vertex: usize) -> [f32; 2] {
    let (group, lane) = (&layout[vertex / LANES], vertex % LANES);
    [0, 1].map(|axis| bytemuck::cast_ref::<F, [f32; LANES]>(&group[axis])[lane])
}
