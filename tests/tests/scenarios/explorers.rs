//! Several explorers in one building: together, one after the other, and after the building has
//! changed. In simulated time, without cameras; the last three tests run real processes.

use crate::programs::{executable, start};
use fht_demo::{Crew, HandoffConfig, Process, Role, free_endpoint, hand_off};
use fht_eval::{Member, TeamRun, TeamTask, explore_as_team};
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRef, NodeRouteConfig, SpaceConfig};
use fht_perception::pose::{Point2, Pose2, from_fixed};
use fht_proto::{FixedPoint, NodeId};
use fht_session::SessionConfig;
use fht_sim::{Changes, SimConfig, World, load, load_with, start_near};
use fht_tests::museum_demo::museum_demo;
use mapper::MapperConfig;
use mapper::explore::Ending;
use mapper::program::ExploreReport;
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

fn museum() -> Arc<World> {
    Arc::new(load("museum", None, 1).unwrap())
}

fn explored(world: &Arc<World>, members: Vec<Member>, seed: u64) -> TeamRun {
    println!("seed {seed}");
    let task = TeamTask { members, seed, cameras: false, mapper: MapperConfig::default(), most_s: 3600.0 };
    explore_as_team(world, &task, |_, _| {}).unwrap()
}

/// How many of the paths between random places of `world` touch something, and how many paths there
/// are.
fn blocked_paths(map: &MapState, world: &World, world_from_map: &Pose2) -> (usize, usize) {
    let radius_m = SimConfig::default().radius_m;
    let space = FreeSpace::of(map, &SpaceConfig::default());
    let fixed = |point: Point2| FixedPoint::from_metres(point.x, point.y);
    let place = |seed: u64| Point2::from(world.random_free_pose(seed, 0.2).translation.vector);
    let (mut blocked, mut planned) = (0, 0);
    for pair in 0..150 {
        let [from, to] = [place(2 * pair), place(2 * pair + 1)].map(|place| world_from_map.inverse() * place);
        let route = match shortest_path::plan(map, &space, fixed(from), fixed(to), &NodeRouteConfig::default()) {
            Ok(route) => route,
            Err(reason) => {
                println!("no path from {from} to {to} (map frame): {reason}");
                continue;
            }
        };
        let points: Vec<Point2> = route
            .waypoints
            .iter()
            .map(|waypoint| world_from_map * Point2::new(waypoint.point.x(), waypoint.point.y()))
            .collect();
        planned += 1;
        blocked += usize::from(points.windows(2).any(|way| !world.is_clear(way[0], way[1], radius_m)));
    }
    (blocked, planned)
}

/// A room of 8 m by 6 m in the file `room.yaml` of a folder: a partition from its south wall, a
/// desk in its middle, a cabinet and a shelf at walls.
fn furnished_room(folder: &Path) -> Arc<World> {
    const CELLS: (usize, usize) = (168, 128);
    let metres = |cell: usize| (cell as f64 + 0.5) * 0.05 - 0.2;
    let is_in = |(x, y): (f64, f64), [west, south, east, north]: [f64; 4]| {
        (west..east).contains(&x) && (south..north).contains(&y)
    };
    let things =
        [[5.0, 0.0, 5.1, 3.4], [2.2, 2.6, 3.8, 3.4], [0.0, 4.2, 0.6, 5.2], [6.2, 4.4, 6.9, 6.0], [7.2, 1.2, 8.0, 2.0]];
    let mut picture = format!("P5\n{} {}\n255\n", CELLS.0, CELLS.1).into_bytes();
    for row in (0..CELLS.1).rev() {
        for column in 0..CELLS.0 {
            let at = (metres(column), metres(row));
            let is_free = is_in(at, [0.0, 0.0, 8.0, 6.0]) && !things.iter().any(|thing| is_in(at, *thing));
            picture.push(if is_free { 254 } else { 0 });
        }
    }
    std::fs::write(folder.join("room.pgm"), picture).unwrap();
    let yaml = "image: room.pgm\nresolution: 0.05\norigin: [-0.2, -0.2, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
                free_thresh: 0.196\n";
    let path = folder.join("room.yaml");
    std::fs::write(&path, yaml).unwrap();
    Arc::new(load(path.to_str().unwrap(), None, 1).unwrap())
}

/// How many places of the world's plan, of those where a robot's body fits, lie in no rectangle of
/// the map, and how many there are.
fn uncovered(team: &TeamRun, world: &World) -> (usize, usize) {
    let plan = world.plan();
    let fits = plan.reachable(Point2::from(world.start().translation.vector), SimConfig::default().radius_m);
    let rectangles: Vec<_> = team
        .map
        .nodes()
        .filter_map(|node| Some((node.free_space?.min(node.pose.position), node.free_space?.max(node.pose.position))))
        .collect();
    let is_covered = |at: Point2| {
        let is_in = |((west, south), (east, north)): &((f64, f64), (f64, f64))| {
            (*west..=*east).contains(&at.x) && (*south..=*north).contains(&at.y)
        };
        rectangles.iter().any(is_in)
    };
    let cells = (0..plan.width() * plan.height()).map(|cell| (cell % plan.width(), cell / plan.width()));
    let fitting: Vec<_> = cells.filter(|(column, row)| fits.contains(*column, *row)).collect();
    let at = |(column, row): &(usize, usize)| team.world_from_map.inverse() * plan.centre_of(*column, *row);
    (fitting.iter().filter(|cell| !is_covered(at(cell))).count(), fitting.len())
}

#[test]
fn floor_that_was_seen_for_a_moment_is_looked_at_again_and_is_in_the_map() {
    let folder = tempfile::tempdir().unwrap();
    let world = furnished_room(folder.path());
    let (mut with, mut without) = (0, 0);
    for seed in 1..=8 {
        let run = |min_half_seen_m2: Option<f64>| {
            let mut mapper = MapperConfig::default();
            mapper.explore.min_half_seen_m2 = min_half_seen_m2.unwrap_or(mapper.explore.min_half_seen_m2);
            // Rectangles lie along the axes of the map's frame, and here along the walls.
            let at = start_near(&world, &world.start(), f64::INFINITY, seed).translation;
            let members = vec![Member::at(Pose2::new(at.vector, 0.0))];
            let task = TeamTask { members, seed, cameras: false, mapper, most_s: 3600.0 };
            let team = explore_as_team(&world, &task, |_, _| {}).unwrap();
            let member = &team.report.members[0];
            assert_eq!((member.ending, member.collisions), (Some(Ending::Complete), 0), "{:?}", team.report);
            (uncovered(&team, &world), member.driven_m)
        };
        let (((open, all), driven_m), ((open_before, _), driven_before_m)) = (run(None), run(Some(f64::INFINITY)));
        println!(
            "seed {seed}: of {all} cells {open} in no rectangle, {driven_m:.1} m driven; without a second look \
             {open_before}, {driven_before_m:.1} m"
        );
        assert!(open * 100 <= all, "{open} of {all}");
        with += open;
        without += open_before;
    }
    assert!(with <= without, "{with} instead of {without}");
}

#[test]
fn two_explorers_divide_a_building_and_make_one_map() {
    let world = museum();
    let second = start_near(&world, &world.start(), 3.0, 1);
    let alone = explored(&world, vec![Member::at(world.start())], 1).report;
    let team = explored(&world, vec![Member::at(world.start()), Member::at(second)], 1);
    let report = &team.report;
    assert!(report.members.iter().all(|member| member.ending == Some(Ending::Complete)), "{report:?}");
    assert_eq!(report.parts, 1, "{report:?}");
    assert!(report.explored_fraction > 0.99 && report.members[1].joined.is_some(), "{report:?}");
    assert!(report.members.iter().all(|member| member.node_error_max_m < 0.05 && member.main_nodes > 3), "{report:?}");
    // A building of seven rooms has less to divide than an office.
    assert!(report.time_s < 0.85 * alone.time_s, "{} s and {} s", report.time_s, alone.time_s);
    let (blocked, planned) = blocked_paths(&team.map, &world, &team.world_from_map);
    assert!(planned == 150 && blocked == 0, "{blocked} of {planned}");
}

#[test]
fn one_that_begins_far_away_joins_when_it_comes_to_what_is_known() {
    let world = museum();
    let far = start_near(&world, &world.start(), f64::INFINITY, 3);
    let team = explored(&world, vec![Member::at(world.start()), Member::at(far)], 2);
    let report = &team.report;
    assert!(report.parts == 1 && report.explored_fraction > 0.99, "{report:?}");
    assert!(report.members[1].joined.is_some_and(|[_, metres]| metres > 1.0), "{report:?}");
    assert!(report.members.iter().all(|member| member.node_error_max_m < 0.05), "{report:?}");
}

#[test]
fn an_explorer_that_dies_is_succeeded_by_another_that_finishes_the_map() {
    let world = museum();
    let first = Member { dies_s: Some(100.0), ..Member::at(world.start()) };
    let next = Member { begins_s: 130.0, ..Member::at(start_near(&world, &world.start(), 3.0, 2)) };
    let team = explored(&world, vec![first, next], 3);
    let report = &team.report;
    assert_eq!((report.members[0].ending, report.members[1].ending), (None, Some(Ending::Complete)), "{report:?}");
    assert!(report.parts == 1 && report.explored_fraction > 0.99, "{report:?}");
    assert!(report.members[0].main_nodes > 0 && report.members[1].main_nodes > 0, "{report:?}");
    let (blocked, planned) = blocked_paths(&team.map, &world, &team.world_from_map);
    assert!(planned == 150 && blocked == 0, "{blocked} of {planned}");
}

#[test]
fn what_has_changed_is_found_by_one_that_looks_again() {
    let world = museum();
    let before = explored(&world, vec![Member::at(world.start())], 4);
    // Nodes where something stands in a changed building.
    let hidden = |changed: &World| -> Vec<NodeId> {
        let stands = |node: &NodeRef<'_>| {
            let place = before.world_from_map * from_fixed(node.pose);
            changed.plan().clearance_m(Point2::from(place.translation.vector)) == 0.0
        };
        before.map.nodes().filter(stands).map(|node| node.id).collect()
    };
    assert_eq!(hidden(&world), []);
    // Nothing new stands where the robots begin, and something where nodes are.
    let here = Point2::from(world.start().translation.vector);
    let changed = (5..50).map(|seed| load_with("museum", None, 1, Some(&Changes { share: 0.6, seed })).unwrap());
    let is_told = |changed: &World| changed.is_clear(here, here, 0.4) && hidden(changed).len() >= 3;
    let changed = Arc::new(changed.into_iter().find(is_told).unwrap());
    assert!(changed.changes() > 5);
    let first = Member::at(world.start());
    let again = Member {
        begins_s: before.report.time_s + 10.0,
        world: Some(changed.clone()),
        looks_again: true,
        ..Member::at(start_near(&changed, &world.start(), 3.0, 4))
    };
    let after = explored(&world, vec![first, again], 4);
    assert_eq!(after.report.members[1].ending, Some(Ending::Complete), "{:?}", after.report);
    let (stale, _) = blocked_paths(&before.map, &changed, &before.world_from_map);
    let (blocked, planned) = blocked_paths(&after.map, &changed, &after.world_from_map);
    println!("paths that touch something: {stale} before, {blocked} of {planned} after");
    assert!(stale >= 5, "the changes stand in nobody's way: {stale}");
    assert!(planned > 140 && blocked * 10 <= stale, "{blocked} of {planned}, {stale} before");
    // Nodes where something now stands are gone, and the others keep their trust.
    let gone = before.map.nodes().filter(|node| after.map.node(node.id).is_none()).count();
    let doubted = after.map.nodes().filter(|node| node.trust < fht_map::FULL_TRUST).count();
    println!("{gone} nodes of {} retired, {doubted} doubted", before.map.nodes().count());
    let left = hidden(&changed).into_iter().filter(|id| after.map.node(*id).is_some());
    let edges: Vec<usize> = left.map(|id| after.map.neighbours(id).count()).collect();
    println!("edges of nodes that are left where something stands: {edges:?}");
    assert!(gone > 0 && gone * 4 < before.map.nodes().count());
}

#[test]
fn two_explorers_hand_over_to_a_client_as_processes() {
    let folder = tempfile::tempdir().unwrap();
    let config =
        HandoffConfig { crew: Crew::Team(2), ..museum_demo(executable(), free_endpoint().unwrap(), folder.path()) };
    let (report, _server) = hand_off(&config).unwrap();
    assert!(report.is_success() && report.explored_fraction > 0.98 && report.collisions == 0, "{report:?}");
    // One began the map, and the other joined it.
    let joined = report.explorers.iter().filter(|one| one.joined.is_some_and(|[seconds, _]| seconds > 0.0)).count();
    assert!(joined == 1 && report.explorers.iter().all(|one| one.joined.is_some()), "{:?}", report.explorers);
    assert!(report.relocalization_error_m.is_some_and(|metres| metres < 0.3), "{report:?}");
}

#[test]
fn a_robot_that_comes_back_under_its_own_name_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint().unwrap();
    let data = folder.path().join("data");
    let _server = Process::map_server(executable(), &data, &endpoint, Duration::from_secs(20)).unwrap();
    let explore = |robot: &str, max_sim_s: &str, report: &Path| {
        let report = report.to_str().unwrap();
        let flags = ["explore", "--world", "museum", "--map", "museum", "--connect", &endpoint, "--no-cameras"];
        let more = ["--progress-json", "--robot", robot, "--max-sim", max_sim_s, "--report", report];
        let ended = start(Role::Mapper, flags.into_iter().chain(more)).follow(|line| {
            let line: Value = serde_json::from_str(line).unwrap();
            let [written, acknowledged] = ["written", "acknowledged"].map(|count| line[count].as_u64().unwrap());
            assert!(acknowledged <= written, "{acknowledged} of {written} increments stored");
        });
        let report: ExploreReport = serde_json::from_str(&std::fs::read_to_string(report).unwrap()).unwrap();
        (ended.is_ok(), report)
    };
    let (is_done, first) = explore("explorer", "60", &folder.path().join("first.json"));
    assert!(!is_done && first.map.ending == Ending::OutOfTime && first.map.delivered, "{first:?}");
    let (is_done, second) = explore("explorer", "3600", &folder.path().join("second.json"));
    assert!(is_done && second.map.ending == Ending::Complete && second.map.delivered, "{second:?}");
    assert!(
        second.map.version > first.map.version && second.joined.is_some_and(|[seconds, _]| seconds > 0.0),
        "{second:?}"
    );
    assert!(second.map.main_nodes > first.map.main_nodes && second.explored_fraction > Some(0.98), "{second:?}");
    assert_eq!(
        (first.map.version, second.map.version),
        (first.map.written, second.map.written),
        "there is no other author"
    );

    // Another robot's version is that of the map, whoever wrote it.
    let (_, third) = explore("other", "3600", &folder.path().join("third.json"));
    assert!(third.joined.is_some() && third.map.delivered, "{third:?}");
    assert_eq!(third.map.version, second.map.written + third.map.written, "{third:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_only_says_that_it_explores_keeps_nobody_from_beginning_a_map() {
    let folder = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint().unwrap();
    let data = folder.path().join("data");
    let _server = Process::map_server(executable(), &data, &endpoint, Duration::from_secs(20)).unwrap();
    // Its name comes first.
    let idle = fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None)).await.unwrap();
    let _token = idle.liveliness().declare_token("fht/museum/robots/a-idle/goal").await.unwrap();
    let report = folder.path().join("report.json");
    let flags = ["explore", "--world", "museum", "--map", "museum", "--connect", &endpoint, "--no-cameras"];
    let more = ["--progress-json", "--robot", "explorer", "--max-sim", "20", "--report", report.to_str().unwrap()];
    let explorer = start(Role::Mapper, flags.into_iter().chain(more));
    let _ = explorer.follow(|_| {}); // its time is short
    let report: ExploreReport = serde_json::from_str(&std::fs::read_to_string(report).unwrap()).unwrap();
    assert!(report.map.main_nodes > 0 && report.map.delivered && report.explored_fraction > Some(0.0), "{report:?}");
}
