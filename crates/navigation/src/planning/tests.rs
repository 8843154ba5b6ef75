use super::*;
use proptest::prelude::*;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// A grid drawn with characters: `#` occupied, `?` unknown, anything else free. Row 0 is y = 0; a
/// cell is 0.05 m.
fn drawn(rows: &[String], config: &PlanConfig) -> Traversable {
    let zero = Cell { i: 0, j: 0 };
    let region = CellBounds { min: zero, max: Cell { i: rows[0].len() as i32, j: rows.len() as i32 } };
    let states: Vec<CellState> = rows
        .iter()
        .flat_map(|row| row.bytes())
        .map(|byte| match byte {
            b'#' => CellState::Occupied,
            b'?' => CellState::Unknown,
            _ => CellState::Free,
        })
        .collect();
    Traversable::from_states(&states, region, 0.05, config)
}

/// A free room `width` × `height` cells with a wall around it and what `is_wall` adds.
fn room(width: i32, height: i32, is_wall: impl Fn(i32, i32) -> bool) -> Vec<String> {
    let edge = |i: i32, j: i32| i == 0 || j == 0 || i == width - 1 || j == height - 1;
    (0..height).map(|j| (0..width).map(|i| if edge(i, j) || is_wall(i, j) { '#' } else { '.' }).collect()).collect()
}

#[test]
fn a_door_narrower_than_the_robot_is_closed() {
    let wall_with_door = |cells: i32| room(80, 60, move |i, j| i == 40 && !(30..30 + cells).contains(&j));
    let (from, to) = (Point2::new(0.5, 1.5), Point2::new(3.5, 1.5));
    // Seven free cells: the middle one is 4 cells = 0.2 m from either post.
    let open = drawn(&wall_with_door(7), &PlanConfig::default());
    let path = open.shortest_path(from, to).unwrap();
    assert!(path.length_m > 3.0 && path.length_m < 3.5, "{}", path.length_m);
    assert_eq!((path.points.first(), path.points.last()), (Some(&from), Some(&to)));
    let closed = drawn(&wall_with_door(5), &PlanConfig::default());
    assert!(closed.shortest_path(from, to).is_none());
    assert!(closed.distances_from(from).distance_m(closed.cell_of(to)).is_none());
}

#[test]
fn comfort_keeps_the_path_off_the_walls_where_there_is_room() {
    let rows = room(120, 60, |i, j| i == 60 && !(20..50).contains(&j));
    let (from, to) = (Point2::new(0.5, 0.5), Point2::new(5.5, 0.5));
    let least_clearance = |config: &PlanConfig| {
        let space = drawn(&rows, config);
        let path = space.shorten(&space.shortest_path(from, to).unwrap().points);
        let steps =
            path.windows(2).flat_map(|pair| (0..=50).map(|t| pair[0] + (pair[1] - pair[0]) * (f64::from(t) / 50.0)));
        steps.map(|point| space.clearance_m(space.cell_of(point))).fold(f64::INFINITY, f64::min)
    };
    let (comfortable, shortest) = (least_clearance(&PlanConfig::default()), least_clearance(&PlanConfig::shortest()));
    assert!(comfortable > 0.26 && shortest < 0.21, "{comfortable} {shortest}");
}

#[test]
fn a_robot_too_near_to_a_wall_leaves_it_first_but_not_through_it() {
    // Beside the thin wall at i = 40 on its left; the nearest passable cells to the right are as
    // near.
    let rows = room(80, 60, |i, j| i == 40 && j < 50);
    let space = drawn(&rows, &PlanConfig::default());
    let from = Point2::new(39.5 * 0.05, 1.0);
    assert!(!space.is_passable(space.cell_of(from)));
    let path = space.shortest_path(from, Point2::new(0.5, 1.0)).unwrap();
    assert!(path.points.iter().all(|point| point.x < 40.0 * 0.05));
    assert!(space.shortest_path(from, Point2::new(1.0, 0.02)).is_none(), "a goal inside the wall");
    assert!(space.shortest_path(Point2::new(f64::NAN, 0.0), Point2::new(1.0, 1.0)).is_none());
    assert!(space.shortest_path(Point2::new(90.0, 90.0), Point2::new(1.0, 1.0)).is_none());
}

#[test]
fn unknown_cells_are_what_the_config_says() {
    let mut rows = room(80, 60, |_, _| false);
    for row in &mut rows {
        row.replace_range(30..50, &"?".repeat(20));
    }
    let (from, to) = (Point2::new(0.5, 1.5), Point2::new(3.5, 1.5));
    let with = |unknown| drawn(&rows, &PlanConfig { unknown, ..PlanConfig::default() });
    let beside = Cell { i: 29, j: 30 };
    assert!(with(UnknownCells::Forbidden).shortest_path(from, to).is_none());
    assert!(with(UnknownCells::Forbidden).is_passable(beside));
    assert!(with(UnknownCells::Obstacle).shortest_path(from, to).is_none());
    assert!(!with(UnknownCells::Obstacle).is_passable(beside));
    assert!(with(UnknownCells::Allowed).shortest_path(from, to).is_some());
}

#[test]
fn the_field_and_the_path_agree() {
    let rows = room(100, 80, |i, j| (i == 50 && j < 60) || (j == 40 && (20..50).contains(&i)));
    let space = drawn(&rows, &PlanConfig::shortest());
    let (from, to) = (space.centre(Cell { i: 10, j: 10 }), space.centre(Cell { i: 90, j: 10 }));
    let field = space.distances_from(from);
    let path = space.shortest_path(from, to).unwrap();
    let end = space.cell_of(to);
    assert!((field.distance_m(end).unwrap() - path.length_m).abs() < 1e-3);
    assert!((path_length_m(&field.path_to(end)) - path.length_m).abs() < 1e-3);
}

/// Textbook Dijkstra in floating point over the same eight steps, for comparison.
fn reference_length(space: &Traversable, from: Cell, to: Cell) -> Option<f64> {
    let mut best = BTreeMap::from([(from, 0_u64)]);
    let mut queue = BinaryHeap::from([Reverse((0_u64, from))]);
    while let Some(Reverse((cost, cell))) = queue.pop() {
        if best[&cell] < cost {
            continue;
        }
        for (di, dj) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let next = Cell { i: cell.i + di, j: cell.j + dj };
            let beside = [Cell { i: next.i, j: cell.j }, Cell { i: cell.i, j: next.j }];
            if !space.is_passable(next) || !beside.iter().all(|&cell| space.is_passable(cell)) {
                continue;
            }
            // Nanometres, so that the queue is ordered.
            let step = if di != 0 && dj != 0 { 70_710_678 } else { 50_000_000 };
            if best.get(&next).is_none_or(|&known| known > cost + step) {
                best.insert(next, cost + step);
                queue.push(Reverse((cost + step, next)));
            }
        }
    }
    best.get(&to).map(|&cost| cost as f64 / 1e9)
}

fn cluttered() -> impl Strategy<Value = Vec<String>> {
    let pillars = prop::collection::vec((2..58_i32, 2..48_i32, 1..12_i32, 1..12_i32), 0..14);
    pillars.prop_map(|pillars| {
        room(60, 50, |i, j| pillars.iter().any(|&(x, y, w, h)| (x..x + w).contains(&i) && (y..y + h).contains(&j)))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn there_is_a_way_where_the_search_over_all_cells_gets(
        rows in cluttered(),
        from in (0.0..3.0, 0.0..2.5),
        robot_radius_m in 0.0..0.2,
    ) {
        let space = drawn(&rows, &PlanConfig { robot_radius_m, ..PlanConfig::shortest() });
        let from = Point2::new(from.0, from.1);
        let (field, start) = (space.distances_from(from), space.nearest_passable(from, ESCAPE_REACH_M));
        let joined = space.joined_with(start.into_iter());
        for (index, is_joined) in joined.into_iter().enumerate() {
            let cell = space.bounds.cell(index);
            let is_reached = field.distance_m(cell).is_some();
            prop_assert_eq!((space.has_way(from, cell), is_joined), (is_reached, is_reached), "{:?}", cell);
        }
    }

    #[test]
    fn a_path_is_as_short_as_dijkstras_and_keeps_the_radius(
        rows in cluttered(), from in (0..60_i32, 0..50_i32), to in (0..60_i32, 0..50_i32), comfort in prop::bool::ANY,
    ) {
        let config = if comfort { PlanConfig::default() } else { PlanConfig::shortest() };
        let space = drawn(&rows, &config);
        let (from, to) = (Cell { i: from.0, j: from.1 }, Cell { i: to.0, j: to.1 });
        prop_assume!(space.is_passable(from) && space.is_passable(to));
        let path = space.shortest_path(space.centre(from), space.centre(to));
        let reference = reference_length(&space, from, to);
        prop_assert_eq!(path.is_some(), reference.is_some());
        let (Some(path), Some(reference)) = (path, reference) else { return Ok(()) };
        if comfort {
            prop_assert!(path.length_m > reference - 1e-6);
        } else {
            prop_assert!((path.length_m - reference).abs() < 1e-4 * reference + 1e-9, "{} {}", path.length_m, reference);
        }
        let shortened = space.shorten(&path.points);
        prop_assert!(path_length_m(&shortened) < path.length_m + 1e-9);
        for line in [&path.points, &shortened] {
            for pair in line.windows(2) {
                prop_assert!(space.is_segment_passable(pair[0], pair[1]));
                for t in 0..=20 {
                    let at = space.cell_of(pair[0] + (pair[1] - pair[0]) * (f64::from(t) / 20.0));
                    for (j, row) in rows.iter().enumerate() {
                        for (i, _) in row.match_indices('#') {
                            let (dx, dy) = (f64::from(at.i) - i as f64, f64::from(at.j) - j as f64);
                            prop_assert!(dx.hypot(dy) * 0.05 > config.robot_radius_m);
                        }
                    }
                }
            }
        }
    }
}
