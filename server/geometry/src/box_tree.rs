//! Tree of axis-aligned boxes: finds the boxes near a point without a test of each.

use nalgebra::Point3;

/// Largest number of boxes in a leaf.
const LEAF_SIZE: usize = 4;

/// An axis-aligned box \[m\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aabb {
    lower: Point3<f64>,
    upper: Point3<f64>,
}

impl Aabb {
    /// The least box around `points`, of which there is at least one.
    pub(crate) fn around(points: &[Point3<f64>]) -> Self {
        let lower = points.iter().fold(points[0], |a, x| a.inf(x));
        let upper = points.iter().fold(points[0], |a, x| a.sup(x));
        Self { lower, upper }
    }

    /// Distance from `x` \[m\], 0 inside.
    pub(crate) fn distance(&self, x: &Point3<f64>) -> f64 {
        (x - x.sup(&self.lower).inf(&self.upper)).norm()
    }

    pub(crate) fn diagonal(&self) -> f64 {
        (self.upper - self.lower).norm()
    }

    fn joined(&self, other: &Self) -> Self {
        Self { lower: self.lower.inf(&other.lower), upper: self.upper.sup(&other.upper) }
    }

    fn centre(&self) -> Point3<f64> {
        nalgebra::center(&self.lower, &self.upper)
    }
}

/// Boxes in a binary tree, split at the median of their centres along the longest side.
#[derive(Clone, Debug)]
pub(crate) struct BoxTree {
    boxes: Vec<Aabb>,
    /// Indices of the boxes, ordered so that every branch holds a contiguous run.
    order: Vec<u32>,
    branches: Vec<Branch>,
}

#[derive(Clone, Debug)]
struct Branch {
    bounds: Aabb,
    /// Range of its run in `order`.
    run: [usize; 2],
    /// Branches of the two halves; none in a leaf.
    halves: Option<[usize; 2]>,
}

impl BoxTree {
    /// Tree over `boxes`, each identified by its position in the slice.
    pub(crate) fn new(boxes: Vec<Aabb>) -> Self {
        let order = (0..boxes.len() as u32).collect();
        let mut tree = Self { boxes, order, branches: Vec::new() };
        if !tree.boxes.is_empty() {
            tree.grow(0, tree.boxes.len());
        }
        tree
    }

    /// Boxes within `distance_m` of `x`, with their distance \[m\], in increasing order of number.
    pub(crate) fn within(&self, x: &Point3<f64>, distance_m: f64) -> Vec<(usize, f64)> {
        let mut found = Vec::new();
        let mut waiting: Vec<usize> = (!self.branches.is_empty()).then_some(0).into_iter().collect();
        while let Some(branch) = waiting.pop() {
            let branch = &self.branches[branch];
            if branch.bounds.distance(x) > distance_m {
                continue;
            }
            match branch.halves {
                Some(halves) => waiting.extend(halves),
                None => found.extend(self.near_of_run(branch.run, x, distance_m)),
            }
        }
        found.sort_unstable_by_key(|&(number, _)| number);
        found
    }

    fn near_of_run(&self, [start, end]: [usize; 2], x: &Point3<f64>, reach: f64) -> impl Iterator<Item = (usize, f64)> {
        let numbers = self.order[start..end].iter().map(|&number| number as usize);
        numbers.map(|number| (number, self.boxes[number].distance(x))).filter(move |&(_, distance)| distance <= reach)
    }

    /// Adds the branch of a run and the branches below it; returns its index.
    fn grow(&mut self, start: usize, end: usize) -> usize {
        let bounds = self.bounds_of(start, end);
        let branch = self.branches.len();
        self.branches.push(Branch { bounds, run: [start, end], halves: None });
        if end - start > LEAF_SIZE {
            let middle = self.split(start, end);
            self.branches[branch].halves = Some([self.grow(start, middle), self.grow(middle, end)]);
        }
        branch
    }

    fn bounds_of(&self, start: usize, end: usize) -> Aabb {
        let first = self.boxes[self.order[start] as usize];
        self.order[start..end].iter().fold(first, |bounds, &number| bounds.joined(&self.boxes[number as usize]))
    }

    /// Partitions a run at the median along the longest side of its centres; returns the start of the second half.
    fn split(&mut self, start: usize, end: usize) -> usize {
        let boxes = &self.boxes;
        let centre = |number: u32| boxes[number as usize].centre();
        let centres: Vec<_> = self.order[start..end].iter().map(|&number| centre(number)).collect();
        let spread = Aabb::around(&centres);
        let axis = (spread.upper - spread.lower).imax();
        let middle = start.midpoint(end);
        let by_centre = |a: &u32, b: &u32| centre(*a)[axis].total_cmp(&centre(*b)[axis]).then(a.cmp(b));
        self.order[start..end].select_nth_unstable_by(middle - start, by_centre);
        middle
    }
}
