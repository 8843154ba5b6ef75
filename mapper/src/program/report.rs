//! What an exploration came to, scored against the simulator's truth.

use super::keeping::Kept;
use super::map_figures::MapFigures;
use fht_sim::scoring::TrajectoryError;
use fht_sim::{Contacts, RobotContacts};
use serde::{Deserialize, Serialize};

/// People in the building, and what is left of them in the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PeopleFigures {
    /// How many there were.
    pub count: usize,
    /// How often they and the robot touched.
    pub contacts: Contacts,
    /// Returns in the scans of main nodes that truly ended on somebody and not on a wall.
    pub returns_in_nodes: usize,
    /// Returns in these scans altogether.
    pub returns: usize,
    /// Area that the grid says is occupied where there truly is nothing within 0.2 m, square
    /// metres.
    pub ghosts_m2: f64,
}

/// Other robots of a shared world, and what is left of them in the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotFigures {
    /// How many there were at once, at most.
    pub count: usize,
    /// How often they and this robot touched.
    pub contacts: RobotContacts,
    /// Least distance between this robot's side and another's, metres.
    pub nearest_m: f64,
    /// Returns in this robot's scans that truly ended on another robot.
    pub returns_in_scans: usize,
    /// Returns in the scans of main nodes that did.
    pub returns_in_nodes: usize,
    /// Returns in the scans of main nodes altogether.
    pub returns: usize,
}

/// Figures of one exploration.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExploreReport {
    /// The world explored.
    pub world: String,
    /// Pose of the map frame in the world: `[x, y, yaw]`, metres and radians.
    pub world_from_map: [f64; 3],
    /// Seconds and metres of driving after which the robot knew where in the map it is: at once,
    /// unless it joined one that others had begun; none if it never did.
    pub joined: Option<[f64; 2]>,
    /// The map, and why the exploration ended: `complete`, `stuck`, `out_of_time`, `interrupted` or
    /// `unplaced`.
    #[serde(flatten)]
    pub map: MapFigures,
    /// Area that is free and that the robot can see from where it can drive, square metres.
    pub free_area_m2: f64,
    /// Share of that area that the grid knows; none if the robot never knew where in the map it is:
    /// nobody can say what of the building that grid shows.
    #[serde(default)]
    pub explored_fraction: Option<f64>,
    /// Distance truly driven, metres.
    pub driven_m: f64,
    /// Times that the robot touched a wall or a thing.
    pub collisions: u64,
    /// The people in the building, if there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub people: Option<PeopleFigures>,
    /// Other robots in the building, if it is shared and there were any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robots: Option<RobotFigures>,
    /// Error of the poses of all frames as they were known at the frame; none if none was known.
    #[serde(default)]
    pub trajectory_error: Option<TrajectoryError>,
    /// Error of the same poses as they are known at the end.
    #[serde(default)]
    pub corrected_trajectory_error: Option<TrajectoryError>,
    /// Main nodes of the map that this robot made, and that were scored.
    #[serde(default)]
    pub own_main_nodes: usize,
    /// Share of these that lie within 0.05 m of where they truly were seen; none if there are none.
    #[serde(default)]
    pub main_nodes_within_5cm: Option<f64>,
    /// Greatest error of the position of one of these, metres.
    #[serde(default)]
    pub main_node_error_max_m: Option<f64>,
    /// Simulated seconds.
    pub sim_s: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
    /// What else was left of it.
    #[serde(flatten)]
    pub kept: Kept,
}
