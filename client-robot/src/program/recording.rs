//! A client's run as a bag: what the sensors said, and where the robot thought it was.

use crate::mission::MissionObserver;
use crate::pilot::{Pilot, PilotStep};
use fht_bag::{FrameRecording, Recorder, WriteError};
use fht_perception::frame::SensorFrame;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Writes a run while it goes on: frames, and the transform `map → odom` from when the robot knows
/// its place. Without a bag it does nothing.
pub(super) struct Recording(Option<Bag>);

struct Bag {
    recorder: Recorder,
    frames: Arc<Mutex<FrameRecording>>,
}

impl Recording {
    /// Begins a bag at `path`, if one is given: an `.mcap` file, or else a folder.
    ///
    /// # Errors
    /// [`WriteError`] when something is there already or cannot be made.
    pub(super) fn start(path: Option<&Path>) -> Result<Self, WriteError> {
        let Some(path) = path else { return Ok(Self(None)) };
        Ok(Self(Some(Bag { recorder: Recorder::start(path)?, frames: Arc::default() })))
    }

    /// Ends the bag.
    ///
    /// # Errors
    /// The first [`WriteError`] of the run; what was written before it can be read.
    pub(super) fn finish(self) -> Result<(), WriteError> {
        self.0.map_or(Ok(()), |bag| bag.recorder.finish().map(|_| ()))
    }
}

/// Waits for the disk if it is far behind.
impl MissionObserver for Recording {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        let Some(bag) = &self.0 else { return ControlFlow::Continue(()) };
        let (frames, frame) = (bag.frames.clone(), frame.clone());
        let map_from_base = step.localization.map_from_base();
        bag.recorder.submit(move |file| {
            let mut frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
            frames.write(file, &frame, map_from_base.as_ref())
        });
        ControlFlow::Continue(())
    }
}
