//! Why two maps are not merged.

use fht_perception::pose_graph::GraphError;

/// Why two maps are not merged. Nothing is written then.
#[derive(Clone, Debug, thiserror::Error)]
pub enum MergeRefusal {
    /// There is nothing to compare.
    #[error("{map} has no main node with a scan: there is nothing to compare")]
    NothingSeen {
        /// Which map.
        map: &'static str,
    },
    /// One is a copy of the other, or goes on from it.
    #[error(
        "the maps share {shared} main nodes: they are one map, or robots of one name wrote both. What one map has and the other lacks \
         of the same run is brought over by export and import; a run that is replayed to be merged needs a --robot of its own"
    )]
    SameMap {
        /// Main nodes that are in both.
        shared: usize,
    },
    /// More than can be compared.
    #[error("{what}: more than is merged ({most})")]
    TooLarge {
        /// What is too large.
        what: String,
        /// How much is allowed.
        most: String,
    },
    /// Too few places of one are found in the other.
    #[error(
        "the maps do not overlap, as far as can be told: {agreeing} places of the second were found in the first and agree, {needed} are needed"
    )]
    TooFewMatches {
        /// Places that agree.
        agreeing: usize,
        /// How many are needed.
        needed: usize,
    },
    /// They overlap too little to be sure.
    #[error(
        "the maps overlap too little to be sure: {agreeing} places agree, {spread_m:.1} m apart at most, over {overlap_m2:.0} m², which is \
         {:.0} % of the smaller map", 100.0 * share
    )]
    TooLittleOverlap {
        /// Places that agree.
        agreeing: usize,
        /// How far apart they are, metres.
        spread_m: f64,
        /// Free space that both know, square metres.
        overlap_m2: f64,
        /// Its share of the smaller map.
        share: f64,
    },
    /// Where they overlap, they contradict each other.
    #[error(
        "these are different buildings: where the maps fit best, {:.1} % of the beams contradict the other map ({:.1} % are allowed)",
        100.0 * share, 100.0 * most
    )]
    Contradiction {
        /// Share of beams that cannot be, among those that say something.
        share: f64,
        /// How much is allowed.
        most: f64,
    },
    /// The walls fit, but nothing looks alike: another storey.
    #[error(
        "the walls fit, but the places do not look alike ({:.0} % of the places elsewhere look less like one than what is there; by chance 50 %): \
         another storey, perhaps, or all is redecorated", 100.0 * share
    )]
    LooksDifferent {
        /// Mean share of places elsewhere that look less alike.
        share: f64,
    },
    /// There are two places for it.
    #[error(
        "ambiguous: the second map fits in the first in two ways, {apart_m:.1} m and {apart_deg:.0}° apart, and the worse one is {:.0} % as \
         good as the better", 100.0 * share
    )]
    Ambiguous {
        /// How far apart, at the middle of what overlaps, metres.
        apart_m: f64,
        /// How much the headings differ, degrees.
        apart_deg: f64,
        /// How good the second is, as a share of the first.
        share: f64,
    },
    /// What is left of the second map hangs on nothing.
    #[error("no way leads from the one map's part to the other's")]
    NoWay,
    /// Numbers that are no poses.
    #[error(transparent)]
    Graph(#[from] GraphError),
}
