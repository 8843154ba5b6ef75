//! The search: windows of places, opened best first.

use super::{Favour, PoseCandidate, WallPyramid};
use crate::matching::correlative::thin;
use crate::pose::{Point2, pose, wrap_angle};
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

impl WallPyramid {
    /// Where a scan with these end points (its own frame) may have been taken, best first.
    #[must_use]
    pub fn find(&self, scan: &[Point2], favours: &[Favour]) -> Vec<PoseCandidate> {
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
    fn run(&self) -> Vec<PoseCandidate> {
        let config = &self.pyramid.config;
        let mut open = self.first_windows();
        let mut left = config.windows;
        let mut found: Vec<PoseCandidate> = Vec::new();
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

    fn alignment(&self, window: &Window) -> PoseCandidate {
        let place = self.place(window.level, window.i, window.j);
        PoseCandidate { map_from_scan: pose(place.x, place.y, self.pyramid.yaw_of(window.turn)), fit: window.fit }
    }

    fn is_near(&self, a: &PoseCandidate, b: &PoseCandidate) -> bool {
        let config = &self.pyramid.config;
        let apart = a.map_from_scan.translation.vector - b.map_from_scan.translation.vector;
        let turn = wrap_angle(a.map_from_scan.rotation.angle() - b.map_from_scan.rotation.angle());
        apart.norm() < config.apart_m && turn.abs() < config.apart_rad
    }
}
