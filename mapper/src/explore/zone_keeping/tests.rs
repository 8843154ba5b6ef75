use super::*;
use crate::explore::{Ending, ExploreConfig, ExploreStep, Explorer};
use fht_map::plan::blocked::BlockedBy;
use fht_perception::frame::LaserScan;
use fht_perception::grid::{Cell, CellBounds, CellState, GridConfig};
use fht_perception::pose::pose;
use fht_proto::ZoneRule;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Time between two frames, seconds.
const PERIOD_S: f64 = 0.2;

/// A corridor along x from -3 m to 6 m, 2 m wide. An end that is open is where it has been seen to,
/// and goes on; the other ends in a wall.
fn corridor(is_west_open: bool, is_east_open: bool) -> OccupancyGrid {
    let bounds = CellBounds { min: Cell { i: -100, j: -21 }, max: Cell { i: 160, j: 21 } };
    let state = |index| match bounds.cell(index) {
        Cell { j: -21 | 20, .. } => CellState::Occupied,
        Cell { i: -61, .. } if !is_west_open => CellState::Occupied,
        Cell { i: 120, .. } if !is_east_open => CellState::Occupied,
        Cell { i: -60..120, .. } => CellState::Free,
        _ => CellState::Unknown,
    };
    let cells = bounds.width() * bounds.height();
    OccupancyGrid::from_states(GridConfig::default(), bounds, (0..cells).map(state))
}

/// A zone across the corridor, between two x, metres.
fn across(rule: ZoneRule, west_m: f64, east_m: f64) -> Zone {
    let corners = [(west_m, -2.0), (east_m, -2.0), (east_m, 2.0), (west_m, 2.0)];
    Zone { rule, corners: corners.iter().map(|&(x, y)| FixedPoint::from_metres(x, y)).collect() }
}

fn keep_out(west_m: f64, east_m: f64) -> Arc<Rules> {
    let zone = ("closed".parse().expect("a name"), across(ZoneRule::KeepOut, west_m, east_m));
    Arc::new(Rules { keep_out: vec![zone], ..Rules::default() })
}

fn slow(mm_per_s: u16, west_m: f64, east_m: f64) -> Arc<Rules> {
    let zone = ("slow".parse().expect("a name"), across(ZoneRule::SpeedLimit(mm_per_s), west_m, east_m));
    Arc::new(Rules { slow: vec![zone], ..Rules::default() })
}

fn blocked(x: f64, y: f64) -> Arc<Rules> {
    let places = BTreeSet::from([FixedPoint::from_metres(x, y)]);
    let by = BlockedBy { robot: "another".to_owned(), edges: BTreeSet::new(), places };
    Arc::new(Rules { blocked: vec![by], ..Rules::default() })
}

/// A robot with perfect wheels, around which the scanner sees nothing that would stop it.
struct Drive {
    grid: OccupancyGrid,
    explorer: Explorer,
    map_from_base: Pose2,
    time_us: u64,
    scan: LaserScan,
}

impl Drive {
    fn from(grid: OccupancyGrid, map_from_base: Pose2, rules: Arc<Rules>) -> Self {
        let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
        explorer.set_rules(rules);
        Self { grid, explorer, map_from_base, time_us: 0, scan: LaserScan::all_round(36, |_, _| 6.5) }
    }

    fn here(&self) -> Point2 {
        Point2::from(self.map_from_base.translation.vector)
    }

    /// What the explorer says, after which its question is answered. The robot stays where it is.
    fn ask(&mut self) -> ExploreStep {
        let step = self.explorer.step(&self.grid, &self.map_from_base, &self.scan, self.time_us);
        if let Some(search) = self.explorer.question() {
            self.explorer.answer(search.run(&self.grid));
        }
        self.time_us += (PERIOD_S * 1e6) as u64;
        step
    }

    /// The same, and the robot drives. The command, or how it ended.
    fn step(&mut self) -> Result<Twist, Ending> {
        match self.ask() {
            ExploreStep::Drive(twist) => {
                self.map_from_base *= pose(0.0, 0.0, 0.5 * twist.angular_radps * PERIOD_S)
                    * pose(twist.linear_mps * PERIOD_S, 0.0, 0.5 * twist.angular_radps * PERIOD_S);
                Ok(twist)
            }
            ExploreStep::Done(ending) => Err(ending),
        }
    }

    /// Drives for a while and looks where the robot is after every step. How it ended, if it did.
    fn run(&mut self, seconds: f64, mut look: impl FnMut(&Self)) -> Option<Ending> {
        for _ in 0..(seconds / PERIOD_S) as u32 {
            if let Err(ending) = self.step() {
                return Some(ending);
            }
            look(self);
        }
        None
    }
}

#[test]
fn nothing_is_copied_where_nothing_is_closed() {
    let grid = corridor(true, true);
    let drawn = |rules: &Rules| matches!(drawn(&grid, rules, None), Cow::Owned(_));
    assert!(!drawn(&Rules::default()) && !drawn(&slow(100, 0.0, 1.0)));
    assert!(drawn(&keep_out(0.0, 1.0)) && drawn(&blocked(0.0, 0.0)));
}

#[test]
fn what_is_drawn_is_what_is_closed_even_if_it_is_thinner_than_a_cell() {
    let grid = corridor(true, true);
    let is_occupied = |grid: &OccupancyGrid, x: f64| grid.state_at(Point2::new(x, 0.5)) == CellState::Occupied;
    let wide = drawn(&grid, &keep_out(3.0, 4.0), None);
    assert!([3.02, 3.5, 3.98].iter().all(|&x| is_occupied(&wide, x)));
    assert!([2.9, 4.1].iter().all(|&x| !is_occupied(&wide, x)));
    let bare = drawn(&grid, &keep_out(3.0, 4.0), Some(Point2::new(3.5, 0.0)));
    assert!(!is_occupied(&bare, 3.5), "the robot stands there");
    let thin = drawn(&grid, &keep_out(3.01, 3.015), None);
    assert!(is_occupied(&thin, 3.01) && !is_occupied(&thin, 2.9) && !is_occupied(&thin, 3.1));
    assert_eq!(thin.bounds(), grid.bounds());
}

#[test]
fn what_lies_behind_a_closed_zone_is_left_unexplored() {
    let mut free = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), Arc::default());
    free.ask();
    assert!(free.explorer.goal().is_some_and(|goal| goal.x > 5.5), "{:?}", free.explorer.goal());

    let mut drive = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), keep_out(3.0, 4.0));
    let ending = drive.run(60.0, |drive| assert!(drive.here().x < 2.9, "{:?}", drive.here()));
    assert_eq!(ending, Some(Ending::Complete));
}

#[test]
fn a_zone_declared_on_the_way_makes_the_robot_turn_away() {
    // As far before the robot as a look a second suffices for, and nearer than that.
    for ahead_m in [1.2, 0.6, 0.08] {
        let mut drive = Drive::from(corridor(true, true), pose(2.0, 0.0, 0.0), Arc::default());
        while drive.here().x < 2.5 {
            drive.step().expect("it is under way");
        }
        assert!(drive.explorer.goal().is_some_and(|goal| goal.x > 5.5));
        let west_m = drive.here().x + ahead_m;
        drive.explorer.set_rules(keep_out(west_m, west_m + 0.6));
        let mut turned_away_after = None;
        for step in 0..100 {
            drive.step().expect("there is more to see");
            assert!(drive.here().x < west_m, "{ahead_m}: {:?}", drive.here());
            if drive.explorer.goal().is_some_and(|goal| goal.x < -2.5) {
                turned_away_after.get_or_insert(step);
            }
        }
        assert!(turned_away_after.is_some_and(|steps| f64::from(steps) * PERIOD_S <= 1.0), "{turned_away_after:?}");
        assert!(drive.here().x < 0.0, "{:?}", drive.here());
    }
}

#[test]
fn a_way_that_is_closed_when_nothing_else_is_left_is_given_up() {
    let mut drive = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), Arc::default());
    assert_eq!(drive.run(4.0, |_| ()), None);
    drive.explorer.set_rules(keep_out(4.0, 5.0));
    assert_eq!(drive.run(60.0, |drive| assert!(drive.here().x < 4.0)), Some(Ending::Complete));
}

#[test]
fn a_robot_that_stands_in_a_zone_drives_out_the_nearest_way_and_stays_out() {
    // What is left to be seen lies the other way, through the zone.
    let mut drive = Drive::from(corridor(false, true), pose(2.5, 0.3, 0.0), keep_out(1.0, 5.0));
    let mut has_left = false;
    let ending = drive.run(60.0, |drive| {
        let is_out = drive.here().x < 1.0;
        assert!(drive.here().x < 2.6 && (is_out || !has_left), "{:?}", drive.here());
        has_left |= is_out;
    });
    assert!(has_left);
    assert_eq!(ending, Some(Ending::Complete));
}

#[test]
fn a_robot_that_knows_no_way_out_of_a_zone_looks_for_one() {
    let mut drive = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), keep_out(-10.0, 10.0));
    drive.ask();
    assert!(drive.explorer.goal().is_some_and(|goal| goal.x > 5.5), "{:?}", drive.explorer.goal());
    let mut shut_in = Drive::from(corridor(false, false), pose(0.0, 0.0, 0.0), keep_out(-10.0, 10.0));
    assert_eq!(shut_in.run(60.0, |_| ()), Some(Ending::Complete));
}

#[test]
fn a_zone_between_the_robot_and_where_it_began_is_no_trap() {
    let mut drive = Drive::from(corridor(false, false), pose(3.5, 0.0, 0.0), keep_out(1.0, 2.0));
    assert_eq!(drive.run(60.0, |drive| assert!(drive.here().x > 2.0)), Some(Ending::Complete));
}

#[test]
fn a_robot_at_a_zone_does_not_back_into_it() {
    // It cannot move, and its way leads ahead.
    let mut drive = Drive::from(corridor(false, true), pose(2.02, 0.0, 0.0), keep_out(1.0, 2.0));
    let mut recoveries = 0;
    for _ in 0..5 * 60 * 5 {
        match drive.ask() {
            ExploreStep::Drive(twist) => {
                assert!(twist.linear_mps >= 0.0);
                recoveries += u32::from(twist == Twist { linear_mps: 0.0, angular_radps: 0.8 });
            }
            ExploreStep::Done(ending) => {
                assert!(recoveries > 0 && ending == Ending::Stuck);
                return;
            }
        }
    }
    panic!("still trying after five minutes");
}

#[test]
fn a_place_that_another_robot_found_blocked_is_passed_at_a_distance() {
    let nearest_m = |rules: Arc<Rules>| {
        let mut drive = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), rules);
        let mut nearest_m = f64::INFINITY;
        while drive.here().x < 5.0 {
            drive.step().expect("there is a way");
            nearest_m = f64::min(nearest_m, (drive.here() - Point2::new(3.0, 0.1)).norm());
        }
        nearest_m
    };
    assert!(nearest_m(Arc::default()) < 0.3);
    assert!((0.4..0.7).contains(&nearest_m(blocked(3.0, 0.1))), "{}", nearest_m(blocked(3.0, 0.1)));
}

#[test]
fn a_robot_where_another_one_found_the_way_blocked_drives_off_and_on() {
    let mut drive = Drive::from(corridor(false, true), pose(3.0, 0.0, 0.0), blocked(2.9, 0.0));
    let is_past = |drive: &Drive| drive.here().x > 5.5;
    let mut has_passed = false;
    drive.run(20.0, |drive| has_passed |= is_past(drive));
    assert!(has_passed);
}

#[test]
fn a_speed_zone_slows_the_robot_and_a_little_before_it() {
    let mut drive = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), slow(200, 2.0, 3.0));
    let (mut within, mut without) = (0, 0);
    while drive.here().x < 5.0 {
        let before = drive.here().x;
        let twist = drive.step().expect("there is a way");
        if (1.75..2.99).contains(&before) {
            within += 1;
            assert!(twist.linear_mps <= 0.2 + 1e-9, "{before}: {twist:?}");
        } else if twist.linear_mps > 0.4 {
            without += 1;
        }
    }
    assert!(within > 20 && without > 20, "{within} {without}");
}

#[test]
fn a_robot_that_has_to_creep_is_not_stuck() {
    let mut drive = Drive::from(corridor(false, true), pose(0.0, 0.0, 0.0), slow(10, -1.0, 1.0));
    for _ in 0..5 * 60 {
        assert!(drive.step().expect("there is a way").linear_mps >= 0.0);
    }
    assert!((0.5..0.7).contains(&drive.here().x), "{:?}", drive.here());
}

#[test]
fn rules_do_not_outlive_the_frame_that_they_are_in() {
    let mut explorer = Explorer::new(ExploreConfig::default());
    explorer.set_rules(keep_out(0.0, 1.0));
    explorer.change_frame();
    assert_eq!(*explorer.rules, Rules::default());
}
