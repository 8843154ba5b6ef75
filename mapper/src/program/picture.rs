//! The map that a run made, as a picture.

use super::way::WayDriven;
use crate::mapping::Mapper;
use crate::run::{MappedFrame, MappingObserver};
use fht_perception::pose::Point2;
use fht_picture::{MapPicture, Mark, PictureConfig, PictureError};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// A picture to make of the map at the end of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PictureTask {
    /// The PNG file.
    pub file: PathBuf,
    /// Above the picture.
    pub title: String,
}

/// Draws the map when the run has ended, however it did, unless nothing was seen.
pub(super) struct RunPicture {
    task: Option<PictureTask>,
    way: WayDriven,
    outcome: Option<Result<PathBuf, PictureError>>,
}

impl RunPicture {
    pub(super) fn new(task: Option<PictureTask>) -> Self {
        Self { task, way: WayDriven::default(), outcome: None }
    }

    /// After the run's end: the picture's file, if there is one.
    ///
    /// # Errors
    /// [`PictureError`] if it cannot be made.
    pub(super) fn finish(&mut self) -> Result<Option<PathBuf>, PictureError> {
        self.outcome.take().transpose()
    }
}

impl MappingObserver for RunPicture {
    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        if self.task.is_some() {
            self.way.follow(mapped.mapper);
        }
        ControlFlow::Continue(())
    }

    fn on_end(&mut self, mapper: &Mapper) {
        let Some(PictureTask { file, title }) = self.task.take() else { return };
        let driven: Vec<Point2> =
            self.way.poses(mapper).map(|(_, pose)| Point2::from(pose.translation.vector)).collect();
        let ends = driven.first().map(|start| (Mark::Start, *start));
        let marks: Vec<_> = ends.into_iter().chain(driven.last().map(|end| (Mark::End, *end))).collect();
        // A robot that has not found its place has made no map: it has only seen a floor.
        let title = if mapper.is_placed() { title } else { format!("{title} (not placed in the map)") };
        let picture = MapPicture { title, floor: mapper.grid(), map: mapper.map(), driven: &driven, marks: &marks };
        self.outcome = match picture.save(&PictureConfig::default(), &file) {
            Err(PictureError::Empty) => None,
            outcome => Some(outcome.map(|()| file)),
        };
    }
}
