//! Who is about: what has been seen moving, where it is now, and how fast. Who stops is remembered
//! while something is seen there, for a while; after that it is a piece of furniture.

use super::moving_returns::{Movers, MovingReturnConfig, MovingReturns};
use fht_perception::frame::{LaserScan, SensorFrame};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2};
use fht_perception::segments::ScanSegment;
use fht_perception::standing_alone::{StandingAlone, standing_alone};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::VecDeque;

/// How people are followed.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BystanderConfig {
    /// Which returns are theirs.
    pub returns: MovingReturnConfig,
    /// Somebody is the same as before when he is this near to where he should be, metres. Default
    /// 0.6.
    pub same_m: f64,
    /// Who is seen nowhere is forgotten after this long, seconds. Default 1.
    pub unseen_s: f64,
    /// Who stands is remembered for this long, seconds. Default 60.
    pub standing_s: f64,
    /// Radius of what people are taken for, metres. Default 0.2.
    pub radius_m: f64,
    /// Somebody has truly walked when he has come so far while he was followed, metres. Default
    /// 0.7: what is taken for somebody by mistake stays where it is.
    pub walked_m: f64,
    /// … and was seen moving so often after the first time. Default 3.
    pub least_sights: usize,
    /// Who is slower than this stands, metres per second. Default 0.25. Who has just been seen
    /// moving for the first time walks, however fast.
    pub standing_mps: f64,
    /// Where people walk, what stands alone and is no wider than this may be somebody, metres.
    /// Default 0.6.
    pub somebody_m: f64,
    /// If more than this share of all returns stand alone, they are posts and racks. Default 0.5.
    pub most_alone: f64,
}

impl Default for BystanderConfig {
    fn default() -> Self {
        Self {
            returns: MovingReturnConfig::default(),
            same_m: 0.6,
            unseen_s: 1.0,
            standing_s: 60.0,
            radius_m: 0.2,
            walked_m: 0.7,
            least_sights: 3,
            standing_mps: 0.25,
            somebody_m: 0.6,
            most_alone: 0.5,
        }
    }
}

/// Somebody who walks, or walked and stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bystander {
    /// The middle of the side that is seen, in the frame that was asked for.
    pub position: Point2,
    /// Metres per second, in the same frame.
    pub velocity: Vector2<f64>,
    /// Whether he walks.
    pub is_walking: bool,
}

#[derive(Clone, Copy, Debug)]
struct Track {
    /// Where he was first seen, odometry frame.
    first: Point2,
    /// How often he was seen moving since.
    sights: usize,
    /// He was seen moving for the first time in the newest frame.
    is_new: bool,
    /// He has truly walked: no thing was taken for him.
    has_walked: bool,
    /// Odometry frame.
    position: Point2,
    velocity: Vector2<f64>,
    /// Time of the newest sight, microseconds.
    seen_us: u64,
    moved_us: u64,
}

/// Those about.
pub struct Bystanders {
    config: BystanderConfig,
    returns: MovingReturns,
    tracks: Vec<Track>,
    /// Who has come near since the last frame and is not followed: base frame.
    coming: Vec<Point2>,
    odom_from_base: Pose2,
    has_met: bool,
    /// When somebody was found to walk, of late, microseconds.
    walked_us: VecDeque<u64>,
}

/// Returns within so many radii of somebody's place are his.
const NEAR_RADII: f64 = 1.5;

/// A scan in which nothing is known of some beams.
fn without(scan: &LaserScan, hidden: &[bool]) -> LaserScan {
    let mut scan = scan.clone();
    for (range, _) in scan.ranges_m.iter_mut().zip(hidden).filter(|(_, is_hidden)| **is_hidden) {
        *range = f32::NAN;
    }
    scan
}

fn seconds(from_us: u64, to_us: u64) -> f64 {
    to_us.saturating_sub(from_us) as f64 * 1e-6
}

impl Bystanders {
    /// Nobody is known.
    #[must_use]
    pub fn new(config: BystanderConfig) -> Self {
        Self {
            config,
            returns: MovingReturns::default(),
            tracks: Vec::new(),
            coming: Vec::new(),
            odom_from_base: Pose2::identity(),
            has_met: false,
            walked_us: VecDeque::new(),
        }
    }

    /// Whether anybody has walked by so far. Where nobody does nobody stands either, and what looks
    /// like somebody is a thing: until then nothing is hidden, and only who comes near all of a
    /// sudden is about.
    #[must_use]
    pub fn has_met(&self) -> bool {
        self.has_met
    }

    /// How many have walked by within the time for which those who stand are remembered. Who goes
    /// behind something and comes back counts again.
    #[must_use]
    pub fn walkers(&self) -> usize {
        self.walked_us.len().max(self.tracks.iter().filter(|track| track.has_walked).count())
    }

    /// Takes in a frame, and gives it back without the returns of what moves: of these beams
    /// nothing is known then, so that nothing that walks is matched or drawn. Time must not go
    /// back.
    pub fn hide<'a>(&mut self, frame: &'a SensorFrame) -> Cow<'a, SensorFrame> {
        let SensorFrame { time_us, odom_from_base, scan, .. } = frame;
        let Movers { moving, coming } = self.returns.find(odom_from_base, scan, *time_us, &self.config.returns);
        self.odom_from_base = *odom_from_base;
        while self.walked_us.front().is_some_and(|then| seconds(*then, *time_us) > self.config.standing_s) {
            self.walked_us.pop_front();
        }
        self.follow(&moving, scan, *time_us);
        let unfollowed: Vec<bool> = coming.iter().zip(&moving).map(|(is_coming, moves)| *is_coming && !moves).collect();
        self.coming = middles(&unfollowed, scan, self.config.returns.gap_m, |beam| scan.beam_end_in_base(beam));
        if !self.has_met || !moving.contains(&true) {
            return Cow::Borrowed(frame);
        }
        let (scan, panorama) = (without(scan, &moving), frame.panorama.clone());
        Cow::Owned(SensorFrame { time_us: *time_us, odom_from_base: *odom_from_base, scan, panorama })
    }

    /// The scan of the newest frame, as [`Bystanders::hide`] gave that, for what is kept: without
    /// those who have walked and stand now and, once people have walked by, without narrow things
    /// that stand alone, each of which may be somebody who has stood there all along.
    #[must_use]
    pub fn hide_doubtful<'a>(&self, frame: &'a SensorFrame) -> Cow<'a, LaserScan> {
        if !self.has_met {
            return Cow::Borrowed(&frame.scan); // Until then nobody has walked.
        }
        let mut hidden = self.standing(frame);
        let BystanderConfig { returns, somebody_m, most_alone, .. } = &self.config;
        let MovingReturnConfig { gap_m, least_returns, .. } = *returns;
        let alone = StandingAlone { widest_m: *somebody_m, gap_m, least_returns };
        let things = standing_alone(&frame.scan, &hidden, &alone);
        let alone: Vec<usize> = things.into_iter().flat_map(ScanSegment::beams).collect();
        let all = frame.scan.ranges_m.iter().filter(|range_m| frame.scan.is_return(**range_m)).count();
        if alone.len() as f64 <= most_alone * all as f64 {
            alone.into_iter().for_each(|beam| hidden[beam] = true);
        }
        Cow::Owned(without(&frame.scan, &hidden))
    }

    /// Of each beam of the newest frame, whether it ends at somebody who has walked and stands now.
    fn standing(&self, frame: &SensorFrame) -> Vec<bool> {
        let SensorFrame { odom_from_base, scan, .. } = frame;
        let stand: Vec<Point2> = self.tracks.iter().filter(|it| it.has_walked).map(|it| it.position).collect();
        let is_near = |at: Point2| stand.iter().any(|it| (it - at).norm() < NEAR_RADII * self.config.radius_m);
        let is_return = |beam: usize| scan.is_return(scan.ranges_m[beam]);
        let ends = |beam: usize| odom_from_base * scan.beam_end_in_base(beam);
        (0..scan.ranges_m.len()).map(|beam| is_return(beam) && is_near(ends(beam))).collect()
    }

    /// Those about, in the frame of the robot's base at the newest frame.
    #[must_use]
    pub fn around(&self) -> Vec<Bystander> {
        let base_from_odom = self.odom_from_base.inverse();
        let see = |track: &Track| Bystander {
            position: base_from_odom * track.position,
            velocity: base_from_odom.rotation * track.velocity,
            // How fast somebody walks is known from the second sight on.
            is_walking: track.velocity.norm() >= self.config.standing_mps || track.is_new,
        };
        let come = |position: &Point2| Bystander { position: *position, velocity: Vector2::zeros(), is_walking: true };
        // Whoever comes near is kept away from, be it the first one.
        let tracks = self.tracks.iter().filter(|_| self.has_met);
        tracks.map(see).chain(self.coming.iter().map(come)).collect()
    }

    /// Takes the ground where people stand for occupied, on a copy of a grid: ways are to lead
    /// round them. True if there is anybody. `grid_from_base` is the robot's pose in the grid.
    pub fn suppose(&self, grid: &mut OccupancyGrid, grid_from_base: &Pose2) -> bool {
        let reach = Vector2::repeat(self.config.radius_m);
        let mut is_anybody = false;
        for somebody in self.around().iter().filter(|somebody| !somebody.is_walking) {
            // What is seen is his near side.
            let behind = somebody.position.coords.normalize() * (0.7 * self.config.radius_m);
            let middle = grid_from_base * (somebody.position + behind);
            let is_in = |place: Point2| (place - middle).norm() <= self.config.radius_m;
            grid.suppose_occupied(middle - reach, middle + reach, is_in);
            is_anybody = true;
        }
        is_anybody
    }

    fn follow(&mut self, moving: &[bool], scan: &LaserScan, time_us: u64) {
        let odom_from_base = self.odom_from_base;
        let end = |beam: usize| odom_from_base * scan.beam_end_in_base(beam);
        self.tracks.iter_mut().for_each(|track| track.is_new = false);
        for middle in middles(moving, scan, self.config.returns.gap_m, end) {
            self.take(middle, time_us);
        }
        let Self { tracks, config, .. } = self;
        let returns: Vec<Point2> =
            (0..scan.ranges_m.len()).filter(|&beam| scan.is_return(scan.ranges_m[beam])).map(end).collect();
        for track in tracks.iter_mut().filter(|track| track.seen_us < time_us) {
            // Who is not seen moving stands, if something is seen where he was last.
            let reach_m = NEAR_RADII * config.radius_m;
            let near: Vec<&Point2> = returns.iter().filter(|at| (*at - track.position).norm() < reach_m).collect();
            if seconds(track.moved_us, time_us) > 0.5 {
                track.velocity = Vector2::zeros();
            }
            if !near.is_empty() {
                let sum = near.iter().fold(Vector2::zeros(), |sum, at| sum + at.coords);
                track.position = Point2::from(sum / near.len() as f64);
                track.seen_us = time_us;
            }
        }
        tracks.retain(|track| {
            seconds(track.seen_us, time_us) < config.unseen_s && seconds(track.moved_us, time_us) < config.standing_s
        });
        // Two who stand at one place are one, whom different returns told of.
        let mut index = 0;
        while index < tracks.len() {
            let here = tracks[index].position;
            let is_double = tracks[..index].iter().any(|before| (before.position - here).norm() < config.radius_m);
            if is_double {
                tracks.remove(index);
            } else {
                index += 1;
            }
        }
    }

    /// Somebody moves, and is here now.
    fn take(&mut self, here: Point2, time_us: u64) {
        let expected = |track: &Track| track.position + track.velocity * seconds(track.seen_us, time_us);
        let waiting = self.tracks.iter_mut().filter(|track| track.seen_us < time_us);
        let off_m = |track: &Track| (expected(track) - here).norm();
        let nearest = waiting.min_by(|a, b| off_m(a).total_cmp(&off_m(b)));
        match nearest.filter(|track| off_m(track) < self.config.same_m) {
            Some(track) => {
                let since_s = seconds(track.seen_us, time_us).max(1e-3);
                let newest = (here - track.position) / since_s;
                // What is seen of somebody changes: half of what is new is believed.
                track.velocity = (0.5 * track.velocity + 0.5 * newest).cap_magnitude(2.0);
                (track.position, track.seen_us, track.moved_us) = (here, time_us, time_us);
                track.sights += 1;
                let is_walk = (here - track.first).norm() >= self.config.walked_m;
                if is_walk && track.sights >= self.config.least_sights && !track.has_walked {
                    track.has_walked = true;
                    self.has_met = true;
                    self.walked_us.push_back(time_us);
                }
            }
            None => {
                let velocity = Vector2::zeros();
                self.tracks.push(Track {
                    first: here,
                    sights: 0,
                    is_new: true,
                    has_walked: false,
                    position: here,
                    velocity,
                    seen_us: time_us,
                    moved_us: time_us,
                });
            }
        }
    }
}

/// The middles of what moves and hangs together.
fn middles(moving: &[bool], scan: &LaserScan, gap_m: f64, end: impl Fn(usize) -> Point2) -> Vec<Point2> {
    let mut middles = Vec::new();
    let mut run: Vec<Point2> = Vec::new();
    let mut close = |run: &mut Vec<Point2>| {
        if !run.is_empty() {
            let sum = run.iter().fold(Vector2::zeros(), |sum, at| sum + at.coords);
            middles.push(Point2::from(sum / run.len() as f64));
            run.clear();
        }
    };
    for (index, _) in moving.iter().enumerate().filter(|(_, is_moving)| **is_moving) {
        let follows = index > 0 && moving[index - 1];
        let step_m = if follows { f64::from(scan.ranges_m[index]) - f64::from(scan.ranges_m[index - 1]) } else { 0.0 };
        if !follows || step_m.abs() >= gap_m {
            close(&mut run);
        }
        run.push(end(index));
    }
    close(&mut run);
    middles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planning::{PlanConfig, Traversable};
    use fht_perception::grid::GridConfig;
    use fht_perception::pose::pose;

    /// A room of 8 m by 8 m, seen from its middle, with somebody at a place.
    fn frame(number: u64, somebody: Point2) -> SensorFrame {
        let scan = LaserScan::all_round(360, |cos, sin| {
            let along = somebody.x * cos + somebody.y * sin;
            let beside = somebody.coords.norm_squared() - along * along;
            let wall_m = 4.0 / cos.abs().max(sin.abs());
            if along > 0.0 && beside < 0.04 { along - (0.04 - beside).sqrt() } else { wall_m }
        });
        SensorFrame { time_us: number * 200_000, odom_from_base: Pose2::identity(), scan, panorama: None }
    }

    /// Somebody comes from the right and stops ahead of the robot.
    fn place(number: u64) -> Point2 {
        Point2::new(1.8, (-2.0 + 0.25 * number as f64).min(0.0))
    }

    #[test]
    fn who_comes_and_stops_is_hidden_then_followed_then_forgotten() {
        let mut about = Bystanders::new(BystanderConfig::default());
        let mut hidden = Vec::new();
        for number in 0..40 {
            let frame = frame(number, place(number));
            let seen = about.hide(&frame).scan.ranges_m.iter().filter(|range| range.is_nan()).count();
            hidden.push(seen);
            if number == 7 {
                let somebody = about.around()[0];
                assert!(somebody.is_walking && (somebody.velocity.y - 1.25).abs() < 0.3, "{somebody:?}");
            }
        }
        assert!(hidden[3] == 0 && hidden[7] > 5 && hidden[30] == 0, "{hidden:?}");
        let standing = about.around();
        assert!(standing.len() == 1 && !standing[0].is_walking && about.has_met(), "{standing:?}");
        assert!((standing[0].position - Point2::new(1.6, 0.0)).norm() < 0.15, "{standing:?}");
        assert_eq!(about.walkers(), 1);
        (40..400).for_each(|number| drop(about.hide(&frame(number, place(number)))));
        assert!(about.around().is_empty(), "a piece of furniture by now");
        assert_eq!(about.walkers(), 0, "that is long ago");
    }

    #[test]
    fn who_stands_is_not_kept_once_somebody_has_walked() {
        let mut about = Bystanders::new(BystanderConfig::default());
        for number in 0..400 {
            let frame = frame(number, place(number));
            let lasting = about.hide(&frame);
            let kept = about.hide_doubtful(&lasting);
            let hidden = kept.ranges_m.iter().filter(|range| range.is_nan()).count();
            // Before he is known to be somebody, and after he is forgotten, he stands alone.
            assert_eq!(hidden > 5, about.has_met(), "{hidden} hidden in frame {number}");
            assert!(hidden < 30, "{hidden} hidden in frame {number}");
        }
        assert!(about.has_met());
    }

    #[test]
    fn who_stands_in_the_way_is_driven_round() {
        let mut about = Bystanders::new(BystanderConfig::default());
        let mut grid = OccupancyGrid::new(GridConfig::default());
        for number in 0..20 {
            let frame = frame(number, place(number));
            grid.integrate(&Pose2::identity(), &about.hide(&frame).scan);
        }
        let (from, to) = (Point2::new(0.0, 0.0), Point2::new(3.0, 0.0));
        assert!(about.suppose(&mut grid, &pose(0.0, 0.0, 0.0)));
        let space =
            Traversable::new(&grid, &PlanConfig { unknown: crate::UnknownCells::Allowed, ..PlanConfig::default() });
        let path = space.shortest_path(from, to).expect("a way round");
        let middle = Point2::new(1.8, 0.0);
        let nearest = path.points.iter().map(|point| (point - middle).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest > 0.25, "{nearest}");
    }
}
