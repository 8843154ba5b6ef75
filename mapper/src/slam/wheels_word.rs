//! Wheels against scans: a scan that contradicts the map has many causes, and that the robot is
//! elsewhere is the rarest. It is so only where the scan also contradicts what was seen a moment
//! ago, at the place to which the wheels say the robot has moved since.

use super::estimate::Tracking;
use super::witness::{WITNESSES, WheelsWord, Witness};
use super::{Latest, Slam, is_beyond};
use fht_perception::frame::LaserScan;
use fht_perception::matching::{Prior, ScanMatch};
use fht_perception::pose::{Pose2, wrap_angle};
use fht_perception::shared_view::{SharedView, Verdict};
use nalgebra::Vector3;
use std::sync::Arc;

impl Slam {
    /// Holds the newest scan against what was seen before, where the wheels say; and what the scan
    /// before alone says of it.
    pub(super) fn hear_witnesses(&self, scan: &LaserScan, odom_from_base: &Pose2) -> (WheelsWord, Verdict) {
        let config = &self.config.view;
        let verdict = |witness: &Witness| {
            let moved = self.calibration.correct(&(witness.odom_from_base.inverse() * odom_from_base));
            SharedView::of(&witness.scan, scan, &moved, config).verdict(config)
        };
        let step = self.witnesses.newest.as_ref().map_or(Verdict::Open, verdict);
        let is_broken = self.witnesses.is_broken || step == Verdict::Contradict;
        let agrees = |witness: &Witness| verdict(witness) == Verdict::Agree;
        let word = if (!is_broken && step == Verdict::Agree) || self.witnesses.believed.iter().rev().any(agrees) {
            WheelsWord::Confirmed
        } else if is_broken {
            WheelsWord::Refuted
        } else {
            WheelsWord::Open
        };
        (word, step)
    }

    /// Whether the wheels and the scan before leave room for a match: it is where the wheels' word
    /// (`prior`) lets it be, or the scan before does not agree with the wheels alone.
    pub(super) fn is_heard(&self, found: &ScanMatch, prior: &Prior, latest: &Latest, scan: &LaserScan) -> bool {
        let Some(before) = self.witnesses.newest.as_ref() else { return true };
        if is_near(found, prior, self.config.wheels_sigmas) {
            return true;
        }
        let agrees = |submap_from_base: &Pose2| {
            let moved = latest.submap_from_base.inverse() * submap_from_base;
            let view = SharedView::of(&before.scan, scan, &moved, &self.config.view);
            view.verdict(&self.config.view) == Verdict::Agree
        };
        agrees(&found.reference_from_moving) || !agrees(&prior.reference_from_moving)
    }

    /// Remembers the newest scan, and what it said.
    pub(super) fn remember(&mut self, scan: &LaserScan, odom_from_base: &Pose2, word: WheelsWord) {
        let witness = Witness { scan: Arc::new(scan.clone()), odom_from_base: *odom_from_base };
        let witnesses = &mut self.witnesses;
        witnesses.is_broken = word == WheelsWord::Refuted;
        let spacing = (self.config.keyframe_distance_m, self.config.keyframe_turn_rad);
        let is_new =
            |last: &Witness| is_beyond(&(last.odom_from_base.inverse() * odom_from_base), spacing.0, spacing.1);
        if word != WheelsWord::Refuted && witnesses.believed.back().is_none_or(is_new) {
            witnesses.believed.push_back(witness.clone());
            if witnesses.believed.len() > WITNESSES {
                witnesses.believed.pop_front();
            }
        }
        witnesses.newest = Some(witness);
    }

    /// Nothing speaks against the robot's being where it is thought to be.
    pub(super) fn believe(&mut self, tracking: Tracking) {
        self.contradicted_m = 0.0;
        self.searches_in_vain = 0;
        self.was_lost = false;
        self.tracking = tracking;
    }
}

/// A match that was found without the wheels' word (`prior`), as if that had been heard: what it
/// alone knows is then its information less that of the wheels, as with all others.
pub(super) fn in_light_of(found: ScanMatch, prior: &Prior) -> Option<ScanMatch> {
    let covariance = (found.covariance.try_inverse()? + prior.information).try_inverse()?;
    Some(ScanMatch { covariance, ..found })
}

/// A match in spite of contradictions, if it is where the wheels' word (`prior`) lets it be: with
/// less weight, because what does not fit may have pulled at it.
pub(super) fn discounted(found: ScanMatch, prior: &Prior, most_sigmas: f64) -> Option<ScanMatch> {
    let scan_information = found.covariance.try_inverse()? - prior.information;
    let covariance = (scan_information * found.score * found.score + prior.information).try_inverse()?;
    is_near(&found, prior, most_sigmas).then_some(ScanMatch { covariance, ..found })
}

/// Whether a match is within so many standard deviations of the wheels' word.
fn is_near(found: &ScanMatch, prior: &Prior, most_sigmas: f64) -> bool {
    let (there, expected) = (&found.reference_from_moving, &prior.reference_from_moving);
    let off = there.translation.vector - expected.translation.vector;
    let off = Vector3::new(off.x, off.y, wrap_angle(there.rotation.angle() - expected.rotation.angle()));
    off.dot(&(prior.information * off)) <= most_sigmas * most_sigmas
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    #[test]
    fn what_a_match_found_elsewhere_knows_by_itself_is_never_less_than_nothing() {
        // Along a corridor the scan knows nothing, and the wheels know a lot.
        let covariance = Matrix3::from_diagonal(&Vector3::new(100.0, 1e-6, 1e-7));
        let prior = Prior { reference_from_moving: Pose2::identity(), information: Matrix3::identity() * 1e4 };
        let found = ScanMatch { reference_from_moving: Pose2::identity(), covariance, score: 0.7 };
        let heard = in_light_of(found, &prior).and_then(|found| found.covariance.try_inverse());
        let own = heard.unwrap_or_else(Matrix3::zeros) - prior.information;
        for (index, knows) in [0.01, 1e6, 1e7].into_iter().enumerate() {
            assert!((own[(index, index)] / knows - 1.0).abs() < 1e-3, "{own}");
        }
    }
}
