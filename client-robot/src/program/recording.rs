//! A client's run as a bag: what the sensors said, where the robot thought it was, and the map that
//! it used.

use crate::mission::MissionObserver;
use crate::pilot::{Pilot, PilotStep};
use fht_bag::{FrameRecording, RecordedGrid, Recorder, WriteError, write_map};
use fht_client::LiveReplica;
use fht_localization::landmarks::Landmarks;
use fht_map::MapState;
use fht_perception::frame::SensorFrame;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Least time between two recorded states of the map, microseconds.
const MAP_PERIOD_US: u64 = 5_000_000;

/// Writes a run while it goes on: frames, the transform `map → odom` from when the robot knows its
/// place, and the map on `/map` and `/fht_map`, at the beginning and when it has changed. Without a
/// bag it does nothing.
pub(super) struct Recording<'a>(Option<Bag<'a>>);

struct Bag<'a> {
    recorder: Recorder,
    frames: Arc<Mutex<FrameRecording>>,
    replica: &'a LiveReplica,
    turns: MapTurns,
    last_us: Option<u64>,
}

/// When the map is recorded.
#[derive(Default)]
struct MapTurns {
    /// The newest state that was recorded.
    recorded: Option<u64>,
    next_us: u64,
}

impl MapTurns {
    /// Whether the map, whose state has this number (see [`LiveReplica::changes`]), is to be
    /// recorded now: it has changed, and the last time was long enough ago or this is the `end`.
    fn is_due(&mut self, time_us: u64, changes: u64, is_end: bool) -> bool {
        let is_due = self.recorded != Some(changes) && (is_end || time_us >= self.next_us);
        if is_due {
            self.recorded = Some(changes);
            self.next_us = time_us.saturating_add(MAP_PERIOD_US);
        }
        is_due
    }
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

/// What the map's main nodes saw and its rectangles say, as the robot weighs its poses by.
fn known_floor(map: &MapState) -> RecordedGrid {
    let mut landmarks = Landmarks::default();
    landmarks.refresh(map);
    RecordedGrid::from(&landmarks.walls().known)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_is_recorded_when_it_changes_but_not_too_often() {
        let frame_us = 200_000;
        let times = |changes_at: &dyn Fn(u64) -> u64| {
            let mut turns = MapTurns::default();
            (0..=60)
                .filter(|frame| turns.is_due(frame * frame_us, changes_at(*frame), *frame == 60))
                .collect::<Vec<_>>()
        };
        assert_eq!(times(&|_| 7), [0], "a map that stays as it is is recorded once");
        assert_eq!(times(&|frame| frame), [0, 25, 50, 60], "every five seconds, and at the end");
        assert_eq!(times(&|frame| u64::from(frame >= 3) + u64::from(frame >= 40)), [0, 25, 50]);
    }
}
