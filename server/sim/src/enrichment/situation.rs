//! What an enricher sees of one contact: the coarse state, and the skin laid out around the contact point.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::lanes::{F, LANES, Node};

/// Where a tool touches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Contact point on the reference skin \[m\].
    pub contact_point: Point3<f64>,
    /// Origin of the tool \[m\].
    pub tool_origin: Point3<f64>,
}

/// The coarse state, and the place of one contact.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Situation<'a> {
    /// Displacements of free nodes, in internal order \[m\].
    pub(crate) displacements: &'a [Node],
    /// Offsets of the coarse skin from rest, `[n_skin]` \[m\].
    pub(crate) offsets: &'a [Node],
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
        vector(&self.offsets[vertex])
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
