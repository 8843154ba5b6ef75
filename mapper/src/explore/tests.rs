use super::*;
use fht_perception::grid::{Cell, CellBounds, CellState, GridConfig};
use fht_perception::pose::pose;
use fht_proto::{AuthorId, SeenArea, Square};
use std::sync::Arc;

/// After so many scans, what is free is so beyond doubt.
const LOOKS: usize = 5;

/// What a robot at (0, 0) sees in a closed square room of side 4 m.
fn closed_room() -> (OccupancyGrid, LaserScan) {
    let scan = LaserScan::all_round(720, |cos, sin| 2.0 / cos.abs().max(sin.abs()));
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for _ in 0..LOOKS {
        grid.integrate(&pose(0.0, 0.0, 0.0), &scan);
    }
    (grid, scan)
}

/// The same room, but its right half has not been seen.
fn half_seen_room() -> (OccupancyGrid, LaserScan) {
    let (_, scan) = closed_room();
    let mut half = scan.clone();
    half.ranges_m.iter_mut().enumerate().for_each(|(beam, range)| {
        if !(180..540).contains(&beam) {
            *range = f32::NAN;
        }
    });
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for _ in 0..LOOKS {
        grid.integrate(&pose(0.0, 0.0, 0.0), &half);
    }
    (grid, scan)
}

/// A step, after which the question it led to is answered.
fn step(explorer: &mut Explorer, grid: &OccupancyGrid, here: &Pose2, scan: &LaserScan, time_us: u64) -> ExploreStep {
    let step = explorer.step(grid, here, scan, time_us);
    if let Some(search) = explorer.question() {
        explorer.answer(search.run(grid));
    }
    step
}

#[test]
fn a_closed_room_is_done_and_stays_done() {
    let (grid, scan) = closed_room();
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let waiting = step(&mut explorer, &grid, &pose(0.0, 0.0, 0.0), &scan, 0);
    assert_eq!(waiting, ExploreStep::Drive(Twist::default()));
    assert_eq!(explorer.step(&grid, &pose(0.0, 0.0, 0.0), &scan, 0), ExploreStep::Done(Ending::Complete));
    assert_eq!(explorer.step(&half_seen_room().0, &pose(0.0, 0.0, 0.0), &scan, 1), ExploreStep::Done(Ending::Complete));
}

#[test]
fn a_goal_is_kept_while_its_frontier_lasts() {
    let (grid, scan) = half_seen_room();
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let here = pose(-1.0, 0.0, 0.0);
    step(&mut explorer, &grid, &here, &scan, 0);
    let first = step(&mut explorer, &grid, &here, &scan, 200_000);
    let goal = explorer.goal().unwrap();
    assert!(matches!(first, ExploreStep::Drive(_)) && !explorer.path().is_empty());
    for second in 1..4 {
        step(&mut explorer, &grid, &here, &scan, second * 1_000_000);
        assert_eq!(explorer.goal(), Some(goal));
    }
}

#[test]
fn a_robot_that_cannot_move_backs_out_and_gives_up_in_the_end() {
    let (grid, scan) = half_seen_room();
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let mut has_backed_out = false;
    for frame in 0..5 * 60 * 10 {
        match step(&mut explorer, &grid, &pose(-1.0, 0.0, 0.0), &scan, frame * 200_000) {
            ExploreStep::Drive(twist) => has_backed_out |= twist.linear_mps < 0.0,
            ExploreStep::Done(ending) => {
                assert!(has_backed_out);
                assert_eq!(ending, Ending::Stuck, "that is not the end of what can be explored");
                return;
            }
        }
    }
    panic!("still trying after ten minutes");
}

#[test]
fn a_robot_that_is_boxed_in_squeezes_out_before_it_says_that_all_is_seen() {
    // It began at the origin and stands behind a wall with an opening of 0.25 m; on its side
    // nothing is left to be seen.
    let bounds = CellBounds { min: Cell { i: -20, j: -10 }, max: Cell { i: 41, j: 11 } };
    let state = |index| match bounds.cell(index) {
        Cell { i: 20, j } if j.abs() > 2 => CellState::Occupied,
        Cell { i: 40, .. } | Cell { j: -10 | 10, .. } => CellState::Occupied,
        _ => CellState::Free,
    };
    let cells = bounds.width() * bounds.height();
    let grid = OccupancyGrid::from_states(GridConfig::default(), bounds, (0..cells).map(state));
    let (_, scan) = closed_room();
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let here = pose(1.5, 0.0, 0.0);
    step(&mut explorer, &grid, &here, &scan, 0);
    assert!(explorer.goal().is_some_and(|goal| goal.x < -0.9), "{:?}", explorer.goal());
    assert!(matches!(explorer.step(&grid, &here, &scan, 100_000), ExploreStep::Drive(_)));
}

#[test]
fn who_waits_for_another_one_takes_over_when_that_one_is_gone() {
    let (grid, scan) = half_seen_room();
    let config = ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() };
    let here = pose(-1.0, 0.0, 0.0);
    let mut alone = Explorer::new(config.clone());
    step(&mut alone, &grid, &here, &scan, 0);
    let target = alone.goal();
    assert!(target.is_some());

    let mate = Teammate {
        author: AuthorId(2),
        at: here.translation.vector.into(),
        target,
        remaining_m: 0.0,
        is_finished: false,
        is_finishing: false,
    };
    let config = ExploreConfig { team: DivisionConfig { claim_m: 10.0, ..DivisionConfig::default() }, ..config };
    let mut explorer = Explorer::new(config);
    explorer.set_team(Team { mates: vec![mate], ..Team::default() });
    for second in 0..20 {
        assert_eq!(step(&mut explorer, &grid, &here, &scan, second * 1_000_000), ExploreStep::Drive(Twist::default()));
    }
    assert!(explorer.goal().is_none());
    explorer.set_team(Team::default());
    assert!(matches!(step(&mut explorer, &grid, &here, &scan, 20_000_000), ExploreStep::Drive(_)));
    assert_eq!(explorer.goal(), target);
}

#[test]
fn who_has_nothing_left_waits_for_one_that_writes_its_map_and_goes_on_if_that_one_dies() {
    let (grid, scan) = half_seen_room();
    let config = ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() };
    let here = pose(-1.0, 0.0, 0.0);
    let quiet_s = config.team.quiet_s as u64;
    // The other one has seen all, up to walls all around, and has not written it yet.
    let bounds = CellBounds { min: Cell { i: -100, j: -100 }, max: Cell { i: 101, j: 101 } };
    let squares = bounds.width() * bounds.height();
    let square = |cell: Cell| if cell.i.abs().max(cell.j.abs()) == 100 { Square::Occupied } else { Square::Free };
    let area = SeenArea {
        author: AuthorId(2),
        upto: 1,
        square_mm: 50,
        west: bounds.min.i,
        south: bounds.min.j,
        width: bounds.width() as u16,
        runs: SeenArea::runs_of((0..squares).map(|index| square(bounds.cell(index)))),
    };
    let seen = vec![Arc::new(SeenSquares::new(&area, grid.resolution_m()).expect("cells are its squares"))];
    let at = here.translation.vector.into();
    let mate =
        Teammate { author: AuthorId(2), at, target: None, remaining_m: 0.0, is_finished: false, is_finishing: true };
    let mut explorer = Explorer::new(config);
    explorer.set_team(Team { mates: vec![mate.clone()], told: Arc::default(), seen: seen.clone() });
    for second in 0..2 * quiet_s {
        let done = step(&mut explorer, &grid, &here, &scan, second * 1_000_000);
        assert_eq!(done, ExploreStep::Drive(Twist::default()), "after {second} s");
    }
    let mut heir = explorer.clone();
    // It has written all: nothing is left.
    let mate = Teammate { is_finished: true, is_finishing: false, ..mate };
    explorer.set_team(Team { mates: vec![mate], told: Arc::default(), seen });
    for second in 3 * quiet_s..3 * quiet_s + 3 {
        step(&mut explorer, &grid, &here, &scan, second * 1_000_000);
    }
    assert!(explorer.is_complete());
    // It dies: its word counts no more.
    heir.set_team(Team::default());
    step(&mut heir, &grid, &here, &scan, 3 * quiet_s * 1_000_000);
    assert!(heir.goal().is_some());
}

#[test]
fn where_others_left_off_is_reached_through_what_they_have_seen() {
    // A room with a door in its right wall, and a corridor behind it that only another robot has
    // seen, up to x = 6.
    let cells = |x: i32, y: i32| CellBounds { min: Cell { i: -40, j: -40 }, max: Cell { i: x, j: y } };
    let is_corridor = |cell: Cell| (40..120).contains(&cell.i) && cell.j.abs() < 10;
    let is_wall = |cell: Cell| cell.i.max(cell.j) == 39 || cell.i.min(cell.j) == -40;
    let is_own = |cell: Cell| cell.i < 40;
    let grid_of = |bounds: CellBounds, state: &dyn Fn(Cell) -> CellState| {
        let count = bounds.width() * bounds.height();
        OccupancyGrid::from_states(GridConfig::default(), bounds, (0..count).map(|index| state(bounds.cell(index))))
    };
    let grid = grid_of(cells(40, 40), &|cell| match is_wall(cell) {
        true if cell.i < 39 || cell.j.abs() >= 10 => CellState::Occupied,
        _ => CellState::Free,
    });
    let (_, scan) = closed_room();
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let here = pose(0.0, 0.0, 0.0);
    let squares = cells(130, 40);
    let square = |cell: Cell| match (cell.i, cell.j) {
        _ if is_own(cell) || (is_corridor(cell) && cell.j.abs() < 8) => Square::Free,
        _ if is_corridor(cell) || (40..120).contains(&cell.i) => Square::Occupied,
        _ => Square::Unseen,
    };
    let area = SeenArea {
        author: AuthorId(2),
        upto: 0,
        square_mm: 50,
        west: squares.min.i,
        south: squares.min.j,
        width: squares.width() as u16,
        runs: SeenArea::runs_of((0..squares.width() * squares.height()).map(|index| square(squares.cell(index)))),
    };
    let mate = Teammate {
        author: AuthorId(2),
        at: Point2::new(-1.0, 0.0),
        target: Some(Point2::new(-30.0, 0.0)),
        remaining_m: 30.0,
        is_finished: false,
        is_finishing: false,
    };
    let seen = vec![Arc::new(SeenSquares::new(&area, grid.resolution_m()).expect("cells are its squares"))];
    explorer.set_team(Team { mates: vec![mate], told: Arc::default(), seen });
    step(&mut explorer, &grid, &here, &scan, 0);
    assert!(explorer.goal().is_some_and(|goal| (5.5..6.5).contains(&goal.x)), "{:?}", explorer.goal());
}

/// The closed room, of which the quarter to the left and ahead was seen by one scan only.
fn room_with_a_half_seen_corner() -> (OccupancyGrid, LaserScan) {
    let (_, scan) = closed_room();
    let mut most = scan.clone();
    most.ranges_m[..180].fill(f32::NAN);
    let mut grid = OccupancyGrid::new(GridConfig::default());
    grid.integrate(&pose(0.0, 0.0, 0.0), &scan);
    for _ in 1..LOOKS {
        grid.integrate(&pose(0.0, 0.0, 0.0), &most);
    }
    (grid, scan)
}

#[test]
fn a_corner_seen_for_a_moment_is_looked_at_again() {
    let (mut grid, scan) = room_with_a_half_seen_corner();
    let corner = grid.cell_of(Point2::new(scan.angle(90).cos(), scan.angle(90).sin()));
    assert!(grid.is_barely_free(corner), "the fixture");
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let here = pose(-1.0, -1.0, 0.0);
    step(&mut explorer, &grid, &here, &scan, 0);
    let goal = explorer.goal().expect("the corner is half seen");
    assert!(grid.is_barely_free(grid.cell_of(goal)), "{goal:?}");
    // Once it has been seen, it is no goal any more, and nothing is left.
    for _ in 1..LOOKS {
        grid.integrate(&pose(0.0, 0.0, 0.0), &scan);
    }
    step(&mut explorer, &grid, &here, &scan, 1_000_000);
    assert_eq!(explorer.step(&grid, &here, &scan, 1_200_000), ExploreStep::Done(Ending::Complete));
}

#[test]
fn a_patch_too_small_for_a_rectangle_is_left() {
    let (grid, scan) = room_with_a_half_seen_corner();
    let config = ExploreConfig { first_look_s: 0.0, min_half_seen_m2: 20.0, ..ExploreConfig::default() };
    let mut explorer = Explorer::new(config);
    let here = pose(-1.0, -1.0, 0.0);
    step(&mut explorer, &grid, &here, &scan, 0);
    assert_eq!(explorer.step(&grid, &here, &scan, 200_000), ExploreStep::Done(Ending::Complete));
}

#[test]
fn half_seen_floor_that_stays_so_does_not_keep_a_robot_for_ever() {
    // Nothing that it sees from there is taken into the grid.
    let (grid, scan) = room_with_a_half_seen_corner();
    let mut explorer = Explorer::new(ExploreConfig { first_look_s: 0.0, ..ExploreConfig::default() });
    let (mut here, mut visits) = (pose(-1.0, -1.0, 0.0), Vec::<Point2>::new());
    for frame in 0..10 * 60 * 5 {
        if let ExploreStep::Done(ending) = step(&mut explorer, &grid, &here, &scan, frame * 200_000) {
            assert_eq!(ending, Ending::Complete);
            assert!(!visits.is_empty());
            let most = visits.iter().map(|at| visits.iter().filter(|other| *other == at).count()).max();
            assert!(most <= Some(2), "{visits:?}");
            return;
        }
        if let Some(goal) = explorer.goal() {
            here = pose(goal.x, goal.y, 0.0);
            if visits.last() != Some(&goal) {
                visits.push(goal);
            }
        }
    }
    panic!("still looking after ten minutes: {visits:?}");
}
