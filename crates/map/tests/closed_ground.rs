//! What operators closed is closed: ground that they keep robots out of, and edges.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRoute, NodeRouteConfig, RouteError, SpaceConfig, SpaceLimits};
use fht_proto::{AuthorId, EdgeKey, FixedPoint, FixedPose, Footprint, Increment, NodeId, NodeKind, Op, Rect};
use std::collections::BTreeSet;

fn id(number: u32) -> NodeId {
    NodeId { author: AuthorId(1), number }
}

fn at(x: f64, y: f64) -> FixedPoint {
    FixedPoint::from_metres(x, y)
}

/// A node's place and its rectangle `[min x, min y, max x, max y]`, metres.
type Node = ((f64, f64), [f64; 4]);

fn map(nodes: &[Node], edges: &[(u32, u32)]) -> MapState {
    let mut ops = Vec::new();
    for (number, &((x, y), [x0, y0, x1, y1])) in (0..).zip(nodes) {
        let (id, pose) = (id(number), FixedPose::from_metres(x, y, 0.0));
        ops.push(Op::PutNode { id, kind: NodeKind::Support, pose });
        ops.push(Op::SetFreeSpace { id, rect: Some(Rect::around(pose.position, (x0, y0), (x1, y1))) });
    }
    ops.extend(edges.iter().map(|&(a, b)| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) }));
    let mut state = MapState::new();
    state.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    state
}

/// Two rooms, 6 m by 8 m, with a wall of 0.2 m between them. The rectangles of both sides fill the
/// door, which is 1.2 m wide, and overlap in it; so do those of the other door, if there is one.
/// Both doors are nearer to the western room's node than to the eastern one's.
fn rooms(has_second_door: bool) -> MapState {
    let (west, east) = ((4.0, 2.5), (12.0, 2.5));
    let mut nodes = vec![
        (west, [0.0, 0.0, 6.0, 8.0]),
        (east, [6.2, 0.0, 14.0, 8.0]),
        ((5.5, 2.0), [5.0, 2.0, 6.6, 3.2]),
        ((6.6, 3.0), [5.8, 2.0, 7.0, 3.2]),
    ];
    let mut edges = vec![(0, 1)];
    if has_second_door {
        nodes.push(((5.5, 6.5), [5.0, 6.0, 7.0, 7.0]));
        edges.extend([(0, 4), (4, 1)]);
    }
    map(&nodes, &edges)
}

fn plan(map: &MapState, config: &SpaceConfig, from: FixedPoint, to: FixedPoint) -> Result<NodeRoute, RouteError> {
    shortest_path::plan(map, &FreeSpace::of(map, config), from, to, &NodeRouteConfig::default())
}

fn closing(edges: &[(u32, u32)]) -> SpaceConfig {
    let closed = edges.iter().map(|&(a, b)| EdgeKey::new(id(a), id(b))).collect();
    SpaceConfig { closed, ..SpaceConfig::default() }
}

fn keeping_out(polygons: &[&[(f64, f64)]]) -> SpaceConfig {
    let keep_out = polygons.iter().map(|polygon| polygon.iter().map(|&(x, y)| at(x, y)).collect()).collect();
    SpaceConfig { keep_out, ..SpaceConfig::default() }
}

fn passes(route: &NodeRoute, (x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> bool {
    route.waypoints.windows(2).any(|pair| {
        let [a, b] = [pair[0].point, pair[1].point];
        (0..=200).map(|step| f64::from(step) / 200.0).any(|share| {
            let (x, y) = (a.x() + share * (b.x() - a.x()), a.y() + share * (b.y() - a.y()));
            x > x0 && x < x1 && y > y0 && y < y1
        })
    })
}

#[test]
fn a_closed_edge_closes_its_door_though_rectangles_overlap_there() {
    let (from, to) = (at(2.0, 3.0), at(9.0, 2.0));
    let one_door = rooms(false);
    assert!(plan(&one_door, &SpaceConfig::default(), from, to).unwrap().length_m < 7.2);
    let refusal = plan(&one_door, &closing(&[(0, 1)]), from, to);
    assert!(matches!(refusal, Err(RouteError::NoPath { .. })), "{refusal:?}");
    // Rooms themselves stay whole.
    let within = plan(&one_door, &closing(&[(0, 1)]), at(1.0, 0.5), at(5.0, 7.5)).unwrap();
    assert_eq!(within.waypoints.len(), 2);
    let within = plan(&one_door, &closing(&[(0, 1)]), at(8.0, 0.5), at(8.0, 7.5)).unwrap();
    assert_eq!(within.waypoints.len(), 2);
}

#[test]
fn the_other_door_stays_open() {
    let (from, to) = (at(2.0, 3.0), at(9.0, 2.0));
    let map = rooms(true);
    let route = plan(&map, &closing(&[(0, 1)]), from, to).unwrap();
    assert!(passes(&route, (6.0, 6.0), (6.2, 7.0)) && !passes(&route, (6.0, 2.0), (6.2, 3.2)), "{route:?}");
    let refusal = plan(&map, &closing(&[(0, 1), (0, 4), (4, 1)]), from, to);
    assert!(matches!(refusal, Err(RouteError::NoPath { .. })), "{refusal:?}");
}

#[test]
fn places_right_beside_a_closed_door_are_not_joined_through_it() {
    let map = rooms(false);
    let config = closing(&[(0, 1)]);
    for x in [5.95, 6.0, 6.05, 6.15, 6.2, 6.25] {
        // In the door, before or behind the barrier: only one of the rooms can be reached.
        let reached = [at(3.0, 3.0), at(9.0, 3.0)].map(|goal| plan(&map, &config, at(x, 2.6), goal).is_ok());
        assert!(reached != [true, true], "from ({x}, 2.6)");
    }
}

#[test]
fn a_closed_edge_in_the_open_closes_no_hall() {
    let hall = map(&[((2.0, 5.0), [0.0, 0.0, 10.0, 10.0]), ((8.0, 5.0), [0.0, 0.0, 10.0, 10.0])], &[(0, 1)]);
    let route = plan(&hall, &closing(&[(0, 1)]), at(2.0, 5.0), at(8.0, 5.0)).unwrap();
    assert!(route.length_m > 6.0 && route.length_m < 6.2, "around the corridor's width: {}", route.length_m);
}

#[test]
fn a_closed_edge_whose_node_stands_in_the_door_closes_it() {
    let nodes =
        [((3.0, 2.5), [0.0, 0.0, 6.0, 8.0]), ((6.1, 2.5), [5.5, 2.0, 6.8, 3.0]), ((9.0, 2.5), [6.2, 0.0, 12.0, 8.0])];
    let map = map(&nodes, &[(0, 1), (1, 2)]);
    for closed in [(0, 1), (1, 2)] {
        let refusal = plan(&map, &closing(&[closed]), at(2.0, 2.5), at(10.0, 2.5));
        assert!(matches!(refusal, Err(RouteError::NoPath { .. })), "{closed:?}: {refusal:?}");
    }
    assert!(plan(&map, &closing(&[(0, 1)]), at(6.1, 2.5), at(10.0, 2.5)).is_ok(), "the node is left on its side");
    assert!(plan(&map, &closing(&[(0, 1)]), at(6.1, 2.5), at(2.0, 2.5)).is_err());
}

#[test]
fn a_corridor_without_rectangles_is_closed_too() {
    let map = map(&[((1.0, 1.0), [0.0, 0.0, 2.0, 2.0]), ((8.0, 3.0), [7.0, 2.0, 9.0, 4.0])], &[(0, 1)]);
    assert!(plan(&map, &SpaceConfig::default(), at(1.0, 1.0), at(8.0, 3.0)).is_ok());
    assert!(matches!(plan(&map, &closing(&[(0, 1)]), at(1.0, 1.0), at(8.0, 3.0)), Err(RouteError::NoPath { .. })));
    let unknown = SpaceConfig { closed: BTreeSet::from([EdgeKey::new(id(7), id(8))]), ..SpaceConfig::default() };
    assert!(plan(&map, &unknown, at(1.0, 1.0), at(8.0, 3.0)).is_ok());
}

#[test]
fn ways_lead_around_ground_that_is_kept_out() {
    let hall = map(&[((5.0, 5.0), [0.0, 0.0, 10.0, 10.0])], &[]);
    let square: &[(f64, f64)] = &[(4.0, 1.0), (6.0, 1.0), (6.0, 9.0), (4.0, 9.0)];
    let reversed: Vec<(f64, f64)> = square.iter().rev().copied().collect();
    // Two that overlap, of either sense, close what one does.
    let overlapping: [&[(f64, f64)]; 2] = [square, &[(4.5, 9.0), (5.5, 9.0), (5.5, 1.0), (4.5, 1.0)]];
    for polygons in [&[square][..], &[&reversed[..]], &overlapping] {
        let route = plan(&hall, &keeping_out(polygons), at(1.0, 4.0), at(9.0, 4.0)).unwrap();
        assert!(!passes(&route, (4.0, 1.0), (6.0, 9.0)), "{route:?}");
        let half_width = route.waypoints.iter().map(|it| it.point.y()).fold(f64::INFINITY, f64::min);
        assert!((0.83..0.845).contains(&half_width), "{half_width}");
    }
    let ignored = keeping_out(&[&[], &[(4.0, 1.0)], &[(4.0, 1.0), (6.0, 9.0)]]);
    assert_eq!(plan(&hall, &ignored, at(1.0, 4.0), at(9.0, 4.0)).unwrap().length_m, 8.0);
    let wall: &[(f64, f64)] = &[(4.0, -1.0), (4.1, -1.0), (4.1, 11.0), (4.0, 11.0)];
    for (from, to) in [(at(1.0, 4.0), at(9.0, 4.0)), (at(3.95, 4.0), at(4.15, 4.0)), (at(3.95, 4.0), at(9.0, 4.0))] {
        let refusal = plan(&hall, &keeping_out(&[wall]), from, to);
        assert!(matches!(refusal, Err(RouteError::NoPath { .. })), "{refusal:?}");
    }
}

#[test]
fn a_robot_larger_than_the_explorers_keeps_its_body_out_of_a_zone() {
    let hall = map(&[((5.0, 5.0), [0.0, 0.0, 10.0, 10.0])], &[]);
    let zone: &[(f64, f64)] = &[(4.0, 4.0), (6.0, 4.0), (6.0, 6.0), (4.0, 6.0)];
    // How near a route comes to the zone, metres.
    let nearest = |route: &NodeRoute| {
        let legs = route.waypoints.windows(2).map(|leg| [leg[0].point, leg[1].point]);
        let places = legs.flat_map(|[a, b]| {
            (0..=100).map(move |step| {
                let share = f64::from(step) / 100.0;
                (a.x() + share * (b.x() - a.x()), a.y() + share * (b.y() - a.y()))
            })
        });
        let away = |(x, y): (f64, f64)| ((x - 5.0).abs() - 1.0).max(0.0).hypot(((y - 5.0).abs() - 1.0).max(0.0));
        places.map(away).fold(f64::INFINITY, f64::min)
    };
    for radius in [0.2, 0.4] {
        let config = SpaceConfig::of(&Footprint::disc(radius).unwrap());
        let config = SpaceConfig { keep_out: keeping_out(&[zone]).keep_out, ..config };
        for beside_mm in (10..700).step_by(10) {
            let beside = f64::from(beside_mm) * 1e-3;
            // It comes from behind the zone.
            match plan(&hall, &config, at(2.0, 5.0), at(6.0 + beside, 5.0)) {
                Ok(route) => assert!(nearest(&route) >= radius, "{radius} m, {beside} m beside: {route:?}"),
                Err(error) => assert!(beside < radius + 0.1, "{radius} m, {beside} m beside: {error}"),
            }
            // Where it stands, it may leave.
            let left = plan(&hall, &config, at(6.0 + beside, 5.0), at(9.0, 5.0));
            assert!(left.is_ok(), "{radius} m, {beside} m beside: {left:?}");
        }
    }
}

#[test]
fn what_is_kept_out_may_be_left_and_not_entered() {
    let hall = map(&[((5.0, 5.0), [0.0, 0.0, 10.0, 10.0])], &[]);
    let config = keeping_out(&[&[(4.0, 4.0), (5.0, 4.0), (5.0, 6.0), (4.0, 6.0)]]);
    assert!(FreeSpace::of(&hall, &config).is_kept_out(at(4.5, 5.0)));
    assert!(plan(&hall, &config, at(4.5, 5.0), at(9.0, 5.0)).is_ok());
    assert!(matches!(plan(&hall, &config, at(9.0, 5.0), at(4.5, 5.0)), Err(RouteError::NoPath { .. })));
}

#[test]
fn beyond_the_budget_closed_edges_and_ground_stay_closed() {
    let map = rooms(true);
    let limits = SpaceLimits { outlines: 3, ..SpaceLimits::default() };
    let (from, to) = (at(2.0, 3.0), at(9.0, 2.0));
    let length = |config: SpaceConfig| {
        let config = SpaceConfig { limits: limits.clone(), ..config };
        assert!(FreeSpace::of(&map, &config).over_budget().is_some());
        plan(&map, &config, from, to).map(|route| route.length_m)
    };
    let open = length(SpaceConfig::default()).unwrap();
    let round = length(closing(&[(0, 1)])).unwrap();
    assert!(round > open + 2.0, "{open} {round}");
    assert_eq!(length(keeping_out(&[&[(6.0, 2.0), (6.2, 2.0), (6.2, 3.2), (6.0, 3.2)]])).unwrap(), round);
}

#[test]
fn a_start_on_the_border_of_closed_ground_is_left_and_a_goal_there_is_closed() {
    let hall = map(&[((2.0, 5.0), [0.0, 0.0, 10.0, 10.0])], &[]);
    let config = keeping_out(&[&[(4.0, 4.0), (6.0, 4.0), (6.0, 6.0), (4.0, 6.0)]]);
    for border in [at(4.0, 5.0), at(6.0, 5.0), at(5.0, 4.0), at(5.0, 6.0), at(4.0, 4.0), at(6.0, 6.0)] {
        let route = plan(&hall, &config, border, at(1.0, 1.0));
        assert!(route.is_ok(), "from {border:?}: {route:?}");
        let refusal = plan(&hall, &config, at(1.0, 1.0), border);
        assert!(matches!(refusal, Err(RouteError::NoPath { .. })), "to {border:?}: {refusal:?}");
        assert!(FreeSpace::of(&hall, &config).is_kept_out(border));
    }
}

/// `count` blocked places on a circle, metres.
fn ring(centre: (f64, f64), radius: f64, count: u32) -> SpaceConfig {
    let angle = |k: u32| f64::from(k) / f64::from(count) * std::f64::consts::TAU;
    let place = |k: u32| at(centre.0 + radius * angle(k).cos(), centre.1 + radius * angle(k).sin());
    SpaceConfig { blocked: (0..count).map(place).collect(), ..SpaceConfig::default() }
}

#[test]
fn no_path_leads_into_a_ring_of_blocked_places() {
    let nodes = [((2.0, 5.0), [0.0, 0.0, 10.0, 10.0]), ((8.0, 5.0), [0.0, 0.0, 10.0, 10.0])];
    let hall = map(&nodes, &[(0, 1)]);
    for limits in [SpaceLimits::default(), SpaceLimits { outlines: 0, ..SpaceLimits::default() }] {
        for radius in [0.1, 0.25, 0.35, 0.4, 0.5, 0.7, 1.0, 1.5] {
            let config = SpaceConfig { limits: limits.clone(), ..ring((7.0, 5.0), radius, 64) };
            let refusal = plan(&hall, &config, at(2.0, 5.0), at(7.0, 5.0));
            assert!(matches!(refusal, Err(RouteError::NoPath { .. })), "{radius} m: {refusal:?}");
            // Past it there is a way, and whoever stands in it may leave.
            if limits != SpaceLimits::default() {
                continue;
            }
            for from in [at(2.0, 5.0), at(7.0, 5.0)] {
                let route = plan(&hall, &config, from, at(9.5, 5.0));
                assert!(radius > 0.3 && from == at(7.0, 5.0) || route.is_ok(), "{radius} m: {route:?}");
            }
        }
    }
}

proptest::proptest! {
    #[test]
    fn paths_keep_away_from_what_is_blocked(
        places in proptest::collection::vec((0.0..14.0, 0.0..8.0), 1..40),
        from in (0.3..13.7, 0.3..7.7),
        to in (0.3..13.7, 0.3..7.7),
    ) {
        let (from, to) = (at(from.0, from.1), at(to.0, to.1));
        let blocked: BTreeSet<FixedPoint> = places.iter().map(|&(x, y)| at(x, y)).collect();
        let config = SpaceConfig { blocked: blocked.clone(), ..SpaceConfig::default() };
        let Ok(route) = plan(&rooms(true), &config, from, to) else { return Ok(()) };
        // The octagon around a place lies within its circle; whoever stands in it may leave it.
        let inner_m = 0.3 * std::f64::consts::FRAC_PI_8.cos() - 0.002;
        for place in blocked.iter().filter(|place| place.distance(from) > 0.3) {
            for pair in route.waypoints.windows(2) {
                let [a, b] = [pair[0].point, pair[1].point];
                for share in (0..=100).map(|step| f64::from(step) / 100.0) {
                    let x = a.x() + share * (b.x() - a.x()) - place.x();
                    let y = a.y() + share * (b.y() - a.y()) - place.y();
                    proptest::prop_assert!(x.hypot(y) >= inner_m, "{place:?} on the way {route:?}");
                }
            }
        }
    }
}
