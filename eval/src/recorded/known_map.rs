//! The map that a robot is given.

use crate::recorded::log::RecordedError;
use crate::recorded::registration::Registration;
use fht_localization::landmarks::Landmarks;
use fht_map::MapState;
use fht_perception::frame::SensorFrame;
use fht_perception::pose::Pose2;
use fht_proto::AuthorId;
use mapper::{Mapper, MapperConfig};

/// Frames between two places whose poses are compared.
const PAIR_EVERY: usize = 5;

/// A map, and how the places of the log from which it was made lie in it.
pub struct KnownMap {
    /// Its main nodes.
    pub landmarks: Landmarks,
    /// Known for a map of a part of the log; fixes must tell for other maps.
    pub registration: Option<Registration>,
}

impl KnownMap {
    /// The map that the mapper makes of `frames`. `log_from_base` has the truth of each of them if
    /// they are part of the log that robots are set down in.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn of_frames(
        frames: &[SensorFrame],
        log_from_base: Option<&[Pose2]>,
        mut watch: impl FnMut(usize),
    ) -> Result<Self, RecordedError> {
        let mut mapper = Mapper::new(MapperConfig::default(), AuthorId::of_robot("recorder"), None)?;
        let mut anchors = Vec::with_capacity(frames.len());
        for (index, frame) in frames.iter().enumerate() {
            mapper.observe(frame)?;
            mapper.take_increments();
            anchors.extend(mapper.latest().map(|latest| latest.anchored));
            if index.is_multiple_of(100) {
                watch(index);
            }
        }
        mapper.finish();
        let places = |truth: &[Pose2]| {
            let both = truth.iter().zip(&anchors).step_by(PAIR_EVERY);
            Registration::of_pairs(both.map(|(log, anchored)| (*log, mapper.locate(anchored))).collect())
        };
        let registration = log_from_base.map(places);
        Ok(Self { registration, ..Self::of_state(mapper.map()) })
    }

    /// A map that was made before.
    #[must_use]
    pub fn of_state(map: &MapState) -> Self {
        let mut landmarks = Landmarks::default();
        landmarks.refresh(map);
        Self { landmarks, registration: None }
    }
}
