//! An exploration of a simulated building, scored against the truth.

use super::bodies_score::{Crowded, Seen, on_bodies};
use super::keeping::Kept;
use super::map_figures::MapFigures;
use super::report::{ExploreReport, RobotFigures};
use crate::construct::point;
use crate::mapping::{Located, Mapper};
use crate::run::{MappedFrame, MappingObserver, MappingSummary};
use fht_map::{MapState, NodeRef};
use fht_perception::pose::Pose2;
use fht_sim::scoring::{explored, trajectory_error};
use fht_sim::{Simulator, Truth, World};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A robot is off at a node by less than this where the map is as true as its grid, metres.
const NEAR_M: f64 = 0.05;

/// Collects the figures of an exploration: give it to [`explore`](crate::run::explore) as the
/// observer.
pub(super) struct ExplorationScore {
    world: Arc<World>,
    truth: Truth,
    radius_m: f64,
    start: Pose2,
    /// Where the map's frame truly lies, if this robot joins the map.
    joined_origin: Pose2,
    world_from_map: Pose2,
    began: Instant,
    took: Duration,
    sim_s: f64,
    /// The truth at each frame.
    true_poses: Vec<Pose2>,
    /// Where people were at each frame.
    people: Vec<Crowded>,
    /// Where the other robots of a shared world were.
    robots: Vec<Crowded>,
    /// Returns of all scans that ended on other robots.
    returns_on_robots: usize,
    /// The estimate and the truth, from the frame on at which the robot has known where in the map
    /// it is.
    located: Vec<(Located, Pose2)>,
    joined: Option<[f64; 2]>,
}

impl ExplorationScore {
    /// The score of `simulator`'s robot, which stands at its start. `map_origin` is where the frame
    /// of a map that it joins truly lies; none: at the world's own start.
    pub(super) fn new(simulator: &Simulator, map_origin: Option<Pose2>) -> Self {
        let (world, truth) = (Arc::clone(simulator.world()), simulator.watch_truth());
        let start = truth.world_from_base();
        Self {
            radius_m: simulator.config().radius_m,
            start,
            joined_origin: map_origin.unwrap_or_else(|| world.start()),
            world_from_map: start,
            began: Instant::now(),
            took: Duration::ZERO,
            sim_s: 0.0,
            true_poses: Vec::new(),
            people: Vec::new(),
            robots: Vec::new(),
            returns_on_robots: 0,
            located: Vec::new(),
            joined: None,
            world,
            truth,
        }
    }

    /// The figures of a run that has ended and left what is `kept`.
    pub(super) fn report(&self, summary: &MappingSummary, mapper: &Mapper, kept: Kept) -> ExploreReport {
        let world_from_map = &self.world_from_map;
        let (free_area_m2, explored_fraction) =
            explored(self.world.plan(), mapper.grid(), world_from_map, self.radius_m);
        let online: Vec<Pose2> = self.located.iter().map(|(located, _)| located.map_from_base).collect();
        let corrected: Vec<Pose2> = self.located.iter().map(|(located, _)| mapper.locate(&located.anchored)).collect();
        let truth: Vec<Pose2> = self.located.iter().map(|(_, truth)| *truth).collect();
        let node_errors_m = main_node_errors(mapper.map(), mapper, &self.true_poses, world_from_map);
        let near = node_errors_m.iter().filter(|error_m| **error_m < NEAR_M).count();
        let own_main_nodes = node_errors_m.len();
        // Of nothing nobody is to think that it was measured.
        let error = |poses: &[Pose2]| (!poses.is_empty()).then(|| trajectory_error(poses, &truth, world_from_map));
        let at = world_from_map.translation;
        let seen = Seen { truth: &self.true_poses, world: &self.world, world_from_map, mapper };
        let robots = seen.robots(&self.robots, self.radius_m, self.truth.robot_contacts());
        ExploreReport {
            world: self.world.name().to_owned(),
            world_from_map: [at.x, at.y, world_from_map.rotation.angle()],
            joined: self.joined,
            map: MapFigures::of(summary, mapper),
            free_area_m2,
            explored_fraction: self.joined.map(|_| explored_fraction),
            driven_m: self.truth.driven_m(),
            collisions: self.truth.collisions(),
            people: seen.people(&self.people, self.truth.contacts()),
            robots: robots.map(|robots| RobotFigures { returns_in_scans: self.returns_on_robots, ..robots }),
            trajectory_error: error(&online),
            corrected_trajectory_error: error(&corrected),
            own_main_nodes,
            main_nodes_within_5cm: (own_main_nodes > 0).then(|| near as f64 / own_main_nodes as f64),
            main_node_error_max_m: node_errors_m.into_iter().reduce(f64::max),
            sim_s: self.sim_s,
            wall_s: self.took.as_secs_f64(),
            kept,
        }
    }
}

impl MappingObserver for ExplorationScore {
    fn on_start(&mut self, mapper: &Mapper) {
        self.began = Instant::now();
        // A map that this robot begins has its frame where the robot begins.
        self.world_from_map = if mapper.is_placed() { self.start } else { self.joined_origin };
    }

    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        let (mapper, truth) = (mapped.mapper, self.truth.world_from_base());
        self.true_poses.push(truth);
        self.people.push(self.truth.people());
        let robots = self.truth.robots();
        if !robots.is_empty() {
            let ends = mapped.frame.scan.points_in_base();
            self.returns_on_robots += on_bodies(ends.into_iter(), &robots, &truth, &self.world);
        }
        self.robots.push(robots);
        self.sim_s = mapped.frame.time_us as f64 * 1e-6;
        if mapper.is_placed() {
            let (sim_s, driven_m) = (self.sim_s, self.truth.driven_m());
            self.joined.get_or_insert([sim_s, driven_m]);
            self.located.extend(mapper.latest().map(|latest| (*latest, truth)));
        }
        ControlFlow::Continue(())
    }

    fn on_end(&mut self, _: &Mapper) {
        self.took = self.began.elapsed();
    }
}

/// Distances of the main nodes of `map` that `mapper` made from where the robot truly was (`truth`,
/// world frame, by frame) when it saw them, metres.
#[must_use]
pub fn main_node_errors(map: &MapState, mapper: &Mapper, truth: &[Pose2], world_from_map: &Pose2) -> Vec<f64> {
    let error_of = |node: NodeRef<'_>| {
        let seen_at = mapper.footings().get(&node.id)?.frame?;
        let truth = truth.get(usize::try_from(seen_at).ok()?)?;
        let place = world_from_map * point(node.pose.position);
        Some((place.coords - truth.translation.vector).norm())
    };
    map.main_nodes().filter_map(error_of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explore::Ending;
    use crate::mapping::MapperConfig;
    use fht_proto::AuthorId;
    use fht_sim::{SimConfig, load};

    #[test]
    fn of_a_robot_that_never_found_its_place_nothing_is_said_to_be_measured() {
        let world = Arc::new(load("museum", None, 1).expect("a built-in world"));
        let start = world.start();
        let simulator = Simulator::new(world, SimConfig::default(), start, 1);
        let mut score = ExplorationScore::new(&simulator, None);
        let mapper = Mapper::joining(MapperConfig::default(), AuthorId(1), None, None).expect("a mapper");
        score.on_start(&mapper);
        let summary = MappingSummary {
            ending: Ending::Unplaced,
            robot_error: None,
            frames: 0,
            frames_refused: 0,
            version: 0,
            vector: None,
            written: 0,
            frame_max: Duration::ZERO,
            published: None,
        };
        let report = score.report(&summary, &mapper, Kept::default());
        assert_eq!((report.joined, report.explored_fraction), (None, None));
        assert!(report.trajectory_error.is_none() && report.corrected_trajectory_error.is_none());
        assert_eq!(
            (report.own_main_nodes, report.main_nodes_within_5cm, report.main_node_error_max_m),
            (0, None, None)
        );
        let json = serde_json::to_value(&report).expect("JSON");
        assert!(json["trajectory_error"].is_null() && json["explored_fraction"].is_null(), "{json}");
    }
}
