use super::growth::MAX_CELLS;
use super::*;
use crate::frame::LaserScan;
use crate::pose::pose;

/// A square room of side 4 m around the origin, seen by a LiDAR at its centre.
fn room_scan() -> LaserScan {
    LaserScan::all_round(720, |cos, sin| 2.0 / cos.abs().max(sin.abs()))
}

#[test]
fn a_room_is_free_inside_occupied_at_its_walls_and_unknown_outside() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for _ in 0..3 {
        grid.integrate(&pose(0.0, 0.0, 0.3), &{
            let mut scan = room_scan();
            scan.angle_min = -0.3;
            scan
        });
    }
    assert_eq!(grid.state_at(Point2::new(1.5, -1.5)), CellState::Free);
    assert_eq!(grid.state_at(Point2::new(2.01, 0.0)), CellState::Occupied);
    assert_eq!(grid.state_at(Point2::new(2.5, 0.0)), CellState::Unknown);
    assert!((grid.free_area_m2() - 16.0).abs() < 0.8, "{}", grid.free_area_m2());
}

#[test]
fn no_word_of_others_makes_a_grid_grow_without_bound() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    grid.integrate(&pose(0.0, 0.0, 0.0), &room_scan());
    let near = grid.free_area_m2();
    grid.suppose_free(Point2::new(900.0, 900.0), Point2::new(900.1, 900.1));
    grid.suppose_free(Point2::new(-900.0, -900.0), Point2::new(900.0, 900.0));
    assert!(grid.bounds().width() * grid.bounds().height() <= MAX_CELLS);
    assert!(grid.free_area_m2() >= near && grid.state_at(Point2::new(900.05, 900.05)) == CellState::Unknown);
}

#[test]
fn what_is_supposed_occupied_is_neither_own_nor_beyond_the_bounds() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    grid.suppose_occupied(Point2::new(-1.0, -1.0), Point2::new(1.0, 1.0), |_| true);
    assert_eq!(grid.bounds().width(), 0, "an empty grid stays empty");
    for _ in 0..3 {
        grid.integrate(&pose(0.0, 0.0, 0.0), &room_scan());
    }
    let (seen, bounds) = (grid.clone(), grid.bounds());
    // Two discs: one in the room, and one beyond whatever is known, in the same box.
    let is_in =
        |at: Point2| [Point2::new(1.0, 0.0), Point2::new(900.0, 0.0)].iter().any(|disc| (at - disc).norm() <= 0.3);
    grid.suppose_occupied(Point2::new(0.5, -1.0), Point2::new(1e9, 1.0), is_in);
    assert_eq!(grid.bounds(), bounds);
    for cell in (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index)) {
        let expected = if is_in(grid.centre(cell)) { CellState::Occupied } else { seen.state(cell) };
        assert_eq!((grid.state(cell), grid.is_own(cell)), (expected, seen.is_own(cell)), "{cell:?}");
    }
}

#[test]
fn a_corridor_has_a_width() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for _ in 0..3 {
        grid.integrate(&pose(0.0, 0.0, 0.0), &room_scan());
    }
    let at = Point2::new;
    assert!(grid.is_corridor_free(at(-1.5, -1.5), at(1.5, 1.2), 0.2));
    assert!(!grid.is_corridor_free(at(-1.5, 1.9), at(1.5, 1.9), 0.2), "within 0.2 m of the wall");
    assert!(grid.is_corridor_free(at(-1.5, 1.9), at(1.5, 1.9), 0.05));
    assert!(!grid.is_corridor_free(at(0.0, 0.0), at(3.0, 0.0), 0.0), "through the wall");
    assert!(!grid.is_corridor_free(at(2.5, 2.5), at(2.8, 2.5), 0.0), "unknown is not free");
    assert!(grid.is_corridor_unoccupied(at(2.5, 2.5), at(2.8, 2.5), 0.0));
}

#[test]
fn a_beam_that_met_something_too_near_erases_no_wall() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for _ in 0..3 {
        grid.integrate(&pose(0.0, 0.0, 0.0), &room_scan());
    }
    for too_near in [f32::NEG_INFINITY, 0.05, 0.0] {
        let mut scan = room_scan();
        scan.ranges_m[..90].fill(too_near);
        for _ in 0..50 {
            grid.integrate(&pose(0.0, 0.0, 0.0), &scan);
        }
        assert_eq!(grid.state_at(Point2::new(2.01, 0.2)), CellState::Occupied, "{too_near}");
        assert_eq!(grid.state_at(Point2::new(2.5, 0.2)), CellState::Unknown, "{too_near}");
    }
}

#[test]
fn non_finite_poses_and_ranges_change_nothing() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    let mut scan = room_scan();
    grid.integrate(&pose(f64::NAN, 0.0, 0.0), &scan);
    scan.ranges_m.iter_mut().for_each(|range| *range = f32::NAN);
    grid.integrate(&pose(0.0, 0.0, 0.0), &scan);
    assert!(grid.free_area_m2().abs() < 1e-9);
}

#[test]
fn what_fewer_than_five_scans_passed_is_barely_free() {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    let place = grid.cell_of(Point2::new(1.0, 0.5));
    let mut told = grid.clone();
    assert!(!grid.is_barely_free(place), "unknown");
    for scans in 1..=6 {
        grid.integrate(&pose(0.0, 0.0, 0.0), &room_scan());
        assert_eq!((grid.is_barely_free(place), grid.is_surely_free(place)), (scans < 5, scans >= 5), "{scans}");
    }
    told.integrate_told(&pose(0.0, 0.0, 0.0), &room_scan());
    assert_eq!(told.state(place), CellState::Free);
    assert!(!told.is_barely_free(place), "others have seen that");
}
