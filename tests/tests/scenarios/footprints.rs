//! Paths for robots larger than the explorers, checked against the true plan of the building.

use fht_eval::{Member, TeamTask, explore_as_team};
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, NodeRouteConfig, RouteError, SpaceConfig};
use fht_perception::pose::Point2;
use fht_proto::{FixedPoint, Footprint};
use fht_sim::load;
use mapper::MapperConfig;
use std::sync::Arc;

/// Pairs of places between which paths are asked for.
const PAIRS: u64 = 400;

/// More room than the radius that a robot has where it starts, metres: it knows its place to a
/// centimetre, and walls are drawn from cells.
const START_ROOM_M: f64 = 0.02;

/// Places where the robot has room are the starts; goals are anywhere where the explorer has.
#[test]
fn a_path_for_a_large_robot_is_free_for_it_or_there_is_none() {
    let world = Arc::new(load("office", None, 1).unwrap());
    let members = vec![Member::at(world.start())];
    let task = TeamTask { members, seed: 1, cameras: false, mapper: MapperConfig::default(), most_s: 3600.0 };
    let explored = explore_as_team(&world, &task, |_, _| {}).unwrap();
    let world_from_map = explored.world_from_map;
    let fixed = |place: Point2| {
        let place = world_from_map.inverse() * place;
        FixedPoint::from_metres(place.x, place.y)
    };
    let place = |seed: u64, room_m: f64| Point2::from(world.random_free_pose(seed, room_m).translation.vector);
    for radius_m in [0.2, 0.3, 0.45] {
        let footprint = Footprint::disc(radius_m).unwrap();
        let space = FreeSpace::of(&explored.map, &SpaceConfig::of(&footprint));
        let (mut paths, mut touching, mut possible, mut least_m) = (0, Vec::new(), 0, f64::INFINITY);
        for pair in 0..PAIRS {
            let (from, to) = (place(2 * pair, radius_m + START_ROOM_M), place(2 * pair + 1, 0.11));
            possible +=
                u32::from(world.is_clear(to, to, radius_m) && world.plan().shortest_path(from, to, radius_m).is_some());
            let route = shortest_path::plan(&explored.map, &space, fixed(from), fixed(to), &NodeRouteConfig::default());
            let route = match route {
                Ok(route) => route,
                Err(error) => {
                    assert!(matches!(error, RouteError::NoPath { .. }), "{error}");
                    continue;
                }
            };
            paths += 1;
            let point = |at: FixedPoint| world_from_map * Point2::new(at.x(), at.y());
            let points: Vec<Point2> = route.waypoints.iter().map(|waypoint| point(waypoint.point)).collect();
            let room_m = (1..=100)
                .map(|step| radius_m - 0.1 + 0.002 * f64::from(step))
                .take_while(|room_m| points.windows(2).all(|leg| world.is_clear(leg[0], leg[1], *room_m)))
                .last();
            let room_m = room_m.unwrap_or(0.0);
            least_m = room_m.min(least_m);
            if points.windows(2).any(|leg| !world.is_clear(leg[0], leg[1], radius_m)) {
                touching.push((from, to, points.len(), room_m));
            }
        }
        println!("{radius_m} m: {paths} of {PAIRS} pairs have a path, {possible} could; least room {least_m:.3} m");
        touching.iter().for_each(|touching| println!("touches: {touching:?}"));
        assert!(touching.is_empty(), "{} of {paths} paths for a robot of {radius_m} m touch something", touching.len());
        assert!(paths > 150, "only {paths} of {possible} pairs have a path for a robot of {radius_m} m");
    }
}
