//! What the demo came to, in figures.

use serde::{Deserialize, Serialize};

/// One explorer, in figures.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExplorerFigures {
    /// Its name.
    pub robot: String,
    /// How it ended, or `killed`.
    pub ending: String,
    /// Seconds and metres after which it knew its place in the map, if it joined one.
    pub joined: Option<[f64; 2]>,
    /// Driven, metres; unknown if it was killed.
    pub driven_m: Option<f64>,
    /// Robot time from its start to its end, seconds.
    pub sim_s: f64,
}

/// What happened, in figures.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct HandoffReport {
    /// The world.
    pub world: String,
    /// The seed.
    pub seed: u64,
    /// Reachable free area, square metres.
    pub free_area_m2: f64,
    /// Share of it that was explored.
    pub explored_fraction: f64,
    /// Main nodes of the map.
    pub main_nodes: usize,
    /// Support nodes of the map.
    pub support_nodes: usize,
    /// Edges of the map.
    pub edges: usize,
    /// Bytes of all increments.
    pub map_bytes: u64,
    /// Bytes that the explorer put on the wire.
    pub wire_bytes: u64,
    /// Mean error of the explorer's estimated positions, metres.
    pub mapping_error_m: f64,
    /// Distance that the explorers drove, metres.
    pub explorer_driven_m: f64,
    /// Each explorer.
    pub explorers: Vec<ExplorerFigures>,
    /// Robot time from the first explorer's start to the last one's end, seconds.
    pub explore_sim_s: f64,
    /// Whether the digests of explorer and server agree. With several explorers, those of the
    /// server and of a copy.
    pub digests_agree: bool,
    /// Whether the client found its place.
    pub localized: bool,
    /// Error of the client's first fix, metres.
    pub relocalization_error_m: Option<f64>,
    /// Error of its heading, degrees.
    pub relocalization_error_deg: Option<f64>,
    /// Distance driven until the first fix, metres.
    pub relocalization_distance_m: Option<f64>,
    /// Where the client truly was at the end of its drive, `[x, y]` in the map frame.
    pub end_true: Option<[f64; 2]>,
    /// Where it thought it was.
    pub end_estimated: Option<[f64; 2]>,
    /// Error of its estimate at the end, metres.
    pub final_error_m: Option<f64>,
    /// Driven from the fix to the goal, metres.
    pub path_length_m: Option<f64>,
    /// The shortest that was possible, metres.
    pub shortest_length_m: Option<f64>,
    /// Whether the client arrived: it says so, and it is truly within half a metre of the goal.
    pub arrived: bool,
    /// True distance to the goal at the end, metres.
    pub goal_distance_m: Option<f64>,
    /// Times that either robot touched something.
    pub collisions: u64,
    /// Why the client failed, if it did.
    pub failure: Option<String>,
    /// Seconds of the exploration.
    pub explore_wall_s: f64,
    /// Seconds of the whole demo.
    pub wall_s: f64,
}

impl HandoffReport {
    /// Whether the demo succeeded: server and explorer have the same map, and the client arrived.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.digests_agree && self.arrived
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_fails_unless_the_maps_agree_and_the_client_arrives() {
        for (digests_agree, arrived, is_success) in
            [(true, true, true), (false, true, false), (true, false, false), (false, false, false)]
        {
            let report = HandoffReport { digests_agree, arrived, ..HandoffReport::default() };
            assert_eq!(report.is_success(), is_success, "{digests_agree} {arrived}");
        }
    }
}
