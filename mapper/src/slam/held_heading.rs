//! Wheels that have proven themselves hold the heading.
//!
//! Where wheels do no better than is taken for granted, scans alone say where the robot heads.
//! Others are *proven*: where a scan turns such a robot by more than they let it, as bushes do that
//! fit in many ways, the wheels are right; and where it does not, both are heard.

use super::Slam;
use super::submap::Submap;
use fht_perception::matching::{Prior, ScanMatch, refine_with_prior};
use fht_perception::pose::{Point2, Pose2, pose, wrap_angle};

/// Wheels are proven when the variance of their walk is less than this share of what is taken for
/// granted: those that are just as good are now and then learnt to be a little better.
const PROVEN_SHARE: f64 = 0.5;
/// Information of a heading that no scan moves, rad⁻².
const HELD_INFORMATION: f64 = 1e12;
/// A heading that is held by less than this is not worth another match, radians: 1 cm at 10 m.
const LEAST_HELD_RAD: f64 = 0.001;

impl Slam {
    /// A match with the heading between what it says and what wheels that are proven say
    /// (`prior`, after `motion`).
    pub(super) fn hold_heading(
        &mut self,
        submap: &Submap,
        points: &[Point2],
        found: Option<ScanMatch>,
        prior: &Prior,
        motion: &Pose2,
    ) -> Option<ScanMatch> {
        let scan_variance = |found: &ScanMatch| found.covariance[(2, 2)] + self.config.closure.floor_rad.powi(2);
        let scan = found.as_ref().map_or(0.0, scan_variance);
        let granted = self.calibration.walk_variance_per_m();
        let proven = self.heading_walk.variance_per_m().filter(|variance| *variance < PROVEN_SHARE * granted);
        let Some(variance_per_m) = proven.filter(|_| self.is_doubtless()) else {
            self.heading_walk.variance = scan;
            return found;
        };
        let turn = self.calibration.turn_variance(motion.rotation.angle());
        let growth = variance_per_m * motion.translation.vector.norm() + turn;
        let Some(found) = found else {
            self.heading_walk.variance += growth;
            return None;
        };
        let predicted = &prior.reference_from_moving;
        let off_rad = wrap_angle(found.reference_from_moving.rotation.angle() - predicted.rotation.angle());
        let believed_rad = self.heading_walk.weigh(growth, off_rad, scan, self.config.wheels_sigmas);
        if (off_rad - believed_rad).abs() < LEAST_HELD_RAD {
            return Some(found);
        }
        let mut held = prior.clone();
        let heading_rad = predicted.rotation.angle() + believed_rad;
        held.reference_from_moving = pose(predicted.translation.x, predicted.translation.y, heading_rad);
        held.information[(2, 2)] += HELD_INFORMATION;
        let held = refine_with_prior(submap.cloud(), points, &held, &self.config.matching);
        let is_convincing = |found: &ScanMatch| self.is_convincing(submap, points, found);
        // Walls that fit as the scan says, and not where the wheels say: these have slipped.
        let has_slipped = is_convincing(&found) && !held.as_ref().is_some_and(is_convincing);
        let Some(mut held) = held.filter(|_| !has_slipped) else {
            self.heading_walk.variance = scan;
            return has_slipped.then_some(found);
        };
        held.covariance[(2, 2)] += self.heading_walk.variance;
        Some(held)
    }
}
