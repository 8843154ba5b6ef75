//! What a run leaves beside its map: a recording and a picture.

use super::picture::{PictureTask, RunPicture};
use super::record::RunRecorder;
use crate::mapping::Mapper;
use crate::run::{MappedFrame, MappingObserver};
use fht_bag::WriteError;
use fht_picture::PictureError;
use fht_program::print_line;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Why there is no recording, or no picture.
#[derive(Debug, thiserror::Error)]
pub enum KeepError {
    /// The recording failed.
    #[error("the recording failed: {0}")]
    Record(#[from] WriteError),
    /// The picture failed.
    #[error("there is no picture of the map: {0}")]
    Picture(#[from] PictureError),
}

impl KeepError {
    /// Whether what was given is wrong, and not the run: a recording is there already.
    #[must_use]
    pub fn is_input(&self) -> bool {
        matches!(self, Self::Record(WriteError::Exists { .. }))
    }
}

/// What was left of what was to be left.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Kept {
    /// The recording of the run, if one was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<PathBuf>,
    /// The picture of the map, if one was made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture: Option<PathBuf>,
    /// Why the recording or the picture that was asked for is not there, or not whole. The figures
    /// hold all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_kept: Option<String>,
}

impl Kept {
    pub(super) fn print(&self) {
        if let Some(recording) = &self.recording {
            print_line!("recording   {}", recording.display());
        }
        if let Some(picture) = &self.picture {
            print_line!("picture     {}", picture.display());
        }
    }

    /// Whether all is there that was asked for; says why, if not.
    pub(super) fn tell(&self) -> bool {
        self.not_kept.iter().for_each(|why| fht_program::tell_line!("mapper: {why}"));
        self.not_kept.is_none()
    }
}

/// Records a run and draws its map, as far as either was asked for.
pub(super) struct RunKeeper {
    recorder: RunRecorder,
    picture: RunPicture,
}

impl RunKeeper {
    /// A bag at `record` and a picture, if they are given.
    ///
    /// # Errors
    /// [`KeepError`] when there is something where the bag is to be.
    pub(super) fn new(record: Option<&Path>, picture: Option<PictureTask>) -> Result<Self, KeepError> {
        Ok(Self { recorder: RunRecorder::new(record)?, picture: RunPicture::new(picture) })
    }

    /// What was kept of a run of so many `frames`, after its end.
    ///
    /// # Errors
    /// [`KeepError`] if the recording could not even begin. It ended the run with its first frame,
    /// so there is nothing to be told of it.
    pub(super) fn finish(mut self, frames: usize) -> Result<Kept, KeepError> {
        let recorded = self.recorder.finish().map_err(KeepError::from);
        let drawn = self.picture.finish().map_err(KeepError::from);
        let (recording, picture, failure) = match (recorded, drawn) {
            (Err(failure), _) if frames <= 1 => return Err(failure),
            (Err(failure), drawn) => (None, drawn.ok().flatten(), Some(failure)),
            (Ok(recording), Err(failure)) => (recording, None, Some(failure)),
            (Ok(recording), Ok(picture)) => (recording, picture, None),
        };
        Ok(Kept { recording, picture, not_kept: failure.map(|failure| failure.to_string()) })
    }
}

impl MappingObserver for RunKeeper {
    fn on_start(&mut self, mapper: &Mapper) {
        self.recorder.on_start(mapper);
        self.picture.on_start(mapper);
    }

    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        let goes_on = self.recorder.on_frame(mapped);
        if self.picture.on_frame(mapped).is_break() { ControlFlow::Break(()) } else { goes_on }
    }

    fn on_end(&mut self, mapper: &Mapper) {
        self.recorder.on_end(mapper);
        self.picture.on_end(mapper);
    }
}
