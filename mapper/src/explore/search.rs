//! The search for a goal: the expensive part of exploration, a pure function of a grid and a
//! question. It is asked beside the robot's loop, which drives on meanwhile.

use super::setbacks::Setbacks;
use super::{ExploreConfig, utility, zone_keeping};
use crate::explore::division::{Prospect, Team, Worth};
use crate::explore::frontier::{self, Frontier, Knowledge, find_frontiers};
use crate::explore::half_seen::find_half_seen;
use crate::explore::missing_links::MissingLinks;
use fht_map::{MapState, Rules};
use fht_navigation::motion::PathFollower;
use fht_navigation::planning::{PlanConfig, Traversable, region_around};
use fht_perception::grid::{Cell, CellBounds, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use fht_proto::Square;
use std::borrow::Cow;
use std::sync::Arc;

/// The way's direction is taken at this distance from the robot, metres.
const SET_OFF_M: f64 = 0.6;
/// The first search for a frontier goes so far, metres.
const NEAR_M: f64 = 6.0;
/// Every further search goes farther by this factor.
const WIDEN: f64 = 2.5;
/// The region of a search reaches beyond its limit by this much, so that frontiers at the limit are
/// seen whole, metres.
const REGION_MARGIN_M: f64 = 1.0;
/// Where the robot began is a place this near to it, metres.
const HOME_REACH_M: f64 = 0.5;
/// A way that has become longer by more than this is no longer the way that was chosen, metres.
const DETOUR_M: f64 = 2.0;

/// What a robot goes to see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sought {
    /// What lies beyond a frontier.
    Frontier,
    /// A frontier of its own beyond which another robot has seen on.
    Seam,
    /// Floor that was seen for a moment only.
    HalfSeen,
}

/// A place the robot is on its way to.
#[derive(Clone, Debug)]
pub(super) struct Goal {
    pub(super) target: Point2,
    pub(super) stand: Point2,
    /// What the way there keeps from occupied cells, metres: less than otherwise if the robot was
    /// boxed in.
    pub(super) robot_radius_m: f64,
    pub(super) follower: PathFollower,
    pub(super) reached_us: Option<u64>,
    pub(super) sought: Sought,
}

/// A goal that the robot is driving to already.
#[derive(Clone, Copy, Debug)]
pub(super) struct Underway {
    pub(super) target: Point2,
    pub(super) stand: Point2,
    pub(super) robot_radius_m: f64,
    /// What was left of the way, metres.
    pub(super) remaining_m: f64,
    pub(super) sought: Sought,
}

/// A question: where to drive, or how to get on to where the robot is driving already.
#[derive(Clone, Debug)]
pub struct Search {
    pub(super) config: ExploreConfig,
    pub(super) setbacks: Setbacks,
    /// Where the robot went to look at half-seen floor again.
    pub(super) second_looks: Setbacks,
    pub(super) team: Team,
    pub(super) rules: Arc<Rules>,
    pub(super) map_from_base: Pose2,
    pub(super) time_us: u64,
    /// The goal to be kept, unless the way there has become much longer.
    pub(super) underway: Option<Underway>,
    /// The map, if others have seen some of the building.
    pub(super) map: Option<MapState>,
    /// Whether the grid shows people who stand.
    pub(super) is_among_people: bool,
}

/// Where to look for a goal, and for which.
struct Quest<'a> {
    /// What is free and not zone_keeping, as far as anybody has seen.
    free: &'a OccupancyGrid,
    /// What need not be seen any more.
    known: Knowledge<'a>,
    sought: Sought,
    /// Of seams, only those at which the map lacks a link.
    seams: Option<MissingLinks<'a>>,
}

/// The answer to a [`Search`].
#[derive(Clone, Debug)]
pub struct SearchResult {
    /// The goal that was to be kept.
    pub(super) underway: Option<Point2>,
    /// What to drive to; `None` when nothing is left.
    pub(super) goal: Option<Goal>,
    /// Whether people were in the way.
    pub(super) is_among_people: bool,
}

impl Search {
    /// The same question on a grid that shows people who stand.
    #[must_use]
    pub fn among_people(self, is_among_people: bool) -> Self {
        Self { is_among_people, ..self }
    }

    /// The same question, given the map if it is of use: when others have seen some of the
    /// building.
    #[must_use]
    pub fn over(self, map: impl FnOnce() -> MapState) -> Self {
        let map = (!self.team.seen.is_empty()).then(map);
        Self { map, ..self }
    }

    /// Searches `grid`, which is in the map frame, and what others say that they have seen, but for
    /// what is closed.
    #[must_use]
    pub fn run(&self, grid: &OccupancyGrid) -> SearchResult {
        let mut seen = Cow::Borrowed(grid);
        let is_doubted = |at: Point2| self.team.seen.iter().any(|seen| seen.square_at(at) == Square::Occupied);
        for told in &self.team.seen {
            told.draw_free_space(seen.to_mut(), is_doubted);
        }
        let free = zone_keeping::drawn(&seen, &self.rules, Some(self.position()));
        let (plan, config) = (&self.config.plan, &self.config.links);
        let seams = || self.map.as_ref().map(|map| MissingLinks::of(map, &free, plan, config));
        // Another one may have joined a seam's ends since.
        let is_open = |underway: &Underway| {
            underway.sought != Sought::Seam || seams().is_some_and(|seams| seams.is_missing_link(underway.target))
        };
        let kept = || self.underway.filter(is_open).and_then(|underway| self.way_on(&free, &underway));
        let known = Knowledge { grid: &free, others: &self.team.seen };
        let quest = |known, sought, seams| Quest { free: &free, known, sought, seams };
        let goal = self
            .way_out(&free, &seen)
            .or_else(kept)
            .or_else(|| self.choose(&quest(known, Sought::Frontier, None)))
            .or_else(|| self.choose(&quest(Knowledge::alone(grid), Sought::Seam, Some(seams()?))))
            .or_else(|| self.choose(&quest(known, Sought::HalfSeen, None)));
        let underway = self.underway.map(|underway| underway.target);
        SearchResult { underway, goal, is_among_people: self.is_among_people }
    }

    fn position(&self) -> Point2 {
        Point2::from(self.map_from_base.translation.vector)
    }

    /// The nearest place that is not zone_keeping, if the robot stands where it may not and knows a
    /// way out: what it went to see, and what is best to see, may lie deeper in the same zone.
    /// `free` is open where the robot stands, `seen` is without what is closed.
    fn way_out(&self, free: &OccupancyGrid, seen: &OccupancyGrid) -> Option<Goal> {
        let position = self.position();
        if !zone_keeping::is_closed(&self.rules, position) {
            return None;
        }
        let plan = &self.config.plan;
        let outside = Traversable::new(&zone_keeping::drawn(seen, &self.rules, None), plan);
        let space = Traversable::new(free, plan);
        let distances = space.distances_from(position);
        let bounds = space.bounds();
        let cells = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
        let reached = cells.filter(|&cell| outside.is_passable(cell));
        let reached = reached.filter_map(|cell| Some((distances.distance_m(cell)?, cell)));
        let (_, stand) = reached.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Goal {
            target: space.centre(stand),
            stand: space.centre(stand),
            robot_radius_m: plan.robot_radius_m,
            follower: PathFollower::new(self.config.follow.clone(), space.shorten(&distances.path_to(stand))),
            reached_us: None,
            sought: Sought::Frontier,
        })
    }

    /// The path to the same goal over the grid as it is now, if that is not much longer.
    fn way_on(&self, grid: &OccupancyGrid, underway: &Underway) -> Option<Goal> {
        let position = self.position();
        let reach_m = underway.remaining_m + DETOUR_M;
        let plan = PlanConfig { robot_radius_m: underway.robot_radius_m, ..self.config.plan.clone() };
        let space = Traversable::in_region(grid, &plan, region_around(grid, position, reach_m));
        let path = space.shortest_path(position, underway.stand).filter(|path| path.length_m <= reach_m)?;
        Some(Goal {
            target: underway.target,
            stand: underway.stand,
            robot_radius_m: underway.robot_radius_m,
            follower: PathFollower::new(self.config.follow.clone(), space.shorten(&path.points)),
            reached_us: None,
            sought: underway.sought,
        })
    }

    /// The frontier of greatest utility that has not failed; if all have, the best that may be
    /// tried again. A robot that is boxed in squeezes out first.
    fn choose(&self, quest: &Quest<'_>) -> Option<Goal> {
        let config = &self.config;
        // So that it ends, however the grid changes its mind.
        let may_look = |target: Point2| {
            quest.sought != Sought::HalfSeen || self.second_looks.allows_later(target, &config.setbacks)
        };
        let allowed_later = |target: Point2| self.setbacks.allows_later(target, &config.setbacks) && may_look(target);
        let allowed = |target: Point2| self.setbacks.allows(target, self.time_us, &config.setbacks) && may_look(target);
        let later = || {
            let rests = self.setbacks.has_resting(self.time_us, &config.setbacks);
            rests.then(|| self.best_goal(quest, config, allowed_later)).flatten()
        };
        self.best_goal(quest, config, allowed).or_else(later).or_else(|| {
            if !self.is_boxed_in(quest.free) {
                return None;
            }
            let plan = PlanConfig { robot_radius_m: config.squeeze_m, ..config.plan.clone() };
            let tight = ExploreConfig { plan, ..config.clone() };
            self.best_goal(quest, &tight, allowed_later)
        })
    }

    /// Whether the robot cannot even get back to where it began: it drove into a gap that has
    /// become narrower in the grid, or what was closed since leaves a gap only, or nothing.
    fn is_boxed_in(&self, grid: &OccupancyGrid) -> bool {
        let space = Traversable::new(grid, &self.config.plan);
        let position = self.position();
        let origin = space.nearest_passable(Point2::origin(), HOME_REACH_M);
        origin.is_some_and(|home| space.distances_from(position).distance_m(home).is_none())
    }

    /// The way to the frontier of greatest utility among those that `accept` allows, wherever it
    /// is.
    ///
    /// It looks near the robot first, and farther only while something farther could still be
    /// better.
    fn best_goal(&self, quest: &Quest<'_>, config: &ExploreConfig, accept: impl Fn(Point2) -> bool) -> Option<Goal> {
        let map_from_base = &self.map_from_base;
        let grid = quest.free;
        let position = Point2::from(map_from_base.translation.vector);
        let is_open = |cell: Cell| accept(grid.centre(cell));
        // To look twice whether a link is missing costs more than to look far, and once no frontier
        // is left, nothing is to be overtaken.
        let mut limit_m = if quest.sought == Sought::Frontier { NEAR_M } else { f64::INFINITY };
        loop {
            let region = region_around(grid, position, limit_m + config.frontier.vantage_reach_m + REGION_MARGIN_M);
            let is_all = region == grid.bounds();
            if is_all {
                limit_m = f64::INFINITY;
            }
            let in_reach = |cell: &Cell| is_open(*cell) && (grid.centre(*cell) - position).norm() <= limit_m;
            let mut frontiers = quest.frontiers(region, config);
            frontiers.retain(|frontier| frontier.cells.iter().any(in_reach));
            // Without the cost of a search for ways to nowhere.
            if frontiers.is_empty() {
                if is_all {
                    return None;
                }
                limit_m *= WIDEN;
                continue;
            }
            let space = Traversable::in_region(grid, &config.plan, region);
            let distances = space.distances_within(position, limit_m);
            let candidates = frontiers.iter().filter_map(|frontier| {
                let approach = if quest.sought == Sought::HalfSeen {
                    // Where the robot does not fit, nothing is lost.
                    frontier::own_approach(frontier, &distances, is_open)?
                } else {
                    frontier::approach(frontier, grid, &space, &distances, &config.frontier, is_open)?
                };
                if frontier.is_gap && approach.distance_m > config.frontier.gap_reach_m {
                    return None;
                }
                let prospect = Prospect {
                    target: grid.centre(approach.target),
                    distance_m: approach.distance_m,
                    // Who told of a seam does not know that nothing joins it.
                    is_told: quest.sought == Sought::Frontier && !frontier.cells.iter().any(|cell| grid.is_own(*cell)),
                    is_gap: frontier.is_gap,
                };
                let share = match self.team.worth(&prospect, &config.team) {
                    Worth::Share(share) => share,
                    Worth::LeftToOthers | Worth::Nothing => return None,
                };
                if quest.seams.as_ref().is_some_and(|seams| frontier.is_gap || !seams.is_missing_link(prospect.target))
                {
                    return None;
                }
                let path = distances.path_to(approach.stand);
                let turn_rad = turn_to_set_off(map_from_base, &path);
                Some((share * utility(frontier.size, approach.distance_m, turn_rad, &config.utility), approach, path))
            });
            // The first of equals, in the order of the frontiers' cells.
            let best = candidates.reduce(|best, other| if other.0 > best.0 { other } else { best });
            let best_beyond = utility(usize::MAX, limit_m, 0.0, &config.utility);
            match best {
                Some((utility, approach, path)) if is_all || utility >= best_beyond => {
                    let goal = Goal {
                        target: space.centre(approach.target),
                        stand: space.centre(approach.stand),
                        robot_radius_m: config.plan.robot_radius_m,
                        follower: PathFollower::new(config.follow.clone(), space.shorten(&path)),
                        reached_us: None,
                        sought: quest.sought,
                    };
                    return Some(goal);
                }
                _ if is_all => return None,
                _ => limit_m *= WIDEN,
            }
        }
    }
}

impl Quest<'_> {
    /// What there is of it in a region.
    fn frontiers(&self, region: CellBounds, config: &ExploreConfig) -> Vec<Frontier> {
        match self.sought {
            Sought::Frontier | Sought::Seam => find_frontiers(&self.known, region, &config.frontier),
            Sought::HalfSeen => {
                find_half_seen(&self.known, region, config.min_half_seen_m2, config.frontier.thinning_m)
            }
        }
    }
}

/// How far the robot must turn to follow the path's beginning, radians.
fn turn_to_set_off(map_from_base: &Pose2, path: &[Point2]) -> f64 {
    let position = Point2::from(map_from_base.translation.vector);
    let ahead = path.iter().find(|&&point| (point - position).norm() >= SET_OFF_M).or(path.last());
    ahead.map_or(0.0, |ahead| {
        let along = ahead - position;
        wrap_angle(along.y.atan2(along.x) - map_from_base.rotation.angle())
    })
}
