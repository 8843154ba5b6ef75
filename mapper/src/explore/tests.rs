use super::*;
use fht_robot::grid::{Cell, CellBounds, CellState, GridConfig};
use fht_robot::pose::pose;

/// What a robot at (0, 0) sees in a closed square room of side 4 m.
fn closed_room() -> (OccupancyGrid, LaserScan) {
    let increment = std::f64::consts::TAU / 720.0;
    let ranges_m = (0..720)
        .map(|beam| {
            let (sin, cos) = (f64::from(beam) * increment).sin_cos();
            (2.0 / cos.abs().max(sin.abs())) as f32
        })
        .collect();
    let base_from_sensor = pose(0.0, 0.0, 0.0);
    let (range_min_m, range_max_m) = (0.1, 7.0);
    let scan =
        LaserScan { base_from_sensor, angle_min: 0.0, angle_increment: increment, range_min_m, range_max_m, ranges_m };
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for _ in 0..3 {
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
    for _ in 0..3 {
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
    // It began at the origin and stands behind a wall with an opening of 0.25 m; on its side nothing is left to be seen.
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
