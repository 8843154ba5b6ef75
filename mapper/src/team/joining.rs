//! Joining a map that others have begun: the robot explores in a frame of its own until it has
//! found out where that lies in the map.
//!
//! It finds itself as any robot does that uses the map (`fht_localization::localizer`). A wrong
//! place would spoil the map for everybody, so the fix must hold while the robot drives on, and two
//! fixes apart must say the same.

use fht_localization::landmarks::Landmarks;
use fht_localization::localizer::{Localizer, LocalizerConfig};
use fht_localization::preparation::Preparation;
use fht_map::MapState;
use fht_perception::candidate::PossiblePlace;
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Pose2, wrap_angle};
use fht_proto::Descriptor;
use fht_proto::api::fleet::LocalizationState;
use fht_worker::Taking;
use serde::{Deserialize, Serialize};

/// When a place is believed.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct JoinConfig {
    /// Finding it.
    pub localize: LocalizerConfig,
    /// It must hold over this much driving, metres. Default 1.
    pub confirm_m: f64,
    /// Where the run's frame lies must be the same then and now but for this, metres. Default 0.15.
    pub agree_m: f64,
    /// And this, radians. Default 0.02.
    pub agree_rad: f64,
    /// The robot stands for so long at the start while the map has no main node: another explorer
    /// is about to begin it, perhaps beside it. Seconds. Default 30.
    pub wait_s: f64,
    /// Whether the robot looks at everything again with its own eyes, as when the building has
    /// changed; else it goes only where nobody has been. Default false.
    pub looks_again: bool,
}

impl Default for JoinConfig {
    fn default() -> Self {
        Self {
            localize: LocalizerConfig::default(),
            confirm_m: 1.0,
            agree_m: 0.15,
            agree_rad: 0.02,
            wait_s: 30.0,
            looks_again: false,
        }
    }
}

/// A fix that has to prove itself.
struct Claim {
    map_from_run: Pose2,
    odometer_m: f64,
}

/// A robot that looks for its place in the map.
pub struct Joining {
    config: JoinConfig,
    localizer: Localizer,
    landmarks: Landmarks,
    preparation: Preparation,
    claim: Option<Claim>,
}

impl Joining {
    /// Knows nothing yet; `taking` says when what is made beside the loop is used.
    #[must_use]
    pub fn new(config: JoinConfig, taking: Taking) -> Self {
        Self {
            localizer: Localizer::new(config.localize.clone()),
            landmarks: Landmarks::default(),
            preparation: Preparation::start(taking),
            claim: None,
            config,
        }
    }

    /// The map has changed.
    pub fn follow(&mut self, map: &MapState) {
        self.preparation.follow(&mut self.landmarks, map);
    }

    /// What the robot says of where it is.
    #[must_use]
    pub fn state(&self) -> LocalizationState {
        self.localizer.current().state
    }

    /// Where it may be, likeliest first.
    #[must_use]
    pub fn candidates(&self) -> Vec<PossiblePlace> {
        self.localizer.candidates()
    }

    /// How probable the likeliest is, 0 to 1.
    #[must_use]
    pub fn confidence(&self) -> f64 {
        self.localizer.current().confidence
    }

    /// Whether there is nothing yet to find a place by.
    #[must_use]
    pub fn is_map_bare(&self) -> bool {
        self.landmarks.is_empty()
    }

    /// Takes in a frame at which the robot was at `run_from_base` in its own frame. Where that
    /// frame lies in the map, once it is known.
    pub fn update(
        &mut self,
        frame: &SensorFrame,
        run_from_base: &Pose2,
        describe: impl FnOnce() -> Option<Descriptor>,
    ) -> Option<Pose2> {
        self.preparation.take(&mut self.landmarks);
        if self.landmarks.is_empty() {
            return None;
        }
        let localization = self.localizer.update(&self.landmarks, frame, describe);
        let Some(map_from_base) = localization.map_from_base() else {
            self.claim = None;
            return None;
        };
        let map_from_run = map_from_base * run_from_base.inverse();
        let odometer_m = localization.odometry.odometer_m;
        let Some(claim) = self.claim.as_ref().filter(|_| !localization.is_new_fix) else {
            self.claim = Some(Claim { map_from_run, odometer_m });
            return None;
        };
        if odometer_m - claim.odometer_m < self.config.confirm_m {
            return None;
        }
        // Compared where the robot is: far from the origin a little turn is a long way.
        let off = (claim.map_from_run * run_from_base).inverse() * map_from_base;
        let agrees = off.translation.vector.norm() <= self.config.agree_m
            && wrap_angle(off.rotation.angle()).abs() <= self.config.agree_rad;
        if !agrees {
            tracing::warn!(
                off_m = off.translation.vector.norm(),
                "the place found in the map does not hold: looking on"
            );
            self.claim = Some(Claim { map_from_run, odometer_m });
            return None;
        }
        Some(map_from_run)
    }
}
