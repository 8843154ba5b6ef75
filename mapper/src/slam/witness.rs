//! What was seen a moment ago, and what wheels and scans have said of each other since.

use fht_perception::frame::LaserScan;
use fht_perception::pose::Pose2;
use std::collections::VecDeque;
use std::sync::Arc;

/// Scans that are remembered: a metre of keyframes.
pub(super) const WITNESSES: usize = 4;

/// What the wheels and the scans have said of each other lately.
#[derive(Clone, Debug, Default)]
pub(super) struct Witnesses {
    /// The newest scan, whatever became of it.
    pub newest: Option<Witness>,
    /// The last scans that were taken where the robot surely was, oldest first.
    pub believed: VecDeque<Witness>,
    /// Whether two scans, one after the other, were of different places, and nothing has spoken for
    /// the robot's place since.
    pub is_broken: bool,
}

/// A scan, and where the wheels were.
#[derive(Clone, Debug)]
pub(super) struct Witness {
    pub scan: Arc<LaserScan>,
    pub odom_from_base: Pose2,
}

/// What the newest scan says of the robot's being where the wheels say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum WheelsWord {
    /// It shows what was seen a moment ago.
    Confirmed,
    /// Nothing for sure.
    Open,
    /// Between two scans everything has changed, and no scan since then shows what was seen before.
    Refuted,
}
