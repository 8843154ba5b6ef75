//! Closures after a long way, held back until enough keyframes say the same.
//!
//! A wrong match implies a correction of its own, and right ones all imply the same one, so that
//! agreement tells more than how well one match fits: a scanner of half a turn that comes back
//! along its way sees so little of what it saw then that no match is good enough for itself
//! (compare Mangelson et al., "Pairwise consistent measurement set maximization", ICRA 2018).

use super::config::ClosureConfig;
use fht_perception::pose::{Pose2, wrap_angle};
use fht_perception::pose_graph::PoseConstraint;
use std::collections::BTreeMap;

/// So many wait; the oldest go.
const MOST: usize = 40;

/// One keyframe's word for a closure.
#[derive(Clone, Debug)]
struct Witness {
    edge: PoseConstraint,
    /// The correction in the map frame that it implies.
    correction: Pose2,
    /// Whether the match is good enough for itself.
    is_sure: bool,
}

/// Closures that wait for others that say the same.
#[derive(Debug, Default)]
pub(super) struct Witnesses(Vec<Witness>);

impl Witnesses {
    /// Hears one more; `poses` are the graph's. Returns those that agree, once they are enough: one
    /// of each keyframe, since the same scan seen twice is one witness. None waits then.
    pub(super) fn hear(
        &mut self,
        edge: PoseConstraint,
        is_sure: bool,
        poses: &[Pose2],
        config: &ClosureConfig,
    ) -> Option<Vec<PoseConstraint>> {
        let here = poses[edge.to];
        let correction = poses[edge.from] * edge.measured * here.inverse();
        self.0.push(Witness { edge, correction, is_sure });
        let agrees = |other: &&Witness| {
            let apart = (other.correction * here).inverse() * (correction * here);
            apart.translation.vector.norm() < config.agreement_m
                && wrap_angle(apart.rotation.angle()).abs() < config.agreement_rad
        };
        let agreeing: BTreeMap<usize, &Witness> =
            self.0.iter().filter(agrees).map(|witness| (witness.edge.to, witness)).collect();
        let sure = agreeing.values().filter(|witness| witness.is_sure).count();
        let doubtful = agreeing.len() - sure;
        if sure * config.doubtful_per_sure + doubtful < config.agreeing * config.doubtful_per_sure {
            let excess = self.0.len().saturating_sub(MOST);
            self.0.drain(..excess);
            return None;
        }
        let edges = agreeing.into_values().map(|witness| witness.edge.clone()).collect();
        self.0.clear();
        Some(edges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use nalgebra::Matrix3;

    /// A robot that has driven 100 m, and truly is `off` from where the graph says.
    struct Way {
        poses: Vec<Pose2>,
        witnesses: Witnesses,
    }

    impl Way {
        fn new() -> Self {
            let poses = (0..100).map(|metres| pose(f64::from(metres), 0.0, 0.0)).collect();
            Self { poses, witnesses: Witnesses::default() }
        }

        /// How many are believed when keyframe `to` is matched to the first with this correction.
        fn hear(&mut self, to: usize, off: Pose2, is_sure: bool) -> usize {
            let measured = self.poses[0].inverse() * off * self.poses[to];
            let edge = PoseConstraint { from: 0, to, measured, information: Matrix3::identity(), is_doubtful: true };
            let config = ClosureConfig::default();
            self.witnesses.hear(edge, is_sure, &self.poses, &config).map_or(0, |edges| edges.len())
        }
    }

    #[test]
    fn three_that_are_sure_are_believed_or_six_that_are_not() {
        // A turned way: the farther on, the greater the offset, and it is one correction.
        let off = pose(0.3, 2.0, 0.06);
        for (is_sure, expected) in [
            (vec![true; 3], 3),
            (vec![false; 6], 6),
            (vec![true, false, false, true], 4),
            (vec![false, false, true, false, false], 5),
        ] {
            let mut way = Way::new();
            let last = is_sure.len() - 1;
            for (number, &is_sure) in is_sure.iter().enumerate() {
                let believed = way.hear(50 + 4 * number, off, is_sure);
                assert_eq!(believed, if number == last { expected } else { 0 }, "{number} of {expected}");
            }
            assert_eq!(way.hear(90, off, true), 0, "they are not heard twice");
        }
    }

    #[test]
    fn who_contradicts_or_repeats_itself_is_no_witness() {
        let mut way = Way::new();
        let off = pose(0.3, 2.0, 0.06);
        for again in 0..5 {
            assert_eq!(way.hear(50, off, true), 0, "{again}: one keyframe");
        }
        for number in 0_u8..30 {
            let elsewhere = pose(0.5 * f64::from(number), -3.0, 0.0);
            assert_eq!(way.hear(51 + usize::from(number), elsewhere, false), 0, "each says something else");
        }
        assert_eq!(way.hear(90, off, true), 0);
        assert_eq!(way.hear(94, off, true), 3, "who disagrees does no harm");
    }

    #[test]
    fn what_waits_is_bounded() {
        let mut way = Way::new();
        for number in 0_u16..500 {
            way.hear(usize::from(number % 100), pose(f64::from(number), 0.0, 0.0), true);
        }
        assert_eq!(way.witnesses.0.len(), MOST);
    }
}
