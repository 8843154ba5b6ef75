//! The returns of a scan that something moving gave: they end where beams of a moment ago went on.

use fht_perception::frame::LaserScan;
use fht_perception::pose::{Point2, Pose2};
use fht_perception::segments::{beams_in_turn, is_all_round, segments};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Which returns count as those of something that moves.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MovingReturnConfig {
    /// A scan is compared with those at least this much older, seconds. Default 0.35: who walks
    /// has moved by more than a body's depth.
    pub least_age_s: f64,
    /// … and at most this much older, seconds. Default 1.3: the wheels are good for that long.
    pub most_age_s: f64,
    /// The beams of the older scan must have gone on by this much, metres. Default 0.3.
    pub beyond_m: f64,
    /// Share of a turn that the wheels may be off by. Default 0.08: beams so far aside must have
    /// gone on, too.
    pub turn_error: f64,
    /// So many of the older scans must have seen through. Default 2: one may have seen a thin wall
    /// from its edge, between two beams.
    pub least_scans: usize,
    /// So many returns of what hangs together must be new. Default 3: one or two are poles and
    /// corners between beams.
    pub least_returns: usize,
    /// Returns side by side hang together when their ranges differ by less than this, metres.
    /// Default 0.25.
    pub gap_m: f64,
    /// What hangs together moves as a whole when this share of it is new. Default 0.4.
    pub least_share: f64,
    /// … and it is at most this wide, metres. Default 0.9: what is wider is a wall.
    pub widest_m: f64,
    /// Returns farther than this are not judged, metres. Default 8: who is farther shows too few.
    pub reach_m: f64,
    /// A scan of which more than this share is new tells of this robot and not of others: its
    /// wheels have slipped. Default 0.4.
    pub most_share: f64,
    /// Who is this near may have come from behind somebody else, where older scans saw nothing:
    /// here the newest of them counts alone, metres. Default 0.8.
    pub near_m: f64,
    /// Its beams must have gone on by this much, metres. Default 0.12: between two scans somebody
    /// comes so far, and no wall is so rough.
    pub nearer_m: f64,
}

impl Default for MovingReturnConfig {
    fn default() -> Self {
        Self {
            least_age_s: 0.35,
            most_age_s: 1.3,
            beyond_m: 0.3,
            turn_error: 0.08,
            least_scans: 2,
            least_returns: 3,
            gap_m: 0.25,
            least_share: 0.4,
            widest_m: 0.9,
            reach_m: 8.0,
            most_share: 0.4,
            near_m: 0.8,
            nearer_m: 0.12,
        }
    }
}

struct Past {
    time_us: u64,
    odom_from_sensor: Pose2,
    scan: LaserScan,
    /// Beams in a whole turn, in parts.
    beams_in_turn: f64,
    /// The scanner looks all round: beside its last beam is its first.
    is_full: bool,
}

impl Past {
    fn new(time_us: u64, odom_from_sensor: Pose2, scan: LaserScan) -> Self {
        Self { time_us, odom_from_sensor, beams_in_turn: beams_in_turn(&scan), is_full: is_all_round(&scan), scan }
    }

    /// How many beams on each side of that towards a place count, now that the robot is at
    /// `odom_from_sensor`: one more than the wheels may be off.
    fn beams_aside(&self, odom_from_sensor: &Pose2, config: &MovingReturnConfig) -> usize {
        let turned_rad = self.odom_from_sensor.rotation.angle_to(&odom_from_sensor.rotation).abs();
        1 + (config.turn_error * turned_rad / TAU * self.beams_in_turn).ceil() as usize
    }

    /// Whether the beams towards a place, and so many on each side, went on beyond it by
    /// `beyond_m`.
    fn saw_through(&self, place: Point2, aside: usize, beyond_m: f64) -> bool {
        let to = self.odom_from_sensor.inverse_transform_point(&place);
        let (least_m, scan) = (to.coords.norm() + beyond_m, &self.scan);
        let count = scan.ranges_m.len();
        let angle = (to.y.atan2(to.x) - scan.angle_min) / scan.angle_increment;
        let beam = angle.rem_euclid(self.beams_in_turn).round() as usize;
        if 2 * aside >= count || (!self.is_full && !(aside..count - aside).contains(&beam)) {
            return false; // it did not look there
        }
        let mut ranges =
            (beam + count - aside..=beam + count + aside).map(|beam| f64::from(scan.ranges_m[beam % count]));
        // Of NaN nothing is known.
        ranges.all(|range_m| !range_m.is_nan() && range_m.min(scan.range_max_m) > least_m)
    }
}

/// The returns of a scan, beam by beam.
pub(super) struct Movers {
    /// What gave them moves.
    pub(super) moving: Vec<bool>,
    /// It is near, and was not there a moment ago.
    pub(super) coming: Vec<bool>,
}

/// Compares scans with those before.
#[derive(Default)]
pub(super) struct MovingReturns {
    past: VecDeque<Past>,
}

impl MovingReturns {
    /// Which returns of a scan something moving gave. Time must not go back.
    pub(super) fn find(
        &mut self,
        odom_from_base: &Pose2,
        scan: &LaserScan,
        time_us: u64,
        config: &MovingReturnConfig,
    ) -> Movers {
        let odom_from_sensor = odom_from_base * scan.base_from_sensor;
        let age_s = |past: &Past| time_us.saturating_sub(past.time_us) as f64 * 1e-6;
        while self.past.front().is_some_and(|past| age_s(past) > config.most_age_s) {
            self.past.pop_front();
        }
        let is_judged = |range: f32| scan.is_return(range) && f64::from(range) < config.reach_m;
        let aside = |past: &Past| past.beams_aside(&odom_from_sensor, config);
        let older = self.past.iter().filter(|past| age_s(past) >= config.least_age_s);
        let older: Vec<(&Past, usize)> = older.map(|past| (past, aside(past))).collect();
        let place = |beam: usize| odom_from_base * scan.beam_end_in_base(beam);
        let places: Vec<Point2> = (0..scan.ranges_m.len()).map(place).collect();
        let is_new = |beam: usize| {
            let through = older.iter().filter(|(past, aside)| past.saw_through(places[beam], *aside, config.beyond_m));
            is_judged(scan.ranges_m[beam]) && through.take(config.least_scans).count() >= config.least_scans
        };
        let newest = self.past.back().map(|past| (past, aside(past)));
        let is_nearer = |beam: usize| {
            let range = scan.ranges_m[beam];
            let is_near = scan.is_return(range) && f64::from(range) < config.near_m;
            is_near && newest.is_some_and(|(past, aside)| past.saw_through(places[beam], aside, config.nearer_m))
        };
        let found = |is_found: &dyn Fn(usize) -> bool| (0..scan.ranges_m.len()).map(is_found).collect::<Vec<bool>>();
        let returns = scan.ranges_m.iter().filter(|range| scan.is_return(**range)).count();
        let unless_most = |found: Vec<bool>, all: usize| {
            let count = found.iter().filter(|is_found| **is_found).count();
            if count as f64 > config.most_share * all as f64 { vec![false; found.len()] } else { found }
        };
        let moving = unless_most(grown(&found(&is_new), scan, config), returns);
        let nearer = found(&is_nearer);
        let beside = side_by_side(&nearer, config.least_returns);
        let coming = grown(&nearer, scan, config).into_iter().zip(beside).map(|(one, other)| one || other).collect();
        // In the open those who come may be all that returns.
        let coming = unless_most(coming, scan.ranges_m.len());
        self.past.push_back(Past::new(time_us, odom_from_sensor, scan.clone()));
        Movers { moving, coming }
    }
}

/// What hangs together, is no wider than somebody, and is new in good part.
fn grown(new: &[bool], scan: &LaserScan, config: &MovingReturnConfig) -> Vec<bool> {
    let mut moving = vec![false; new.len()];
    for segment in segments(scan, config.gap_m) {
        let count = segment.beams().filter(|beam| new[*beam]).count();
        let is_much = count >= config.least_returns && count as f64 >= config.least_share * segment.count() as f64;
        if is_much && segment.width_m(scan) <= config.widest_m {
            segment.beams().for_each(|beam| moving[beam] = true);
        }
    }
    moving
}

/// Those of which so many lie side by side. Who comes near may hang together with others, or with a
/// wall.
fn side_by_side(found: &[bool], least: usize) -> Vec<bool> {
    let runs = found.chunk_by(|a, b| a == b);
    runs.flat_map(|run| std::iter::repeat_n(run[0] && run.len() >= least, run.len())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;

    /// A room of 8 m by 8 m, seen from its middle, with somebody at a place or nobody.
    fn room(somebody: Option<Point2>) -> LaserScan {
        LaserScan::all_round(360, |cos, sin| {
            let wall_m = 4.0 / cos.abs().max(sin.abs());
            let met = somebody.and_then(|at| {
                let along = at.x * cos + at.y * sin;
                let beside = at.coords.norm_squared() - along * along;
                (along > 0.0 && beside < 0.04).then(|| along - (0.04 - beside).sqrt())
            });
            met.unwrap_or(wall_m)
        })
    }

    fn count(somebody: impl Fn(u64) -> Option<Point2>) -> Vec<usize> {
        let (mut moving, config) = (MovingReturns::default(), MovingReturnConfig::default());
        let scan = |frame| room(somebody(frame));
        let find = |frame: u64| moving.find(&Pose2::identity(), &scan(frame), frame * 200_000, &config);
        (0..15).map(find).map(|found| found.moving.iter().filter(|is_moving| **is_moving).count()).collect()
    }

    #[test]
    fn who_walks_across_is_seen_and_who_stands_is_not() {
        let walking = count(|frame| Some(Point2::new(2.0, -1.5 + 0.25 * frame as f64)));
        assert!(walking[3..].iter().all(|&count| count >= 8), "{walking:?}");
        assert!(count(|_| Some(Point2::new(2.0, 0.5))).iter().all(|&count| count == 0));
        assert!(count(|_| None).iter().all(|&count| count == 0));
    }

    #[test]
    fn who_stops_is_not_seen_moving_after_a_moment() {
        let stopping = count(|frame| Some(Point2::new(2.0, (0.25 * frame as f64 - 1.5).min(-0.5))));
        assert!(stopping[4] >= 8 && stopping[12..].iter().all(|&count| count == 0), "{stopping:?}");
    }

    #[test]
    fn a_scan_that_is_new_as_a_whole_tells_of_the_robot() {
        let (mut moving, config) = (MovingReturns::default(), MovingReturnConfig::default());
        let small = LaserScan::all_round(360, |cos, sin| 2.0 / cos.abs().max(sin.abs()));
        (0..4).for_each(|frame| drop(moving.find(&Pose2::identity(), &room(None), frame * 200_000, &config)));
        assert!(moving.find(&Pose2::identity(), &small, 900_000, &config).moving.iter().all(|is_moving| !is_moving));
    }

    #[test]
    fn who_comes_from_behind_somebody_is_coming_before_it_is_sure_that_he_moves() {
        let (mut moving, config) = (MovingReturns::default(), MovingReturnConfig::default());
        // Somebody stands 0.9 m ahead, and another comes out from behind him.
        for (frame, ahead_m) in [0.9, 0.9, 0.9, 0.9, 0.75].into_iter().enumerate() {
            let scan = room(Some(Point2::new(ahead_m, 0.0)));
            let found = moving.find(&Pose2::identity(), &scan, frame as u64 * 200_000, &config);
            let count = |returns: &[bool]| returns.iter().filter(|is| **is).count();
            assert_eq!(count(&found.moving), 0, "frame {frame}");
            assert_eq!(count(&found.coming) > 10, frame == 4, "frame {frame}");
        }
    }

    #[test]
    fn who_comes_beside_somebody_who_stands_is_coming_too() {
        let (mut moving, config) = (MovingReturns::default(), MovingReturnConfig::default());
        // A row of people stands 0.75 m ahead, and one of them steps forward.
        for (frame, ahead_m) in [0.75, 0.75, 0.75, 0.75, 0.55].into_iter().enumerate() {
            let others = [-0.6, -0.3, 0.3, 0.6].map(|aside_m| Point2::new(0.75, aside_m));
            let row = others.map(|at| room(Some(at)));
            let mut scan = room(Some(Point2::new(ahead_m, 0.0)));
            for other in &row {
                let nearer = scan.ranges_m.iter_mut().zip(&other.ranges_m);
                nearer.for_each(|(range_m, other_m)| *range_m = range_m.min(*other_m));
            }
            let found = moving.find(&Pose2::identity(), &scan, frame as u64 * 200_000, &config);
            let coming = found.coming.iter().filter(|is_coming| **is_coming).count();
            assert_eq!(coming > 8, frame == 4, "{coming} in frame {frame}");
        }
    }

    #[test]
    fn what_the_robot_drives_towards_does_not_come() {
        let (mut moving, config) = (MovingReturns::default(), MovingReturnConfig::default());
        for frame in 0..14_u32 {
            // At 0.5 m/s past a pillar, to a wall, turning.
            let ahead_m = 0.1 * f64::from(frame);
            let odom_from_base = pose(ahead_m, 0.0, 0.05 * f64::from(frame));
            let scan = LaserScan::all_round(360, |cos, sin| {
                let (sin_yaw, cos_yaw) = odom_from_base.rotation.angle().sin_cos();
                let (cos, sin) = (cos * cos_yaw - sin * sin_yaw, sin * cos_yaw + cos * sin_yaw);
                let wall_m = [((2.0 - ahead_m) / cos, cos), (0.4 / sin, sin), (-0.6 / sin, -sin)];
                let wall_m = wall_m.into_iter().filter(|(_, towards)| *towards > 1e-6).map(|(range, _)| range);
                let to = Point2::new(1.0 - ahead_m, 0.25);
                let along = to.x * cos + to.y * sin;
                let beside = to.coords.norm_squared() - along * along;
                let pillar = (along > 0.0 && beside < 0.01).then(|| along - (0.01 - beside).sqrt());
                pillar.unwrap_or_else(|| wall_m.fold(6.0, f64::min))
            });
            let found = moving.find(&odom_from_base, &scan, u64::from(frame) * 200_000, &config);
            assert!(found.coming.iter().all(|is_coming| !is_coming), "frame {frame}");
        }
    }
}
