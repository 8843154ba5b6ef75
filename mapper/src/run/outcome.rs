//! What a run came to.

use crate::explore::Ending;
use crate::mapping::Mapper;
use crate::publish::Progress;
use fht_perception::robot::RobotError;
use fht_proto::VersionVector;
use std::time::Duration;

/// How a run ended, in figures.
#[derive(Debug)]
pub struct MappingSummary {
    /// Why it ended.
    pub ending: Ending,
    /// What the robot said when it could not go on ([`Ending::RobotFailed`]). The map is finished
    /// as it was by then.
    pub robot_error: Option<RobotError>,
    /// Frames mapped.
    pub frames: usize,
    /// Frames that nothing could be made of.
    pub frames_refused: usize,
    /// The map's version: increments of all authors that are in it, as this robot knew it at the
    /// end.
    pub version: u64,
    /// The same increments, author by author; none without a server.
    pub vector: Option<VersionVector>,
    /// Increments that this robot has written, those of its earlier runs included.
    pub written: u64,
    /// Longest time that a frame took, sensing excluded.
    pub frame_max: Duration,
    /// How far publishing came; without a server, what there was to publish.
    pub published: Option<Progress>,
}

impl MappingSummary {
    /// Whether the server has acknowledged everything.
    #[must_use]
    pub fn is_delivered(&self) -> bool {
        self.published.as_ref().is_some_and(|published| published.acknowledged >= self.written)
    }

    /// Number up to which the server has acknowledged everything.
    #[must_use]
    pub fn acknowledged(&self) -> u64 {
        self.published.as_ref().map_or(0, |published| published.acknowledged)
    }

    /// Why the server has not taken what it was sent last, if it says so.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        self.published.as_ref()?.refusal.as_ref().map(ToString::to_string)
    }
}

/// What a run came to.
pub struct MappingOutcome<R, O> {
    /// How it ended.
    pub summary: MappingSummary,
    /// The finished map, and what it rests on.
    pub mapper: Mapper,
    /// The robot.
    pub robot: R,
    /// The observer.
    pub observer: O,
}

impl<R, O> MappingOutcome<R, O> {
    pub(super) fn with(mut self, published: Progress) -> Self {
        self.summary.published = Some(published);
        self
    }
}
