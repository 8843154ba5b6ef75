//! How a robot looks for what tells places apart.

use crate::planning::{PlanConfig, UnknownCells};
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How a robot looks for what tells places apart.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DisambiguationConfig {
    /// The robot wanders so far first, metres: most places are known by then. Default 2.
    pub after_m: f64,
    /// It chooses anew after so much driving, metres. Default 2.
    pub choose_every_m: f64,
    /// Most probable candidates that are told apart. Default 4.
    #[cfg_attr(feature = "schema", schemars(range(min = 2, max = 16)))]
    pub candidates: usize,
    /// Those that have less than this share of the probability of the most probable do not matter.
    /// Default 0.05.
    pub least_share: f64,
    /// Unseen ground is driven over if it is free for candidates with this share of the
    /// probability, 0 to 1. Default 0.75.
    pub agreement: f64,
    /// Places are looked at as far as this along the way, metres. Default 40.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 200)))]
    pub reach_m: f64,
    /// So many at most. Default 300.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 10000)))]
    pub places: usize,
    /// Directions in which the views from a place are compared. Default 72.
    #[cfg_attr(feature = "schema", schemars(range(min = 3, max = 3600)))]
    pub directions: usize,
    /// Views reach as far as this, metres, and no farther than the scanner. Default 10.
    pub range_m: f64,
    /// A wall this much nearer or farther is another one, metres. Default 0.4: maps and poses are
    /// not exact.
    pub margin_m: f64,
    /// Side of the pieces of wall that count as one, metres. Default 0.5.
    pub square_m: f64,
    /// A place from which candidates differ by so many pieces of wall tells all. Default 16: half
    /// of them would do if the robot saw each as the map says.
    pub distinct_pieces: f64,
    /// Places that give less than this share of that are not driven to. Default 0.15.
    pub least_told: f64,
    /// What it takes to look about at a place that gives all of it, as metres of way; one that
    /// gives half takes twice as many. Default 3.
    pub look_about_m: f64,
    /// Where the robot may drive.
    pub plan: PlanConfig,
}

impl Default for DisambiguationConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

impl DisambiguationConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            after_m: 2.0,
            choose_every_m: 2.0,
            candidates: 4,
            least_share: 0.05,
            agreement: 0.75,
            reach_m: 40.0,
            places: 300,
            directions: 72,
            range_m: 10.0,
            margin_m: 0.4,
            square_m: 0.5,
            distinct_pieces: 16.0,
            least_told: 0.15,
            look_about_m: 3.0,
            plan: PlanConfig { unknown: UnknownCells::Forbidden, ..PlanConfig::of(footprint) },
        }
    }
}
