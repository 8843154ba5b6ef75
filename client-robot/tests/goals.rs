//! The end of a drive in a simulated building: the robot turns to the heading of a named place; it
//! gives up, with the reason, on a goal that it cannot reach; and it has arrived only where the
//! truth says so, too.

mod fixture;
#[path = "fixture/scored.rs"]
mod scored;

use client_robot::mission::{MissionConfig, MissionGoal, Services};
use client_robot::program::MissionReport;
use fht_client::{PathPoint, PathSource, PlannedPath};
use fht_map::MapState;
use fht_perception::frame::Panorama;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_proto::api::reply::ErrorReply;
use fht_proto::{AuthorId, FixedPoint, FixedPose, Increment, Op};
use fht_sim::{SimConfig, Simulator, World};
use fixture::{FixtureConfig, OwnPaths, colour_descriptor, map_of};
use scored::scored;
use std::collections::BTreeSet;
use std::sync::{Arc, LazyLock};

fn describe(panorama: &Panorama) -> Option<fht_proto::Descriptor> {
    Some(colour_descriptor(panorama))
}

/// The museum, and a map of it with two places at one point that look north and south.
static SITE: LazyLock<(Arc<World>, MapState)> = LazyLock::new(|| {
    let museum = Arc::new(fht_sim::load("museum", None, 0).expect("a built-in world"));
    let mut map = map_of(&museum, &FixtureConfig { spacing_m: 4.0, ..FixtureConfig::default() }, &mut describe);
    let place = |name: &str, degrees: f64| Op::SetPlace {
        name: name.parse().expect("a name"),
        pose: Some(FixedPose::from_metres(1.0, 0.5, degrees.to_radians())),
    };
    let ops = vec![place("north", 90.0), place("south", -90.0)];
    map.apply(&Increment { author: AuthorId(2), number: 1, hlc_us: 1_000_000, ops });
    (museum, map)
});

fn mission(
    goal: &MissionGoal,
    world_from_map: Option<Pose2>,
    paths: Option<&mut (dyn PathSource + Send)>,
) -> MissionReport {
    let (world, map) = &*SITE;
    let start = world.random_free_pose(1, 0.4);
    let simulator = Simulator::new(Arc::clone(world), SimConfig::default(), start, 1);
    let mut own = OwnPaths(map);
    let paths = paths.unwrap_or(&mut own);
    let mut services = Services { map, paths, describe: &mut describe };
    let world_from_map = world_from_map.unwrap_or_else(|| world.start());
    scored(simulator, MissionConfig::default(), goal, &world_from_map, &mut services)
}

#[test]
fn at_a_named_place_the_robot_turns_to_its_heading() {
    let named = |name: &str| MissionGoal::Named(name.parse().expect("a name"));
    let goals = [named("north"), named("south"), MissionGoal::Pose(pose(1.0, 0.5, 3.1))];
    for (goal, yaw_deg) in goals.iter().zip([90.0_f64, -90.0, 3.1_f64.to_degrees()]) {
        let report = mission(goal, None, None);
        assert!(report.arrived, "{goal:?}: {:?}", report.failure);
        assert!(report.goal_yaw.is_some_and(|yaw| (yaw.to_degrees() - yaw_deg).abs() < 0.01));
        assert!(report.goal_turn_deg.is_some_and(|degrees| degrees < 3.0), "{goal:?}: {:?}", report.goal_turn_deg);
        assert!(report.goal_distance_m.is_some_and(|metres| metres < 0.3), "{goal:?}: {:?}", report.goal_distance_m);
    }
    let coordinates = mission(&MissionGoal::Point(Point2::new(1.0, 0.5)), None, None);
    assert!(coordinates.arrived && coordinates.goal_turn_deg.is_none());
}

/// True paths to the place nearest to the goal, and from there straight on, whatever is between.
struct ThroughWalls<'a> {
    map: &'a MapState,
    inside: Point2,
}

impl PathSource for ThroughWalls<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        let mut path = OwnPaths(self.map).plan(from, self.inside, blocked)?;
        path.length_m += (to - self.inside).norm();
        path.points.push(PathPoint { position: to, node: None });
        Ok(path)
    }
}

#[test]
fn a_goal_behind_a_wall_is_given_up_and_the_building_not_toured() {
    let (world, map) = &*SITE;
    let plan = world.plan();
    let goal = Point2::new(0.0, -10.0);
    assert!(plan.is_occupied(goal.x, goal.y) || plan.clearance_m(goal) < 0.1);
    let cells = (0..plan.height()).flat_map(|row| (0..plan.width()).map(move |column| (column, row)));
    let reachable = plan.reachable(Point2::from(world.start().translation.vector), 0.5);
    let places = cells.filter(|(column, row)| reachable.contains(*column, *row)).map(|(x, y)| plan.centre_of(x, y));
    let inside = places.min_by(|a, b| (a - goal).norm().total_cmp(&(b - goal).norm())).expect("a place");
    let map_from_world = world.start().inverse();
    let mut paths = ThroughWalls { map, inside: map_from_world * inside };
    let report = mission(&MissionGoal::Point(map_from_world * goal), None, Some(&mut paths));
    println!(
        "{:?} after {:.0} s and {:?} m, {} plans",
        report.failure, report.sim_s, report.path_length_m, report.plans
    );
    let failure = report.failure.expect("a reason");
    assert!(!report.arrived && failure.contains("the goal cannot be reached"), "{failure}");
    let way_m = plan.shortest_path(Point2::origin(), inside, 0.2).map_or(0.0, |way| fht_sim::path_length_m(&way));
    assert!(
        report.sim_s < 240.0 && report.path_length_m.is_some_and(|metres| metres < way_m + 60.0),
        "{}",
        report.sim_s
    );
}

#[test]
fn a_robot_that_is_elsewhere_has_not_arrived_whatever_it_says() {
    let elsewhere = SITE.0.start() * pose(3.0, 3.0, 0.0);
    let report = mission(&MissionGoal::Point(Point2::new(1.0, 0.5)), Some(elsewhere), None);
    assert!(!report.arrived);
    assert!(report.failure.is_some_and(|reason| reason.contains("says that it arrived, but it stands 4.")));
    let report = mission(&MissionGoal::None, Some(elsewhere), None);
    assert!(report.localized_at_end && report.failure.is_some_and(|reason| reason.contains("4.24 m and ")));
}
