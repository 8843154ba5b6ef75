//! Maps come over the network: valid ones that no explorer would make take no forever and no
//! gigabytes.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, OverBudget, SpaceConfig, SpaceLimits};
use fht_proto::{
    AuthorId, EdgeKey, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect, ScanRecord, Signature,
};

fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

fn put(number: u32, x: f64, y: f64) -> Op {
    Op::PutNode { id: id(number), kind: NodeKind::Main, pose: FixedPose::from_metres(x, y, 0.0) }
}

fn edge(a: u32, b: u32) -> Op {
    Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }
}

fn see(number: u32, angle_increment: f32, ranges_mm: Vec<u16>) -> Op {
    let scan = ScanRecord { base_from_sensor: FixedPose::default(), angle_min: 0.0, angle_increment, ranges_mm };
    Op::SetSignature { id: id(number), signature: Signature { descriptor: None, scan } }
}

fn hall(number: u32, x: f64, y: f64) -> Op {
    let rect = Rect::around(FixedPoint::from_metres(x, y), (-5.0, -5.0), (5.0, 5.0));
    Op::SetFreeSpace { id: id(number), rect: Some(rect) }
}

fn map(ops: Vec<Op>) -> MapState {
    let mut map = MapState::new();
    map.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    map
}

/// Plans between places in and outside of the hall.
fn plan(map: &MapState) {
    let space = FreeSpace::of(map, &SpaceConfig::default());
    let at = FixedPoint::from_metres;
    for (from, to) in [(at(0.0, 1.0), at(2.0, -1.0)), (at(6.0, 0.0), at(-6.0, 0.0)), (at(90_000.0, 0.0), at(0.0, 0.0))]
    {
        let _ = shortest_path::plan(map, &space, from, to, &NodeRouteConfig::default());
    }
}

#[test]
fn edges_across_the_world() {
    let mut ops: Vec<Op> = Vec::new();
    for number in 0..32 {
        let (far, beside) = (99_000.0, f64::from(number));
        ops.extend([put(number, -far, beside - far), put(100 + number, far, beside + far), edge(number, 100 + number)]);
        ops.push(see(number, 0.01, vec![1000; 600]));
    }
    plan(&map(ops));
}

#[test]
fn scans_without_angles_and_of_part_of_a_turn() {
    for step in [0.0, -0.0, 1e-40, -0.01, 0.01, 1.0, 100.0] {
        let ranges = |most: u16| (0..271).map(|beam| beam % most).collect();
        let ops = vec![
            put(0, 0.0, 0.0),
            hall(0, 0.0, 0.0),
            see(0, step, ranges(7)),
            put(1, 1.0, 0.0),
            see(1, step, ranges(5000)),
        ];
        plan(&map(ops));
    }
}

#[test]
fn a_crowd_of_nodes_that_all_see_one_spot() {
    let mut ops = Vec::new();
    for number in 0..100 {
        let y = 0.001 * f64::from(number);
        ops.extend([put(number, 0.0, y), hall(number, 0.0, y)]);
        ops.push(see(number, 0.0001, (0..720).map(|beam| 3000 + (beam * 7 + number as u16) % 50).collect()));
        ops.extend((0..number).map(|other| edge(other, number)));
    }
    plan(&map(ops));
}

/// Thin rectangles that all cross each other, so many of either direction, 131 m long.
fn lattice(count: i32) -> MapState {
    let pitch = 120_000 / count;
    let mut ops = Vec::new();
    for number in 0..count {
        let away = number * pitch - 60_000;
        let thin = (pitch / 2).max(1) as u16;
        let (level, upright) = (FixedPoint { x_mm: 0, y_mm: away }, FixedPoint { x_mm: away, y_mm: 0 });
        let rects = [
            Rect { west_mm: u16::MAX, south_mm: 0, east_mm: u16::MAX, north_mm: thin },
            Rect { west_mm: 0, south_mm: u16::MAX, east_mm: thin, north_mm: u16::MAX },
        ];
        for (turn, (position, rect)) in [level, upright].into_iter().zip(rects).enumerate() {
            let id = id(2 * number as u32 + turn as u32);
            ops.push(Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose { position, ..FixedPose::default() } });
            ops.push(Op::SetFreeSpace { id, rect: Some(rect) });
        }
    }
    map(ops)
}

/// Such a map has no mesh, and paths over its nodes.
fn assert_over(map: &MapState, expected: OverBudget) {
    assert_eq!(FreeSpace::of(map, &SpaceConfig::default()).over_budget(), Some(expected));
    plan(map);
}

#[test]
fn ten_thousand_rectangles_cross_ten_thousand() {
    let limits = SpaceLimits::default();
    assert_over(&lattice(10_000), OverBudget::Overlaps(limits.overlaps));
    // Fewer, but with free space that is all corners.
    assert_over(&lattice(150), OverBudget::Corners(limits.corners));
    assert_eq!(FreeSpace::of(&lattice(20), &SpaceConfig::default()).over_budget(), None);
}

#[test]
fn thousands_of_scans_of_one_spot() {
    let limits = SpaceLimits::default();
    let crowd = |count: u32, is_in_hall: bool| {
        let scan = |number: u32| (0..720).map(|beam| 3000 + (beam * 7 + number as u16) % 50).collect();
        let mut ops = Vec::new();
        for number in 0..count {
            ops.extend([put(number, 0.0, 0.0), see(number, 0.0001, scan(number))]);
            ops.extend(is_in_hall.then(|| hall(number, 0.0, 0.0)));
        }
        map(ops)
    };
    assert_over(&crowd(3000, false), OverBudget::Beams(limits.beams));
    assert_over(&crowd(600, true), OverBudget::Looks(limits.looks));
}

#[test]
fn a_map_of_more_nodes_than_any_building() {
    let limits = SpaceLimits::default();
    let mut ops = Vec::new();
    for number in 0..limits.outlines as u32 + 1 {
        let (x, y) = (f64::from(number % 400) * 20.0, f64::from(number / 400) * 20.0);
        ops.extend([put(number, x, y), hall(number, x, y)]);
    }
    assert_over(&map(ops), OverBudget::Outlines(limits.outlines));
}
