//! Pareto front of points with two costs.

/// Indices of the points `[cost, error]` on the front: no other point is at most as large in both and smaller in one. By rising
/// cost; of equal points the first.
pub fn pareto_front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|i, j| {
        let ([a, b], [c, d]) = (points[*i], points[*j]);
        a.total_cmp(&c).then(b.total_cmp(&d))
    });
    let mut least = f64::INFINITY;
    order.retain(|i| {
        let better = points[*i][1] < least;
        least = least.min(points[*i][1]);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_another_point_beats_is_not_on_the_front() {
        let points = [[2.0, 2.0], [1.0, 3.0], [3.0, 2.0], [3.0, 1.0], [1.0, 4.0], [1.0, 3.0], [4.0, 0.5], [5.0, 9.0]];
        assert_eq!(pareto_front(&points), [1, 0, 3, 6]);
        assert!(pareto_front(&[]).is_empty());
    }
}
