//! Following a path of the map: which of its points to head for next (paper, section III-C-2).

use fht_client::PlannedPath;
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How a path is followed.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PathFollowingConfig {
    /// A node counts as passed at this distance, metres. Default 0.5 (paper).
    pub node_reach_m: f64,
    /// The goal counts as reached at this distance, metres. Default 0.1 (the paper's).
    pub goal_reach_m: f64,
    /// Points farther than this are not looked for, metres. Default 6.5, within the LiDAR's 7.
    pub see_m: f64,
    /// Between points that are farther apart there are more, metres: each lies where the robot has
    /// looked, or soon will. Default 2.
    pub spacing_m: f64,
    /// Half the width that must be free on the way to a point for it to count as seen, metres.
    /// Default 0.16.
    pub half_width_m: f64,
    /// The path is planned anew when the robot's estimate of its own place has moved this far
    /// since, metres. Default 0.3.
    pub replan_m: f64,
    /// Or turned this far, radians. Default 4°.
    pub replan_rad: f64,
}

impl Default for PathFollowingConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

impl PathFollowingConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            node_reach_m: 0.5,
            goal_reach_m: 0.1,
            see_m: 6.5,
            spacing_m: 2.0,
            half_width_m: footprint.mesh_clearance_m(),
            replan_m: 0.3,
            replan_rad: 4.0_f64.to_radians(),
        }
    }
}

/// The point to head for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Where, odometry frame.
    pub in_odom: Point2,
    /// Distance from the robot, metres.
    pub distance_m: f64,
    /// Whether it is the path's end.
    pub is_goal: bool,
}

/// A path being followed.
#[derive(Clone, Debug)]
pub struct FollowedPath {
    config: PathFollowingConfig,
    path: PlannedPath,
    /// Its points, and more where they are far apart: map frame.
    points: Vec<Point2>,
    /// Of each, whether it is one of the path's.
    is_corner: Vec<bool>,
    next: usize,
    planned_with: Pose2,
}

impl FollowedPath {
    /// Starts along `path`, planned while the robot took `map_from_odom` for true.
    #[must_use]
    pub fn new(config: PathFollowingConfig, path: PlannedPath, map_from_odom: Pose2) -> Self {
        let corners: Vec<Point2> = path.points.iter().map(|point| point.position).collect();
        let (points, is_corner): (Vec<Point2>, Vec<bool>) = spaced(&corners, config.spacing_m).into_iter().unzip();
        // The first point is where the robot stands.
        let next = usize::from(points.len() > 1);
        Self { config, path, points, is_corner, next, planned_with: map_from_odom }
    }

    /// The path.
    #[must_use]
    pub fn path(&self) -> &PlannedPath {
        &self.path
    }

    /// Whether the robot's idea of where it is has changed so much that the path should be planned
    /// anew. `here` is the robot in the odometry frame: what matters is how far the robot itself
    /// was displaced.
    #[must_use]
    pub fn is_outdated(&self, map_from_odom: &Pose2, here: Point2) -> bool {
        let shift = (map_from_odom * here - self.planned_with * here).norm();
        let turn = wrap_angle(map_from_odom.rotation.angle() - self.planned_with.rotation.angle()).abs();
        shift > self.config.replan_m || turn > self.config.replan_rad
    }

    /// The point to head for: the farthest on the path that the robot can really see (the way there
    /// is known to be free, for the robot's width), otherwise the next one. `None` once the goal is
    /// reached or if the path is empty.
    pub fn target(&mut self, map_from_odom: &Pose2, odom_from_base: &Pose2, grid: &OccupancyGrid) -> Option<Target> {
        let here = Point2::from(odom_from_base.translation.vector);
        let last = self.points.len().checked_sub(1)?;
        let odom_from_map = map_from_odom.inverse();
        let at = |index: usize| odom_from_map * self.points[index];
        let distance = |index: usize| (at(index) - here).norm();

        let is_seen = |&index: &usize| {
            distance(index) <= self.config.see_m && grid.is_corridor_free(here, at(index), self.config.half_width_m)
        };
        if let Some(farthest) = (self.next..=last).rev().find(is_seen) {
            self.next = farthest;
        }
        while self.next < last && (at(self.next) - here).norm() <= self.config.node_reach_m {
            self.next += 1;
        }
        let at = odom_from_map * self.points[self.next];
        let distance_m = (at - here).norm();
        let is_goal = self.next == last;
        if is_goal && distance_m <= self.config.goal_reach_m {
            return None;
        }
        Some(Target { in_odom: at, distance_m, is_goal })
    }

    /// What is left of the path from `here` (odometry frame), metres: to the point to head for, and
    /// on along the path.
    #[must_use]
    pub fn left_m(&self, map_from_odom: &Pose2, here: Point2) -> f64 {
        let ahead = self.points.get(self.next..).unwrap_or_default();
        let to_next = ahead.first().map_or(0.0, |point| (point - map_from_odom * here).norm());
        to_next + ahead.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>()
    }

    /// If there is no way to the next point, and it is none of the path's own: heads for the one
    /// after it, if that is not too far to be seen. Something may stand on a straight way that can
    /// be driven round. `here` is the robot in the odometry frame.
    pub fn skip_between(&mut self, map_from_odom: &Pose2, here: Point2) -> bool {
        let is_between = self.is_corner.get(self.next) == Some(&false);
        let after = self.points.get(self.next + 1);
        let is_near = after.is_some_and(|after| (after - map_from_odom * here).norm() <= self.config.see_m);
        is_between && is_near && self.skip()
    }

    /// Heads for the point after the next one, as when the next one itself cannot be reached. False
    /// at the path's end.
    pub fn skip(&mut self) -> bool {
        let can = self.next + 1 < self.points.len();
        self.next += usize::from(can);
        can
    }
}

/// The corners of a path, and between those that are farther apart than `spacing_m` as many more
/// points as it takes; and of each whether it is a corner.
fn spaced(corners: &[Point2], spacing_m: f64) -> Vec<(Point2, bool)> {
    /// Nobody has looked along a line so long, metres: it is as blocked as it seems.
    const LONGEST_M: f64 = 100.0;
    let between = corners.windows(2).flat_map(|pair| {
        let way = pair[1] - pair[0];
        let way_m = Some(way.norm()).filter(|way_m| (0.0..=LONGEST_M).contains(way_m));
        let parts = way_m.map_or(1, |way_m| (way_m / spacing_m.max(0.1)).ceil().max(1.0) as usize);
        let between = (1..parts).map(move |part| (pair[0] + way * (part as f64 / parts as f64), false));
        between.chain(std::iter::once((pair[1], true)))
    });
    corners.first().map(|first| (*first, true)).into_iter().chain(between).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_client::{PathPoint, Planner};
    use fht_perception::frame::LaserScan;
    use fht_perception::grid::GridConfig;
    use fht_perception::pose::pose;
    use fht_proto::{AuthorId, NodeId};

    fn path(points: &[(f64, f64)]) -> PlannedPath {
        let points = points.iter().enumerate().map(|(number, &(x, y))| PathPoint {
            position: Point2::new(x, y),
            node: Some(NodeId { author: AuthorId(1), number: number as u32 }),
        });
        PlannedPath {
            points: points.collect(),
            length_m: 0.0,
            planner: Planner::Replica,
            goal_moved_m: 0.0,
            unmapped_m: 0.0,
        }
    }

    /// A room of 4 m, seen from its middle.
    fn room() -> OccupancyGrid {
        let ranges_m = (0..720)
            .map(|beam| {
                let (sin, cos) = (f64::from(beam) / 2.0).to_radians().sin_cos();
                (2.0 / cos.abs().max(sin.abs())) as f32
            })
            .collect();
        let scan = LaserScan {
            base_from_sensor: pose(0.0, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: 0.5_f64.to_radians(),
            range_min_m: 0.1,
            range_max_m: 7.0,
            ranges_m,
        };
        let mut grid = OccupancyGrid::new(GridConfig::default());
        grid.integrate(&Pose2::identity(), &scan);
        grid.integrate(&Pose2::identity(), &scan);
        grid
    }

    #[test]
    fn it_skips_to_the_farthest_point_in_sight_and_not_through_a_wall() {
        let map_from_odom = pose(10.0, 5.0, 0.0);
        let route = path(&[(10.0, 5.0), (10.5, 6.0), (11.0, 6.4), (14.0, 5.0)]);
        let mut route = FollowedPath::new(PathFollowingConfig::default(), route, map_from_odom);
        let target = route.target(&map_from_odom, &Pose2::identity(), &room()).expect("not there yet");
        assert!((target.in_odom - Point2::new(1.0, 1.4)).norm() < 1e-9);
        assert!(!target.is_goal);
    }

    #[test]
    fn on_a_long_straight_way_there_is_a_point_within_reach_to_head_for() {
        let route = path(&[(0.0, 0.0), (0.3, 0.0), (0.3, 20.0)]);
        let mut route = FollowedPath::new(PathFollowingConfig::default(), route, Pose2::identity());
        let length_m = route.left_m(&Pose2::identity(), Point2::origin());
        assert!((length_m - 20.3).abs() < 1e-9, "{length_m}");
        for driven in 0..19 {
            let here = pose(0.3, f64::from(driven), 0.0);
            let target = route.target(&Pose2::identity(), &here, &room()).expect("not there yet");
            assert!(target.distance_m < 3.0 && !target.is_goal || driven > 17, "{target:?} after {driven} m");
        }
        assert_eq!(route.path().points.len(), 3);
    }

    #[test]
    fn what_stands_on_a_point_between_is_driven_round() {
        let (far, here) = (path(&[(0.0, 0.0), (20.0, 0.0)]), Point2::origin());
        let mut route = FollowedPath::new(PathFollowingConfig::default(), far, Pose2::identity());
        let skipped = (0..20).take_while(|_| route.skip_between(&Pose2::identity(), here)).count();
        assert_eq!(skipped, 2, "from 2 m to 6 m, and no farther than it sees");
        let corners = path(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        let mut route = FollowedPath::new(PathFollowingConfig::default(), corners, Pose2::identity());
        assert!(!route.skip_between(&Pose2::identity(), here));
    }

    #[test]
    fn it_ends_at_the_goal() {
        let mut route =
            FollowedPath::new(PathFollowingConfig::default(), path(&[(0.0, 0.0), (1.0, 0.0)]), Pose2::identity());
        assert!(route.target(&Pose2::identity(), &pose(0.5, 0.0, 0.0), &room()).is_some_and(|t| t.is_goal));
        assert!(route.target(&Pose2::identity(), &pose(0.95, 0.0, 0.0), &room()).is_none());
    }

    #[test]
    fn what_is_left_goes_by_way_of_the_points_ahead() {
        let map_from_odom = pose(1.0, 0.0, 0.0);
        let way = path(&[(1.0, 0.0), (3.0, 0.0), (3.0, 4.0)]);
        let route = FollowedPath::new(PathFollowingConfig::default(), way, map_from_odom);
        assert!((route.left_m(&map_from_odom, Point2::new(0.5, 0.0)) - 5.5).abs() < 1e-9);
        let nothing = FollowedPath::new(PathFollowingConfig::default(), path(&[]), map_from_odom);
        assert_eq!(nothing.left_m(&map_from_odom, Point2::origin()), 0.0);
    }

    #[test]
    fn a_better_estimate_outdates_the_path() {
        let route =
            FollowedPath::new(PathFollowingConfig::default(), path(&[(0.0, 0.0), (1.0, 0.0)]), Pose2::identity());
        let here = Point2::new(10.0, 0.0);
        assert!(!route.is_outdated(&pose(0.1, 0.0, 0.01), here));
        assert!(route.is_outdated(&pose(0.0, 0.0, 0.05), here), "0.5 m where the robot is");
        assert!(!route.is_outdated(&pose(0.0, 0.0, 0.05), Point2::new(1.0, 0.0)));
    }
}
