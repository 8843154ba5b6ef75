//! How places outside of the mesh are joined to it.

use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How places outside join the mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct EntryConfig {
    /// A straight way is taken if it is at most this long, millimetres. Default 300.
    pub straight_mm: f64,
    /// And if it keeps this far from walls, millimetres. Default 130
    /// ([`Footprint::sure_clearance_mm`]).
    pub straight_room_mm: f64,
    /// Other ways keep this far from walls, millimetres; if there is none, the second. Default 115
    /// and 95 ([`Footprint::entry_clearances_mm`]).
    pub room_mm: [f64; 2],
    /// And this far where it costs little, millimetres. Default 150
    /// ([`Footprint::grid_clearance_mm`]).
    pub good_room_mm: f64,
    /// A metre at the least distance from walls counts for this many more. Default 10.
    pub near_factor: f64,
    /// A metre on which nobody saw the ground under the robot counts for this many more. Default
    /// 20.
    pub unseen_factor: f64,
    /// A goal is this far from walls that were seen, millimetres, or no robot's centre can be
    /// there. Default 75: the explorers' radius, less 30 by which scans and map may be off.
    pub goal_room_mm: f64,
    /// The way to a goal leads over at most so much ground that no rectangle covers and no main
    /// node saw, millimetres, on a map that has scans: what hides more of it may be a wall. Default
    /// 300.
    pub unseen_goal_mm: f64,
    /// The same for the way from a start farther outside than `start_mm`: a robot stands there, or
    /// thinks so. Default 750.
    pub unseen_start_mm: f64,
    /// A robot that stands at most this far outside of the mesh gets some way into it, whatever was
    /// seen there: what stood there is gone, or the robot is not quite where it thinks it is.
    /// Millimetres. Default 400. From farther away no way leads through a wall.
    pub start_mm: f64,
    /// The ground under the robot reaches this far from its centre, millimetres. Default 112
    /// ([`Footprint::body_mm`]).
    pub body_mm: f64,
    /// Main nodes farther away than this are not asked what they saw, millimetres. Default 8000.
    pub view_mm: f64,
    /// Ways lead over ground that was seen to be free under the whole robot, and keep the first
    /// distance of `room_mm`. Only where the robot stands already may it be the second, and ground
    /// unseen. Otherwise there is no way. Default false, for robots like the explorers: they get
    /// some way into the mesh, for none would leave them where they are.
    pub is_strict: bool,
}

impl EntryConfig {
    /// For robots of a footprint; strict for those larger than the explorers.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            straight_mm: 300.0,
            straight_room_mm: footprint.sure_clearance_mm().into(),
            room_mm: footprint.entry_clearances_mm().map(f64::from),
            good_room_mm: footprint.grid_clearance_mm().into(),
            goal_room_mm: 75.0,
            unseen_goal_mm: 300.0,
            unseen_start_mm: 750.0,
            start_mm: 400.0,
            near_factor: 10.0,
            unseen_factor: 20.0,
            body_mm: footprint.body_mm().into(),
            view_mm: 8_000.0,
            is_strict: footprint.is_larger_than_explorers(),
        }
    }
}

impl Default for EntryConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}
