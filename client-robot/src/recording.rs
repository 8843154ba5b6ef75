//! A client's run as a bag: what the sensors said, and where the robot thought it was.

use crate::pilot::Step;
use fht_robot::bag::{FrameRecording, Recorder, WriteError, WriteReport};
use fht_robot::frame::SensorFrame;
use fht_robot::stop::Stop;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Writes a run while it goes on: frames, and the transform `map → odom` from when the robot knows its place.
pub struct Recording {
    recorder: Option<Recorder>,
    frames: Arc<Mutex<FrameRecording>>,
    stop: Stop,
}

impl Recording {
    /// Begins a bag at `path`: an `.mcap` file, or else a folder. Ctrl-C ends the bag properly before the program.
    ///
    /// # Errors
    /// [`WriteError`] when something is there already or cannot be made.
    pub fn start(path: &Path) -> Result<Self, WriteError> {
        let stop = Stop::on_signal().map_err(|source| WriteError::Create { path: path.to_owned(), source })?;
        Ok(Self { recorder: Some(Recorder::start(path)?), frames: Arc::default(), stop })
    }

    /// Writes a frame and where the robot thinks it is. Waits for the disk if it is far behind.
    pub fn record(&mut self, frame: &SensorFrame, step: &Step) {
        let Some(recorder) = &self.recorder else { return };
        let (frames, frame) = (self.frames.clone(), frame.clone());
        let map_from_base = step.localization.map_from_base();
        recorder.submit(move |bag| {
            let mut frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
            frames.write(bag, &frame, map_from_base.as_ref())
        });
        if self.stop.is_set() {
            let ended = self.recorder.take().map(Recorder::finish);
            if let Some(Err(error)) = ended {
                eprintln!("client-robot: the recording failed: {error}");
            }
            std::process::exit(130);
        }
    }

    /// Ends the bag.
    ///
    /// # Errors
    /// The first [`WriteError`] of the run; what was written before it can be read.
    pub fn finish(mut self) -> Result<Option<WriteReport>, WriteError> {
        self.recorder.take().map(Recorder::finish).transpose()
    }
}
