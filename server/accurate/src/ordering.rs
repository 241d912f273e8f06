//! Order of elimination: geometric nested dissection \[Geo73\].

use nalgebra::Vector3;

/// Parts of at most this many nodes are not divided further.
const MAX_LEAF: usize = 16;
/// Candidate cuts along each axis, as shares of the nodes.
const CUTS: [f64; 5] = [0.4, 0.45, 0.5, 0.55, 0.6];

/// Nodes in the order of their elimination, given their `positions` \[m\] and, as `neighbours[n]`, the nodes coupled
/// with `n`.
///
/// A part is cut by a plane across an axis; nodes on one side with neighbours on the other are the separator. They come last,
/// after the halves that they separate, so that eliminating one half fills nothing in the other. Of several planes the
/// one with the smallest separator is taken, weighted by the imbalance of the halves.
pub(crate) fn nested_dissection(positions: &[Vector3<f64>], neighbours: &[Vec<u32>]) -> Vec<usize> {
    let n = positions.len();
    let mut dissection =
        Dissection { positions, neighbours, mark: vec![0; n], n_marks: 0, order: Vec::with_capacity(n) };
    dissection.divide((0..n).collect());
    dissection.order
}

struct Dissection<'a> {
    positions: &'a [Vector3<f64>],
    neighbours: &'a [Vec<u32>],
    /// `mark[n] == n_marks` for nodes beyond the current plane.
    mark: Vec<usize>,
    n_marks: usize,
    order: Vec<usize>,
}

/// The first `n_low` of `nodes` lie on one side.
struct Cut {
    cost: f64,
    nodes: Vec<usize>,
    n_low: usize,
}

impl Dissection<'_> {
    fn divide(&mut self, nodes: Vec<usize>) {
        let cut = if nodes.len() > MAX_LEAF { self.best_cut(&nodes) } else { None };
        let Some(Cut { nodes: sorted, n_low, .. }) = cut else {
            self.order.extend(nodes);
            return;
        };
        let high = sorted[n_low..].to_vec();
        self.mark(&high);
        let (mut separator, low): (Vec<_>, Vec<_>) = sorted[..n_low].iter().partition(|&&node| self.touches_mark(node));
        self.divide(low);
        self.divide(high);
        separator.sort_unstable();
        self.order.extend(separator);
    }

    fn best_cut(&mut self, nodes: &[usize]) -> Option<Cut> {
        let mut best: Option<Cut> = None;
        for axis in 0..3 {
            let coordinate = |node: usize| self.positions[node][axis];
            let mut sorted = nodes.to_vec();
            sorted.sort_by(|&a, &b| coordinate(a).total_cmp(&coordinate(b)).then(a.cmp(&b)));
            let extent = coordinate(sorted[sorted.len() - 1]) - coordinate(sorted[0]);
            for share in CUTS {
                let plane = coordinate(sorted[(share * sorted.len() as f64) as usize]) - 1e-9 * extent;
                let n_low = sorted.partition_point(|&node| self.positions[node][axis] < plane);
                let limit = best.as_ref().map_or(f64::INFINITY, |cut| cut.cost);
                if let Some(cost) = self.cost(&sorted, n_low).filter(|cost| *cost < limit) {
                    best = Some(Cut { cost, nodes: sorted.clone(), n_low });
                }
            }
        }
        best
    }

    /// Size of the separator, up to half as much again for unequal parts; `None` where a part is empty.
    fn cost(&mut self, sorted: &[usize], n_low: usize) -> Option<f64> {
        self.mark(&sorted[n_low..]);
        let n_separator = sorted[..n_low].iter().filter(|&&node| self.touches_mark(node)).count();
        let (low, high) = (n_low - n_separator, sorted.len() - n_low);
        let inequality = low.abs_diff(high) as f64 / sorted.len() as f64;
        (low > 0 && high > 0).then_some(n_separator as f64 * (1.0 + 0.5 * inequality))
    }

    fn mark(&mut self, nodes: &[usize]) {
        self.n_marks += 1;
        nodes.iter().for_each(|&node| self.mark[node] = self.n_marks);
    }

    fn touches_mark(&self, node: usize) -> bool {
        self.neighbours[node].iter().any(|&other| self.mark[other as usize] == self.n_marks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of nodes, each coupled with the next.
    fn chain(n: usize) -> (Vec<Vector3<f64>>, Vec<Vec<u32>>) {
        let positions = (0..n).map(|i| Vector3::new(i as f64, 0.0, 0.0)).collect();
        let near = |i: usize| [i.wrapping_sub(1), i + 1].into_iter().filter(|&j| j < n).map(|j| j as u32).collect();
        (positions, (0..n).map(near).collect())
    }

    #[test]
    fn every_node_comes_once_and_the_separator_last() {
        let (positions, neighbours) = chain(101);
        let order = nested_dissection(&positions, &neighbours);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..101).collect::<Vec<_>>());
        assert!((40..=60).contains(&order[100]), "{}", order[100]);
    }

    #[test]
    fn nodes_in_one_place_are_not_divided() {
        let (_, neighbours) = chain(40);
        assert_eq!(nested_dissection(&[Vector3::zeros(); 40], &neighbours).len(), 40);
    }
}
