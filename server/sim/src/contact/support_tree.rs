//! Which of many linear functions is largest at a point: a tree of boxes around their coefficients.
//!
//! A hull of thousands of faces so costs what one of a few dozen does. The answer is that of asking all of them, bit for bit:
//! branches are left out only where their bound is below the best found, by more than rounding.

/// Functions in a leaf at most.
const LEAF_SIZE: usize = 8;
/// Branches wait here; a tree of 2^32 functions is not deeper.
const DEPTH: usize = 64;
/// Share of the largest term by which a bound may be too small: rounding.
const ROUNDING: f32 = 1e-6;

/// Functions `f_i(q) = a_i . q` with four coefficients each.
#[derive(Debug, Clone)]
pub(super) struct SupportTree {
    order: Vec<u32>,
    branches: Vec<Branch>,
    /// Largest magnitude of each coefficient.
    magnitudes: [f32; 4],
}

/// The first half of a branch follows it.
#[derive(Debug, Clone)]
struct Branch {
    lower: [f32; 4],
    upper: [f32; 4],
    start: u32,
    end: u32,
    /// Second half; 0 in a leaf.
    second: u32,
}

/// A function and its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Largest {
    pub(super) value: f32,
    pub(super) index: u32,
}

impl SupportTree {
    pub(super) fn new(functions: &[[f32; 4]]) -> Self {
        let order = (0..functions.len() as u32).collect();
        let magnitudes = [0, 1, 2, 3].map(|k| functions.iter().map(|f| f[k].abs()).fold(0.0, f32::max));
        let mut tree = Self { order, branches: Vec::new(), magnitudes };
        if !functions.is_empty() {
            tree.grow(functions, 0, functions.len());
        }
        tree
    }

    /// The function with the largest `value(i)`, which is `f_i(q)` but for rounding; of equal ones the first.
    pub(super) fn largest(&self, q: [f32; 4], value: impl Fn(u32) -> f32) -> Largest {
        let slack = ROUNDING * (0..4).map(|k| q[k].abs() * self.magnitudes[k]).sum::<f32>();
        let mut best = Largest { value: f32::NEG_INFINITY, index: u32::MAX };
        let mut waiting = [(0_u32, f32::INFINITY); DEPTH];
        let mut n_waiting = usize::from(!self.branches.is_empty());
        while n_waiting > 0 {
            n_waiting -= 1;
            let (number, bound) = waiting[n_waiting];
            if bound + slack < best.value {
                continue;
            }
            let branch = &self.branches[number as usize];
            if branch.second == 0 {
                for &index in &self.order[branch.start as usize..branch.end as usize] {
                    let value = value(index);
                    if value > best.value || (value == best.value && index < best.index) {
                        best = Largest { value, index };
                    }
                }
                continue;
            }
            let halves = [number + 1, branch.second].map(|half| (half, self.branches[half as usize].bound(&q)));
            let [low, high] = if halves[0].1 < halves[1].1 { halves } else { [halves[1], halves[0]] };
            waiting[n_waiting] = low;
            waiting[n_waiting + 1] = high;
            n_waiting += 2;
        }
        best
    }

    /// Calls `visit` with the functions of all leaves that `is_wanted`, which is asked about boxes of coefficients.
    pub(super) fn visit(&self, is_wanted: impl Fn(&[f32; 4], &[f32; 4]) -> bool, mut visit: impl FnMut(u32)) {
        let mut waiting = [0_u32; DEPTH];
        let mut n_waiting = usize::from(!self.branches.is_empty());
        while n_waiting > 0 {
            n_waiting -= 1;
            let number = waiting[n_waiting];
            let branch = &self.branches[number as usize];
            if !is_wanted(&branch.lower, &branch.upper) {
                continue;
            }
            if branch.second == 0 {
                self.order[branch.start as usize..branch.end as usize].iter().for_each(|&index| visit(index));
                continue;
            }
            waiting[n_waiting] = branch.second;
            waiting[n_waiting + 1] = number + 1;
            n_waiting += 2;
        }
    }

    fn grow(&mut self, functions: &[[f32; 4]], start: usize, end: usize) -> u32 {
        let run = self.order[start..end].iter().map(|&i| functions[i as usize]);
        let [mut lower, mut upper] = [[f32::INFINITY; 4], [f32::NEG_INFINITY; 4]];
        for f in run {
            for k in 0..4 {
                lower[k] = lower[k].min(f[k]);
                upper[k] = upper[k].max(f[k]);
            }
        }
        let number = self.branches.len();
        self.branches.push(Branch { lower, upper, start: start as u32, end: end as u32, second: 0 });
        if end - start > LEAF_SIZE {
            let spread = |k: &usize| upper[*k] - lower[*k];
            let axis = (0..3).max_by(|a, b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
            let middle = start.midpoint(end);
            let along = |i: &u32| functions[*i as usize][axis];
            let by_place = |a: &u32, b: &u32| along(a).total_cmp(&along(b)).then(a.cmp(b));
            self.order[start..end].select_nth_unstable_by(middle - start, by_place);
            self.grow(functions, start, middle);
            self.branches[number].second = self.grow(functions, middle, end);
        }
        number as u32
    }
}

impl Branch {
    /// No function of the branch is larger, but for rounding.
    fn bound(&self, q: &[f32; 4]) -> f32 {
        (0..4).map(|k| (self.lower[k] * q[k]).max(self.upper[k] * q[k])).sum()
    }
}
