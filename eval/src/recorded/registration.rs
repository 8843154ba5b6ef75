//! Where the places of a log lie in a map of the same building.
//!
//! Both were made by SLAM and are bent, each in its own way. So there is no one transformation:
//! what holds is that of a known place near.

use fht_perception::pose::{Pose2, wrap_angle};

/// Two fixes agree on where the log lies in the map within this, metres.
const AGREE_M: f64 = 1.0;
/// … and so much more for each metre between them: both maps are bent.
const AGREE_PER_M: f64 = 0.01;
/// The same for headings, radians.
const AGREE_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// A place of the map is told by what the log says of those within this distance, metres: as far as
/// a scanner sees well.
const NEAR_M: f64 = 15.0;

/// Poses of the same places in the log and in the map.
#[derive(Clone, Debug)]
pub struct Registration {
    pairs: Vec<(Pose2, Pose2)>,
}

impl Registration {
    /// `pairs` are poses of the same places in the log's frame and in the map's.
    #[must_use]
    pub fn of_pairs(pairs: Vec<(Pose2, Pose2)>) -> Self {
        Self { pairs }
    }

    /// From what robots declared, where nobody knows better: `fixes` are true poses in the log's
    /// frame and declared ones in the map's. Of sets of fixes that agree with one of them, the
    /// largest is right.
    #[must_use]
    pub fn of_fixes(fixes: &[(Pose2, Pose2)]) -> Self {
        let agreeing = |one: &(Pose2, Pose2)| -> Vec<(Pose2, Pose2)> {
            fixes.iter().filter(|other| agree(one, other)).copied().collect()
        };
        let sets = fixes.iter().map(agreeing);
        // The first of the largest.
        let largest = sets.reduce(|best, other| if other.len() > best.len() { other } else { best });
        Self { pairs: largest.unwrap_or_default() }
    }

    /// Where a place of the log lies in the map, by the nearest place that is known in both; `None`
    /// if there is none.
    #[must_use]
    pub fn map_from_base(&self, log_from_base: &Pose2) -> Option<Pose2> {
        let distance = |(log, _): &&(Pose2, Pose2)| distance_m(log, log_from_base);
        let (log, map) = self.pairs.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        Some(map * (log.inverse() * log_from_base))
    }

    /// The same for a robot that says that it is at `said`. Where a loop of the map is open, the
    /// map lies over itself, a little apart: right is what agrees with one of the passes that the
    /// map was made from near the place that was said.
    #[must_use]
    pub fn map_from_base_near(&self, log_from_base: &Pose2, said: &Pose2) -> Option<Pose2> {
        let near = self.pairs.iter().filter(|(_, map)| distance_m(map, said) <= NEAR_M);
        let by_passes = near.map(|(log, map)| map * (log.inverse() * log_from_base));
        by_passes.chain(self.map_from_base(log_from_base)).min_by(|a, b| {
            let distance = |pose: &Pose2| distance_m(pose, said);
            distance(a).total_cmp(&distance(b))
        })
    }
}

fn distance_m(a: &Pose2, b: &Pose2) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}

fn agree((log, map): &(Pose2, Pose2), (other_log, other_map): &(Pose2, Pose2)) -> bool {
    let expected = map * (log.inverse() * other_log);
    let turn = wrap_angle(expected.rotation.angle() - other_map.rotation.angle());
    distance_m(&expected, other_map) <= AGREE_M + AGREE_PER_M * distance_m(log, other_log) && turn.abs() <= AGREE_RAD
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use std::f64::consts::PI;

    #[test]
    fn the_largest_set_of_fixes_that_agree_tells_where_the_log_lies() {
        let map_from_log = pose(10.0, -3.0, 1.0);
        let at = |x: f64| pose(x, 0.5 * x, 0.1 * x);
        let mut fixes: Vec<(Pose2, Pose2)> =
            (0..6).map(|x| (at(f64::from(x)), map_from_log * at(f64::from(x)))).collect();
        // Turned by half a turn, as in a corridor, twice.
        fixes.insert(0, (at(2.0), map_from_log * at(2.0) * pose(0.0, 0.0, PI)));
        fixes.insert(3, (at(2.5), map_from_log * at(2.0) * pose(0.0, 0.0, PI)));
        let registration = Registration::of_fixes(&fixes);
        let found = registration.map_from_base(&at(7.0)).unwrap();
        assert!(distance_m(&found, &(map_from_log * at(7.0))) < 1e-9);
        assert!(Registration::of_fixes(&[]).map_from_base(&at(0.0)).is_none());
    }
}
