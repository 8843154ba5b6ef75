//! What the two scans of a relation say themselves: aligned with each other alone, without wheels
//! and without a map. So it shows which of the two is off where trajectory and relations differ.

use super::relations::{Relation, pose_at};
use fht_perception::matching::{MatchConfig, ReferenceCloud, ScanMatch, refine};
use fht_perception::pose::{Point2, Pose2};
use serde::Serialize;

/// Both scans must explain so much of each other…
const LEAST_SCORE: f64 = 0.8;
/// … and hold each other so fast in every direction: standard deviation, metres.
const MOST_SIGMA_M: f64 = 0.002;
/// The two directions of an alignment agree to this, metres.
const AGREE_M: f64 = 0.01;
/// How much longer relations are is asked where a robot drove so far between the scans, metres…
const LEAST_DRIVEN_M: f64 = 0.2;
/// … and turned at most so far, radians.
const MOST_TURNED_RAD: f64 = 0.1;

/// Alignments of two scans beside the trajectory and the relations, means over those relations
/// whose scans hold each other fast.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ScanPairs {
    /// Relations whose scans hold each other fast.
    pairs: usize,
    /// How far the trajectory is from the alignment, metres.
    trajectory_off_m: f64,
    /// How far the relations are from the alignment, metres.
    relations_off_m: f64,
    /// How far the trajectory is from the same relations, metres.
    apart_m: f64,
    /// How much longer the relations are than the alignment, where the robot drove straight on.
    relations_longer: f64,
    /// The same of the trajectory.
    trajectory_longer: f64,
}

impl ScanPairs {
    /// Aligns the scans (points in the base's frame) of `trajectory`, one each. `None` if no two
    /// hold each other fast.
    pub fn of(trajectory: &[(u64, Pose2)], scans: &[&[Point2]], relations: &[Relation]) -> Option<Self> {
        let mut sums = [0.0; 3];
        let (mut pairs, mut driven, mut ways) = (0, 0, [0.0; 3]);
        for relation in relations {
            let [Some(first), Some(second)] = relation.times_us.map(|time_us| pose_at(trajectory, time_us)) else {
                continue;
            };
            let known = relation.first_from_second;
            let Some(aligned) = align(scans[first], scans[second], &known) else { continue };
            let ours = trajectory[first].1.inverse() * trajectory[second].1;
            let off = |a: &Pose2, b: &Pose2| (a.translation.vector - b.translation.vector).norm();
            let offs = [off(&ours, &aligned), off(&known, &aligned), off(&ours, &known)];
            sums.iter_mut().zip(offs).for_each(|(sum, off)| *sum += off);
            pairs += 1;
            let way = aligned.translation.vector;
            if way.norm() >= LEAST_DRIVEN_M && aligned.rotation.angle().abs() <= MOST_TURNED_RAD {
                let along = [aligned, known, ours].map(|pose| pose.translation.vector.dot(&way.normalize()));
                ways.iter_mut().zip(along).for_each(|(sum, along)| *sum += along);
                driven += 1;
            }
        }
        let [trajectory_off_m, relations_off_m, apart_m] = sums.map(|sum| sum / f64::from(pairs));
        let longer = |way: f64| if driven > 0 { way / ways[0] - 1.0 } else { 0.0 };
        (pairs > 0).then(|| Self {
            pairs: pairs as usize,
            trajectory_off_m,
            relations_off_m,
            apart_m,
            relations_longer: longer(ways[1]),
            trajectory_longer: longer(ways[2]),
        })
    }

    /// For people.
    pub fn text(&self) -> String {
        format!(
            "two scans    of {} relations hold each other fast: off them are the relations by {:.4} m ({:+.1} % along \
             the way) and the trajectory by {:.4} m ({:+.1} %); these two are {:.4} m apart",
            self.pairs,
            self.relations_off_m,
            100.0 * self.relations_longer,
            self.trajectory_off_m,
            100.0 * self.trajectory_longer,
            self.apart_m
        )
    }
}

/// The pose of the second scan in the frame of the first, if each says the same of the other.
fn align(first: &[Point2], second: &[Point2], guess: &Pose2) -> Option<Pose2> {
    let config = MatchConfig::default();
    let one_way = |reference: &[Point2], moving: &[Point2], guess: &Pose2| {
        refine(&ReferenceCloud::from_scan(reference), moving, guess, &config).filter(holds_fast)
    };
    let there = one_way(first, second, guess)?.reference_from_moving;
    let back = one_way(second, first, &guess.inverse())?.reference_from_moving.inverse();
    let apart = there.translation.vector - back.translation.vector;
    let mut mean = there;
    mean.translation.vector -= 0.5 * apart;
    (apart.norm() <= AGREE_M).then_some(mean)
}

fn holds_fast(found: &ScanMatch) -> bool {
    let place = found.covariance.fixed_view::<2, 2>(0, 0).into_owned();
    found.score >= LEAST_SCORE && place.symmetric_eigenvalues().max() <= MOST_SIGMA_M.powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;

    /// The walls of a room of 6 m by 4 m, from `place`.
    fn room(place: &Pose2) -> Vec<Point2> {
        let long = (0..=120).map(|step| -3.0 + 0.05 * f64::from(step));
        let short = (0..=80).map(|step| -2.0 + 0.05 * f64::from(step));
        let walls = long.flat_map(|x| [Point2::new(x, -2.0), Point2::new(x, 2.0)]);
        let walls = walls.chain(short.flat_map(|y| [Point2::new(-3.0, y), Point2::new(3.0, y)]));
        walls.map(|point| place.inverse_transform_point(&point)).collect()
    }

    #[test]
    fn the_scans_say_whether_trajectory_or_relation_is_off() {
        let places = [pose(0.0, 0.0, 0.1), pose(0.4, 0.0, 0.1)];
        let scans = places.map(|place| room(&place));
        let scans: Vec<&[Point2]> = scans.iter().map(Vec::as_slice).collect();
        let trajectory = [(1_000_000, places[0]), (2_000_000, places[1])];
        let true_pose = places[0].inverse() * places[1];
        let mut known = true_pose;
        known.translation.vector *= 1.05;
        let relation = Relation { times_us: [1_000_000, 2_000_000], first_from_second: known };
        let pairs = ScanPairs::of(&trajectory, &scans, &[relation]).expect("a room holds fast");
        assert!(pairs.trajectory_off_m < 0.002 && (pairs.relations_off_m - 0.02).abs() < 0.002, "{pairs:?}");
        assert!((pairs.relations_longer - 0.05).abs() < 0.005 && pairs.trajectory_longer.abs() < 0.005, "{pairs:?}");
        assert!((pairs.apart_m - 0.02).abs() < 1e-9, "{pairs:?}");
        // Two long walls hold nobody along them.
        let corridor: Vec<Point2> = room(&places[0]).into_iter().filter(|point| point.x.abs() < 2.0).collect();
        assert!(ScanPairs::of(&trajectory, &[&corridor, &corridor], &[relation]).is_none());
    }
}
