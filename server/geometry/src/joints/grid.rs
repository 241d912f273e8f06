//! Points and boxes of very different sizes by place: a grid of cubes per power of two.

use std::collections::{BTreeSet, HashMap};

use nalgebra::Point3;

/// Nodes, or a node and a face, closer than this share of the shortest edge around them are at one place.
pub(super) const TOUCH: f64 = 1e-2;

/// Power of two of a grid, and the cube in it.
type Cube = (i32, [i64; 3]);

/// Numbered items by the cubes that they lie in.
#[derive(Debug, Default)]
pub(super) struct Grid {
    cubes: HashMap<Cube, Vec<u32>>,
    levels: BTreeSet<i32>,
}

/// Level whose cubes are at least as large as `size`.
fn level(size: f64) -> i32 {
    size.max(f64::MIN_POSITIVE).log2().ceil() as i32
}

fn cube_at(level: i32, x: &Point3<f64>) -> [i64; 3] {
    let edge = 2.0_f64.powi(level);
    [x.x, x.y, x.z].map(|c| (c / edge).floor() as i64)
}

impl Grid {
    /// Puts an item into the cubes, about as large as `size`, that the box from `lower` to `upper` meets.
    pub(super) fn insert(&mut self, item: u32, size: f64, lower: &Point3<f64>, upper: &Point3<f64>) {
        let level = level(size);
        self.levels.insert(level);
        let (low, high) = (cube_at(level, lower), cube_at(level, upper));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    self.cubes.entry((level, [x, y, z])).or_default().push(item);
                }
            }
        }
    }

    /// Calls `visit` with every item that is as large as `size` or larger and may meet the box; with some more than once.
    pub(super) fn near(&self, size: f64, lower: &Point3<f64>, upper: &Point3<f64>, mut visit: impl FnMut(u32)) {
        for &level in self.levels.range(level(size)..) {
            let (low, high) = (cube_at(level, lower), cube_at(level, upper));
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        self.cubes.get(&(level, [x, y, z])).into_iter().flatten().for_each(|&item| visit(item));
                    }
                }
            }
        }
    }
}

/// Nodes that lie at one point.
pub(super) struct Twins {
    /// For each node the first node at its point.
    pub(super) first_of_node: Vec<u32>,
    /// First nodes of points with several, in increasing order.
    pub(super) firsts: Vec<u32>,
    pub(super) widest_gap_m: f64,
}

/// Nodes closer than [`TOUCH`] of the shorter of their edges `sizes`.
pub(super) fn coincident(nodes: &[Point3<f64>], sizes: &[f64]) -> Twins {
    let mut grid = Grid::default();
    for (node, (x, size)) in (0..).zip(nodes.iter().zip(sizes)) {
        grid.insert(node, *size, x, x);
    }
    let mut first_of_node: Vec<u32> = (0..nodes.len() as u32).collect();
    let mut widest_gap_m = 0.0_f64;
    for (node, (x, size)) in (0..).zip(nodes.iter().zip(sizes)) {
        let reach = nalgebra::Vector3::repeat(TOUCH * size);
        grid.near(*size, &(x - reach), &(x + reach), |other| {
            let gap = (nodes[other as usize] - x).norm();
            if other != node && gap <= TOUCH * size.min(sizes[other as usize]) {
                widest_gap_m = widest_gap_m.max(gap);
                join(&mut first_of_node, node, other);
            }
        });
    }
    let mut firsts = Vec::new();
    for node in 0..nodes.len() as u32 {
        let first = root(&mut first_of_node, node);
        if first != node {
            firsts.push(first);
        }
    }
    firsts.sort_unstable();
    firsts.dedup();
    Twins { first_of_node, firsts, widest_gap_m }
}

/// Least member of the set of `item`; afterwards `item` points at it.
pub(super) fn root(parents: &mut [u32], item: u32) -> u32 {
    let mut least = item;
    while parents[least as usize] != least {
        least = parents[least as usize];
    }
    let mut at = item;
    while at != least {
        at = std::mem::replace(&mut parents[at as usize], least);
    }
    least
}

/// Joins the sets of two items.
pub(super) fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}
