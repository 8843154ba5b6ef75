//! What the map knows to be free and where it has walls, as cells; and what a scan says for or
//! against a pose in it.
//!
//! A beam that ends where the map has a wall speaks for the pose. One that ends well before, where
//! the map is free, or goes on well behind a wall speaks against it, whatever the scan matcher
//! thought. One that ends where nobody looked says little.

use crate::frame::LaserScan;
use crate::grid::CellState;
use crate::pose::{Point2, Pose2};
use crate::segments::ScanSegment;
use crate::standing_alone::{StandingAlone, standing_alone};
use fht_proto::{FixedPoint, Rect};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Side of a cell, metres.
const CELL_M: f64 = 0.1;
/// A beam frees the way up to this before its end, metres.
const BEFORE_WALL_M: f64 = 0.15;
/// Cells that a map may have: 25 million, 0.25 km².
const MOST_CELLS: f64 = 25e6;

const FREE: u8 = 1;
const WALL: u8 = 2;
/// A wall is in this cell or in one beside it.
const NEAR_WALL: u8 = 4;

/// Cells in the map frame.
#[derive(Clone, Debug, Default)]
pub struct EvidenceGrid {
    min: Point2,
    width: usize,
    height: usize,
    cells: Vec<u8>,
}

/// What was seen from one place: a scanner and the ends of its beams, map frame.
#[derive(Clone, Debug)]
pub struct Sighting {
    /// The scanner.
    pub from: Point2,
    /// Ends of beams.
    pub ends: Vec<Point2>,
}

/// Where a straight line leaves what is known to be free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sightline {
    /// Known to be free so far, metres.
    pub free_m: f64,
    /// Whether a wall ends it: else nobody looked on, or it is as long as was asked for.
    pub is_wall: bool,
}

impl EvidenceGrid {
    /// Draws what was seen, and rectangles of free space around nodes.
    #[must_use]
    pub fn new(sightings: &[Sighting], free: &[(FixedPoint, Rect)]) -> Self {
        let corners = free.iter().flat_map(|(node, rect)| [rect.min(*node), rect.max(*node)]);
        let corners = corners.map(|(x, y)| Point2::new(x, y));
        let ends = sightings.iter().flat_map(|seen| seen.ends.iter().chain([&seen.from]).copied());
        let (low, high) = ends
            .chain(corners)
            .fold((Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN)), |(low, high), point| {
                (low.inf(&point), high.sup(&point))
            });
        let size = Self::size_in_cells(low, high);
        if size.x < 0.0 || !Self::holds(low, high) {
            return Self::default();
        }
        let (width, height) = (size.x.ceil() as usize, size.y.ceil() as usize);
        let min = Point2::new(low.x - 2.0 * CELL_M, low.y - 2.0 * CELL_M);
        let mut space = Self { min, width, height, cells: vec![0; width * height] };
        for (node, rect) in free {
            space.free_rectangle(rect.min(*node), rect.max(*node));
        }
        for seen in sightings {
            seen.ends.iter().for_each(|end| space.free_beam(seen.from, *end));
        }
        // Walls last: a cell that one beam passes and another ends in has one.
        for end in sightings.iter().flat_map(|seen| &seen.ends) {
            space.put_wall(*end);
        }
        space
    }

    /// Whether there are cells enough for what lies between two corners.
    #[must_use]
    pub fn holds(low: Point2, high: Point2) -> bool {
        let size = Self::size_in_cells(low, high);
        (size.x * size.y).is_finite() && size.x * size.y <= MOST_CELLS
    }

    fn size_in_cells(low: Point2, high: Point2) -> Vector2<f64> {
        (high - low).map(|metres| metres / CELL_M + 4.0)
    }

    /// The middles of all cells known to be free.
    pub fn free_places(&self) -> impl Iterator<Item = Point2> + '_ {
        let is_free = |&(_, &cell): &(usize, &u8)| cell & (FREE | WALL) == FREE;
        self.cells.iter().enumerate().filter(is_free).map(|(index, _)| {
            let cell = Vector2::new((index % self.width) as f64 + 0.5, (index / self.width) as f64 + 0.5);
            self.min + cell * CELL_M
        })
    }

    /// Whether a place is known to be free.
    #[must_use]
    pub fn is_free(&self, place: Point2) -> bool {
        self.cell(place) & (FREE | WALL) == FREE
    }

    /// Whether something stands at a place.
    #[must_use]
    pub fn is_wall(&self, place: Point2) -> bool {
        self.cell(place) & WALL != 0
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn resolution_m(&self) -> f64 {
        CELL_M
    }

    /// The corner of least x and y, metres.
    #[must_use]
    pub fn origin(&self) -> Point2 {
        self.min
    }

    /// Cells along x.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Cells along y.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// What is known of each cell, row by row from the origin.
    pub fn states(&self) -> impl Iterator<Item = CellState> + '_ {
        self.cells.iter().map(|cell| match cell & (FREE | WALL) {
            0 => CellState::Unknown,
            FREE => CellState::Free,
            _ => CellState::Occupied,
        })
    }

    fn index(&self, point: Point2) -> Option<usize> {
        let cell = (point - self.min) / CELL_M;
        let is_inside = cell.x >= 0.0 && cell.y >= 0.0 && cell.x < self.width as f64 && cell.y < self.height as f64;
        is_inside.then(|| cell.y as usize * self.width + cell.x as usize)
    }

    fn cell(&self, point: Point2) -> u8 {
        self.index(point).map_or(0, |index| self.cells[index])
    }

    fn free_rectangle(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64)) {
        // Cells that lie in it whole.
        let first = |metres: f64, least: f64| ((metres - least) / CELL_M).ceil().max(0.0) as usize;
        let last = |metres: f64, least: f64| ((metres - least) / CELL_M).floor().max(0.0) as usize;
        for j in first(y1, self.min.y)..last(y2, self.min.y).min(self.height) {
            for i in first(x1, self.min.x)..last(x2, self.min.x).min(self.width) {
                self.cells[j * self.width + i] |= FREE;
            }
        }
    }

    fn free_beam(&mut self, from: Point2, end: Point2) {
        let length = (end - from).norm() - BEFORE_WALL_M;
        let ahead = (end - from).normalize();
        for step in 0..(length / (0.7 * CELL_M)).max(0.0) as usize {
            if let Some(index) = self.index(from + ahead * (step as f64 * 0.7 * CELL_M)) {
                self.cells[index] |= FREE;
            }
        }
    }

    fn put_wall(&mut self, end: Point2) {
        let Some(index) = self.index(end) else { return };
        self.cells[index] |= WALL;
        for (dj, di) in (0..3).flat_map(|dj| (0..3).map(move |di| (dj, di))) {
            // The margin around everything keeps this inside.
            let beside = (index + dj * self.width + di).checked_sub(self.width + 1);
            if let Some(cell) = beside.and_then(|beside| self.cells.get_mut(beside)) {
                *cell |= NEAR_WALL;
            }
        }
    }

    /// How far one can look from a place, metres at most `most_m`. `ahead` is a unit vector.
    #[must_use]
    pub fn sightline(&self, from: Point2, ahead: Vector2<f64>, most_m: f64) -> Sightline {
        let step_m = 0.7 * CELL_M;
        for step in 0..(most_m / step_m) as usize {
            let free_m = step as f64 * step_m;
            let cell = self.cell(from + ahead * free_m);
            if cell & WALL != 0 {
                return Sightline { free_m, is_wall: true };
            }
            if cell & FREE == 0 {
                return Sightline { free_m, is_wall: false };
            }
        }
        Sightline { free_m: most_m, is_wall: false }
    }
}

/// How beams are counted.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct EvidenceConfig {
    /// Directions looked at in a scan, evenly spread. Default 90.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 3600)))]
    pub directions: usize,
    /// Angle to either side within which the greatest and the least range count, radians. Default
    /// 2°: what a pose that is off by as much still explains.
    pub aside_rad: f64,
    /// A range this much shorter or longer than what the map says is a contradiction, metres.
    /// Default 0.3.
    pub margin_m: f64,
}

impl Default for EvidenceConfig {
    fn default() -> Self {
        Self { directions: 90, aside_rad: 2.0_f64.to_radians(), margin_m: 0.3 }
    }
}

#[derive(Clone, Copy, Debug)]
struct Beam {
    /// Direction in the base frame.
    angle: f64,
    /// `None` where nothing returned.
    range_m: Option<f64>,
    /// Least range around it.
    least_m: f64,
    /// Greatest range around it; infinite where a beam did not return.
    greatest_m: f64,
    /// It ends at something narrow that stands alone.
    is_alone: bool,
}

/// Beams of a scan, thinned.
#[derive(Clone, Debug)]
pub struct Beams {
    from: Point2,
    beams: Vec<Beam>,
}

impl Beams {
    /// Of a scan.
    #[must_use]
    pub fn of(scan: &LaserScan, config: &EvidenceConfig) -> Self {
        let count = scan.ranges_m.len();
        let ranges: Vec<Option<f64>> =
            scan.ranges_m.iter().map(|&range| scan.is_return(range).then_some(f64::from(range))).collect();
        let aside = (config.aside_rad / scan.angle_increment.abs().max(1e-6)).round() as usize;
        let picked = config.directions.clamp(1, count.max(1));
        let mut is_alone = vec![false; count];
        let things = standing_alone(scan, &[], &StandingAlone::default());
        things.into_iter().flat_map(ScanSegment::beams).for_each(|index| is_alone[index] = true);
        let beam = |number: usize| {
            let index = number * count / picked;
            let around = &ranges[index.saturating_sub(aside)..(index + aside + 1).min(count)];
            let least_m = around.iter().flatten().copied().fold(f64::INFINITY, f64::min);
            let greatest_m = around.iter().map(|range| range.unwrap_or(f64::INFINITY)).fold(0.0, f64::max);
            let angle = scan.angle_min + index as f64 * scan.angle_increment + scan.base_from_sensor.rotation.angle();
            Beam { angle, range_m: ranges[index], least_m, greatest_m, is_alone: is_alone[index] }
        };
        let beams = if count == 0 { Vec::new() } else { (0..picked).map(beam).collect() };
        Self { from: Point2::from(scan.base_from_sensor.translation.vector), beams }
    }

    /// Where they end, base frame; `None` where nothing returned.
    pub fn ends(&self) -> impl Iterator<Item = Option<Point2>> + '_ {
        self.beams.iter().map(|beam| {
            let (sin, cos) = beam.angle.sin_cos();
            beam.range_m.map(|range_m| self.from + Vector2::new(cos, sin) * range_m)
        })
    }
}

/// What one beam says of a pose. Places are in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BeamVerdict {
    /// It ends at a wall of the map, here.
    Explained(Point2),
    /// It ends where the map is free: something stands there, or the pose is wrong.
    TooShort,
    /// The same, and what it ends at is narrow and stands alone: it may be somebody.
    Somebody,
    /// It goes on behind a wall of the map, here: glass, a wall that is gone, or the pose is wrong.
    TooLong(Point2),
    /// It ends where nobody looked.
    Silent,
}

/// What beams say of a pose: how many for it, how many against it, how many of them nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evidence {
    /// End at a wall of the map.
    pub explained: usize,
    /// Cannot be.
    pub contradicted: usize,
    /// End where nobody looked.
    pub silent: usize,
}

impl Evidence {
    /// Of the verdicts of all beams.
    #[must_use]
    pub fn of(verdicts: &[Option<BeamVerdict>]) -> Self {
        let mut evidence = Self::default();
        for verdict in verdicts.iter().flatten() {
            match verdict {
                BeamVerdict::Explained(_) => evidence.explained += 1,
                BeamVerdict::TooShort | BeamVerdict::Somebody | BeamVerdict::TooLong(_) => evidence.contradicted += 1,
                BeamVerdict::Silent => evidence.silent += 1,
            }
        }
        evidence
    }

    /// Adds another.
    pub fn add(&mut self, other: Self) {
        self.explained += other.explained;
        self.contradicted += other.contradicted;
        self.silent += other.silent;
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / (self.explained + self.contradicted + self.silent).max(1) as f64
    }

    /// Share of the beams that are explained, 0 to 1.
    #[must_use]
    pub fn explained_share(&self) -> f64 {
        self.share(self.explained)
    }

    /// Share of the beams that cannot be, 0 to 1.
    #[must_use]
    pub fn contradicted_share(&self) -> f64 {
        self.share(self.contradicted)
    }

    /// Share of the beams that end where nobody looked, 0 to 1.
    #[must_use]
    pub fn silent_share(&self) -> f64 {
        self.share(self.silent)
    }
}

impl EvidenceGrid {
    /// What `beams` say of the robot being at `map_from_base`.
    #[must_use]
    pub fn weigh(&self, beams: &Beams, map_from_base: &Pose2, config: &EvidenceConfig) -> Evidence {
        Evidence::of(&self.judge(beams, map_from_base, config))
    }

    /// What each of `beams` says of it; `None` where nothing returned.
    #[must_use]
    pub fn judge(&self, beams: &Beams, map_from_base: &Pose2, config: &EvidenceConfig) -> Vec<Option<BeamVerdict>> {
        let from = map_from_base * beams.from;
        let yaw = map_from_base.rotation.angle();
        let ahead = |beam: &Beam| {
            let (sin, cos) = (yaw + beam.angle).sin_cos();
            Vector2::new(cos, sin)
        };
        let reach = |beam: &Beam| beam.range_m.unwrap_or(0.0) + 2.0 * config.margin_m;
        let rays: Vec<Sightline> =
            beams.beams.iter().map(|beam| self.sightline(from, ahead(beam), reach(beam))).collect();
        let judged = |(index, beam): (usize, &Beam)| {
            let range_m = beam.range_m?;
            let around = &rays[index.saturating_sub(1)..(index + 2).min(rays.len())];
            let farthest = around.iter().map(|ray| ray.free_m).fold(0.0, f64::max);
            let nearest = around.iter().map(|ray| ray.free_m).fold(f64::INFINITY, f64::min);
            let is_behind = around.iter().all(|ray| ray.is_wall) && beam.least_m > farthest + config.margin_m;
            let is_before = beam.greatest_m < nearest - config.margin_m;
            let end = from + ahead(beam) * range_m;
            Some(if is_behind {
                BeamVerdict::TooLong(from + ahead(beam) * rays[index].free_m)
            } else if self.cell(end) & NEAR_WALL != 0 {
                BeamVerdict::Explained(end)
            } else if is_before && beam.is_alone {
                BeamVerdict::Somebody
            } else if is_before {
                BeamVerdict::TooShort
            } else {
                BeamVerdict::Silent
            })
        };
        beams.beams.iter().enumerate().map(judged).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::pose;

    /// What a scanner at `at` sees of a room of 6 m × 4 m around the origin with a box in a
    /// corner.
    fn scan(at: &Pose2) -> LaserScan {
        let walls: [((f64, f64), (f64, f64)); 6] = [
            ((-3.0, -2.0), (3.0, -2.0)),
            ((3.0, -2.0), (3.0, 1.0)),
            ((3.0, 1.0), (2.0, 1.0)),
            ((2.0, 1.0), (2.0, 2.0)),
            ((2.0, 2.0), (-3.0, 2.0)),
            ((-3.0, 2.0), (-3.0, -2.0)),
        ];
        let range = |degree: i32| {
            let (dy, dx) = (f64::from(degree).to_radians() + at.rotation.angle()).sin_cos();
            let meets = walls.iter().filter_map(|&((x1, y1), (x2, y2))| {
                let (ex, ey, ox, oy) = (x2 - x1, y2 - y1, x1 - at.translation.x, y1 - at.translation.y);
                let cross = dx * ey - dy * ex;
                let (t, u) = ((ox * ey - oy * ex) / cross, (ox * dy - oy * dx) / cross);
                (t > 0.0 && (0.0..=1.0).contains(&u)).then_some(t)
            });
            meets.fold(f64::INFINITY, f64::min) as f32
        };
        LaserScan {
            base_from_sensor: pose(0.0, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: 1.0_f64.to_radians(),
            range_min_m: 0.1,
            range_max_m: 7.0,
            ranges_m: (0..360).map(range).collect(),
        }
    }

    fn known() -> EvidenceGrid {
        let at = [pose(0.0, 0.0, 0.0), pose(-1.0, 1.0, 0.5)];
        let sightings = at.map(|at| Sighting {
            from: Point2::from(at.translation.vector),
            ends: scan(&at).points_in_base().iter().map(|end| at * end).collect(),
        });
        EvidenceGrid::new(&sightings, &[])
    }

    #[test]
    fn the_true_pose_is_explained_and_others_are_contradicted() {
        let (known, config) = (known(), EvidenceConfig::default());
        let truth = pose(1.0, -0.7, 2.0);
        let beams = Beams::of(&scan(&truth), &config);
        let here = known.weigh(&beams, &truth, &config);
        assert!(here.explained_share() > 0.95 && here.contradicted == 0, "{here:?}");
        let nearly = known.weigh(&beams, &pose(1.05, -0.66, 2.02), &config);
        assert!(nearly.contradicted_share() < 0.02, "{nearly:?}");
        for wrong in [pose(-1.0, 0.7, 2.0), pose(1.0, -0.7, 2.0 + std::f64::consts::PI), pose(0.0, 0.0, 2.0)] {
            let there = known.weigh(&beams, &wrong, &config);
            assert!(there.contradicted_share() > 0.15, "{wrong}: {there:?}");
        }
    }

    #[test]
    fn who_stands_in_a_room_may_be_somebody() {
        let (known, config) = (known(), EvidenceConfig::default());
        let at = pose(-1.0, -0.5, 0.0);
        // Somebody stands 1 m ahead.
        let mut seen = scan(&at);
        for (index, range_m) in seen.ranges_m.iter_mut().enumerate() {
            let off = (index as i32 + 180).rem_euclid(360) - 180;
            *range_m = if off.abs() <= 8 { 1.0 } else { *range_m };
        }
        let verdicts = known.judge(&Beams::of(&seen, &config), &at, &config);
        let count = |verdict| verdicts.iter().flatten().filter(|it| **it == verdict).count();
        assert!(count(BeamVerdict::Somebody) >= 2 && count(BeamVerdict::TooShort) == 0, "{verdicts:?}");
    }

    #[test]
    fn what_was_seen_through_is_where_the_map_has_it() {
        let (mut known, config) = (known(), EvidenceConfig::default());
        let at = pose(-1.0, -0.5, 0.0);
        // Somebody stood there when the map was made.
        let ghost = Point2::new(-1.0, -0.5);
        known.put_wall(ghost);
        for verdict in known.judge(&Beams::of(&scan(&at), &config), &at, &config).into_iter().flatten() {
            assert!(matches!(verdict, BeamVerdict::TooLong(wall) if (wall - ghost).norm() < 0.2), "{verdict:?}");
        }
    }

    #[test]
    fn nothing_known_says_nothing() {
        let config = EvidenceConfig::default();
        let beams = Beams::of(&scan(&pose(0.0, 0.0, 0.0)), &config);
        let evidence = EvidenceGrid::default().weigh(&beams, &pose(0.0, 0.0, 0.0), &config);
        assert_eq!((evidence.explained, evidence.contradicted), (0, 0));
        assert!(evidence.silent > 80);
    }
}
