//! Where the robot is: from sensor frames to a pose on the map.

use crate::map::Map;
use fht_client::PoseReport;
#[cfg(feature = "descriptor")]
use fht_descriptor::DescriptorNet;
use fht_localization::LiveLandmarks;
use fht_localization::localizer::{Localization, Localizer, LocalizerConfig};
use fht_navigation::disambiguation::{Ambiguity, DisambiguationConfig};
use fht_navigation::local_map::{LocalMap, LocalMapConfig};
use fht_navigation::people::{BystanderConfig, Bystanders};
use fht_navigation::searching::Searcher;
use fht_navigation::steering::SteeringConfig;
use fht_navigation::wandering::WanderingConfig;
use fht_perception::candidate::PossiblePlace;
#[cfg(feature = "descriptor")]
use fht_perception::frame::Panorama;
use fht_perception::frame::{FrameError, SensorFrame, Twist};
use fht_perception::pose::Pose2;
use fht_proto::Descriptor;
use fht_proto::api::fleet::LocalizationState;
use fht_worker::Taking;

impl Map {
    /// A localizer that finds the robot's place on this map, without a guess, and keeps it. What it
    /// finds is what the robot publishes of itself. [`Map::go`] has one of its own, and finds the
    /// place by itself.
    ///
    /// ```no_run
    /// # use fht::{LocalizerConfig, Map, Pose2, Robot, Twist};
    /// # type Found = Result<Pose2, Box<dyn std::error::Error>>;
    /// # async fn find(map: Map, mut robot: impl Robot) -> Found {
    /// let mut localizer = map.localizer(LocalizerConfig::default());
    /// let pose = loop {
    ///     let frame = robot.sense().await?;
    ///     match localizer.update(&frame)?.pose() {
    ///         Some(pose) => break pose,
    ///         None => robot.drive(localizer.search(&frame)).await?,
    ///     }
    /// };
    /// robot.drive(Twist::default()).await?; // it drives on else
    /// # Ok(pose)
    /// # }
    /// ```
    #[must_use]
    pub fn localizer(&self, config: LocalizerConfig) -> MapLocalizer {
        let footprint = &self.inner.footprint;
        MapLocalizer {
            map: self.clone(),
            live: LiveLandmarks::start(Taking::WhenThere, self.inner.replica.generation()),
            localizer: Localizer::new(config),
            bystanders: Bystanders::new(BystanderConfig::default()),
            local_map: LocalMap::new(LocalMapConfig::default()),
            searcher: Searcher::new(
                DisambiguationConfig::of(footprint),
                WanderingConfig::of(footprint),
                SteeringConfig::of(footprint),
                0,
            ),
            last_us: None,
            #[cfg(feature = "descriptor")]
            cameras: None,
        }
    }
}

/// Why a frame was not used. The robot's pose stays what it was; the next frame may be better.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UpdateError {
    /// Nothing can be made of it.
    #[error("the sensor frame is not usable: {0}")]
    Frame(#[from] FrameError),
    /// It is older than the one before.
    #[error("the sensor frame of {time_us} µs came after the one of {last_us} µs")]
    WentBack {
        /// Its time.
        time_us: u64,
        /// The time of the one before.
        last_us: u64,
    },
}

/// What the robot knows of where it is after a frame.
#[derive(Clone, Debug)]
pub struct LocalizerState {
    localization: Localization,
    candidates: Vec<PossiblePlace>,
}

impl LocalizerState {
    /// The robot's pose in the map frame, if it knows.
    #[must_use]
    pub fn pose(&self) -> Option<Pose2> {
        self.localization.map_from_base()
    }

    /// Where the robot may be while it does not know, likeliest first.
    #[must_use]
    pub fn candidates(&self) -> &[PossiblePlace] {
        &self.candidates
    }

    /// Whether it knows: not localized, candidates, localized, or lost.
    #[must_use]
    pub fn state(&self) -> LocalizationState {
        self.localization.state
    }

    /// Probability that the pose, or the likeliest candidate, is right: 0 to 1.
    #[must_use]
    pub fn confidence(&self) -> f64 {
        self.localization.confidence
    }

    /// The rest: corrected odometry, the transform from the odometry frame to the map frame, what
    /// the fix rests on.
    #[must_use]
    pub fn localization(&self) -> &Localization {
        &self.localization
    }

    fn report(&self) -> PoseReport {
        PoseReport {
            state: self.state(),
            confidence: self.confidence(),
            candidates: self.candidates.clone(),
            map_from_base: self.pose(),
            lost_because: self.localization.lost.map(|reason| reason.to_string()),
        }
    }
}

/// Finds the robot's place on a map, without a guess, and keeps it; made by [`Map::localizer`]. The
/// map may change meanwhile.
#[doc(alias = "Localizer")]
pub struct MapLocalizer {
    map: Map,
    live: LiveLandmarks,
    localizer: Localizer,
    bystanders: Bystanders,
    local_map: LocalMap,
    searcher: Searcher,
    last_us: Option<u64>,
    #[cfg(feature = "descriptor")]
    cameras: Option<DescriptorNet>,
}

impl MapLocalizer {
    /// Uses the robot's cameras, too: panoramas in its frames are described by `net`, which must be
    /// of the model that the map was made with. Without cameras the place is found by the scanner
    /// alone.
    #[cfg(feature = "descriptor")]
    #[must_use]
    pub fn with_cameras(mut self, net: DescriptorNet) -> Self {
        self.cameras = Some(net);
        self
    }

    /// Takes in a frame. The first frames of a run need the longest: what all nodes of the map saw
    /// is put together then.
    ///
    /// # Errors
    /// [`UpdateError`]; the frame is left out.
    pub fn update(&mut self, frame: &SensorFrame) -> Result<LocalizerState, UpdateError> {
        frame.check()?;
        if let Some(last_us) = self.last_us.filter(|&last_us| frame.time_us < last_us) {
            return Err(UpdateError::WentBack { time_us: frame.time_us, last_us });
        }
        self.last_us = Some(frame.time_us);
        self.follow_map();
        let (landmarks, localizer) = (self.live.landmarks(), &mut self.localizer);
        let lasting = self.bystanders.hide(frame);
        localizer.expect_people(self.bystanders.walkers());
        #[cfg(feature = "descriptor")]
        let localization =
            localizer.update(landmarks, &lasting, || describe(self.cameras.as_mut()?, frame.panorama.as_ref()?));
        #[cfg(not(feature = "descriptor"))]
        let localization = localizer.update(landmarks, &lasting, || None::<Descriptor>);
        self.local_map.integrate(&localization.odometry, &lasting.scan);
        let knows = localization.map_from_odom.is_some();
        if knows {
            self.searcher.end();
        }
        let candidates = if knows { Vec::new() } else { self.localizer.candidates() };
        let state = LocalizerState { localization, candidates };
        self.map.inner.set_pose(state.report());
        Ok(state)
    }

    fn follow_map(&mut self) {
        let replica = &self.map.inner.replica;
        if self.live.restart_at(replica.generation()) {
            self.localizer.replace_map();
        }
        self.live.follow(replica.changes(), |follow| follow(&replica.running()));
    }

    /// While the place is not known: how to move to see more, clear of obstacles. Call it for the
    /// frame that was taken in last, and drive so until the next.
    pub fn search(&mut self, frame: &SensorFrame) -> Twist {
        let odom_from_base = self.localizer.current().odometry.odom_from_base;
        let candidates = self.localizer.relocalizer().ambiguity();
        let landmarks = self.live.landmarks();
        let ambiguity = landmarks.has_walls().then(|| Ambiguity { known: &landmarks.walls().known, candidates });
        self.searcher.step(ambiguity.as_ref(), &self.local_map, &odom_from_base, &frame.scan)
    }
}

#[cfg(feature = "descriptor")]
pub(crate) fn describe(net: &mut DescriptorNet, panorama: &Panorama) -> Option<Descriptor> {
    let components = net.describe(panorama);
    let components = components.inspect_err(|error| tracing::warn!(%error, "no descriptor of this panorama")).ok()?;
    Some(Descriptor::quantise(net.model().id, &components))
}
