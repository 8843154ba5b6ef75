//! `--drive nav2`: Nav2 drives the robot along the fleet's path, point after point, once the robot
//! knows its place. Until then, and on the last bit that Nav2 leaves, the client drives itself.

use crate::mission::MissionObserver;
use crate::pilot::{DriveGoal, Pilot, PilotStep};
use fht_client::{PathSource, PlannedPath};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_proto::FixedPoint;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_ros_robot::{Nav2Driver, Nav2State};
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::Arc;

/// So near to a point of the path Nav2 is sent on to the next one, metres: it does not slow down
/// then.
const SEND_ON_M: f64 = 1.0;

/// Who drives a robot with ROS 2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum ClientDriver {
    /// The client, by velocity commands.
    #[default]
    Client,
    /// Nav2, by its action navigate_to_pose.
    Nav2,
}

/// Which point of a path is next.
#[derive(Clone, Debug, Default)]
struct NextPoint {
    path: Vec<Point2>,
    next: usize,
}

impl NextPoint {
    /// Where to send Nav2 from `here`, map frame. At the end the robot is to have the heading
    /// `yaw`, if there is one; before, that of the way on.
    fn on(&mut self, path: &PlannedPath, here: Point2, yaw: Option<f64>) -> Option<Pose2> {
        let is_known = self.path.iter().eq(path.points.iter().map(|point| &point.position));
        if !is_known {
            // The first point is where the robot stood.
            self.next = usize::from(path.points.len() > 1);
            self.path = path.points.iter().map(|point| point.position).collect();
        }
        let last = self.path.len().checked_sub(1)?;
        while self.next < last && (self.path[self.next] - here).norm() <= SEND_ON_M {
            self.next += 1;
        }
        let at = self.path[self.next];
        let way = match self.path.get(self.next + 1) {
            Some(after) => after - at,
            None => at - self.path[self.next.saturating_sub(1)],
        };
        let along = if way.norm() > 0.0 { way.y.atan2(way.x) } else { 0.0 };
        let heading = if self.next == last { yaw.unwrap_or(along) } else { along };
        Some(pose(at.x, at.y, heading))
    }
}

/// Tells Nav2 with each frame where to drive.
pub(super) struct Nav2Guide {
    driver: Arc<Nav2Driver>,
    next: NextPoint,
    yaw: Option<f64>,
}

impl Nav2Guide {
    pub(super) fn new(driver: Arc<Nav2Driver>) -> Self {
        Self { driver, next: NextPoint::default(), yaw: None }
    }
}

impl MissionObserver for Nav2Guide {
    fn on_frame(&mut self, _: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()> {
        let here = step.localization.map_from_base().filter(|_| step.outcome.is_none());
        let wanted = pilot.path().zip(here).and_then(|(path, here)| {
            let here = Point2::from(here.translation.vector);
            self.next.on(path, here, self.yaw)
        });
        self.driver.want(wanted);
        ControlFlow::Continue(())
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        self.yaw = goal.yaw;
    }
}

/// Paths, until Nav2 gives up on one.
pub(super) struct Nav2Paths<'p, P> {
    paths: &'p mut P,
    driver: Option<Arc<Nav2Driver>>,
}

impl<'p, P: PathSource> Nav2Paths<'p, P> {
    /// The paths of `paths`; without a driver those and nothing else.
    pub(super) fn new(paths: &'p mut P, driver: Option<Arc<Nav2Driver>>) -> Self {
        Self { paths, driver }
    }
}

impl<P: PathSource> PathSource for Nav2Paths<'_, P> {
    fn begin(&mut self, to_nearest: bool) {
        self.paths.begin(to_nearest);
    }

    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.paths.plan(from, to, blocked)
    }

    fn is_pending(&self) -> bool {
        self.paths.is_pending()
    }

    fn is_outdated(&self) -> bool {
        self.paths.is_outdated()
    }

    fn speed_limit_mps(&self, place: Point2) -> Option<f64> {
        self.paths.speed_limit_mps(place)
    }

    fn revised(&mut self) -> Option<Result<PlannedPath, ErrorReply>> {
        let revised = self.paths.revised();
        match self.driver.as_ref().map(|driver| driver.state()) {
            Some(Nav2State::GaveUp(reason)) => Some(Err(ErrorReply::new(ErrorCode::Blocked, &reason))),
            _ => revised,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_client::{PathPoint, Planner};

    fn path(points: &[(f64, f64)]) -> PlannedPath {
        PlannedPath {
            points: points.iter().map(|(x, y)| PathPoint { position: Point2::new(*x, *y), node: None }).collect(),
            length_m: 0.0,
            planner: Planner::Replica,
            goal_moved_m: 0.0,
            unmapped_m: 0.0,
        }
    }

    #[test]
    fn nav2_is_sent_on_before_it_stops_and_turned_at_the_end() {
        let mut next = NextPoint::default();
        let corner = path(&[(0.0, 0.0), (5.0, 0.0), (5.0, 4.0)]);
        let up = std::f64::consts::FRAC_PI_2;
        let mut at = |path: &PlannedPath, x: f64, y: f64, yaw: Option<f64>| {
            let found = next.on(path, Point2::new(x, y), yaw).expect("a point");
            (found.translation.x, found.translation.y, (found.rotation.angle() * 1e6).round() / 1e6)
        };
        let up_rounded = (up * 1e6).round() / 1e6;
        assert_eq!(at(&corner, 0.0, 0.0, None), (5.0, 0.0, up_rounded), "it leaves the corner as the way goes on");
        assert_eq!(at(&corner, 3.9, 0.0, None), (5.0, 0.0, up_rounded));
        assert_eq!(at(&corner, 4.1, 0.0, None), (5.0, 4.0, up_rounded));
        assert_eq!(at(&corner, 3.0, 0.0, Some(3.0)), (5.0, 4.0, 3.0), "it does not go back");
        let other = path(&[(3.0, 0.0), (3.0, 5.0), (9.0, 5.0)]);
        assert_eq!(at(&other, 3.0, 0.0, None), (3.0, 5.0, 0.0), "another path begins at its begin");
        assert!(next.on(&path(&[]), Point2::origin(), None).is_none());
        let one = next.on(&path(&[(1.0, 1.0)]), Point2::origin(), Some(1.0)).expect("the goal");
        assert!((one.translation.x - 1.0).abs() < 1e-12 && (one.rotation.angle() - 1.0).abs() < 1e-12);
    }
}
