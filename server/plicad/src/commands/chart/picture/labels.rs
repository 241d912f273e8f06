//! Labels beside points, where they cover least.

/// A rectangle in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Box2 {
    centre: [f64; 2],
    /// Half of width and height.
    half: [f64; 2],
}

/// Distances from the point that are tried, one after the other.
const DISTANCES: [f64; 6] = [7.0, 10.0, 16.0, 26.0, 40.0, 60.0];
/// Directions, the best ones first: right, left, above, below, and between.
const DIRECTIONS: [[f64; 2]; 8] =
    [[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0], [0.0, 1.0], [0.7, -0.7], [0.7, 0.7], [-0.7, -0.7], [-0.7, 0.7]];
/// A label nearer than this needs no line to its point.
const BESIDE: f64 = 12.0;

impl Box2 {
    pub(super) fn around((x, y): (f64, f64), half: [f64; 2]) -> Self {
        Self { centre: [x, y], half }
    }

    /// Of which two points are opposite corners.
    pub(super) fn spanning(a: (f64, f64), b: (f64, f64)) -> Self {
        let half = [0.5 * (a.0 - b.0).abs() + 1.0, 0.5 * (a.1 - b.1).abs() + 1.0];
        Self { centre: [0.5 * (a.0 + b.0), 0.5 * (a.1 + b.1)], half }
    }

    pub(super) fn centre(&self) -> (f64, f64) {
        (self.centre[0], self.centre[1])
    }

    /// Where a line from `point` should end, if the label is not beside it.
    pub(super) fn leader(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        let nearest = |k: usize, at: f64| at.clamp(self.centre[k] - self.half[k], self.centre[k] + self.half[k]);
        let end = (nearest(0, x), nearest(1, y));
        ((end.0 - x).hypot(end.1 - y) > BESIDE).then_some(end)
    }

    fn overlap(&self, other: &Self) -> f64 {
        let along = |k: usize| (self.half[k] + other.half[k] - (self.centre[k] - other.centre[k]).abs()).max(0.0);
        along(0) * along(1)
    }

    fn is_within(&self, [left, top, right, bottom]: [f64; 4]) -> bool {
        let [x, y] = self.centre;
        x - self.half[0] >= left && x + self.half[0] <= right && y - self.half[1] >= top && y + self.half[1] <= bottom
    }
}

/// The nearest place for a label of half extents `half` at a point that covers nothing.
pub(super) fn place(point: (f64, f64), half: [f64; 2], taken: &[Box2], frame: [f64; 4]) -> Option<Box2> {
    let spots = DISTANCES.iter().flat_map(|distance| DIRECTIONS.iter().map(move |direction| (distance, direction)));
    let mut spots = spots.map(|(distance, direction)| {
        let shift = |k: usize| direction[k] * distance + direction[k].signum() * direction[k].abs().ceil() * half[k];
        Box2::around((point.0 + shift(0), point.1 + shift(1)), half)
    });
    spots.find(|spot| spot.is_within(frame) && taken.iter().all(|t| spot.overlap(t) == 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: [f64; 4] = [0.0, 0.0, 100.0, 100.0];

    #[test]
    fn a_label_stands_beside_its_point_and_gives_way() {
        let half = [10.0, 5.0];
        let first = place((50.0, 50.0), half, &[], FRAME);
        assert_eq!(first, Some(Box2 { centre: [67.0, 50.0], half }));
        let first = Box2 { centre: [67.0, 50.0], half };
        assert_eq!(first.leader((50.0, 50.0)), None);
        let second = place((50.0, 50.0), half, &[first], FRAME);
        assert_eq!(second.map(|s| s.centre()), Some((33.0, 50.0)));
    }

    #[test]
    fn labels_stay_in_the_frame_and_point_back() {
        let half = [20.0, 5.0];
        assert!(place((98.0, 50.0), half, &[], FRAME).is_some_and(|spot| spot.is_within(FRAME)));
        // Everything near is covered: it goes away and draws a line.
        let wall = Box2::spanning((30.0, 30.0), (70.0, 70.0));
        let spot = place((50.0, 50.0), [5.0, 5.0], &[wall], FRAME);
        assert!(spot.is_some_and(|s| s.overlap(&wall) == 0.0 && s.leader((50.0, 50.0)).is_some()));
        assert_eq!(place((50.0, 50.0), [5.0, 5.0], &[Box2::spanning((0.0, 0.0), (100.0, 100.0))], FRAME), None);
    }
}
