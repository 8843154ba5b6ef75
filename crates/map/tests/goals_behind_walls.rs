//! A goal that free space does not reach: no path leads there through a wall that a main node saw;
//! the refusal says where the nearest point is that can be reached, and a path there can be asked
//! for. Robots leave the place where they stand all the same.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRoute, NodeRouteConfig, PathEnds, RouteError, SpaceConfig};
use fht_proto::{AuthorId, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect, ScanRecord, Signature};

fn at(x: f64, y: f64) -> FixedPoint {
    FixedPoint::from_metres(x, y)
}

/// A hall of 10 m by 4 m. A main node stands in its middle. The wall along the south side, at y =
/// -0.1, is seen from there by a beam each degree: to the sides its ends are a quarter of a metre
/// apart. It has a gap from x = 7 to x = 8; nothing else is seen.
fn hall() -> MapState {
    let (x, y) = (5.0, 2.0);
    let ranges_mm = (0..360_u32).map(|beam| {
        let (sin, cos) = f64::from(beam).to_radians().sin_cos();
        let range = (-0.1 - y) / sin;
        let meets = sin < -0.2 && !(7.0..8.0).contains(&(x + range * cos));
        if meets { (range * 1000.0).round() as u16 } else { 0 }
    });
    let scan = ScanRecord {
        base_from_sensor: FixedPose::default(),
        angle_min: 0.0,
        angle_increment: 1.0_f32.to_radians(),
        ranges_mm: ranges_mm.collect(),
    };
    let (id, pose) = (NodeId { author: AuthorId(1), number: 0 }, FixedPose::from_metres(x, y, 0.0));
    let ops = vec![
        Op::PutNode { id, kind: NodeKind::Main, pose },
        Op::SetFreeSpace { id, rect: Some(Rect::around(pose.position, (0.0, 0.0), (10.0, 4.0))) },
        Op::SetSignature { id, signature: Signature { descriptor: None, scan } },
    ];
    let mut state = MapState::new();
    state.apply(&Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops });
    state
}

fn plan(map: &MapState, from: FixedPoint, to: FixedPoint, ends: PathEnds) -> Result<NodeRoute, RouteError> {
    let space = FreeSpace::of(map, &SpaceConfig::default());
    shortest_path::plan(map, &space, from, to, &NodeRouteConfig { ends, ..NodeRouteConfig::default() })
}

/// Where a route crosses the line of the wall.
fn crossings(route: &NodeRoute) -> Vec<f64> {
    let legs = route.waypoints.windows(2).map(|leg| (leg[0].point, leg[1].point));
    let crossing = |(a, b): (FixedPoint, FixedPoint)| {
        let share = (-0.1 - a.y()) / (b.y() - a.y());
        (a.y() != b.y() && (0.0..=1.0).contains(&share)).then(|| a.x() + share * (b.x() - a.x()))
    };
    legs.filter_map(crossing).collect()
}

#[test]
fn no_path_leads_through_a_wall_that_was_seen() {
    let map = hall();
    let mut beyond = 0;
    for x in 0..=50 {
        for y in 1..10 {
            let goal = at(f64::from(x) * 0.2, -0.2 * f64::from(y));
            match plan(&map, at(5.0, 3.0), goal, PathEnds::Unknown) {
                Ok(route) => {
                    beyond += 1;
                    let through = crossings(&route);
                    // Beams at less than 11.5° to the wall do not count as meeting it.
                    assert!(
                        through.iter().all(|x| (6.9..8.2).contains(x)),
                        "{goal:?}: through the wall at {through:?}"
                    );
                    // Nobody saw the ground behind the wall's line.
                    assert!(route.unmapped_m > 0.05 && route.unmapped_m <= 0.3, "{goal:?}: {route:?}");
                }
                Err(error) => assert!(matches!(error, RouteError::NoPath { nearest: Some(_), .. }), "{error}"),
            }
        }
    }
    assert!(beyond > 2, "{beyond} goals can be reached by the gap");
}

#[test]
fn the_refusal_says_how_near_a_path_can_lead_and_it_can_be_asked_for() {
    let (map, from, goal) = (hall(), at(5.0, 3.0), at(4.0, -1.5));
    let error = plan(&map, from, goal, PathEnds::Unknown).unwrap_err();
    let said = error.to_string();
    assert!(said.contains("1.66 m from the goal") && said.contains("to_nearest=true"), "{said}");
    let route = plan(&map, from, goal, PathEnds::ToNearest).unwrap();
    assert_eq!(route.waypoints.last().unwrap().point, at(4.0, 0.16));
    assert!((route.goal_moved_m - 1.66).abs() < 1e-9 && route.unmapped_m == 0.0, "{route:?}");
    assert!((route.length_m - from.distance(at(4.0, 0.16))).abs() < 0.01);
    // Far outside it is another refusal, and the same path.
    let far = at(4.0, -30.0);
    let error = plan(&map, from, far, PathEnds::Unknown).unwrap_err();
    assert!(matches!(error, RouteError::OutOfMap { .. }) && error.to_string().contains("to_nearest=true"), "{error}");
    let route = plan(&map, from, far, PathEnds::ToNearest).unwrap();
    assert_eq!(route.waypoints.last().unwrap().point, at(4.0, 0.16));
    // A goal that can be reached is not moved.
    let route = plan(&map, from, at(2.0, 2.0), PathEnds::ToNearest).unwrap();
    assert_eq!((route.goal_moved_m, route.waypoints.last().unwrap().point), (0.0, at(2.0, 2.0)));
}

#[test]
fn a_robot_leaves_the_place_where_it_stands() {
    let map = hall();
    // It stands a little beyond the wall's line, as it thinks: the wall is under it.
    assert!(plan(&map, at(4.0, -0.15), at(5.0, 3.0), PathEnds::Unknown).is_ok());
    // And not through a wall from well behind it.
    let behind = plan(&map, at(3.0, -1.0), at(5.0, 3.0), PathEnds::Unknown);
    assert!(matches!(behind, Err(RouteError::NoPath { .. })), "{behind:?}");
    // Nor from far beyond the gap, where nobody saw anything.
    let hidden = plan(&map, at(7.5, -1.2), at(5.0, 3.0), PathEnds::Unknown);
    assert!(matches!(hidden, Err(RouteError::NoPath { is_shut_in: true, .. })), "{hidden:?}");
    assert!(hidden.unwrap_err().to_string().contains("nothing leads away from the start"));
    // Nodes are known to be reachable.
    assert!(plan(&map, at(5.0, 3.0), at(4.0, -0.15), PathEnds::Known).is_ok());
}

#[test]
fn a_path_over_nodes_begins_with_no_way_through_a_wall_at_the_border_of_a_rectangle() {
    let map = hall();
    // Nearer to the rectangle than to the mesh, which keeps away from its border: the wall stands
    // between, and the path over nodes would enter the rectangle just behind it.
    for x in [2.0, 3.0, 4.0, 5.0, 6.0] {
        for y in [-0.26, -0.3, -0.35, -0.45] {
            let start = at(x, y);
            let behind = plan(&map, start, at(5.0, 3.0), PathEnds::Unknown);
            assert!(matches!(behind, Err(RouteError::NoPath { .. })), "{start:?}: {behind:?}");
        }
    }
    // Where there is no wall, it is left.
    assert!(plan(&map, at(7.5, -0.3), at(5.0, 3.0), PathEnds::Unknown).is_ok());
}

#[test]
fn ground_that_a_scan_passed_over_is_known() {
    let map = hall();
    // Through the gap, where beams returned from nothing, nobody knows what is there.
    let route = plan(&map, at(5.0, 3.0), at(7.5, -0.2), PathEnds::Unknown).unwrap();
    assert!((0.1..0.3).contains(&route.unmapped_m), "{route:?}");
    let hidden = plan(&map, at(5.0, 3.0), at(7.5, -0.6), PathEnds::Unknown);
    assert!(matches!(hidden, Err(RouteError::NoPath { nearest: Some(_), .. })), "{hidden:?}");
    // A robot that stands there leaves it.
    let route = plan(&map, at(7.5, -0.6), at(5.0, 3.0), PathEnds::Unknown).unwrap();
    assert!((0.4..0.7).contains(&route.unmapped_m), "{route:?}");
    let route = plan(&map, at(5.0, 3.0), at(9.9, 2.0), PathEnds::Unknown).unwrap();
    assert_eq!(route.unmapped_m, 0.0, "beside the mesh, in the rectangle");
}
