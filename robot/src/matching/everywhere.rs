//! Search in a whole building: branch and bound over pictures of its walls, best first.
//!
//! A window of places is bounded by letting each point fit as well as it does anywhere in the window (Hess et al., "Real-time
//! loop closure in 2D LIDAR SLAM", ICRA 2016). Windows are opened best first, so the alignments come out in order, and the
//! work can be bounded: what was not found by then fits less well than what was. The first windows of one heading are bounded all at
//! once: each point adds a shifted picture to theirs.

use super::correlative::thin;
use crate::pose::{Point2, Pose2, pose, wrap_angle};
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

/// How a building is searched.
#[derive(Clone, Debug)]
pub struct EverywhereConfig {
    /// Side of a cell of the picture, metres. Default 0.2.
    pub resolution_m: f64,
    /// A point this far from a wall fits not at all, one on it fully, metres. Default 0.3.
    pub blur_m: f64,
    /// Step of the headings, radians. Default 0.05.
    pub step_rad: f64,
    /// The first windows are 2 to this many cells wide. Default 2.
    pub levels: u32,
    /// Points of the scan that are compared. Default 80, at most 255.
    pub points: usize,
    /// Points farther from the scan's origin are left out, metres. Default 12.
    pub reach_m: f64,
    /// Alignments to find. Default 16.
    pub found: usize,
    /// They differ by at least this, metres. Default 0.6.
    pub apart_m: f64,
    /// Or by this, radians. Default 0.3.
    pub apart_rad: f64,
    /// Alignments that fit worse than this share of the best are left out. Default 0.75.
    pub least_of_best: f64,
    /// And those that fit worse than this, 0 to 1. Default 0.3.
    pub least_fit: f64,
    /// Windows to look at, after the first ones. Default 40,000.
    pub windows: usize,
}

impl Default for EverywhereConfig {
    fn default() -> Self {
        Self {
            resolution_m: 0.2,
            blur_m: 0.3,
            step_rad: 0.05,
            levels: 2,
            points: 80,
            reach_m: 12.0,
            found: 16,
            apart_m: 0.6,
            apart_rad: 0.3,
            least_of_best: 0.75,
            least_fit: 0.3,
            windows: 40_000,
        }
    }
}

/// Places that something else than the scan speaks for, as a picture of them does.
#[derive(Clone, Copy, Debug)]
pub struct Favour {
    /// Their middle.
    pub centre: Point2,
    /// How far from it they are, metres.
    pub radius_m: f64,
    /// What is added to the fit, which is from 0 to 1.
    pub bonus: f64,
}

/// Where the scan may have been taken.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// Pose of the scan's frame in the map, true to about half a cell and half a step.
    pub map_from_scan: Pose2,
    /// How well its points fit, 0 to 1.
    pub fit: f64,
}

/// Pictures of a building's walls and of where a robot can stand, each cell holding the best of ever wider windows.
#[derive(Clone, Debug)]
pub struct WallPyramid {
    config: EverywhereConfig,
    min: Point2,
    width: usize,
    height: usize,
    /// By level: how well a point fits at best in the window of 2^level cells that begins here, 0 to 255.
    fits: Vec<Vec<u8>>,
    /// By level: whether a robot can stand anywhere in the window.
    standable: Vec<Vec<u8>>,
    /// The widest windows sorted by where they begin within a square of the first windows: `[row % side][column % side]`.
    phases: Vec<Vec<u8>>,
}

/// Cells that a picture may have: 64 million, 2.5 km² at 0.2 m.
const MOST_CELLS: f64 = 64e6;

impl WallPyramid {
    /// Draws `walls` (points on them) and `places` where a robot can stand, no farther apart than a cell. `None` without
    /// either, or when they are too far apart for a building.
    #[must_use]
    pub fn new(walls: &[Point2], places: &[Point2], config: &EverywhereConfig) -> Option<Self> {
        let resolution = config.resolution_m;
        let first = walls.first()?;
        let all = walls.iter().chain(places);
        let (low, high) = all.fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
        // All points of a scan taken anywhere inside fall into the picture.
        let side = 1_usize << config.levels;
        let margin = config.reach_m + config.blur_m + resolution * (2 * side) as f64;
        let size = (high - low).map(|metres| (metres + 2.0 * margin) / resolution);
        if places.is_empty() || !(size.x * size.y).is_finite() || size.x * size.y > MOST_CELLS {
            return None;
        }
        let whole = |cells: f64| (cells.ceil() as usize + 1).next_multiple_of(side);
        let (width, height) = (whole(size.x), whole(size.y));
        let min = Point2::new(low.x - margin, low.y - margin);
        let mut pyramid = Self {
            config: config.clone(),
            min,
            width,
            height,
            fits: Vec::new(),
            standable: Vec::new(),
            phases: Vec::new(),
        };
        let mut fits = vec![0_u8; width * height];
        walls.iter().for_each(|wall| pyramid.draw(wall, &mut fits));
        let mut standable = vec![0_u8; width * height];
        for place in places {
            let (i, j) = pyramid.cell_of(place);
            standable[j * width + i] = 1;
        }
        pyramid.fits = pyramid.widened(fits);
        pyramid.standable = pyramid.widened(standable);
        pyramid.phases = pyramid.phases();
        Some(pyramid)
    }

    fn phases(&self) -> Vec<Vec<u8>> {
        let side = 1_usize << self.config.levels;
        let Some(widest) = self.fits.last() else { return Vec::new() };
        let phase = |index: usize| {
            let (row, column) = (index / side, index % side);
            let rows = (row..self.height).step_by(side);
            rows.flat_map(|j| (column..self.width).step_by(side).map(move |i| widest[j * self.width + i])).collect()
        };
        (0..side * side).map(phase).collect()
    }

    fn cell_of(&self, point: &Point2) -> (usize, usize) {
        let cell = (point - self.min) / self.config.resolution_m;
        (cell.x as usize, cell.y as usize)
    }

    fn draw(&self, wall: &Point2, fits: &mut [u8]) {
        let (resolution, blur) = (self.config.resolution_m, self.config.blur_m);
        let (i, j) = self.cell_of(wall);
        let reach = (blur / resolution).ceil() as usize;
        for y in j.saturating_sub(reach)..=(j + reach).min(self.height - 1) {
            for x in i.saturating_sub(reach)..=(i + reach).min(self.width - 1) {
                let centre = self.min + nalgebra::Vector2::new(x as f64 + 0.5, y as f64 + 0.5) * resolution;
                let fit = (255.0 * (1.0 - (centre - wall).norm() / blur).max(0.0)) as u8;
                let cell = &mut fits[y * self.width + x];
                *cell = (*cell).max(fit);
            }
        }
    }

    /// The picture and its wider windows: each doubles the one before.
    fn widened(&self, finest: Vec<u8>) -> Vec<Vec<u8>> {
        let mut levels = vec![finest];
        for level in 0..self.config.levels {
            let step = 1_usize << level;
            let narrow = &levels[level as usize];
            let mut wide = narrow.clone();
            for j in 0..self.height {
                let row = &mut wide[j * self.width..(j + 1) * self.width];
                if j + step < self.height {
                    let below = &narrow[(j + step) * self.width..(j + step + 1) * self.width];
                    row.iter_mut().zip(below).for_each(|(cell, other)| *cell = (*cell).max(*other));
                }
                for i in 0..self.width.saturating_sub(step) {
                    row[i] = row[i].max(row[i + step]);
                }
            }
            levels.push(wide);
        }
        levels
    }

    /// Where a scan with these end points (its own frame) may have been taken, best first.
    #[must_use]
    pub fn find(&self, scan: &[Point2], favours: &[Favour]) -> Vec<Alignment> {
        let config = &self.config;
        let near: Vec<Point2> = scan.iter().filter(|point| point.coords.norm() <= config.reach_m).copied().collect();
        if near.is_empty() {
            return Vec::new();
        }
        let points = thin(&near, config.points.min(255));
        let turns = (TAU / config.step_rad).ceil().max(1.0) as usize;
        let rotated: Vec<Vec<[i32; 2]>> = (0..turns)
            .map(|turn| {
                let rotation = nalgebra::Rotation2::new(self.yaw_of(turn));
                let cell = |point: &Point2| {
                    let at = (rotation * point) / config.resolution_m;
                    [at.x, at.y].map(|cells| (cells + 0.5).floor() as i32)
                };
                points.iter().map(cell).collect()
            })
            .collect();
        Search { pyramid: self, rotated: &rotated, favours }.run()
    }

    fn yaw_of(&self, turn: usize) -> f64 {
        wrap_angle(turn as f64 * self.config.step_rad)
    }

    /// How well points fit, as a sum of 0 to 255 for each, in the window that begins at cell (i, j).
    fn fit(&self, points: &[[i32; 2]], level: u32, i: usize, j: usize) -> u32 {
        let fits = &self.fits[level as usize];
        let base = (j * self.width + i) as i32;
        let cell = |&[x, y]: &[i32; 2]| (base + y * self.width as i32 + x) as usize;
        points.iter().map(|point| fits.get(cell(point)).map_or(0, |fit| u32::from(*fit))).sum()
    }

    /// The same for all first windows, row by row.
    fn first_fits(&self, points: &[[i32; 2]]) -> Vec<u16> {
        let side = 1_i32 << self.config.levels;
        let (columns, rows) = (self.width / side as usize, self.height / side as usize);
        let mut sums = vec![0_u16; columns * rows];
        for &[x, y] in points {
            let phase = &self.phases[(y.rem_euclid(side) * side + x.rem_euclid(side)) as usize];
            // Window w looks at cell w + shift of the phase; what that would take out of the picture belongs to windows in which no
            // robot can stand.
            let shift = i64::from(y.div_euclid(side)) * columns as i64 + i64::from(x.div_euclid(side));
            let first = usize::try_from(-shift).unwrap_or(0);
            let from = usize::try_from(shift).unwrap_or(0);
            let (Some(sums), Some(phase)) = (sums.get_mut(first..), phase.get(from..)) else { continue };
            sums.iter_mut().zip(phase).for_each(|(sum, fit)| *sum += u16::from(*fit));
        }
        sums
    }
}

/// Places that begin at cell (i, j), 2^level cells wide, at one heading.
#[derive(Clone, Copy)]
struct Window {
    /// Bound of the fit with its favour.
    bound: f64,
    fit: f64,
    level: u32,
    turn: usize,
    i: usize,
    j: usize,
}

impl Ord for Window {
    fn cmp(&self, other: &Self) -> Ordering {
        // Among equals the finer first, then always the same one.
        let place = |window: &Self| (window.turn, window.j, window.i);
        self.bound
            .total_cmp(&other.bound)
            .then(other.level.cmp(&self.level))
            .then_with(|| place(other).cmp(&place(self)))
    }
}

impl PartialOrd for Window {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Window {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Window {}

struct Search<'a> {
    pyramid: &'a WallPyramid,
    /// By turn: the cells of the points.
    rotated: &'a [Vec<[i32; 2]>],
    favours: &'a [Favour],
}

impl Search<'_> {
    fn run(&self) -> Vec<Alignment> {
        let config = &self.pyramid.config;
        let mut open = self.first_windows();
        let mut left = config.windows;
        let mut found: Vec<Alignment> = Vec::new();
        let mut best = 0.0;
        while let Some(window) = open.pop() {
            if window.bound < config.least_of_best * best || left == 0 {
                break;
            }
            let alignment = self.alignment(&window);
            if window.level < 2 && found.iter().any(|other| self.is_near(&alignment, other)) {
                continue;
            }
            if window.level == 0 {
                best = window.bound.max(best);
                found.push(alignment);
                if found.len() >= config.found {
                    break;
                }
                continue;
            }
            let (level, step) = (window.level - 1, 1_usize << (window.level - 1));
            for (i, j) in [(0, 0), (step, 0), (0, step), (step, step)] {
                left = left.saturating_sub(1);
                open.extend(self.window(level, window.turn, window.i + i, window.j + j));
            }
        }
        found
    }

    fn first_windows(&self) -> BinaryHeap<Window> {
        let pyramid = self.pyramid;
        let level = pyramid.config.levels;
        let side = 1_usize << level;
        let columns = pyramid.width / side;
        let place = |index: usize| (index % columns * side, index / columns * side);
        // By place, whatever the heading: what favours speak for it; none where no robot can stand.
        let bonuses: Vec<Option<f64>> = (0..columns * (pyramid.height / side))
            .map(|index| {
                let (i, j) = place(index);
                (pyramid.standable[level as usize][j * pyramid.width + i] != 0).then(|| self.bonus(level, i, j))
            })
            .collect();
        let mut windows = Vec::new();
        for (turn, points) in self.rotated.iter().enumerate() {
            for (index, (sum, bonus)) in pyramid.first_fits(points).into_iter().zip(&bonuses).enumerate() {
                let Some(bonus) = bonus else { continue };
                let fit = self.share(turn, u32::from(sum));
                if fit + bonus >= pyramid.config.least_fit {
                    let (i, j) = place(index);
                    windows.push(Window { bound: fit + bonus, fit, level, turn, i, j });
                }
            }
        }
        BinaryHeap::from(windows)
    }

    /// The window, if a robot can stand in it.
    fn window(&self, level: u32, turn: usize, i: usize, j: usize) -> Option<Window> {
        let pyramid = self.pyramid;
        let is_inside = i < pyramid.width && j < pyramid.height;
        if !is_inside || pyramid.standable[level as usize][j * pyramid.width + i] == 0 {
            return None;
        }
        let fit = self.share(turn, pyramid.fit(&self.rotated[turn], level, i, j));
        Some(Window { bound: fit + self.bonus(level, i, j), fit, level, turn, i, j })
    }

    fn share(&self, turn: usize, sum: u32) -> f64 {
        f64::from(sum) / (255.0 * self.rotated[turn].len() as f64)
    }

    /// The greatest bonus of the favours that speak for some place in the window.
    fn bonus(&self, level: u32, i: usize, j: usize) -> f64 {
        let half_m = 0.5 * f64::from(1_u32 << level) * self.pyramid.config.resolution_m;
        let centre = self.place(level, i, j);
        let speaks = |favour: &&Favour| (favour.centre - centre).norm() <= favour.radius_m + 1.5 * half_m;
        self.favours.iter().filter(speaks).map(|favour| favour.bonus).fold(0.0, f64::max)
    }

    /// The middle of a window.
    fn place(&self, level: u32, i: usize, j: usize) -> Point2 {
        let half = 0.5 * f64::from(1_u32 << level);
        let cell = nalgebra::Vector2::new(i as f64 + half, j as f64 + half);
        self.pyramid.min + cell * self.pyramid.config.resolution_m
    }

    fn alignment(&self, window: &Window) -> Alignment {
        let place = self.place(window.level, window.i, window.j);
        Alignment { map_from_scan: pose(place.x, place.y, self.pyramid.yaw_of(window.turn)), fit: window.fit }
    }

    fn is_near(&self, a: &Alignment, b: &Alignment) -> bool {
        let config = &self.pyramid.config;
        let apart = a.map_from_scan.translation.vector - b.map_from_scan.translation.vector;
        let turn = wrap_angle(a.map_from_scan.rotation.angle() - b.map_from_scan.rotation.angle());
        apart.norm() < config.apart_m && turn.abs() < config.apart_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    /// Points every 5 cm along the walls of a building: two rooms of one shape, 12 m apart, and a pillar in the second.
    fn building() -> Vec<Point2> {
        let room = [(-3.0, -2.0), (4.0, -2.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (-3.0, 4.0), (-3.0, -2.0)];
        let pillar = [(10.0, 0.5), (10.6, 0.5), (10.6, 1.1), (10.0, 1.1), (10.0, 0.5)];
        let second = room.map(|(x, y)| (x + 12.0, y));
        [room.as_slice(), &second, &pillar].into_iter().flat_map(|corners| corners.windows(2).flat_map(along)).collect()
    }

    fn along(pair: &[(f64, f64)]) -> Vec<Point2> {
        let (from, to) = (Point2::new(pair[0].0, pair[0].1), Point2::new(pair[1].0, pair[1].1));
        let steps = ((to - from).norm() / 0.05).round() as usize;
        (0..steps).map(|step| from + (to - from) * (step as f64 / steps as f64)).collect()
    }

    fn places() -> Vec<Point2> {
        let room = (0..28).flat_map(|i| (0..24).map(move |j| (f64::from(i) * 0.2 - 2.6, f64::from(j) * 0.2 - 1.8)));
        let inside = room.filter(|&(x, y)| x < 0.9 || y < 0.9);
        inside.flat_map(|(x, y)| [Point2::new(x, y), Point2::new(x + 12.0, y)]).collect()
    }

    /// What is within 7 m of `at`, in its frame; walls hide nothing here.
    fn scan(at: &Pose2) -> Vec<Point2> {
        let near = building().into_iter().step_by(3).map(|point| at.inverse() * point);
        near.filter(|point| point.coords.norm() < 4.0).collect()
    }

    fn pyramid() -> WallPyramid {
        WallPyramid::new(&building(), &places(), &EverywhereConfig::default()).expect("a building")
    }

    fn gap(found: &Alignment, truth: &Pose2) -> (f64, f64) {
        let apart = (found.map_from_scan.translation.vector - truth.translation.vector).norm();
        (apart, wrap_angle(found.map_from_scan.rotation.angle() - truth.rotation.angle()).abs())
    }

    #[test]
    fn look_alikes_are_both_found_and_a_favour_decides_between_them() {
        let truth = pose(-2.0, 2.5, 1.0);
        let twin = pose(10.0, 2.5, 1.0);
        let seen = scan(&truth);
        let found = pyramid().find(&seen, &[]);
        for place in [truth, twin] {
            let is_there = found.iter().any(|alignment| gap(alignment, &place).0 < 0.3);
            assert!(is_there, "{place}: {found:?}");
        }
        for place in [truth, twin] {
            let centre = Point2::from(place.translation.vector);
            let favour = Favour { centre, radius_m: 3.0, bonus: 0.1 };
            let first = pyramid().find(&seen, &[favour])[0];
            assert!(gap(&first, &place).0 < 0.3, "{first:?}");
        }
    }

    #[test]
    fn alignments_come_best_first_and_apart() {
        let config = EverywhereConfig::default();
        let found = pyramid().find(&scan(&pose(1.5, -1.0, -2.0)), &[]);
        assert!(found.windows(2).all(|pair| pair[0].fit >= pair[1].fit));
        for (index, a) in found.iter().enumerate() {
            assert!(a.fit >= config.least_of_best * found[0].fit - 1e-9);
            for b in &found[..index] {
                let (metres, radians) = gap(a, &b.map_from_scan);
                assert!(metres >= config.apart_m || radians >= config.apart_rad, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn nothing_is_found_in_nothing() {
        let config = EverywhereConfig::default();
        assert!(WallPyramid::new(&[], &places(), &config).is_none());
        assert!(WallPyramid::new(&building(), &[], &config).is_none());
        let far = [Point2::new(0.0, 0.0), Point2::new(1e9, 1e9)];
        assert!(WallPyramid::new(&far, &places(), &config).is_none());
        assert!(pyramid().find(&[], &[]).is_empty());
        assert!(pyramid().find(&[Point2::new(100.0, 0.0)], &[]).is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn a_scan_is_found_where_it_was_taken(i in 0..500_usize, yaw in -PI..PI) {
            let place = places()[i % places().len()];
            let truth = pose(place.x, place.y, yaw);
            let found = pyramid().find(&scan(&truth), &[]);
            let best = found.iter().map(|alignment| gap(alignment, &truth)).filter(|&(metres, radians)| metres < 0.3 && radians < 0.1);
            prop_assert!(best.count() > 0, "{truth}: {found:?}");
        }

        #[test]
        fn a_first_window_bounds_all_places_in_it(i in 0..500_usize, turn in 0..126_usize, column in 0..40_usize, row in 0..30_usize) {
            let pyramid = pyramid();
            let place = places()[i % places().len()];
            let points: Vec<[i32; 2]> = scan(&pose(place.x, place.y, 0.05 * turn as f64)).iter()
                .map(|point| [point.x, point.y].map(|metres| (metres / 0.2 + 0.5).floor() as i32)).collect();
            let points = &points[..points.len().min(255)];
            let side = 1 << pyramid.config.levels;
            let margin = 64 / side;
            let (column, row) = (column % (pyramid.width / side - 2 * margin) + margin, row % (pyramid.height / side - 2 * margin) + margin);
            let first = u32::from(pyramid.first_fits(points)[row * (pyramid.width / side) + column]);
            prop_assert_eq!(first, pyramid.fit(points, pyramid.config.levels, column * side, row * side));
            for (j, i) in (0..side).flat_map(|j| (0..side).map(move |i| (j, i))) {
                prop_assert!(pyramid.fit(points, 0, column * side + i, row * side + j) <= first);
            }
        }
    }
}
