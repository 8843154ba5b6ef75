//! A client's run as a bag: what the sensors said, where the robot thought it was, and the map that
//! it used.

use super::floor::{MapTurns, known_floor};
use crate::mission::MissionObserver;
use crate::pilot::{Pilot, PilotStep};
use fht_bag::{FrameRecording, Recorder, WriteError, write_map};
use fht_client::LiveReplica;
use fht_perception::frame::SensorFrame;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Writes a run while it goes on: frames, the transform `map → odom` from when the robot knows
/// its place, and the map on `/map` and `/fht_map`, at the beginning and when it has changed.
/// Without a bag it does nothing.
pub(super) struct Recording<'a>(Option<Bag<'a>>);

struct Bag<'a> {
    recorder: Recorder,
    frames: Arc<Mutex<FrameRecording>>,
    replica: &'a LiveReplica,
    turns: MapTurns,
    last_us: Option<u64>,
}

impl<'a> Recording<'a> {
    /// Begins a bag at `path`, if one is given: an `.mcap` file, or else a folder. The robot uses
    /// the map of `replica`.
    ///
    /// # Errors
    /// [`WriteError`] when something is there already or cannot be made.
    pub(super) fn start(path: Option<&Path>, replica: &'a LiveReplica) -> Result<Self, WriteError> {
        let Some(path) = path else { return Ok(Self(None)) };
        let (recorder, turns) = (Recorder::start(path)?, MapTurns::default());
        Ok(Self(Some(Bag { recorder, frames: Arc::default(), replica, turns, last_us: None })))
    }

    /// Ends the bag, with the map as it is now.
    ///
    /// # Errors
    /// The first [`WriteError`] of the run; what was written before it can be read.
    pub(super) fn finish(self) -> Result<(), WriteError> {
        let Some(mut bag) = self.0 else { return Ok(()) };
        if let Some(last_us) = bag.last_us {
            bag.record_map(last_us, true);
        }
        bag.recorder.finish().map(|_| ())
    }
}

impl Bag<'_> {
    fn record_map(&mut self, time_us: u64, is_end: bool) {
        if self.turns.is_due(time_us, self.replica.changes(), is_end) {
            let map = self.replica.running();
            self.recorder.submit(move |file| write_map(file, time_us, &known_floor(&map), &map));
        }
    }
}

/// Waits for the disk if it is far behind.
impl MissionObserver for Recording<'_> {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        let Some(bag) = &mut self.0 else { return ControlFlow::Continue(()) };
        bag.last_us = Some(frame.time_us);
        bag.record_map(frame.time_us, false);
        let (frames, frame) = (bag.frames.clone(), frame.clone());
        let map_from_base = step.localization.map_from_base();
        bag.recorder.submit(move |file| {
            let mut frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
            frames.write(file, &frame, map_from_base.as_ref())
        });
        ControlFlow::Continue(())
    }
}
