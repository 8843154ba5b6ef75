//! Paths through free space: exact on rectangles, inside free space, and the same for whoever asks.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::plan::node_route::RoutePoint;
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, RouteError, SpaceConfig};
use fht_proto::{AuthorId, EdgeKey, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect};
use proptest::prelude::*;

fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

fn at(x: f64, y: f64) -> FixedPoint {
    FixedPoint::from_metres(x, y)
}

/// A map of support nodes in the middle of rectangles `[min x, min y, max x, max y]`, metres,
/// joined by edges.
fn map(rectangles: &[[f64; 4]], edges: &[(u32, u32)]) -> MapState {
    let mut ops = Vec::new();
    for (number, &[x0, y0, x1, y1]) in (0..).zip(rectangles) {
        let (id, pose) = (id(number), FixedPose::from_metres(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0));
        ops.push(Op::PutNode { id, kind: NodeKind::Support, pose });
        ops.push(Op::SetFreeSpace { id, rect: Some(Rect::around(pose.position, (x0, y0), (x1, y1))) });
    }
    ops.extend(edges.iter().map(|&(a, b)| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }));
    let mut state = MapState::new();
    state.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    state
}

fn plan(map: &MapState, from: FixedPoint, to: FixedPoint) -> Result<(f64, Vec<FixedPoint>), RouteError> {
    let space = FreeSpace::of(map, &SpaceConfig::default());
    let route = shortest_path::plan(map, &space, from, to, &NodeRouteConfig::default())?;
    Ok((route.length_m, route.waypoints.iter().map(|point: &RoutePoint| point.point).collect()))
}

const HALF: f64 = 0.16;

#[test]
fn the_way_turns_around_the_corner_of_an_l_at_the_robots_half_width() {
    // A corridor to the east and one to the north; the inner corner is at (2, 2).
    let map = map(&[[0.0, 0.0, 8.0, 2.0], [0.0, 0.0, 2.0, 8.0]], &[]);
    let (length_m, points) = plan(&map, at(7.0, 1.5), at(1.5, 7.0)).unwrap();
    // Taut around an arc of the half width: two tangents and what is between them.
    let tangent = |dx: f64, dy: f64| (dx * dx + dy * dy - HALF * HALF).sqrt();
    let straight = tangent(5.0, 0.5) + tangent(0.5, 5.0);
    assert!(length_m > straight && length_m < straight + 0.25, "{length_m} {straight}");
    let corner = at(2.0, 2.0);
    let nearest = points.iter().map(|point| point.distance(corner)).fold(f64::INFINITY, f64::min);
    // Arcs are drawn with corners and whole millimetres.
    assert!((0.995 * HALF - 0.001..HALF + 0.02).contains(&nearest), "{nearest}");
}

#[test]
fn rectangles_that_only_touch_are_one_space() {
    let map = map(&[[0.0, 0.0, 3.0, 4.0], [3.0, 1.0, 6.0, 3.0]], &[]);
    let (length_m, points) = plan(&map, at(1.0, 2.0), at(5.0, 2.0)).unwrap();
    assert_eq!((length_m, points.len()), (4.0, 2));
}

#[test]
fn a_gap_narrower_than_the_robot_is_closed() {
    // The rectangles share 0.2 m of a side.
    let map = map(&[[0.0, 0.0, 3.0, 3.0], [3.0, 2.8, 6.0, 6.0]], &[]);
    assert!(matches!(plan(&map, at(1.0, 1.0), at(5.0, 5.0)), Err(RouteError::NoPath { .. })));
}

#[test]
fn an_edge_joins_rectangles_that_are_apart() {
    let map = map(&[[0.0, 0.0, 2.0, 2.0], [5.0, 0.0, 7.0, 2.0]], &[(0, 1)]);
    let (length_m, points) = plan(&map, at(1.0, 0.5), at(6.0, 0.5)).unwrap();
    assert!(length_m > 5.0 && length_m < 5.3, "{length_m}");
    let inside = points.iter().filter(|point| point.x() > 2.0 && point.x() < 5.0);
    assert!(inside.into_iter().all(|point| (point.y() - 1.0).abs() < 0.03), "{points:?}");
}

#[test]
fn a_blocked_door_is_gone_round() {
    // Two rooms with two doors: the southern one is nearer.
    let rooms = [[0.0, 0.0, 4.0, 8.0], [4.2, 0.0, 8.0, 8.0], [3.5, 1.0, 4.7, 2.0], [3.5, 6.0, 4.7, 7.0]];
    let map = map(&rooms, &[(0, 2), (2, 1), (0, 3), (3, 1)]);
    let (from, to) = (at(2.0, 1.5), at(6.0, 1.5));
    let route = |blocked: &[FixedPoint]| {
        let space =
            FreeSpace::of(&map, &SpaceConfig { blocked: blocked.iter().copied().collect(), ..SpaceConfig::default() });
        shortest_path::plan(&map, &space, from, to, &NodeRouteConfig::default())
    };
    assert_eq!(route(&[]).unwrap().length_m, 4.0);
    let round = route(&[at(4.1, 1.5)]).unwrap();
    assert!(round.length_m > 8.0, "{}", round.length_m);
    assert!(round.waypoints.iter().any(|point| point.point.y() > 5.5));
    assert!(matches!(route(&[at(4.1, 1.5), at(4.1, 6.5)]), Err(RouteError::NoPath { .. })));
    let beside = route(&[at(5.5, 1.5)]).unwrap();
    assert!(beside.length_m > 4.0 && beside.length_m < 4.3, "in a room the way leads around it: {}", beside.length_m);
}

#[test]
fn a_place_beside_the_free_space_joins_it_at_the_nearest_point_and_one_far_away_does_not() {
    let map = map(&[[0.0, 0.0, 4.0, 4.0]], &[]);
    let (_, points) = plan(&map, at(-1.0, 2.0), at(3.0, 3.0)).unwrap();
    assert_eq!(points, [at(-1.0, 2.0), at(HALF, 2.0), at(3.0, 3.0)]);
    assert!(matches!(plan(&map, at(-9.0, 2.0), at(3.0, 3.0)), Err(RouteError::OutOfMap { .. })));
    assert!(matches!(plan(&MapState::new(), at(0.0, 0.0), at(1.0, 0.0)), Err(RouteError::OutOfMap { .. })));
}

/// The shortest way over a fine lattice in the union of rectangles, at least `HALF` from its
/// border: an upper bound.
fn lattice_length(rectangles: &[[f64; 4]], from: FixedPoint, to: FixedPoint) -> Option<f64> {
    let step = 0.25;
    let fits = |x: f64, y: f64| {
        // Where the robot's square fits it fits as well: that makes the bound a bound.
        let corners =
            [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)];
        let is_in = |x: f64, y: f64| rectangles.iter().any(|r| x >= r[0] && y >= r[1] && x <= r[2] && y <= r[3]);
        let margin = HALF + 0.1;
        is_in(x, y) && corners.iter().all(|(dx, dy)| is_in(x + dx * margin, y + dy * margin))
    };
    let index = |p: FixedPoint| ((p.x() / step).round() as i32, (p.y() / step).round() as i32);
    let (start, goal) = (index(from), index(to));
    let steps = |&(i, j): &(i32, i32)| {
        let mut next = Vec::new();
        for (di, dj) in [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
            let (x, y) = (f64::from(i + di) * step, f64::from(j + dj) * step);
            if fits(x, y) {
                next.push(((i + di, j + dj), if di != 0 && dj != 0 { 1414 } else { 1000 }));
            }
        }
        next
    };
    let (_, cost) = pathfinding::directed::dijkstra::dijkstra(&start, steps, |cell| *cell == goal)?;
    Some(f64::from(cost) * 1e-3 * step)
}

fn rooms() -> impl Strategy<Value = Vec<[f64; 4]>> {
    let room = (0..24_u8, 0..24_u8, 4..14_u8, 4..14_u8).prop_map(|(x, y, width, height)| {
        let [x, y, width, height] = [x, y, width, height].map(|value| f64::from(value) * 0.5);
        [x, y, x + width, y + height]
    });
    proptest::collection::vec(room, 1..12)
}

proptest! {
    #[test]
    fn ways_stay_in_free_space_and_none_is_shorter(rectangles in rooms(), a in 0..12_usize, b in 0..12_usize,
                                                    reach in prop::array::uniform4(0.2..0.8_f64)) {
        let map = map(&rectangles, &[]);
        let inside = |room: usize, x: f64, y: f64| {
            let [x0, y0, x1, y1] = rectangles[room % rectangles.len()];
            at(x0 + x * (x1 - x0), y0 + y * (y1 - y0))
        };
        let (from, to) = (inside(a, reach[0], reach[1]), inside(b, reach[2], reach[3]));
        let forth = plan(&map, from, to);
        let back = plan(&map, to, from);
        prop_assert_eq!(forth.is_ok(), back.is_ok());
        let Ok((length_m, points)) = forth else {
            // The mesh is larger than the lattice: where that finds a way, there is one.
            let snap = |p: FixedPoint| at((p.x() / 0.25).round() * 0.25, (p.y() / 0.25).round() * 0.25);
            prop_assert!(lattice_length(&rectangles, snap(from), snap(to)).is_none());
            return Ok(());
        };
        prop_assert!((length_m - back.unwrap().0).abs() < 0.01);
        prop_assert!(length_m + 0.01 >= from.distance(to));
        if let Some(bound) = lattice_length(&rectangles, from, to) {
            // The ends are moved to the lattice: at most half a diagonal each.
            prop_assert!(length_m <= bound + 2.0 * 0.18, "{} {}", length_m, bound);
        }
        for pair in points.windows(2) {
            for share in 0..=20 {
                let share = f64::from(share) / 20.0;
                let (x, y) = (pair[0].x() + share * (pair[1].x() - pair[0].x()), pair[0].y() + share * (pair[1].y() - pair[0].y()));
                let is_free = rectangles.iter().any(|r| x >= r[0] - 1e-3 && y >= r[1] - 1e-3 && x <= r[2] + 1e-3 && y <= r[3] + 1e-3);
                prop_assert!(is_free, "({}, {})", x, y);
            }
        }
    }
}
