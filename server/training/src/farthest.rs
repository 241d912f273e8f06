//! Farthest-point sampling: of many candidates, those that lie as far from each other as can be \[Gonzalez85\].

/// Picks `count` of `features` (`[n_candidates][n_features]`), in the order of choice: the first candidate, then always the
/// one farthest from all chosen ones; of equals the first. Any leading part is a choice of its own.
pub(crate) fn farthest_points(features: &[Vec<f64>], count: usize) -> Vec<usize> {
    let count = count.min(features.len());
    let mut chosen = Vec::with_capacity(count);
    let mut nearest = vec![f64::INFINITY; features.len()];
    while chosen.len() < count {
        let next = largest(&nearest);
        chosen.push(next);
        for (distance, candidate) in nearest.iter_mut().zip(features) {
            *distance = distance.min(distance_squared(candidate, &features[next]));
        }
        nearest[next] = f64::NEG_INFINITY;
    }
    chosen
}

fn largest(values: &[f64]) -> usize {
    (0..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

fn distance_squared(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_points_come_first_and_none_twice() {
        let line: Vec<Vec<f64>> = [0.0, 1.0, 10.0, 5.0, 0.1].iter().map(|x| vec![*x]).collect();
        assert_eq!(farthest_points(&line, 3), [0, 2, 3]);
        let mut all = farthest_points(&line, 9);
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn duplicates_are_taken_last() {
        let twice = vec![vec![0.0], vec![0.0], vec![1.0]];
        assert_eq!(farthest_points(&twice, 3), [0, 2, 1]);
    }
}
