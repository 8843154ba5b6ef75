//! How much a robot may close by its reports of what is blocked, and what is said of reports that
//! close more.

use fht_proto::Invalid;
use serde::{Deserialize, Serialize};

/// How much a robot may close by its reports, and for how long. Operators' reports hold for as long
/// as they say.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ReportLimits {
    /// Longest time that a report holds, seconds; one that says more holds for so long. Default
    /// 600.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 86400)))]
    pub max_s: f64,
    /// The same for a robot that holds no liveliness token, and for the reports of one that has
    /// gone, seconds. Default 60.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 86400)))]
    pub without_token_max_s: f64,
    /// Edges and places that one robot may have closed at a time; the newest reports stay. Default
    /// 64.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub max_things: usize,
    /// How far they may lie from their centre, metres: what a robot reported farther away before is
    /// open again. Default 25.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 100000)))]
    pub radius_m: f64,
    /// Things that all robots together may have closed on a map; further reports are refused.
    /// Default 4096.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 1000000)))]
    pub max_things_on_map: usize,
    /// Reports change the map's free space at most this often, seconds: it has to be made anew.
    /// Default 0.5.
    #[cfg_attr(feature = "schema", schemars(range(min = 0, max = 3600)))]
    pub apply_every_s: f64,
}

impl Default for ReportLimits {
    fn default() -> Self {
        Self {
            max_s: 600.0,
            without_token_max_s: 60.0,
            max_things: 64,
            radius_m: 25.0,
            max_things_on_map: 4096,
            apply_every_s: 0.5,
        }
    }
}

/// Who reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reporter {
    /// A robot.
    Robot {
        /// Whether it is there: its liveliness token is.
        has_token: bool,
    },
    /// An operator, or a server that has judged the report already: nothing is cut.
    Trusted,
}

/// Why a report is not taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReportRefused {
    /// It cannot be read.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// It closes too much at once.
    #[error("it closes {things} things, and a robot may close {limit}")]
    TooMany {
        /// Edges and places.
        things: usize,
        /// How many one robot may close.
        limit: usize,
    },
    /// What it closes lies too far apart.
    #[error("what it closes lies up to {distance_m:.0} m from its middle, and {limit_m} m are allowed")]
    TooWide {
        /// From the middle, metres.
        distance_m: f64,
        /// The limit, metres.
        limit_m: f64,
    },
    /// All robots together have closed too much.
    #[error("robots have closed {limit} things on this map already")]
    Full {
        /// The limit.
        limit: usize,
    },
    /// An operator has said that this robot's reports do not count.
    #[error("an operator lets reports of {robot} not count for another {for_s:.0} s")]
    Ignored {
        /// The robot.
        robot: String,
        /// For how much longer, seconds.
        for_s: f64,
    },
}
