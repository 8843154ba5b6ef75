//! The progress bar.

use super::arguments::RobotArgs;
use crate::mission::MissionObserver;
use crate::pilot::{Pilot, PilotStep};
use fht_perception::frame::SensorFrame;
use fht_proto::api::fleet::LocalizationState;
use indicatif::{ProgressBar, ProgressStyle};
use std::ops::ControlFlow;

/// Frames between two looks: 1 s.
const SHOW_EVERY: u64 = 5;

/// Shows where the robot thinks it is.
pub(super) struct Display {
    bar: ProgressBar,
    frames: u64,
    /// Time of the first frame, microseconds.
    first_us: Option<u64>,
}

impl Display {
    pub(super) fn new(args: &RobotArgs, robot: &str) -> Self {
        Self { bar: progress(args, robot), frames: 0, first_us: None }
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl MissionObserver for Display {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        if self.frames.is_multiple_of(SHOW_EVERY) {
            let first_us = *self.first_us.get_or_insert(frame.time_us);
            show(&self.bar, frame.time_us.saturating_sub(first_us), step);
        }
        self.frames += 1;
        ControlFlow::Continue(())
    }
}

fn progress(args: &RobotArgs, robot: &str) -> ProgressBar {
    if args.quiet || args.report.json {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix} {msg}") {
        bar.set_style(style);
    }
    bar.set_prefix(robot.to_owned());
    bar
}

fn show(bar: &ProgressBar, elapsed_us: u64, step: &PilotStep) {
    let place = step.localization.map_from_base().map_or_else(
        || match step.localization.state {
            LocalizationState::Candidates => format!("CANDIDATES ({:.0} %)", 100.0 * step.localization.confidence),
            state => state.to_string(),
        },
        |at| format!("at ({:.2}, {:.2})", at.translation.x, at.translation.y),
    );
    let seconds = elapsed_us / 1_000_000;
    bar.set_message(format!(
        "{place}, {:.1} m driven, {seconds} s of robot time",
        step.localization.odometry.odometer_m
    ));
    bar.tick();
}
