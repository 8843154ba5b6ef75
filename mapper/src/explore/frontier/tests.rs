use super::*;
use fht_navigation::planning::PlanConfig;
use fht_perception::frame::LaserScan;
use fht_perception::grid::GridConfig;
use fht_perception::pose::pose;

/// Adds what a LiDAR at (x, 0) says when its beams have the lengths that `range` gives for their
/// (cos, sin).
fn look(grid: &mut OccupancyGrid, x: f64, range: impl Fn(f64, f64) -> f64) {
    let scan = LaserScan::all_round(720, range);
    for _ in 0..3 {
        grid.integrate(&pose(x, 0.0, 0.0), &scan);
    }
}

/// Range of a beam from (x, 0) to the walls x = ±2 and y = ±2.
fn to_wall(x: f64, cos: f64, sin: f64) -> f64 {
    let to_x = if cos > 0.0 { (2.0 - x) / cos } else { (-2.0 - x) / cos };
    to_x.min(2.0 / sin.abs())
}

/// A square room of side 4 m, its walls solid but for a door of 0.8 m in the wall at x = 2, seen
/// from (x, 0).
fn room_with_a_door(x: f64) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    look(&mut grid, x, |cos, sin| {
        let range = to_wall(x, cos, sin);
        let hits_door = x + range * cos > 1.99 && (range * sin).abs() < 0.4;
        if hits_door { f64::INFINITY } else { range }
    });
    grid
}

#[test]
fn what_is_seen_through_a_door_is_a_frontier_and_the_walls_are_not() {
    let grid = room_with_a_door(-0.5);
    let frontiers = find_frontiers(&Knowledge::alone(&grid), grid.bounds(), &FrontierConfig::default());
    assert!(!frontiers.is_empty());
    for cell in frontiers.iter().flat_map(|frontier| &frontier.cells) {
        assert!(is_frontier(&Knowledge::alone(&grid), *cell));
        assert!(grid.centre(*cell).x > 1.9, "{:?}", grid.centre(*cell));
    }
    let space = Traversable::new(&grid, &PlanConfig::default());
    let distances = space.distances_from(Point2::new(-0.5, 0.0));
    let config = FrontierConfig::default();
    let ways: Vec<Approach> = frontiers
        .iter()
        .filter_map(|frontier| approach(frontier, &grid, &space, &distances, &config, |_| true))
        .collect();
    assert!(ways.iter().any(|way| way.distance_m > 2.0 && space.is_passable(way.stand)));
    assert!(
        frontiers.iter().all(|frontier| approach(frontier, &grid, &space, &distances, &config, |_| false).is_none())
    );
}

#[test]
fn the_row_by_row_search_finds_what_the_definition_says() {
    let grid = room_with_a_door(0.7);
    let all = FrontierConfig { min_cells: 1, min_unknown_m2: 0.0, ..FrontierConfig::default() };
    let bounds = grid.bounds();
    let mut found: Vec<Cell> = find_frontiers(&Knowledge::alone(&grid), bounds, &all)
        .into_iter()
        .flat_map(|frontier| frontier.cells)
        .collect();
    found.sort_unstable();
    let count = bounds.width() * bounds.height();
    let mut defined: Vec<Cell> = (0..count)
        .map(|index| bounds.cell(index))
        .filter(|&cell| is_frontier(&Knowledge::alone(&grid), cell))
        .collect();
    defined.sort_unstable();
    assert_eq!(found, defined);
    let point = grid.centre(defined[0]);
    let near = defined.iter().filter(|&&cell| (grid.centre(cell) - point).norm() <= 0.3).count();
    assert_eq!(frontier_cells_near(&Knowledge::alone(&grid), point, 0.3), near);
}

#[test]
fn a_gap_with_little_behind_it_is_no_frontier() {
    // Beams from (-1.5, 0) towards 10° on either side end 2 m away; what they hide, a look from
    // (1.7, 0) to the right shows in part: 0.4 m² between the two stay unknown.
    let mut grid = OccupancyGrid::new(GridConfig::default());
    look(&mut grid, -1.5, |cos, sin| if cos > 0.985 { 2.0 } else { to_wall(-1.5, cos, sin) });
    look(&mut grid, 1.7, |cos, sin| if cos < 0.0 { f64::NAN } else { to_wall(1.7, cos, sin) });
    let with = |min_unknown_m2| {
        let config = FrontierConfig { min_cells: 7, min_unknown_m2, ..FrontierConfig::default() };
        find_frontiers(&Knowledge::alone(&grid), grid.bounds(), &config)
    };
    assert!(!with(0.1).is_empty());
    assert!(with(2.0).is_empty());
    let empty = OccupancyGrid::new(GridConfig::default());
    assert!(find_frontiers(&Knowledge::alone(&empty), empty.bounds(), &FrontierConfig::default()).is_empty());
}

/// The floor beside a bed that stands `gap` cells from the wall below it: only the bed's end has
/// been seen.
fn beside_a_bed(gap: i32) -> OccupancyGrid {
    let bounds = CellBounds { min: Cell { i: 0, j: 0 }, max: Cell { i: 60, j: 40 } };
    let state = |index| match bounds.cell(index) {
        Cell { i: 0..=29, j: 0 } => CellState::Occupied,
        Cell { i: 30, j } if j > gap => CellState::Occupied,
        Cell { i: 0..=29, .. } => CellState::Free,
        _ => CellState::Unknown,
    };
    OccupancyGrid::from_states(GridConfig::default(), bounds, (0..60 * 40).map(state))
}

#[test]
fn a_gap_that_the_robot_could_go_into_is_a_frontier() {
    let beside_wall = |frontier: &Frontier| frontier.cells.iter().all(|cell| cell.i == 29);
    let found = |gap| {
        let grid = beside_a_bed(gap);
        let frontiers = find_frontiers(&Knowledge::alone(&grid), grid.bounds(), &FrontierConfig::default());
        frontiers.into_iter().filter(beside_wall).map(|frontier| frontier.cells.len()).collect::<Vec<_>>()
    };
    assert_eq!(found(6), [4], "0.3 m");
    assert_eq!(found(4), [0; 0], "0.2 m");
}

#[test]
fn who_looks_into_no_gap_still_looks_through_doors() {
    let config = FrontierConfig::without_gaps();
    let room = room_with_a_door(-0.5);
    assert!(!find_frontiers(&Knowledge::alone(&room), room.bounds(), &config).is_empty());
    let bed = beside_a_bed(6);
    let frontiers = find_frontiers(&Knowledge::alone(&bed), bed.bounds(), &config);
    assert!(frontiers.iter().all(|frontier| frontier.cells.iter().any(|cell| cell.i != 29)));
}
