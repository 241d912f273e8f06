//! Which of many planes of a convex polytope is nearest to a point: an octree whose cells list the planes that may be.
//!
//! A hull of thousands of faces so costs about what one of a few dozen does. The answer is that of asking all planes, bit for bit.

use super::V3;

/// A cell with more planes is divided.
const FEW: usize = 16;
/// Cells are at least the root's edge over 2 to this power: where very many planes are equally near, deep inside, division is in vain.
const DEPTH: u32 = 7;
/// Edge of the root over the largest edge of the vertices' box: skin that far from a tool is seldom asked about.
const ROOM: f32 = 3.0;
/// Share of the root's edge by which a plane may be too far to be listed: rounding.
const ROUNDING: f32 = 1e-5;

/// The half-space `normal . x <= offset`, normal of length 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plane {
    pub(super) normal: V3,
    pub(super) offset: f32,
}

/// A plane and the signed distance of a point from it \[m\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Nearest {
    pub(super) distance: f32,
    pub(super) plane: u32,
}

/// Cells of space with the planes that may be nearest to their points.
#[derive(Debug, Clone)]
pub(super) struct PlaneOctree {
    cells: Vec<Cell>,
    /// Cell after cell.
    lists: Vec<u32>,
    root: Cube,
}

/// A leaf lists planes `lists[first..first + count]`; with a count of 0, `first` is the first of eight children.
#[derive(Debug, Clone, Copy)]
struct Cell {
    first: u32,
    count: u32,
}

#[derive(Debug, Clone, Copy)]
struct Cube {
    center: V3,
    half_edge: f32,
}

impl Plane {
    /// Signed distance \[m\].
    pub(super) fn distance(&self, p: &V3) -> f32 {
        self.normal.dot(p) - self.offset
    }
}

/// The plane among `numbers`, in ascending order, with the largest signed distance to `p`; the first of equal ones.
/// To a point that is not finite, plane 0 at a distance of minus infinity.
pub(super) fn nearest_of(planes: &[Plane], numbers: impl Iterator<Item = u32>, p: &V3) -> Nearest {
    let mut best = Nearest { distance: f32::NEG_INFINITY, plane: 0 };
    for plane in numbers {
        let distance = planes[plane as usize].distance(p);
        if distance > best.distance {
            best = Nearest { distance, plane };
        }
    }
    best
}

impl PlaneOctree {
    /// Of the planes of a polytope around `low` to `high`, the corners of its box.
    pub(super) fn new(planes: &[Plane], low: &V3, high: &V3) -> Self {
        let root = Cube { center: (low + high) * 0.5, half_edge: (high - low).max() * 0.5 * ROOM };
        let mut octree = Self { cells: vec![Cell { first: 0, count: 0 }], lists: Vec::new(), root };
        octree.fill(planes, 0, &root, &(0..planes.len() as u32).collect::<Vec<_>>(), 0);
        octree
    }

    /// The plane with the largest signed distance to `p`; of equal ones the first.
    pub(super) fn nearest(&self, planes: &[Plane], p: &V3) -> Nearest {
        if (p - self.root.center).amax() > self.root.half_edge {
            return nearest_of(planes, 0..planes.len() as u32, p);
        }
        let (mut cell, mut cube) = (self.cells[0], self.root);
        while cell.count == 0 {
            let octant = cube.octant(p);
            cell = self.cells[cell.first as usize + octant];
            cube = cube.child(octant);
        }
        let list = &self.lists[cell.first as usize..(cell.first + cell.count) as usize];
        nearest_of(planes, list.iter().copied(), p)
    }

    /// Fills the cell of a number with those of `possible` planes that are nearest to a point of `cube`, or divides it.
    fn fill(&mut self, planes: &[Plane], number: usize, cube: &Cube, possible: &[u32], depth: u32) {
        // Plane i passes plane b, the nearest to the center c, somewhere in the cube only if
        // (f_i - f_b)(c) + h |n_i - n_b|_1 >= 0, with the signed distances f and half of the edge h.
        let best = nearest_of(planes, possible.iter().copied(), &cube.center);
        let nearest = &planes[best.plane as usize];
        let slack = ROUNDING * self.root.half_edge;
        let may_be_nearest = |i: &&u32| {
            let plane = &planes[**i as usize];
            let gain = cube.half_edge * (plane.normal - nearest.normal).abs().sum();
            plane.distance(&cube.center) - best.distance + gain >= -slack
        };
        let listed: Vec<u32> = possible.iter().filter(may_be_nearest).copied().collect();
        if listed.len() <= FEW || depth == DEPTH {
            self.cells[number] = Cell { first: self.lists.len() as u32, count: listed.len() as u32 };
            self.lists.extend(listed);
            return;
        }
        let first = self.cells.len();
        self.cells[number] = Cell { first: first as u32, count: 0 };
        self.cells.resize(first + 8, Cell { first: 0, count: 0 });
        for octant in 0..8 {
            self.fill(planes, first + octant, &cube.child(octant), &listed, depth + 1);
        }
    }
}

impl Cube {
    fn octant(&self, p: &V3) -> usize {
        (0..3).map(|k| usize::from(p[k] >= self.center[k]) << k).sum()
    }

    fn child(&self, octant: usize) -> Self {
        let half_edge = self.half_edge * 0.5;
        let offset = V3::from_fn(|k, _| if octant >> k & 1 == 1 { half_edge } else { -half_edge });
        Self { center: self.center + offset, half_edge }
    }
}
