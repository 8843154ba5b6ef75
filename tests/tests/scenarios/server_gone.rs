//! The server is gone (SIGKILL), and robots continue with their own copies of the map: their paths
//! are those that the server gave them before, and a robot that was driving arrives.

use crate::programs::{executable, start};
use fht_client::{
    AskError, LiveReplica, PathQuestion, PathSource, PlannedPath, Planner, ReplicaConfig, ServerPaths,
    ServerPathsConfig, ask, ask_head, ask_path, planned_between,
};
use fht_demo::{Process, ProcessError, Role, free_endpoint};
use fht_map::{FreeSpace, MapState, NodeRouteConfig, Rules};
use fht_perception::pose::Point2;
use fht_proto::api::fleet::{LocalizationState, RobotPose};
use fht_proto::api::keys::{Key, RobotTopic};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{EdgeKey, FixedPoint, Footprint, MapName};
use fht_session::SessionConfig;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::runtime::Runtime;
use zenoh::{Session, Wait};

/// How long a process or the network may take.
const PATIENCE: Duration = Duration::from_secs(40);

fn museum() -> MapName {
    "museum".parse().unwrap()
}

/// Runs an operator's command; returns its output.
fn operate(endpoint: &str, args: &[&str]) -> String {
    start(Role::MapServer, [args, &["--connect", endpoint]].concat()).finish(PATIENCE).unwrap()
}

fn map_server(data: &Path, endpoint: &str) -> Process {
    Process::map_server(executable(), data, endpoint, PATIENCE).unwrap()
}

/// The museum's first rooms in a file, explored once for all tests.
fn explored() -> PathBuf {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    let dir = MADE.get_or_init(|| {
        let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
        let _server = map_server(&dir.path().join("data"), &endpoint);
        let args =
            ["explore", "--world", "museum", "--no-cameras", "--max-sim", "60", "--quiet", "--connect", &endpoint];
        // It reports, by its exit code, too, that the map is not complete; what there is has been
        // stored.
        let ended = start(Role::Mapper, args).finish(PATIENCE).unwrap_err();
        let is_out_of_time =
            matches!(&ended, ProcessError::Failed { stderr, .. } if stderr.contains("not complete: out of time"));
        assert!(is_out_of_time, "{ended}");
        operate(&endpoint, &["export", "museum", dir.path().join("museum.fht").to_str().unwrap()]);
        dir
    });
    dir.path().join("museum.fht")
}

/// A server that has the map, and a session with it.
struct Site {
    server: Process,
    endpoint: String,
    session: Session,
    // In this order: the session ends before its runtime does.
    _runtime: Runtime,
    folder: TempDir,
}

impl Site {
    fn start() -> Self {
        let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
        let map = explored();
        let server = map_server(&folder.path().join("data"), &endpoint);
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let link = SessionConfig::from_options(vec![endpoint.clone()], None);
        let session = runtime.block_on(fht_session::open(&link)).unwrap();
        // It listens before it answers, and operators' commands ask once.
        let begin = Instant::now();
        while let Err(error) = ask(&session, &Key::Maps.to_string(), PATIENCE) {
            assert!(begin.elapsed() < PATIENCE, "the server does not answer: {error}");
            std::thread::sleep(Duration::from_millis(10));
        }
        operate(&endpoint, &["import", map.to_str().unwrap()]);
        Self { server, endpoint, session, _runtime: runtime, folder }
    }

    /// Waits until a copy has everything that the server has.
    fn has_all(&self, replica: &LiveReplica) {
        let head = ask_head(&self.session, &museum(), PATIENCE).unwrap();
        assert!(
            replica.wait_for(&head.vector, PATIENCE),
            "the copy has {} of {}",
            replica.read().vector(),
            head.vector
        );
    }
}

type Answer = Result<PlannedPath, ErrorReply>;
type Question = (Point2, Point2);

/// The server's answer.
fn server_says(session: &Session, (from, to): Question) -> Answer {
    let text = |point: Point2| format!("{:.3},{:.3}", point.x, point.y);
    let (from_text, to_text) = (text(from), text(to));
    let question = PathQuestion {
        from: &from_text,
        to: &to_text,
        footprint: &Footprint::default(),
        release: None,
        to_nearest: false,
    };
    match ask_path(session, &museum(), &question, PATIENCE) {
        Ok(reply) => Ok(planned_between(reply, from, to).unwrap()),
        Err(AskError::Refused(refusal)) => Err(refusal),
        Err(error) => panic!("{from} to {to}: {error}"),
    }
}

/// The path that a robot's loop ends up with: its own at once, then the server's if that is better.
fn robot_has(paths: &mut ServerPaths<'_>, (from, to): Question) -> Answer {
    let begin = Instant::now();
    let mut answer = paths.plan(from, to, &BTreeSet::new());
    while paths.is_pending() {
        assert!(begin.elapsed() < PATIENCE, "{from} to {to}: no end");
        answer = paths.revised().unwrap_or(answer);
    }
    answer
}

/// Whether two answers are the same to the last point, or the same refusal. The server's lengths
/// are in whole millimetres.
fn is_same(one: &Answer, other: &Answer) -> bool {
    match (one, other) {
        (Ok(one), Ok(other)) => one.points == other.points && (one.length_m - other.length_m).abs() < 0.000_501,
        (Err(one), Err(other)) => one == other,
        _ => false,
    }
}

/// Pairs of nodes all over the map, an unknown goal and an unknown start, and a start just outside
/// the known space.
fn questions(map: &MapState) -> Vec<Question> {
    let point = |point: FixedPoint| Point2::new(point.x(), point.y());
    let places: Vec<Point2> = map.nodes().map(|node| point(node.pose.position)).collect();
    let last = places.len() - 1;
    let mut questions: Vec<Question> =
        (0..=last / 2).step_by(7).map(|number| (places[number], places[last - number])).collect();
    let nowhere = Point2::new(500.0, 500.0);
    questions.extend([(places[0], nowhere), (nowhere, places[0])]);
    let leftmost = places.iter().copied().min_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
    questions.push((Point2::new(leftmost.x - 4.0, leftmost.y), places[0]));
    questions
}

/// An edge that a path uses, and that the path must avoid when it is closed.
fn edge_in_the_way(map: &MapState, (from, to): Question) -> EdgeKey {
    let fixed = |point: Point2| FixedPoint::from_metres(point.x, point.y);
    let way = |closed: BTreeSet<EdgeKey>| {
        let rules = Rules { closed, ..Rules::default() };
        let space = FreeSpace::of(map, &rules.space_config());
        rules.plan(map, &space, fixed(from), fixed(to), &NodeRouteConfig::default()).map(|route| route.length_m).ok()
    };
    let open = way(BTreeSet::new());
    assert!(open.is_some());
    map.edges().find(|edge| way(BTreeSet::from([*edge])) != open).expect("an edge that matters")
}

#[test]
fn without_the_server_a_robot_finds_the_paths_that_it_was_given() {
    let mut site = Site::start();
    let replica = LiveReplica::start(&site.session, &museum(), "r", ReplicaConfig::default()).unwrap();
    site.has_all(&replica);
    let map = replica.read().state().clone();
    let mut questions = questions(&map);
    let free: Vec<Answer> = questions.iter().map(|&question| server_says(&site.session, question)).collect();

    // A zone in the way of the second question, and an edge in the way of the first.
    let points = &free[1].as_ref().unwrap().points;
    let straights = points.windows(2).map(|way| (way[0].position, way[1].position));
    let length = |(from, to): &(Point2, Point2)| (to - from).norm();
    let (from, to) = straights.max_by(|a, b| length(a).total_cmp(&length(b))).unwrap();
    let middle = nalgebra::center(&from, &to);
    let corner = |x: f64, y: f64| format!("{:.2},{:.2}", middle.x + x, middle.y + y);
    let zone = [corner(-0.3, -0.3), corner(0.3, -0.3), corner(0.3, 0.3), corner(-0.3, 0.3)].join(" ");
    operate(&site.endpoint, &["zone", "museum", "wet", &zone]);
    let [a, b] = edge_in_the_way(&map, questions[0]).to_texts();
    operate(&site.endpoint, &["close", "museum", &a, &b]);
    site.has_all(&replica);
    questions.push((questions[0].0, middle));

    let served: Vec<Answer> = questions.iter().map(|&question| server_says(&site.session, question)).collect();
    let changed = |number: usize| !is_same(&free[number], &served[number]);
    assert!(changed(0) && changed(1), "what the operator closed is in nobody's way");
    let paths = served.iter().filter(|answer| answer.is_ok()).count();
    assert!(paths >= 5, "{paths} paths of {}", questions.len());
    assert_eq!(served.last().unwrap().as_ref().unwrap_err().code, ErrorCode::KeepOut);

    // A robot outside the mapped space drives to the nearest node first; the server leaves that to
    // the robot.
    let outside = questions.len() - 2;
    assert_eq!(served[outside].as_ref().unwrap_err().code, ErrorCode::OutOfMap);
    let ask_all = |timeout: Duration| {
        let config = ServerPathsConfig { timeout_s: timeout.as_secs_f64(), ..ServerPathsConfig::default() };
        let mut paths = ServerPaths::new(&site.session, museum(), "r", &replica, &config).unwrap();
        let answers: Vec<Answer> = questions.iter().map(|&question| robot_has(&mut paths, question)).collect();
        (answers, paths.fallbacks())
    };
    let (with_server, fallbacks) = ask_all(PATIENCE);
    assert_eq!(fallbacks, 0);
    site.server.kill().unwrap();
    let (without, fallbacks) = ask_all(Duration::from_millis(300));
    assert_eq!(fallbacks, questions.len(), "the server said nothing to any of them");

    for (number, question) in questions.iter().enumerate() {
        let (with_server, without) = (&with_server[number], &without[number]);
        println!("{question:?}: {:?}", without.as_ref().map(|path| (path.length_m, path.points.len())));
        assert!(is_same(with_server, without), "{question:?}: {with_server:?}, and without the server {without:?}");
        assert!(number == outside || is_same(&served[number], without), "{question:?}: {:?}", served[number]);
        assert!(with_server.as_ref().is_ok_and(|path| path.planner == Planner::Server) || with_server.is_err());
        assert!(without.as_ref().is_ok_and(|path| path.planner == Planner::Replica) || without.is_err());
    }
    assert!(without[outside].as_ref().is_ok_and(|path| path.points[1].node.is_some()), "{:?}", without[outside]);
}

/// A robot drives to the far end of the map; the server is killed as soon as the robot's status
/// satisfies `is_time`. Returns its report, if it arrives.
fn driven(mut is_time: impl FnMut(&RobotPose) -> bool) -> Value {
    let mut site = Site::start();
    let pose_key = Key::robot(&museum(), "tug", RobotTopic::Pose).to_string();
    let poses = site.session.declare_subscriber(pose_key).wait().unwrap();
    let start_pose = fht_sim::load("museum", None, 1).unwrap().start();
    let (x, y) = (start_pose.translation.x, start_pose.translation.y);
    // Where the map begins, but turned.
    let begin = format!("{x},{y},{}rad", start_pose.rotation.angle() + 2.0);
    let report = site.folder.path().join("report.json");
    let [to, at, report_arg] = ["--to", "--start", report.to_str().unwrap()];
    let args =
        ["go", to, "random", at, &begin, "--no-cameras", "--robot", "tug", "--quiet", "--connect", &site.endpoint];
    let mut robot = start(Role::ClientRobot, [&args[..], &["--report", report_arg]].concat());
    loop {
        let sample = poses.recv_timeout(PATIENCE).unwrap().expect("the robot says nothing of itself");
        if is_time(&serde_json::from_slice(&sample.payload().to_bytes()).unwrap()) {
            break;
        }
    }
    site.server.kill().unwrap();
    assert!(robot.is_running().unwrap(), "the robot was there before the server was killed");
    robot.finish(PATIENCE).unwrap();
    let report: Value = serde_json::from_str(&std::fs::read_to_string(&report).unwrap()).unwrap();
    assert_eq!((&report["arrived"], &report["collisions"]), (&true.into(), &0.into()), "{report}");
    assert!(report["goal_distance_m"].as_f64().unwrap() < 0.5, "{report}");
    assert!(report["path_length_m"].as_f64().unwrap() > 3.0, "too near to tell: {report}");
    report
}

#[test]
fn a_robot_that_loses_the_server_while_it_looks_for_its_place_plans_for_itself_and_arrives() {
    let report = driven(|pose| {
        assert_ne!(pose.state, LocalizationState::Localized, "it knows its place at once");
        true
    });
    assert_eq!(report["planner"], "replica", "{report}");
    let count = |name: &str| report[name].as_u64().unwrap();
    assert!(count("plans") >= 1 && count("fallbacks") == count("plans"), "each is counted: {report}");
}

#[test]
fn a_robot_that_loses_the_server_on_the_way_arrives() {
    let mut first = None;
    let report = driven(|pose| {
        let Some([x, y, _]) = pose.map_from_base else { return false };
        let here = Point2::new(x, y);
        (here - *first.get_or_insert(here)).norm() > 1.0
    });
    // The path that it was on was the server's.
    assert_eq!(report["planner"], "server", "{report}");
    let count = |name: &str| report[name].as_u64().unwrap();
    assert!(count("fallbacks") < count("plans"), "the first one was answered: {report}");
}
