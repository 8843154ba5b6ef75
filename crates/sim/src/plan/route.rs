//! The shortest path of a disc over the plan: A* over 8 neighbours, then pulled taut.

use super::FloorPlan;
use fht_perception::pose::Point2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Cost of a straight step in A*; a diagonal one costs √2 times it. Integers keep the order of
/// the queue exact.
const STEP: u64 = 1_000_000;
const DIAGONAL: u64 = 1_414_214;
/// Rounds of pulling taut; the length stops falling after two or three.
const ROUNDS: usize = 6;
/// Between rounds the path is cut into pieces of this length, so that corners can move.
const PIECE_M: f64 = 0.25;

impl FloorPlan {
    /// The shortest path for a disc of radius `radius_m` from `from` to `to` (world frame), corners
    /// only, both ends included; `None` if there is none or an end has no room for the disc within
    /// `radius_m` + 0.5 m. The path is the taut string in the homotopy class of the best
    /// 8-connected path, so its length is within about 1 % of the shortest.
    #[must_use]
    pub fn shortest_path(&self, from: Point2, to: Point2, radius_m: f64) -> Option<Vec<Point2>> {
        let start = self.nearest_with_clearance(from, radius_m)?;
        let goal = self.nearest_with_clearance(to, radius_m)?;
        let cells = self.a_star(start, goal, radius_m)?;
        let mut path: Vec<Point2> =
            cells.iter().map(|&cell| self.centre_of(cell % self.width, cell / self.width)).collect();
        // The ends are the given points themselves if the disc fits there.
        let last = path.len() - 1;
        if self.clearance_m(from) >= radius_m {
            path[0] = from;
        }
        if self.clearance_m(to) >= radius_m {
            path[last] = to;
        }
        if path.len() == 1 {
            path.push(to);
        }
        for round in 0..ROUNDS {
            path = self.pull(&path, radius_m);
            if round + 1 < ROUNDS {
                path = subdivide(&path);
                path.reverse();
            }
        }
        // The number of turns so far is odd.
        if ROUNDS.is_multiple_of(2) {
            path.reverse();
        }
        Some(self.pull(&path, radius_m))
    }

    /// Whether a disc of radius `radius_m` fits everywhere on the segment.
    #[must_use]
    pub fn is_clear(&self, from: Point2, to: Point2, radius_m: f64) -> bool {
        let length = (to - from).norm();
        let mut at = 0.0;
        loop {
            let point = if length > 0.0 { from + (to - from) * (at / length) } else { from };
            let clearance = self.clearance_m(point);
            if clearance < radius_m || self.is_occupied(point.x, point.y) {
                return false;
            }
            if at >= length {
                return true;
            }
            // A cell's clearance is measured at its centre, so a step can rely on it only to within
            // a cell.
            at = (at + (clearance - radius_m - self.resolution_m).max(self.resolution_m * 0.5)).min(length);
        }
    }

    fn a_star(&self, start: usize, goal: usize, radius_m: f64) -> Option<Vec<usize>> {
        const UNSEEN: u64 = u64::MAX;
        let (width, height) = (self.width as isize, self.height as isize);
        let (goal_x, goal_y) = ((goal % self.width) as isize, (goal / self.width) as isize);
        let estimate = |index: usize| {
            let dx = ((index % self.width) as isize - goal_x).unsigned_abs() as u64;
            let dy = ((index / self.width) as isize - goal_y).unsigned_abs() as u64;
            dx.min(dy) * DIAGONAL + (dx.max(dy) - dx.min(dy)) * STEP
        };
        let mut cost = vec![UNSEEN; self.occupied.len()];
        let mut parent = vec![usize::MAX; self.occupied.len()];
        let mut open = BinaryHeap::new();
        cost[start] = 0;
        open.push(Reverse((estimate(start), start)));
        while let Some(Reverse((total, index))) = open.pop() {
            if index == goal {
                let mut path = vec![goal];
                while let Some(&last) = path.last()
                    && last != start
                {
                    path.push(parent[last]);
                }
                path.reverse();
                return Some(path);
            }
            if total > cost[index] + estimate(index) {
                continue;
            }
            let (x, y) = ((index % self.width) as isize, (index / self.width) as isize);
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
                let (nx, ny) = (x + dx, y + dy);
                if nx < 0 || ny < 0 || nx >= width || ny >= height {
                    continue;
                }
                let next = (ny * width + nx) as usize;
                let step = if dx != 0 && dy != 0 { DIAGONAL } else { STEP };
                if self.has_room(next, radius_m) && cost[index] + step < cost[next] {
                    cost[next] = cost[index] + step;
                    parent[next] = index;
                    open.push(Reverse((cost[next] + estimate(next), next)));
                }
            }
        }
        None
    }

    /// From each corner, goes on to the farthest point of the path that can be reached in a
    /// straight line.
    fn pull(&self, path: &[Point2], radius_m: f64) -> Vec<Point2> {
        let mut taut = Vec::new();
        let mut at = 0;
        while at < path.len() {
            taut.push(path[at]);
            let farthest = (at + 2..path.len()).rev().find(|&next| self.is_clear(path[at], path[next], radius_m));
            at = farthest.unwrap_or(at + 1);
        }
        taut
    }
}

fn subdivide(path: &[Point2]) -> Vec<Point2> {
    let mut fine = Vec::new();
    for pair in path.windows(2) {
        let pieces = ((pair[1] - pair[0]).norm() / PIECE_M).ceil().max(1.0);
        fine.extend((0..pieces as usize).map(|piece| pair[0] + (pair[1] - pair[0]) * (piece as f64 / pieces)));
    }
    fine.extend(path.last());
    fine
}
