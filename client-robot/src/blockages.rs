//! Places that the robot found blocked. Paths lead around them for a while only: people and doors
//! move. If nothing is left but to wait, it waits, a few times.

use fht_proto::FixedPoint;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// How long the robot believes that a way is blocked.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BlockageConfig {
    /// A place found blocked is gone round for this long, seconds. Default 30.
    pub blocked_for_s: f64,
    /// Without any way left, all places count as open again and the robot waits this long, seconds.
    /// Default 5.
    pub wait_s: f64,
    /// … at most this often before the task fails. Default 3.
    pub waits: u32,
    /// Waits longer ago than this are forgotten, seconds. Default 120.
    pub forget_s: f64,
}

impl Default for BlockageConfig {
    fn default() -> Self {
        Self { blocked_for_s: 30.0, wait_s: 5.0, waits: 3, forget_s: 120.0 }
    }
}

/// What is blocked, and since when the robot waits. Times are the sensors', microseconds.
#[derive(Clone, Debug, Default)]
pub struct Blockages {
    until_us: BTreeMap<FixedPoint, u64>,
    waits: u32,
    wait_until_us: u64,
}

fn micros(seconds: f64) -> u64 {
    (seconds.max(0.0) * 1e6) as u64 // saturates
}

impl Blockages {
    /// A place, map frame, was found blocked.
    pub fn block(&mut self, place: FixedPoint, now_us: u64, config: &BlockageConfig) {
        self.until_us.insert(place, now_us.saturating_add(micros(config.blocked_for_s)));
    }

    /// The places that count as blocked now, map frame.
    pub fn places(&mut self, now_us: u64) -> BTreeSet<FixedPoint> {
        self.until_us.retain(|_, until_us| *until_us > now_us);
        self.until_us.keys().copied().collect()
    }

    /// Whether any place was blocked when they were last looked at.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.until_us.is_empty()
    }

    /// No way is left: opens all places and begins to wait. False if the robot has waited often
    /// enough.
    pub fn wait(&mut self, now_us: u64, config: &BlockageConfig) -> bool {
        if now_us > self.wait_until_us.saturating_add(micros(config.forget_s)) {
            self.waits = 0;
        }
        if self.waits >= config.waits {
            return false;
        }
        self.until_us.clear();
        self.waits += 1;
        self.wait_until_us = now_us.saturating_add(micros(config.wait_s));
        true
    }

    /// The robot goes elsewhere, and waits no longer.
    pub fn forget_waits(&mut self) {
        (self.waits, self.wait_until_us) = (0, 0);
    }

    /// Whether the robot still waits.
    #[must_use]
    pub fn is_waiting(&self, now_us: u64) -> bool {
        now_us < self.wait_until_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    const SECOND: u64 = 1_000_000;

    fn place(x: f64) -> FixedPoint {
        FixedPoint::from_metres(x, 0.0)
    }

    #[test]
    fn a_place_opens_again_after_a_while() {
        let config = BlockageConfig::default();
        let mut blockages = Blockages::default();
        blockages.block(place(1.0), 0, &config);
        blockages.block(place(2.0), 20 * SECOND, &config);
        assert_eq!(blockages.places(29 * SECOND).len(), 2);
        assert_eq!(blockages.places(31 * SECOND), BTreeSet::from([place(2.0)]));
        assert!(blockages.places(51 * SECOND).is_empty() && blockages.is_empty());
    }

    #[test]
    fn the_robot_waits_a_few_times_and_not_for_ever() {
        let config = BlockageConfig::default();
        let mut blockages = Blockages::default();
        for round in 0..3 {
            blockages.block(place(1.0), round * 10 * SECOND, &config);
            assert!(blockages.wait(round * 10 * SECOND, &config));
            assert!(blockages.is_empty());
            assert!(blockages.is_waiting((round * 10 + 4) * SECOND));
            assert!(!blockages.is_waiting((round * 10 + 5) * SECOND));
        }
        assert!(!blockages.wait(30 * SECOND, &config));
        assert!(blockages.wait(200 * SECOND, &config), "that was long ago");
    }
}
