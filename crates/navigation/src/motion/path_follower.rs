//! Following a path: regulated pure pursuit.

use fht_perception::frame::Twist;
use fht_perception::pose::{Point2, Pose2};
use serde::{Deserialize, Serialize};

/// How a path is followed.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PathFollowerConfig {
    /// Greatest forward speed, metres per second. Default 0.5 (paper).
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 10.0)))]
    pub max_linear_mps: f64,
    /// Greatest turning rate, radians per second. Default 1.5. The paper's robot turned at 0.2,
    /// which costs half a minute for an about-turn; a TurtleBot3 can do 2.8.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 20.0)))]
    pub max_angular_radps: f64,
    /// How far ahead on the path to aim where it is straight, metres. Default 0.5.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 10.0)))]
    pub lookahead_m: f64,
    /// How far ahead to aim at least, in the tightest corner, metres. Default 0.15.
    pub min_lookahead_m: f64,
    /// Aim no farther than the path stays this near to the straight line there, so that corners are
    /// not cut, metres. Default 0.04.
    pub corner_tolerance_m: f64,
    /// The path is done this near to its end, metres. Default 0.1.
    pub goal_tolerance_m: f64,
    /// Turn on the spot when the aim is farther off than this, radians. Default 0.6.
    pub turn_in_place_rad: f64,
    /// Drive again when the aim is less off than this, radians. Default 0.2.
    pub resume_rad: f64,
    /// Braking before the end of the path, metres per second squared. Default 0.5.
    pub deceleration_mps2: f64,
    /// Time between commands, seconds. Default 0.2, one LiDAR frame. Gains are derived from it.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 10.0)))]
    pub period_s: f64,
}

impl Default for PathFollowerConfig {
    fn default() -> Self {
        Self {
            max_linear_mps: 0.5,
            max_angular_radps: 1.5,
            lookahead_m: 0.5,
            min_lookahead_m: 0.15,
            corner_tolerance_m: 0.04,
            goal_tolerance_m: 0.1,
            turn_in_place_rad: 0.6,
            resume_rad: 0.2,
            deceleration_mps2: 0.5,
            period_s: 0.2,
        }
    }
}

/// Slowest forward speed short of standing, so that the end is reached in finite time, metres per
/// second.
const CREEP_MPS: f64 = 0.04;
/// How far ahead on the path the robot may have got since the last command, metres.
const PROGRESS_WINDOW_M: f64 = 0.6;
/// Step of the search for the point to aim at, metres.
const AIM_STEP_M: f64 = 0.05;

/// Drives along one path. The path may be in any frame that does not jump, as long as the poses are
/// in the same.
#[derive(Clone, Debug)]
pub struct PathFollower {
    config: PathFollowerConfig,
    points: Vec<Point2>,
    /// Length of the path up to each point, metres.
    along_m: Vec<f64>,
    progress_m: f64,
    turning: bool,
    done: bool,
}

impl PathFollower {
    /// A follower at the start of `path`. An empty path is done.
    #[must_use]
    pub fn new(config: PathFollowerConfig, path: Vec<Point2>) -> Self {
        let along_m = (0..path.len())
            .scan(0.0, |along, index| {
                *along += if index > 0 { (path[index] - path[index - 1]).norm() } else { 0.0 };
                Some(*along)
            })
            .collect();
        Self { config, done: path.is_empty(), points: path, along_m, progress_m: 0.0, turning: false }
    }

    /// The path.
    #[must_use]
    pub fn path(&self) -> &[Point2] {
        &self.points
    }

    /// What is still to be driven: from the farthest place reached to the end.
    #[must_use]
    pub fn remaining_path(&self) -> Vec<Point2> {
        if self.points.is_empty() {
            return Vec::new();
        }
        let ahead = self.along_m.partition_point(|&along| along <= self.progress_m);
        std::iter::once(self.point_at(self.progress_m)).chain(self.points[ahead..].iter().copied()).collect()
    }

    /// Length of what is still to be driven, metres.
    #[must_use]
    pub fn remaining_m(&self) -> f64 {
        self.total_m() - self.progress_m
    }

    /// Whether the robot has been within the goal tolerance of the end.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// The next command for a robot at `frame_from_base`, in the path's frame. Stands still when
    /// done, or when the pose is not finite.
    pub fn command(&mut self, frame_from_base: &Pose2) -> Twist {
        let position = Point2::from(frame_from_base.translation.vector);
        let Some(&end) = self.points.last() else { return Twist::default() };
        if !(position.x.is_finite() && position.y.is_finite() && frame_from_base.rotation.angle().is_finite()) {
            return Twist::default();
        }
        self.progress_m = self.nearest_ahead(position);
        let to_end = (end - position).norm();
        if to_end <= self.config.goal_tolerance_m && self.remaining_m() <= 2.0 * self.config.goal_tolerance_m {
            self.done = true;
        }
        if self.done {
            return Twist::default();
        }

        let aim = frame_from_base.inverse_transform_point(&self.aim());
        let heading = aim.y.atan2(aim.x);
        self.turning =
            heading.abs() > if self.turning { self.config.resume_rad } else { self.config.turn_in_place_rad };
        let limit = self.config.max_angular_radps;
        if self.turning {
            // Half of the error per period: cannot overshoot.
            let angular_radps = (0.5 * heading / self.config.period_s).clamp(-limit, limit);
            return Twist { linear_mps: 0.0, angular_radps };
        }
        let distance = aim.coords.norm().max(1e-6);
        let curvature = 2.0 * aim.y / (distance * distance);
        let braking = (2.0 * self.config.deceleration_mps2 * self.remaining_m().max(to_end)).sqrt();
        let linear_mps = self
            .config
            .max_linear_mps
            .min(limit / curvature.abs().max(1e-9))
            .min(braking)
            // Pursuit of a point less than three periods ahead would oscillate.
            .min(distance / (3.0 * self.config.period_s))
            .min(self.config.max_linear_mps * heading.cos().max(0.0))
            .max(CREEP_MPS.min(limit / curvature.abs().max(1e-9)));
        Twist { linear_mps, angular_radps: (linear_mps * curvature).clamp(-limit, limit) }
    }

    fn total_m(&self) -> f64 {
        self.along_m.last().copied().unwrap_or(0.0)
    }

    /// The point of the path at a length from its start.
    fn point_at(&self, along_m: f64) -> Point2 {
        let after = self.along_m.partition_point(|&along| along < along_m).clamp(1, self.points.len().max(2) - 1);
        let Some(&b) = self.points.get(after) else { return self.points[0] };
        let a = self.points[after - 1];
        let length = self.along_m[after] - self.along_m[after - 1];
        let t = if length > 0.0 { ((along_m - self.along_m[after - 1]) / length).clamp(0.0, 1.0) } else { 1.0 };
        a + (b - a) * t
    }

    /// Length along the path of its point nearest to `position`, not behind the progress so far and
    /// not far ahead of it: where the path comes back to itself, the robot must not skip the loop.
    fn nearest_ahead(&self, position: Point2) -> f64 {
        let (from, to) = (self.progress_m, self.progress_m + PROGRESS_WINDOW_M);
        let mut best = (f64::INFINITY, self.progress_m);
        for (index, pair) in self.points.windows(2).enumerate() {
            let (start, end) = (self.along_m[index], self.along_m[index + 1]);
            if end < from || start > to || end <= start {
                continue;
            }
            let along = pair[1] - pair[0];
            let t = (position - pair[0]).dot(&along) / along.norm_squared();
            let length = (start + t * (end - start)).clamp(start.max(from), end.min(to));
            let distance = (self.point_at(length) - position).norm();
            if distance < best.0 - 1e-9 {
                best = (distance, length);
            }
        }
        best.1
    }

    /// The farthest point within the lookahead from which the path back to the robot's place on it
    /// is nearly straight.
    fn aim(&self) -> Point2 {
        let from = self.point_at(self.progress_m);
        let first = self.along_m.partition_point(|&along| along <= self.progress_m);
        let mut length = self.config.lookahead_m;
        loop {
            let to_m = (self.progress_m + length).min(self.total_m());
            let to = self.point_at(to_m);
            let last = self.along_m.partition_point(|&along| along < to_m);
            let between = self.points.get(first..last).unwrap_or_default();
            let is_straight =
                between.iter().all(|&point| distance_to_segment(point, from, to) <= self.config.corner_tolerance_m);
            if is_straight || length <= self.config.min_lookahead_m {
                return to;
            }
            length = (length - AIM_STEP_M).max(self.config.min_lookahead_m);
        }
    }
}

/// Distance from a point to the segment from `a` to `b`, metres.
#[must_use]
pub fn distance_to_segment(point: Point2, a: Point2, b: Point2) -> f64 {
    let along = b - a;
    let t =
        if along.norm_squared() > 0.0 { ((point - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
    (point - (a + along * t)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::safety::position_after;
    use crate::planning::path_length_m;
    use fht_perception::pose::pose;
    use std::f64::consts::PI;

    /// Follows `path` from `start` at 5 Hz; returns the way driven and the farthest the robot
    /// strayed from the path.
    fn drive(path: &[Point2], start: Pose2) -> (Vec<Pose2>, f64) {
        let mut follower = PathFollower::new(PathFollowerConfig::default(), path.to_vec());
        let mut poses = vec![start];
        let mut stray = 0.0_f64;
        for _ in 0..1000 {
            let now = poses[poses.len() - 1];
            let twist = follower.command(&now);
            if follower.is_done() {
                return (poses, stray);
            }
            assert!(twist.linear_mps.abs() <= 0.5 + 1e-9 && twist.angular_radps.abs() <= 1.5 + 1e-9);
            let moved = position_after(twist, 0.2);
            let next = now * pose(moved.x, moved.y, twist.angular_radps * 0.2);
            let place = Point2::from(next.translation.vector);
            let off = path.windows(2).map(|pair| distance_to_segment(place, pair[0], pair[1])).fold(f64::MAX, f64::min);
            stray = stray.max(off);
            poses.push(next);
        }
        panic!("not done after 200 s, at {:?}", poses.last());
    }

    fn points(coordinates: &[(f64, f64)]) -> Vec<Point2> {
        coordinates.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    #[test]
    fn a_straight_path_takes_hardly_longer_than_its_length() {
        let (poses, stray) = drive(&points(&[(0.0, 0.0), (5.0, 0.0)]), pose(0.0, 0.0, 0.0));
        assert!(poses.len() < 60, "{} steps", poses.len());
        assert!(stray < 1e-6);
    }

    #[test]
    fn corners_are_not_cut_and_loops_not_skipped() {
        let corner = points(&[(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.5, 2.0), (0.5, 0.1)]);
        let (poses, stray) = drive(&corner, pose(0.0, 0.0, 0.0));
        assert!(stray < 0.08, "{stray}");
        assert!(poses.len() < 130, "{} steps", poses.len());
        assert!(poses.iter().any(|pose| pose.translation.x > 1.9 && pose.translation.y > 1.9));
    }

    #[test]
    fn a_robot_that_looks_away_turns_first() {
        let (poses, stray) = drive(&points(&[(0.0, 0.0), (2.0, 0.0)]), pose(0.0, 0.0, PI - 0.01));
        assert!(stray < 0.05, "{stray}");
        assert!(poses.len() < 50, "{} steps", poses.len());
    }

    #[test]
    fn a_robot_beside_the_path_joins_it_without_swinging() {
        let path = points(&[(0.0, 0.0), (4.0, 0.0)]);
        let (poses, _) = drive(&path, pose(0.0, 0.3, 0.0));
        let crossings = poses.windows(2).filter(|pair| pair[0].translation.y * pair[1].translation.y < -1e-6).count();
        assert!(crossings <= 1, "{crossings}");
    }

    #[test]
    fn remaining_path_shrinks() {
        let mut follower =
            PathFollower::new(PathFollowerConfig::default(), points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]));
        let _ = follower.command(&pose(0.4, 0.02, 0.0));
        assert!((follower.remaining_m() - 1.6).abs() < 1e-9);
        assert_eq!(follower.remaining_path().len(), 3);
        assert!((path_length_m(&follower.remaining_path()) - 1.6).abs() < 1e-9);
        assert!(PathFollower::new(PathFollowerConfig::default(), Vec::new()).is_done());
        let mut one = PathFollower::new(PathFollowerConfig::default(), points(&[(1.0, 0.0)]));
        assert!(one.command(&pose(0.0, 0.0, 0.0)).linear_mps > 0.0);
        assert_eq!(one.command(&pose(f64::NAN, 0.0, 0.0)), Twist::default());
        let _ = one.command(&pose(0.95, 0.0, 0.0));
        assert!(one.is_done());
    }
}
