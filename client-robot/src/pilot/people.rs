//! Giving way to people on the way.

use super::PilotConfig;
use fht_navigation::people::{Bystanders, DistanceConfig, keep_distance};
use fht_perception::frame::{SensorFrame, Twist};
use std::borrow::Cow;

/// Who is about, and since when the robot stands for them.
pub(super) struct GivingWay {
    bystanders: Bystanders,
    distance: DistanceConfig,
    patience_s: f64,
    since_us: Option<u64>,
}

impl GivingWay {
    pub(super) fn new(config: &PilotConfig) -> Self {
        Self {
            bystanders: Bystanders::new(config.people.clone()),
            distance: config.distance.clone(),
            patience_s: config.give_way_s,
            since_us: None,
        }
    }

    /// The frame without what moves.
    pub(super) fn hide<'a>(&mut self, frame: &'a SensorFrame) -> Cow<'a, SensorFrame> {
        self.bystanders.hide(frame)
    }

    /// How many have walked by of late.
    pub(super) fn walkers(&self) -> usize {
        self.bystanders.walkers()
    }

    /// The command near people, and whether the robot stands for them and may go on doing so.
    pub(super) fn keep_distance(&mut self, wanted: Twist, time_us: u64) -> (Twist, bool) {
        let command = keep_distance(wanted, &self.bystanders.around(), &self.distance);
        if command.linear_mps != 0.0 || wanted.linear_mps == 0.0 {
            self.since_us = None;
            return (command, false);
        }
        let since_us = *self.since_us.get_or_insert(time_us);
        (command, (time_us.saturating_sub(since_us) as f64) < self.patience_s * 1e6)
    }
}
