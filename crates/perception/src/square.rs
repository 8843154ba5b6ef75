//! Squares of a plane: in which of them a point lies, and one point of each.

use crate::pose::Point2;
use std::collections::BTreeSet;

/// A square: how many squares it is from the origin along x and y.
pub type SquareIndex = (i32, i32);

/// The square of side `side_m` metres in which a point lies.
#[must_use]
pub fn square_of(point: Point2, side_m: f64) -> SquareIndex {
    ((point.x / side_m).floor() as i32, (point.y / side_m).floor() as i32)
}

/// The first of the points in each square of side `side_m` metres, in their order: evenly spread.
pub fn one_per_square(points: impl IntoIterator<Item = Point2>, side_m: f64) -> Vec<Point2> {
    let mut squares = BTreeSet::new();
    points.into_iter().filter(|point| squares.insert(square_of(*point, side_m))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_point_of_each_square_is_kept_also_below_the_origin() {
        let points = [(0.1, 0.1), (0.2, 0.2), (-0.1, 0.1), (0.3, 0.1), (0.1, 0.1)].map(|(x, y)| Point2::new(x, y));
        assert_eq!(one_per_square(points, 0.25), [points[0], points[2], points[3]]);
        assert_eq!(square_of(points[2], 0.25), (-1, 0));
    }
}
