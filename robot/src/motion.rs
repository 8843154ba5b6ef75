//! Following a path with a differential drive, and not hitting what the scan shows.
//!
//! The follower is a regulated pure pursuit: it steers along an arc to a point ahead on the path, slower where the path
//! bends and near its end, and turns on the spot when it looks the wrong way. The safety check knows nothing of paths or
//! maps: it only compares a command with the newest scan.

use crate::frame::{LaserScan, Twist};
use crate::pose::{Point2, Pose2};

/// So far ahead a robot slows down before ground on which it must be slow, metres.
const SLOW_AHEAD_M: f64 = 0.3;

/// The least of the limits, metres per second, where a robot is and a little ahead of it; `limit_mps` gives that of a place. None if nothing
/// limits it there.
#[must_use]
pub fn speed_limit_ahead(map_from_base: &Pose2, limit_mps: impl Fn(Point2) -> Option<f64>) -> Option<f64> {
    let places = [0.0, SLOW_AHEAD_M].map(|ahead_m| map_from_base * Point2::new(ahead_m, 0.0));
    places.into_iter().filter_map(limit_mps).min_by(f64::total_cmp)
}

/// How a path is followed.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// Greatest forward speed, metres per second. Default 0.5 (paper).
    pub max_linear_mps: f64,
    /// Greatest turning rate, radians per second. Default 1.5. The paper's robot turned at 0.2, which costs half a
    /// minute for an about-turn; a TurtleBot3 can do 2.8.
    pub max_angular_radps: f64,
    /// How far ahead on the path to aim where it is straight, metres. Default 0.5.
    pub lookahead_m: f64,
    /// How far ahead to aim at least, in the tightest corner, metres. Default 0.15.
    pub min_lookahead_m: f64,
    /// Aim no farther than the path stays this near to the straight line there, so that corners are not cut, metres.
    /// Default 0.04.
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
    pub period_s: f64,
}

impl Default for FollowConfig {
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

/// Slowest forward speed short of standing, so that the end is reached in finite time, metres per second.
const CREEP_MPS: f64 = 0.04;
/// How far ahead on the path the robot may have got since the last command, metres.
const PROGRESS_WINDOW_M: f64 = 0.6;
/// Step of the search for the point to aim at, metres.
const AIM_STEP_M: f64 = 0.05;

/// Drives along one path. The path may be in any frame that does not jump, as long as the poses are in the same.
#[derive(Clone, Debug)]
pub struct PathFollower {
    config: FollowConfig,
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
    pub fn new(config: FollowConfig, path: Vec<Point2>) -> Self {
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

    /// The next command for a robot at `frame_from_base`, in the path's frame. Stands still when done, or when the pose
    /// is not finite.
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

    /// Length along the path of its point nearest to `position`, not behind the progress so far and not far ahead of
    /// it: where the path comes back to itself, the robot must not skip the loop.
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

    /// The farthest point within the lookahead from which the path back to the robot's place on it is nearly straight.
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

/// What the safety check assumes of the robot.
#[derive(Clone, Debug)]
pub struct SafetyConfig {
    /// Radius of the robot around its base, metres. Default 0.105 (TurtleBot3 Burger).
    pub robot_radius_m: f64,
    /// Kept free around the robot, metres. Default 0.03: three times the noise of the LiDAR.
    pub margin_m: f64,
    /// How far ahead a command is followed, seconds. Default 0.8, four LiDAR frames.
    pub horizon_s: f64,
}

impl Default for SafetyConfig {
    fn default() -> Self {
        Self { robot_radius_m: 0.105, margin_m: 0.03, horizon_s: 0.8 }
    }
}

/// Steps of the prediction within the horizon.
const PREDICTION_STEPS: u32 = 8;
/// Speeds that are tried, in order, as parts of the command.
const SPEED_FACTORS: [f64; 6] = [1.0, 0.8, 0.6, 0.4, 0.2, 0.1];

/// The fastest command along the same arc that, kept up for the horizon, does not bring the robot's disc nearer than the
/// margin to a return of the scan, or to something too near for the scanner. If there is none the robot may only turn. Moving away from something that is already
/// too near is allowed.
#[must_use]
pub fn safe_command(command: Twist, scan: &LaserScan, config: &SafetyConfig) -> Twist {
    if !(command.linear_mps.is_finite() && command.angular_radps.is_finite()) {
        return Twist::default();
    }
    if command.linear_mps == 0.0 {
        return command; // A disc that turns on the spot sweeps nothing.
    }
    let keep = config.robot_radius_m + config.margin_m;
    let reach = keep + command.linear_mps.abs() * config.horizon_s;
    let mut points = scan.obstacles_in_base();
    points.retain(|point| point.coords.norm() < reach);
    let scaled =
        |factor: f64| Twist { linear_mps: command.linear_mps * factor, angular_radps: command.angular_radps * factor };
    SPEED_FACTORS
        .into_iter()
        .map(scaled)
        .find(|&twist| is_clear(twist, &points, keep, config.horizon_s))
        .unwrap_or(Twist { linear_mps: 0.0, ..command })
}

/// Whether no point comes within `keep_m` of the robot, or nearer if it is within already.
fn is_clear(twist: Twist, points: &[Point2], keep_m: f64, horizon_s: f64) -> bool {
    (1..=PREDICTION_STEPS).all(|step| {
        let centre = position_after(twist, horizon_s * f64::from(step) / f64::from(PREDICTION_STEPS));
        points.iter().all(|point| {
            let distance = (point - centre).norm();
            distance >= keep_m || distance >= point.coords.norm()
        })
    })
}

/// Where the base is after driving `twist` for `seconds`, in the frame of the base before: an arc of a circle.
fn position_after(twist: Twist, seconds: f64) -> Point2 {
    let turned = twist.angular_radps * seconds;
    let length = twist.linear_mps * seconds;
    if turned.abs() < 1e-6 {
        return Point2::new(length, 0.0);
    }
    Point2::new(length * turned.sin() / turned, length * (1.0 - turned.cos()) / turned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planning::path_length_m;
    use crate::pose::pose;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    /// Follows `path` from `start` at 5 Hz; returns the way driven and the farthest the robot strayed from the path.
    fn drive(path: &[Point2], start: Pose2) -> (Vec<Pose2>, f64) {
        let mut follower = PathFollower::new(FollowConfig::default(), path.to_vec());
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
        let mut follower = PathFollower::new(FollowConfig::default(), points(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]));
        let _ = follower.command(&pose(0.4, 0.02, 0.0));
        assert!((follower.remaining_m() - 1.6).abs() < 1e-9);
        assert_eq!(follower.remaining_path().len(), 3);
        assert!((path_length_m(&follower.remaining_path()) - 1.6).abs() < 1e-9);
        assert!(PathFollower::new(FollowConfig::default(), Vec::new()).is_done());
        let mut one = PathFollower::new(FollowConfig::default(), points(&[(1.0, 0.0)]));
        assert!(one.command(&pose(0.0, 0.0, 0.0)).linear_mps > 0.0);
        assert_eq!(one.command(&pose(f64::NAN, 0.0, 0.0)), Twist::default());
        let _ = one.command(&pose(0.95, 0.0, 0.0));
        assert!(one.is_done());
    }

    /// A scan with one flat wall ahead at `distance` from the base, 2 m wide.
    fn wall_ahead(distance: f64) -> LaserScan {
        let increment = TAU / 360.0;
        let ranges_m = (0..360)
            .map(|beam| {
                let (sin, cos) = (f64::from(beam) * increment).sin_cos();
                let range = (distance + 0.032) / cos;
                if cos > 0.0 && (range * sin).abs() < 1.0 { range as f32 } else { f32::INFINITY }
            })
            .collect();
        LaserScan {
            base_from_sensor: pose(-0.032, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: increment,
            range_min_m: 0.12,
            range_max_m: 7.0,
            ranges_m,
        }
    }

    #[test]
    fn never_drives_into_a_wall() {
        let config = SafetyConfig::default();
        let mut x = 0.0;
        for _ in 0..100 {
            let twist = safe_command(Twist { linear_mps: 0.5, angular_radps: 0.0 }, &wall_ahead(2.0 - x), &config);
            x += twist.linear_mps * 0.2;
        }
        assert!(2.0 - x >= 0.105 + 0.025, "{x}");
        assert!(2.0 - x < 0.2, "{x}");
        let turn = Twist { linear_mps: 0.0, angular_radps: 1.0 };
        assert_eq!(safe_command(turn, &wall_ahead(0.13), &config), turn);
        let back = Twist { linear_mps: -0.1, angular_radps: 0.0 };
        assert_eq!(safe_command(back, &wall_ahead(0.13), &config), back);
        let bad = Twist { linear_mps: f64::NAN, angular_radps: 0.0 };
        assert_eq!(safe_command(bad, &wall_ahead(1.0), &config), Twist::default());
    }

    #[test]
    fn what_is_too_near_to_be_measured_is_not_driven_into() {
        let (config, forward) = (SafetyConfig::default(), Twist { linear_mps: 0.5, angular_radps: 0.0 });
        for too_near in [f32::NEG_INFINITY, 0.05] {
            let mut scan = wall_ahead(2.0);
            scan.ranges_m[..5].fill(too_near);
            assert!(safe_command(forward, &scan, &config).linear_mps.abs() < 1e-12, "{too_near}");
            let back = Twist { linear_mps: -0.1, angular_radps: 0.0 };
            assert_eq!(safe_command(back, &scan, &config), back);
        }
        let mut scan = wall_ahead(2.0);
        scan.ranges_m[..5].fill(f32::NAN);
        assert_eq!(safe_command(forward, &scan, &config), forward, "NaN says nothing");
    }

    #[test]
    fn an_arc_is_an_arc() {
        let quarter = position_after(Twist { linear_mps: FRAC_PI_2, angular_radps: FRAC_PI_2 }, 1.0);
        assert!((quarter - Point2::new(1.0, 1.0)).norm() < 1e-9);
    }
}
