//! A robot whose way is blocked tries another, waits, and goes on when the way is open again; it
//! gives up in the end.

mod fixture;
#[path = "fixture/scored.rs"]
mod scored;

use client_robot::mission::{MissionConfig, MissionGoal, Services};
use client_robot::program::MissionReport;
use fht_client::{PathPoint, PathSource, PlannedPath, Planner};
use fht_map::MapState;
use fht_perception::frame::Panorama;
use fht_perception::pose::Point2;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, FixedPoint, NodeId};
use fht_sim::{SimConfig, Simulator, World};
use fixture::{FixtureConfig, OwnPaths, colour_descriptor, map_of};
use nalgebra::Vector2;
use scored::scored;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Gives paths that lead out of the building, and true ones once it was asked `open_after` times.
/// With a place blocked it has none.
struct Scripted<'a> {
    map: &'a MapState,
    open_after: usize,
    /// How many places were blocked at each question.
    asked: Vec<usize>,
}

impl PathSource for Scripted<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.asked.push(blocked.len());
        if self.asked.len() > self.open_after {
            return OwnPaths(self.map).plan(from, to, blocked);
        }
        if !blocked.is_empty() {
            return Err(ErrorReply::new(ErrorCode::NoPath, "the only way is blocked"));
        }
        let node = |number| Some(NodeId { author: AuthorId(1), number });
        let outside = PathPoint { position: from + Vector2::new(200.0, 0.0), node: node(2) };
        let points = vec![PathPoint { position: from, node: node(1) }, outside];
        Ok(PlannedPath { points, length_m: 200.0, planner: Planner::Replica, goal_moved_m: 0.0, unmapped_m: 0.0 })
    }
}

fn describe(panorama: &Panorama) -> Option<fht_proto::Descriptor> {
    Some(colour_descriptor(panorama))
}

fn mission(world: &Arc<World>, map: &MapState, open_after: usize) -> (MissionReport, Vec<usize>) {
    let start = world.random_free_pose(1, 0.4);
    let simulator = Simulator::new(Arc::clone(world), SimConfig::default(), start, 1);
    let mut paths = Scripted { map, open_after, asked: Vec::new() };
    let mut services = Services { map, paths: &mut paths, describe: &mut describe };
    let report = scored(simulator, MissionConfig::default(), &MissionGoal::FarNode(1), &world.start(), &mut services);
    (report, paths.asked)
}

#[test]
fn a_blocked_way_is_tried_again_and_given_up_only_after_some_waiting() {
    let museum = Arc::new(fht_sim::load("museum", None, 0).expect("a built-in world"));
    let map = map_of(&museum, &FixtureConfig { spacing_m: 4.0, ..FixtureConfig::default() }, &mut describe);

    let (report, asked) = mission(&museum, &map, usize::MAX);
    assert!(report.localized && !report.arrived);
    assert!(report.failure.is_some_and(|reason| reason.contains("the only way is blocked")));
    assert_eq!(asked, [0, 1, 0, 1, 0, 1, 0, 1], "around it there is no path: all places are opened again");

    let (report, asked) = mission(&museum, &map, 4);
    assert!(report.arrived, "{:?}", report.failure);
    assert_eq!(asked[..5], [0, 1, 0, 1, 0]);
}
