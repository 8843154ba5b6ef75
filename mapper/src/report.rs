//! What an exploration came to, scored against the simulator's truth.

use crate::construct::point;
use crate::explore::Ending;
use crate::mapping::Mapper;
use fht_map::NodeRef;
use fht_proto::Digest;
use fht_robot::grid::{CellState, OccupancyGrid};
use fht_robot::pose::{Point2, Pose2, wrap_angle};
use fht_sim::{FloorPlan, World};
use serde::{Deserialize, Serialize};

/// Figures of one exploration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExploreReport {
    /// The world explored.
    pub world: String,
    /// Pose of the map frame in the world: `[x, y, yaw]`, metres and radians.
    pub world_from_map: [f64; 3],
    /// Seconds and metres of driving after which the robot knew where in the map it is: at once, unless it joined one that others had begun;
    /// none if it never did.
    pub joined: Option<[f64; 2]>,
    /// Why the exploration ended: `complete`, `stuck`, `out_of_time`, `interrupted` or `unplaced`.
    pub ending: Ending,
    /// Area that is free and that the robot can see from where it can drive, square metres.
    pub free_area_m2: f64,
    /// Share of that area that the grid knows.
    pub explored_fraction: f64,
    /// Main nodes of the map.
    pub main_nodes: usize,
    /// Support nodes of the map.
    pub support_nodes: usize,
    /// Edges of the map.
    pub edges: usize,
    /// Increments written.
    pub version: u64,
    /// Digest of the explorer's own map.
    pub digest: Digest,
    /// Bytes of all increments, each counted once.
    pub map_bytes: u64,
    /// Bytes put on the wire, repetitions included.
    pub wire_bytes: u64,
    /// Whether the server has acknowledged everything.
    pub delivered: bool,
    /// Distance truly driven, metres.
    pub driven_m: f64,
    /// Times that the robot touched something.
    pub collisions: u64,
    /// Error of the poses of all frames as they were known at the frame.
    pub trajectory_error: TrajectoryError,
    /// Error of the same poses as they are known at the end.
    pub corrected_trajectory_error: TrajectoryError,
    /// Share of the main nodes that lie within 0.05 m of where they truly were seen.
    pub main_nodes_within_5cm: f64,
    /// Greatest error of a main node's position, metres.
    pub main_node_error_max_m: f64,
    /// Loop closures: close at hand, and after a long way.
    pub closures: [usize; 2],
    /// Longest time that a frame took, simulation excluded, milliseconds.
    pub frame_max_ms: f64,
    /// Simulated seconds.
    pub sim_s: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
}

/// Error of estimated poses.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct TrajectoryError {
    /// Mean error of the positions, metres.
    pub mean_m: f64,
    /// Greatest error of the positions, metres.
    pub max_m: f64,
    /// Mean error of the headings, degrees.
    pub mean_deg: f64,
}

/// Free area reachable by a robot of `radius_m` from the origin of the map frame, and the share of it that `grid` (in the
/// map frame) knows.
#[must_use]
pub fn explored(plan: &FloorPlan, grid: &OccupancyGrid, world_from_map: &Pose2, radius_m: f64) -> (f64, f64) {
    explored_by(plan, world_from_map, radius_m, |place| grid.state_at(place) != CellState::Unknown)
}

/// The same, for whatever `is_known` says of places in the map frame.
#[must_use]
pub fn explored_by(
    plan: &FloorPlan,
    world_from_map: &Pose2,
    radius_m: f64,
    is_known: impl Fn(Point2) -> bool,
) -> (f64, f64) {
    let reachable = plan.reachable_free(Point2::from(world_from_map.translation.vector), radius_m);
    let map_from_world = world_from_map.inverse();
    let (mut total, mut known) = (0_usize, 0_usize);
    for row in 0..plan.height() {
        for column in (0..plan.width()).filter(|column| reachable.contains(*column, row)) {
            total += 1;
            known += usize::from(is_known(map_from_world * plan.centre_of(column, row)));
        }
    }
    (plan.area_m2(&reachable), known as f64 / total.max(1) as f64)
}

/// Error of estimated poses in the map frame against true poses in the world frame.
#[must_use]
pub fn trajectory_error(estimated: &[Pose2], truth: &[Pose2], world_from_map: &Pose2) -> TrajectoryError {
    let (mut sum_m, mut max_m, mut sum_rad) = (0.0, 0.0_f64, 0.0);
    for (estimate, truth) in estimated.iter().zip(truth) {
        let difference = (world_from_map * estimate).inverse() * truth;
        let metres = difference.translation.vector.norm();
        sum_m += metres;
        max_m = max_m.max(metres);
        sum_rad += wrap_angle(difference.rotation.angle()).abs();
    }
    let count = estimated.len().min(truth.len()).max(1) as f64;
    TrajectoryError { mean_m: sum_m / count, max_m, mean_deg: (sum_rad / count).to_degrees() }
}

/// Distances of the main nodes from where the robot truly was (`truth`, world frame, by frame) when it saw them, metres.
#[must_use]
pub fn main_node_errors(mapper: &Mapper, truth: &[Pose2], world_from_map: &Pose2) -> Vec<f64> {
    let error_of = |node: NodeRef<'_>| {
        let seen_at = mapper.footings().get(&node.id)?.frame?;
        let truth = truth.get(usize::try_from(seen_at).ok()?)?;
        let place = world_from_map * point(node.pose.position);
        Some((place.coords - truth.translation.vector).norm())
    };
    mapper.map().main_nodes().filter_map(error_of).collect()
}

/// Pose of the map frame in a world that is explored from its start.
#[must_use]
pub fn default_map_origin(world: &World) -> Pose2 {
    world.start()
}
