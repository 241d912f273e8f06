//! Direct solution of symmetric positive definite systems with a narrow band.

/// Lower half of a symmetric matrix; row `i` holds columns `i - bandwidth ..= i`.
pub struct Banded {
    n: usize,
    bandwidth: usize,
    values: Vec<f64>,
}

impl Banded {
    pub fn zeros(n: usize, bandwidth: usize) -> Self {
        Self { n, bandwidth, values: vec![0.0; n * (bandwidth + 1)] }
    }

    /// Adds to entry `(i, j)`; the upper half is ignored.
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        if j <= i {
            let at = self.at(i, j);
            self.values[at] += value;
        }
    }

    fn at(&self, i: usize, j: usize) -> usize {
        assert!(j + self.bandwidth >= i, "entry ({i}, {j}) lies outside a band of {}", self.bandwidth);
        i * (self.bandwidth + 1) + j + self.bandwidth - i
    }

    /// Columns `from..to` of row `i`.
    fn row(&self, i: usize, from: usize, to: usize) -> &[f64] {
        let first = i * (self.bandwidth + 1) + self.bandwidth - i;
        &self.values[first + from..first + to]
    }

    /// `L L^T = A`, row by row.
    pub fn factor(mut self) -> Factor {
        for i in 0..self.n {
            let first = i.saturating_sub(self.bandwidth);
            for j in first..=i {
                let from = first.max(j.saturating_sub(self.bandwidth));
                let sum = dot(self.row(i, from, j), self.row(j, from, j));
                let (at, pivot) = (self.at(i, j), self.at(j, j));
                let rest = self.values[at] - sum;
                self.values[at] = if j < i { rest / self.values[pivot] } else { rest.sqrt() };
                assert!(self.values[at].is_finite(), "pivot {i} is not positive: {rest}");
            }
        }
        Factor(self)
    }
}

/// A factored matrix.
pub struct Factor(Banded);

impl Factor {
    /// `x` becomes `A^-1 x`.
    pub fn solve(&self, x: &mut [f64]) {
        let Self(l) = self;
        for i in 0..l.n {
            let first = i.saturating_sub(l.bandwidth);
            let sum = dot(l.row(i, first, i), &x[first..i]);
            x[i] = (x[i] - sum) / l.row(i, i, i + 1)[0];
        }
        for i in (0..l.n).rev() {
            let first = i.saturating_sub(l.bandwidth);
            x[i] /= l.row(i, i, i + 1)[0];
            let xi = x[i];
            x[first..i].iter_mut().zip(l.row(i, first, i)).for_each(|(x, l)| *x -= l * xi);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (x, y) in a4.iter().zip(b4) {
        (0..4).for_each(|k| sums[k] += x[k] * y[k]);
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum::<f64>()
}
