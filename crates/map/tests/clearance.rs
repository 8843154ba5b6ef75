//! Paths keep away from what main nodes saw: thin things that stand in free space after all, and
//! walls between a place outside and the mesh.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, SpaceConfig};
use fht_proto::{
    AuthorId, EdgeKey, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect, ScanRecord, Signature,
};

fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

fn at(x: f64, y: f64) -> FixedPoint {
    FixedPoint::from_metres(x, y)
}

/// A scan from the origin of its node that returns from `things` (positions relative to the node,
/// metres) only.
fn scan(things: &[(f64, f64)]) -> Signature {
    let mut ranges_mm = vec![0; 720];
    for &(x, y) in things {
        let beam = (y.atan2(x).rem_euclid(std::f64::consts::TAU) / 0.5_f64.to_radians()).round() as usize % 720;
        ranges_mm[beam] = (x.hypot(y) * 1000.0).round() as u16;
    }
    let scan = ScanRecord {
        base_from_sensor: FixedPose::default(),
        angle_min: 0.0,
        angle_increment: 0.5_f32.to_radians(),
        ranges_mm,
    };
    Signature { descriptor: None, scan }
}

/// A rectangle, `[min x, min y, max x, max y]`, the place of a main node in it, and what that node
/// sees (map frame, metres).
type Node<'a> = ([f64; 4], (f64, f64), &'a [(f64, f64)]);

fn map(nodes: &[Node<'_>], edges: &[(u32, u32)]) -> MapState {
    let mut ops = Vec::new();
    for (number, (rect, (x, y), things)) in (0..).zip(nodes) {
        let pose = FixedPose::from_metres(*x, *y, 0.0);
        let seen: Vec<(f64, f64)> = things.iter().map(|(tx, ty)| (tx - x, ty - y)).collect();
        ops.push(Op::PutNode { id: id(number), kind: NodeKind::Main, pose });
        let rect = Rect::around(pose.position, (rect[0], rect[1]), (rect[2], rect[3]));
        ops.push(Op::SetFreeSpace { id: id(number), rect: Some(rect) });
        ops.push(Op::SetSignature { id: id(number), signature: scan(&seen) });
    }
    ops.extend(edges.iter().map(|&(a, b)| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }));
    let mut state = MapState::new();
    state.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    state
}

fn plan(map: &MapState, from: FixedPoint, to: FixedPoint) -> Vec<FixedPoint> {
    let space = FreeSpace::of(map, &SpaceConfig::default());
    let route = shortest_path::plan(map, &space, from, to, &NodeRouteConfig::default()).unwrap();
    route.waypoints.iter().map(|waypoint| waypoint.point).collect()
}

/// How near a path comes to a place, metres.
fn nearest_m(path: &[FixedPoint], place: FixedPoint) -> f64 {
    let along = |a: FixedPoint, b: FixedPoint| {
        (0..=100).map(move |step| {
            let share = f64::from(step) / 100.0;
            at(a.x() + share * (b.x() - a.x()), a.y() + share * (b.y() - a.y()))
        })
    };
    let points = path.windows(2).flat_map(|pair| along(pair[0], pair[1]));
    points.map(|point| point.distance(place)).fold(f64::INFINITY, f64::min)
}

const HALL: [f64; 4] = [0.0, 0.0, 10.0, 4.0];
const POLE: (f64, f64) = (5.0, 2.0);

#[test]
fn a_pole_that_two_nodes_saw_is_gone_round() {
    let map = map(&[(HALL, (2.0, 1.0), &[POLE]), (HALL, (8.0, 3.0), &[POLE])], &[]);
    let path = plan(&map, at(1.0, 2.0), at(9.0, 2.0));
    let nearest = nearest_m(&path, at(POLE.0, POLE.1));
    assert!((0.15..0.25).contains(&nearest), "{nearest} m: {path:?}");
}

#[test]
fn an_edge_that_leads_past_it_is_closed() {
    let (west, east) = ([0.0, 0.0, 4.0, 4.0], [6.0, 0.0, 10.0, 4.0]);
    let nodes: [Node<'_>; 4] =
        [(west, (2.0, 1.9), &[POLE]), (east, (8.0, 1.9), &[POLE]), (west, (2.0, 0.5), &[]), (east, (8.0, 0.5), &[])];
    let path = plan(&map(&nodes, &[(0, 1), (2, 3)]), at(1.0, 1.9), at(9.0, 1.9));
    assert!(nearest_m(&path, at(POLE.0, POLE.1)) > 1.0, "{path:?}");
}

#[test]
fn what_only_one_saw_is_gone_round_unless_another_saw_through_it() {
    let unseen = map(&[(HALL, (2.0, 1.0), &[POLE]), (HALL, (8.0, 3.0), &[])], &[]);
    let path = plan(&unseen, at(1.0, 2.0), at(9.0, 2.0));
    let nearest = nearest_m(&path, at(POLE.0, POLE.1));
    assert!((0.15..0.25).contains(&nearest), "{nearest} m: {path:?}");
    // From (2, 1), 3.2 m away, beams are 28 mm apart: somebody who is seen by ten of them, and gone
    // when the other node looks at the wall behind.
    let somebody: Vec<(f64, f64)> =
        (0..10).map(|step| (5.0 - 0.01 * f64::from(step), 1.9 + 0.028 * f64::from(step))).collect();
    let wall: Vec<(f64, f64)> = (0..120).map(|step| (0.0, 0.02 * f64::from(step))).collect();
    let seen_through = map(&[(HALL, (2.0, 1.0), &somebody), (HALL, (8.0, 3.0), &wall)], &[]);
    assert_eq!(plan(&seen_through, at(1.0, 2.0), at(9.0, 2.0)).len(), 2);
}

#[test]
fn walls_just_outside_of_a_rectangle_take_nothing_from_it() {
    let wall: Vec<(f64, f64)> = (0..50).map(|step| (3.0 + 0.05 * f64::from(step), -0.02)).collect();
    let map = map(&[(HALL, (2.0, 1.0), &wall), (HALL, (8.0, 3.0), &wall)], &[]);
    assert_eq!(plan(&map, at(1.0, 0.17), at(9.0, 0.17)).len(), 2);
}

#[test]
fn a_place_outside_joins_the_mesh_where_no_wall_stands_between() {
    // The place is 0.5 m below the hall; between them stands a wall that ends 0.2 m to its left.
    let wall: Vec<(f64, f64)> = (0..38).map(|step| (4.8 + 0.05 * f64::from(step), -0.2)).collect();
    let walled = map(&[(HALL, (2.0, 1.0), &wall)], &[]);
    let path = plan(&walled, at(5.0, -0.5), at(5.0, 3.0));
    let nearest = wall.iter().map(|&(x, y)| nearest_m(&path, at(x, y))).fold(f64::INFINITY, f64::min);
    assert!(nearest > 0.09, "{nearest} m: {path:?}");
    let straight = plan(&map(&[(HALL, (2.0, 1.0), &[])], &[]), at(5.0, -0.5), at(5.0, 3.0));
    assert!(straight.iter().all(|point| (point.x() - 5.0).abs() < 0.002), "{straight:?}");
}
