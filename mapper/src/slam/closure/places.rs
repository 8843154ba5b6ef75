//! Places anywhere in a submap, found without a guess; and whether one of them stands out.

use super::config::ClosureConfig;
use super::matching::judge;
use crate::slam::submap::{Submap, SubmapFit};
use fht_perception::matching::{ScanMatch, SearchWindow, alignments};
use fht_perception::pose::{Point2, Pose2, pose};

/// Two places nearer than this are one, metres and radians.
const ONE_PLACE: (f64, f64) = (1.0, 0.3);

/// Where a scan fits a submap.
pub(super) struct Place {
    /// Where it fits in the submap.
    pub(super) found: ScanMatch,
    /// How well.
    pub(super) fit: SubmapFit,
    /// Where that is in the map.
    pub(super) map_from_base: Pose2,
}

impl Place {
    /// Whether it fits as well as one must who does not know where it is.
    pub(super) fn is_good(&self, config: &ClosureConfig) -> bool {
        self.fit.agreement() >= config.lost_agreement && self.fit.overlap() >= config.lost_overlap
    }

    fn is_elsewhere(&self, other: &Self) -> bool {
        let apart = self.map_from_base.inverse() * other.map_from_base;
        apart.translation.vector.norm() > ONE_PLACE.0 || apart.rotation.angle().abs() > ONE_PLACE.1
    }
}

/// Where a scan may fit in a submap that lies at `map_from_submap`: at headings within
/// `half_yaw_rad` of `yaw_rad`, in the submap's frame.
pub(super) fn places(
    submap: &Submap,
    map_from_submap: &Pose2,
    points: &[Point2],
    (yaw_rad, half_yaw_rad): (f64, f64),
    config: &ClosureConfig,
) -> impl Iterator<Item = Place> {
    let middle = submap.members()[submap.members().len() / 2].translation;
    let window = SearchWindow {
        centre: pose(middle.x, middle.y, yaw_rad),
        half_x_m: config.lost_window_m,
        half_y_m: config.lost_window_m,
        half_yaw_rad,
    };
    alignments(submap.cloud(), points, &window, &config.matching).into_iter().map(move |found| {
        let (found, fit) = judge(submap, points, found);
        let map_from_base = map_from_submap * found.reference_from_moving;
        Place { found, fit, map_from_base }
    })
}

/// The best of good places, if no other one is nearly as good.
pub(super) fn standing_out<T>(mut places: Vec<(Place, T)>, config: &ClosureConfig) -> Option<(Place, T)> {
    let balance = |(place, _): &(Place, T)| place.fit.balance();
    let best = (0..places.len()).max_by_key(|&index| balance(&places[index]))?;
    let rivals = places.iter().filter(|(place, _)| places[best].0.is_elsewhere(place));
    let rival = rivals.map(balance).max();
    let is_clear = rival.is_none_or(|rival| (rival as f64) < config.lost_ambiguity * balance(&places[best]) as f64);
    is_clear.then(|| places.swap_remove(best))
}
