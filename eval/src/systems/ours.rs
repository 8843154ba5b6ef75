//! Relocalization on an FHT-Map, as the client robot does it.

use super::Localizing;
use fht_localization::landmarks::Landmarks;
use fht_localization::localizer::{Localizer, LocalizerConfig};
use fht_navigation::people::{BystanderConfig, Bystanders};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::Pose2;
use fht_proto::Descriptor;

/// The client robot's localizer.
pub struct Ours<'a> {
    landmarks: &'a Landmarks,
    localizer: Localizer,
    bystanders: Bystanders,
    has_cameras: bool,
}

impl<'a> Ours<'a> {
    /// On the nodes of a map. Without cameras, by the scanner alone.
    #[must_use]
    pub fn new(landmarks: &'a Landmarks, has_cameras: bool) -> Self {
        Self::with_config(landmarks, has_cameras, LocalizerConfig::default())
    }

    /// The same, as configured.
    #[must_use]
    pub fn with_config(landmarks: &'a Landmarks, has_cameras: bool, config: LocalizerConfig) -> Self {
        let bystanders = Bystanders::new(BystanderConfig::default());
        Self { landmarks, localizer: Localizer::new(config), bystanders, has_cameras }
    }
}

impl Localizing for Ours<'_> {
    fn update(&mut self, frame: &SensorFrame, describe: &mut dyn FnMut() -> Option<Descriptor>) -> Option<Pose2> {
        let has_cameras = self.has_cameras;
        let look = || if has_cameras { describe() } else { None };
        let lasting = self.bystanders.hide(frame);
        self.localizer.expect_people(self.bystanders.walkers());
        self.localizer.update(self.landmarks, &lasting, look).map_from_base()
    }
}
