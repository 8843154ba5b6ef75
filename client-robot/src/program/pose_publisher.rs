//! What the robot says of itself over Zenoh while it is at work: its pose and its status.

use crate::mission::MissionObserver;
use crate::pilot::{Pilot, PilotStep};
use fht_client::{LiveReplica, PoseReport, Presence};
use fht_perception::frame::SensorFrame;
use std::ops::ControlFlow;

/// Frames between published poses: 1 s.
const POSE_EVERY: u64 = 5;

/// Publishes the robot's pose and status once a second, and where it ended.
pub(super) struct PosePublisher<'a> {
    presence: Presence,
    replica: &'a LiveReplica,
    frames: u64,
    /// What the newest frame led to, if it was not published.
    unsaid: Option<PoseReport>,
}

impl<'a> PosePublisher<'a> {
    /// Publishes through `presence`, with the version of `replica`.
    pub(super) fn new(presence: Presence, replica: &'a LiveReplica) -> Self {
        Self { presence, replica, frames: 0, unsaid: None }
    }

    /// The robot's last word: where it is in the end.
    pub(super) fn finish(self) {
        if let Some(report) = &self.unsaid {
            self.presence.publish_last(report, self.replica.read().vector().clone(), self.release());
        }
    }

    fn release(&self) -> Option<String> {
        self.replica.release().map(|release| release.to_string())
    }
}

impl MissionObserver for PosePublisher<'_> {
    fn on_frame(&mut self, _: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        let report = step.pose_report();
        self.unsaid = if self.frames.is_multiple_of(POSE_EVERY) {
            self.presence.publish(&report, self.replica.read().vector().clone(), self.release());
            None
        } else {
            Some(report)
        };
        self.frames += 1;
        ControlFlow::Continue(())
    }
}
