//! Straight drives over passable cells, and paths pulled straight.

use super::Traversable;
use super::search::UNIT_WEIGHT;
use super::touched_cells::for_each_touched_cell;
use fht_perception::grid::Cell;
use fht_perception::pose::Point2;

impl Traversable {
    /// Whether the robot can drive straight from `a` to `b`: every cell that the segment touches is
    /// passable.
    #[must_use]
    pub fn is_segment_passable(&self, a: Point2, b: Point2) -> bool {
        self.segment_cost(a, b).is_some()
    }

    /// Weighted length of a segment over passable cells, metres.
    fn segment_cost(&self, a: Point2, b: Point2) -> Option<f64> {
        let length = (b - a).norm();
        let (mut sum, mut count, mut open) = (0_u32, 0_u32, true);
        let visit = |cell: Cell| {
            let weight = self.weight(cell);
            open &= weight > 0;
            sum += u32::from(weight);
            count += 1;
            open
        };
        for_each_touched_cell(a / self.resolution_m, b / self.resolution_m, visit);
        open.then(|| length * f64::from(sum) / f64::from(count.max(1) * u32::from(UNIT_WEIGHT)))
    }

    /// Pulls a path straight: leaves out the points between two that a straight drive joins at no
    /// greater cost, the robot's width and the comfort cost included. Segments that are not
    /// passable (the way out of a wall) stay.
    #[must_use]
    pub fn shorten(&self, path: &[Point2]) -> Vec<Point2> {
        let Some(&first) = path.first() else { return Vec::new() };
        let mut short = vec![first];
        let mut anchor = 0;
        while anchor + 1 < path.len() {
            let mut best = anchor + 1;
            let mut along = self.segment_cost(path[anchor], path[best]).unwrap_or(f64::INFINITY);
            for next in anchor + 2..path.len() {
                along += self.segment_cost(path[next - 1], path[next]).unwrap_or(f64::INFINITY);
                let Some(direct) = self.segment_cost(path[anchor], path[next]) else { break };
                // Cell weights along a segment are averages of what it touches: allow for that.
                if direct <= along * 1.02 {
                    best = next;
                }
            }
            short.push(path[best]);
            anchor = best;
        }
        short
    }
}
