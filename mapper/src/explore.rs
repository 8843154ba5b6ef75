//! Frontier exploration (paper section III-A): where to drive next, and how, from the robot's own
//! grid.
//!
//! The explorer is told the grid, the pose and the scan once per frame and answers with a command.
//! It keeps its goal until the frontier there is gone, reached or cut off, so that it does not
//! waver between two of about the same utility. Searching a large grid takes longer than a frame
//! may: the explorer puts a question ([`Explorer::question`]), which is answered beside the loop
//! ([`Search::run`], [`Explorer::answer`]), and drives on meanwhile.

mod config;
mod division;
mod frontier;
mod half_seen;
mod missing_links;
mod search;
mod seen_squares;
mod setbacks;
mod utility;
mod zone_keeping;

pub use config::ExploreConfig;
pub use division::{DivisionConfig, Team, Teammate};
pub use frontier::FrontierConfig;
pub use search::{Search, SearchResult};
pub use seen_squares::{SeenSquares, seen_area};
pub use setbacks::SetbackConfig;
pub use utility::{UtilityConfig, utility};

use crate::explore::frontier::Knowledge;
use fht_map::Rules;
use fht_navigation::motion::safe_command;
use fht_perception::frame::{LaserScan, Twist};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2};
use search::{Goal, Sought, Underway};
use serde::{Deserialize, Serialize};
use setbacks::Setbacks;
use std::fmt;
use std::sync::Arc;

/// Why an exploration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// Nothing reachable is unexplored, but for places that were tried and given up.
    Complete,
    /// The robot could not get free any more.
    Stuck,
    /// The time allowed was up.
    OutOfTime,
    /// It was asked to end, or nobody took the map any more.
    Interrupted,
    /// A robot that was to join a map saw all that it could reach, and did not find its place in
    /// the map.
    Unplaced,
    /// The robot's sensors ended, or it took no commands.
    RobotFailed,
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Complete => "complete",
            Self::Stuck => "the robot is stuck: it tried to get free and did not move",
            Self::OutOfTime => "out of time (--max-sim)",
            Self::Interrupted => "interrupted",
            Self::Unplaced => {
                "the robot saw all that it can reach and did not find its place in the map that it was to join"
            }
            Self::RobotFailed => "the robot failed: its sensors ended, or it took no commands",
        })
    }
}

/// What to do until the next frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExploreStep {
    /// Drive so.
    Drive(Twist),
    /// It is over, complete or stuck.
    Done(Ending),
}

/// Less than this is not moving, metres.
const MOVED_M: f64 = 0.15;
/// Backing out of where the robot got stuck: speed, metres per second, and time, seconds.
const BACK_OUT: (f64, f64) = (-0.15, 2.0);
/// Then turning: rate, radians per second, and time, seconds.
const TURN_AWAY: (f64, f64) = (0.8, 2.0);
/// Turning at a goal shifts the beams into the gaps between them.
const LOOK_AROUND: Twist = Twist { linear_mps: 0.0, angular_radps: 0.8 };
/// A robot that does not move at all tries this often in a row to get free before it gives up.
const MAX_RECOVERIES: u32 = 12;
/// A goal that is chosen again so often after it was reached is none that looking helps.
const MAX_RETURNS: u32 = 10;

/// An exploration in progress.
#[derive(Clone, Debug)]
pub struct Explorer {
    config: ExploreConfig,
    goal: Option<Goal>,
    wanted: Option<Search>,
    /// Whether a question was put and not answered yet.
    is_asking: bool,
    /// Whether the last answer was that nothing is left.
    is_all_seen: bool,
    /// Whether another explorer has left since the last question: what was left to it is to be
    /// looked at again.
    has_lost_mate: bool,
    /// How often in a row a goal was chosen again that was reached.
    returns: u32,
    /// Since when no other explorer has had a goal, as seen by one that has none.
    quiet_since_us: Option<u64>,
    setbacks: Setbacks,
    /// Where the robot went to look at half-seen floor again, and how often.
    second_looks: Setbacks,
    team: Team,
    /// What holds on the map; nothing before the robot knows where in the map it is.
    rules: Arc<Rules>,
    began_us: Option<u64>,
    chosen_us: u64,
    checked_us: u64,
    /// Where and when the robot last was seen to have moved.
    moved: Option<(Point2, u64)>,
    recovering_since_us: Option<u64>,
    recoveries: u32,
    /// Since when the robot has stood for people without having got on.
    gives_way_since_us: Option<u64>,
    /// Since when nothing was found to drive to with people in the way.
    hindered_since_us: Option<u64>,
    ended: Option<Ending>,
}

impl Explorer {
    /// An exploration that has not begun.
    #[must_use]
    pub fn new(config: ExploreConfig) -> Self {
        Self {
            config,
            goal: None,
            wanted: None,
            is_asking: false,
            is_all_seen: false,
            has_lost_mate: false,
            returns: 0,
            quiet_since_us: None,
            setbacks: Setbacks::default(),
            second_looks: Setbacks::default(),
            team: Team::default(),
            rules: Arc::default(),
            began_us: None,
            chosen_us: 0,
            checked_us: 0,
            moved: None,
            recovering_since_us: None,
            recoveries: 0,
            gives_way_since_us: None,
            hindered_since_us: None,
            ended: None,
        }
    }

    /// What the robot is on its way to see, in the map frame.
    #[must_use]
    pub fn goal(&self) -> Option<Point2> {
        self.goal.as_ref().map(|goal| goal.target)
    }

    /// How far the goal is along its path, metres; 0 without a goal.
    #[must_use]
    pub fn remaining_m(&self) -> f64 {
        self.goal.as_ref().map_or(0.0, |goal| goal.follower.remaining_m())
    }

    /// Whether it is over.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.ended.is_some()
    }

    /// Whether all was seen that could be.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.ended == Some(Ending::Complete)
    }

    /// What the others are about.
    pub fn set_team(&mut self, team: Team) {
        self.has_lost_mate |= self.team.mates.iter().any(|mate| !mate.is_finished && !team.is_at_work(mate.author));
        // What one that died had seen and did not write is to be seen again.
        self.has_lost_mate |= self.team.seen.iter().any(|seen| !team.has_word_of(seen.author()));
        self.team = team;
    }

    /// What holds on the map from now on, in the frame that the grid is in.
    pub fn set_rules(&mut self, rules: Arc<Rules>) {
        if !Arc::ptr_eq(&rules, &self.rules) && !rules.closes_the_same(&self.rules) {
            // The way that the robot is on is checked at once.
            self.checked_us = 0;
        }
        self.rules = rules;
    }

    /// The frame in which places are told is another one from now on: whatever was chosen in the
    /// old one is forgotten. The answer to a question that was put before must not be given.
    pub fn change_frame(&mut self) {
        let (config, began_us, ended) = (self.config.clone(), self.began_us, self.ended);
        *self = Self { began_us, ended, ..Self::new(config) };
    }

    /// The path it drives, in the map frame. Empty without a goal.
    #[must_use]
    pub fn path(&self) -> &[Point2] {
        self.goal.as_ref().map_or(&[], |goal| goal.follower.path())
    }

    /// Once per frame: `grid` holds the frame's scan already, `map_from_base` is the robot's pose
    /// in the grid's frame. Time must not go back. After [`ExploreStep::Done`] it stays done.
    pub fn step(&mut self, grid: &OccupancyGrid, map_from_base: &Pose2, scan: &LaserScan, time_us: u64) -> ExploreStep {
        if let Some(ending) = self.ended {
            return ExploreStep::Done(ending);
        }
        let began_us = *self.began_us.get_or_insert(time_us);
        if seconds(began_us, time_us) < self.config.first_look_s {
            return ExploreStep::Drive(Twist::default());
        }
        let position = Point2::from(map_from_base.translation.vector);
        let limit_mps = zone_keeping::speed_limit_mps(&self.rules, map_from_base);
        self.watch_for_being_stuck(position, limit_mps, time_us);
        let twist = if let Some(twist) = self.recovery_command(time_us) {
            Some(twist)
        } else {
            self.update_goal(grid, map_from_base, time_us);
            self.goal_command(map_from_base, time_us)
        };
        match twist {
            Some(twist) if self.recoveries <= MAX_RECOVERIES => {
                let twist = limit_mps.map_or(twist, |limit_mps| twist.limited(limit_mps));
                let obedient = zone_keeping::held_back(twist, &self.rules, map_from_base, self.config.follow.period_s);
                ExploreStep::Drive(safe_command(obedient, scan, &self.config.safety))
            }
            given_up => {
                // Without having moved since, it has given its goals up because it cannot move.
                let is_stuck = given_up.is_some() || self.recoveries > 0;
                let ending = if is_stuck { Ending::Stuck } else { Ending::Complete };
                self.ended = Some(ending);
                ExploreStep::Done(ending)
            }
        }
    }

    /// Begins a recovery when the robot has had a goal but not moved for too long, where it may
    /// drive at `limit_mps`.
    fn watch_for_being_stuck(&mut self, position: Point2, limit_mps: Option<f64>, time_us: u64) {
        let (anchor, since_us) = *self.moved.get_or_insert((position, time_us));
        // Who has to creep is not stuck.
        let stuck_after_s = self.config.stuck_after_s + limit_mps.map_or(0.0, |limit_mps| MOVED_M / limit_mps);
        if (position - anchor).norm() >= MOVED_M {
            self.moved = Some((position, time_us));
            self.recoveries = 0;
            self.gives_way_since_us = None;
        } else if seconds(since_us, time_us) >= stuck_after_s && self.recovering_since_us.is_none() {
            if let Some(goal) = self.goal.take() {
                tracing::debug!(x = goal.target.x, y = goal.target.y, "stuck on the way to a frontier");
                self.setbacks.record(goal.target, time_us, &self.config.setbacks);
            }
            self.moved = Some((position, time_us));
            self.recovering_since_us = Some(time_us);
            self.recoveries += 1;
        }
    }

    /// The robot stands for somebody who is in its way: for a while that is not being stuck.
    pub fn give_way(&mut self, time_us: u64) {
        let since_us = *self.gives_way_since_us.get_or_insert(time_us);
        if seconds(since_us, time_us) < self.config.give_way_s {
            self.moved = None;
        }
    }

    /// Whether the last answer, that nothing is left to drive to, may be because of people who
    /// stand in the way: for a while.
    fn is_hindered(&mut self, answer: &SearchResult) -> bool {
        if answer.goal.is_some() || !answer.is_among_people {
            self.hindered_since_us = None;
            return false;
        }
        let since_us = *self.hindered_since_us.get_or_insert(self.chosen_us);
        seconds(since_us, self.chosen_us) < self.config.give_way_s
    }

    fn recovery_command(&mut self, time_us: u64) -> Option<Twist> {
        let elapsed_s = seconds(self.recovering_since_us?, time_us);
        let ((linear_mps, back_s), (angular_radps, turn_s)) = (BACK_OUT, TURN_AWAY);
        if elapsed_s < back_s {
            Some(Twist { linear_mps, angular_radps: 0.0 })
        } else if elapsed_s < back_s + turn_s {
            Some(Twist { linear_mps: 0.0, angular_radps })
        } else {
            self.recovering_since_us = None;
            None
        }
    }

    /// What is to be searched for now, if anything: once, until it is answered.
    pub fn question(&mut self) -> Option<Search> {
        let search = self.wanted.take();
        self.is_asking |= search.is_some();
        search
    }

    /// The answer to the last question.
    pub fn answer(&mut self, answer: SearchResult) {
        self.is_asking = false;
        // What was asked before the robot got stuck, or for a goal that is no more, is out of date.
        let is_kept =
            |target| self.goal.as_ref().is_some_and(|goal| goal.target == target && goal.reached_us.is_none());
        if self.recovering_since_us.is_none() && answer.underway.is_none_or(is_kept) {
            self.is_all_seen = answer.goal.is_none() && !self.is_hindered(&answer);
            if let Some(goal) = &answer.goal {
                self.quiet_since_us = None;
                let Point2 { coords } = goal.target;
                tracing::debug!(
                    x = coords.x,
                    y = coords.y,
                    sought = ?goal.sought,
                    at_us = self.chosen_us,
                    "going to see"
                );
                if goal.sought == Sought::HalfSeen && answer.underway != Some(goal.target) {
                    self.second_looks.record(goal.target, self.chosen_us, &self.config.setbacks);
                }
                // The robot is there already, and still it is the best to look at.
                let is_back =
                    self.goal.as_ref().is_some_and(|old| old.reached_us.is_some() && old.target == goal.target);
                self.returns = if is_back { self.returns + 1 } else { 0 };
                if self.returns > MAX_RETURNS {
                    self.setbacks.record(goal.target, self.chosen_us, &self.config.setbacks);
                }
            }
            self.goal = answer.goal;
        }
    }

    fn ask(&mut self, map_from_base: &Pose2, time_us: u64, underway: Option<Underway>) {
        if self.is_asking {
            return;
        }
        if std::mem::take(&mut self.has_lost_mate) {
            self.is_all_seen = false;
        }
        self.checked_us = time_us;
        if underway.is_none() {
            self.chosen_us = time_us;
        }
        let (config, setbacks, team) = (self.config.clone(), self.setbacks.clone(), self.team.clone());
        let second_looks = self.second_looks.clone();
        let (rules, map_from_base) = (Arc::clone(&self.rules), *map_from_base);
        self.wanted = Some(Search {
            config,
            setbacks,
            second_looks,
            team,
            rules,
            map_from_base,
            time_us,
            underway,
            map: None,
            is_among_people: false,
        });
    }

    /// Keeps, refreshes or replaces the goal.
    fn update_goal(&mut self, grid: &OccupancyGrid, map_from_base: &Pose2, time_us: u64) {
        let config = &self.config;
        let (mut is_spent, mut is_idle) = (true, true);
        if let Some(goal) = &self.goal {
            let (at, radius_m) = (goal.target, config.goal_radius_m);
            let known = Knowledge { grid, others: &self.team.seen };
            let left = match goal.sought {
                Sought::Frontier => frontier::frontier_cells_near(&known, at, radius_m),
                Sought::Seam => frontier::frontier_cells_near(&Knowledge::alone(grid), at, radius_m),
                Sought::HalfSeen => half_seen::half_seen_cells_near(&known, at, radius_m),
            };
            let seen = left < config.goal_cells;
            let looked = goal.reached_us.is_some_and(|at| seconds(at, time_us) >= config.look_s);
            let is_answered = !self.is_asking && self.wanted.is_none();
            if looked && !seen && is_answered {
                self.setbacks.record(goal.target, time_us, &config.setbacks);
            }
            is_idle = goal.reached_us.is_some();
            let is_taken = !is_idle
                && self.team.takes_over(goal.target, goal.follower.remaining_m(), &config.team)
                && seconds(self.chosen_us, time_us) >= config.team.look_again_s;
            is_spent = seen || looked || is_taken;
        } else if self.is_all_seen && !self.has_lost_mate && self.team.goes_on() {
            // Others may leave something, or die.
            is_spent = seconds(self.chosen_us, time_us) >= config.team.look_again_s;
        }
        if is_spent {
            if is_idle || seconds(self.chosen_us, time_us) >= config.choose_period_s {
                self.ask(map_from_base, time_us, None);
            }
        } else if !is_idle && seconds(self.checked_us, time_us) >= config.check_period_s {
            let underway = |goal: &Goal| Underway {
                target: goal.target,
                stand: goal.stand,
                robot_radius_m: goal.robot_radius_m,
                remaining_m: goal.follower.remaining_m(),
                sought: goal.sought,
            };
            let underway = self.goal.as_ref().map(underway);
            self.ask(map_from_base, time_us, underway);
        }
    }

    /// Whether a robot that has nothing left waits for the others: as long as one of them is busy,
    /// and a little longer, because between two goals it has none.
    fn has_to_wait(&mut self, time_us: u64) -> bool {
        if self.team.is_busy() {
            self.quiet_since_us = Some(time_us);
        }
        let quiet_since_us = *self.quiet_since_us.get_or_insert(time_us);
        self.team.goes_on() && seconds(quiet_since_us, time_us) < self.config.team.quiet_s
    }

    /// The next command on the way to the goal. `None` when there is none left.
    fn goal_command(&mut self, map_from_base: &Pose2, time_us: u64) -> Option<Twist> {
        let Some(goal) = &mut self.goal else {
            // Waiting for an answer is not being stuck.
            self.moved = None;
            let has_to_wait = !self.is_all_seen || self.has_lost_mate || self.has_to_wait(time_us);
            return has_to_wait.then(Twist::default);
        };
        let twist = goal.follower.command(map_from_base);
        if !goal.follower.is_done() {
            return Some(twist);
        }
        goal.reached_us.get_or_insert(time_us);
        // Standing at a goal is not being stuck.
        self.moved = None;
        Some(LOOK_AROUND)
    }
}

fn seconds(from_us: u64, to_us: u64) -> f64 {
    to_us.saturating_sub(from_us) as f64 * 1e-6
}

#[cfg(test)]
mod tests;
