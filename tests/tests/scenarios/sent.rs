//! Robots that are sent: by a person with nothing but zenoh-cli, by operators' commands and by any
//! Zenoh client, goal after goal, over a server that is started anew; what is replaced, cancelled,
//! wrong or too much; a second robot of the same name; another map of the same name; a zone that is
//! drawn on the way; and the robot's end.

use crate::programs::{executable, start};
use fht_demo::{Process, ProcessError, Role, free_endpoint};
use fht_proto::MapName;
use fht_proto::api::fleet::RobotPose;
use fht_proto::api::goal::{GoalState, GoalStatus};
use fht_proto::api::keys::{GoalTopic, Key, RobotTopic, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, NodesReply, PathReply, RulesReply};
use fht_session::SessionConfig;
use fht_tests::corridors::{corridors, put};
use fht_tests::packages::{run, zenoh_cli};
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tokio::sync::watch;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

/// How long anything may take, beside other work.
const PATIENCE: Duration = Duration::from_secs(120);
/// A robot that was there has this much to drive to the far end, metres.
const FAR_M: f64 = 4.0;

fn museum() -> MapName {
    "museum".parse().unwrap()
}

/// Runs a program to its end: its output, or what it said on standard error.
fn outcome(role: Role, args: &[&str]) -> Result<String, String> {
    start(role, args).finish(PATIENCE).map_err(|error| match error {
        ProcessError::Failed { stderr, .. } => stderr,
        other => panic!("{other}"),
    })
}

/// The museum's first rooms in a file, explored once for all tests.
fn explored() -> PathBuf {
    static MADE: OnceLock<TempDir> = OnceLock::new();
    let dir = MADE.get_or_init(|| {
        let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
        let _server = Process::map_server(executable(), &dir.path().join("data"), &endpoint, PATIENCE).unwrap();
        let args =
            ["explore", "--world", "museum", "--no-cameras", "--max-sim", "60", "--quiet", "--connect", &endpoint];
        let said = outcome(Role::Mapper, &args).unwrap_err();
        assert!(said.contains("not complete: out of time"), "{said}");
        let file = dir.path().join("museum.fht");
        outcome(Role::MapServer, &["export", "museum", file.to_str().unwrap(), "--connect", &endpoint]).unwrap();
        dir
    });
    dir.path().join("museum.fht")
}

/// A server that has the map with the places home and far, a robot that serves, and a session.
struct Site {
    server: Option<Process>,
    robot: Process,
    endpoint: String,
    poses: watch::Receiver<Option<[f64; 3]>>,
    _poses: Subscriber<()>,
    session: Session,
    // In this order: the session ends before its runtime does.
    _runtime: Runtime,
    folder: TempDir,
}

/// Where the map begins, but turned: world frame.
fn begin() -> String {
    let start = fht_sim::load("museum", None, 1).unwrap().start();
    format!("{},{},{}rad", start.translation.x, start.translation.y, start.rotation.angle() + 2.0)
}

fn serve(endpoint: &str, rate: &str) -> Vec<String> {
    let at = begin();
    let args = ["serve", "--map", "museum", "--robot", "tug", "--no-cameras", "--start", &at, "--rate", rate];
    args.iter().chain(&["--connect", endpoint]).map(|&word| word.to_owned()).collect()
}

impl Site {
    fn start(rate: &str) -> Self {
        let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
        let map = explored();
        let server = Process::map_server(executable(), &folder.path().join("data"), &endpoint, PATIENCE).unwrap();
        let operate = |args: &[&str]| outcome(Role::MapServer, &[args, &["--connect", &endpoint]].concat()).unwrap();
        operate(&["import", map.to_str().unwrap(), "--wait", "60"]);
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let link = SessionConfig::from_options(vec![endpoint.clone()], None);
        let session = runtime.block_on(fht_session::open(&link)).unwrap();
        operate(&["place", "museum", "home", "0,0"]);
        operate(&["place", "museum", "far", &far_node(&session)]);
        let (told, poses) = watch::channel(None);
        let hear = move |sample: Sample| {
            let pose: RobotPose = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
            told.send_replace(pose.map_from_base);
        };
        let key = Key::robot(&museum(), "tug", RobotTopic::Pose).to_string();
        let hearing = session.declare_subscriber(key).callback(hear).wait().unwrap();
        let robot = start(Role::ClientRobot, serve(&endpoint, rate));
        Self { server: Some(server), robot, endpoint, poses, _poses: hearing, session, _runtime: runtime, folder }
    }

    fn operate(&self, args: &[&str]) -> Result<String, String> {
        outcome(Role::MapServer, &[args, &["--connect", &self.endpoint]].concat())
    }

    /// Asks the robot, as any client does.
    fn ask(&self, topic: Option<GoalTopic>, parameters: &str) -> Result<GoalStatus, ErrorReply> {
        let key = topic
            .map_or_else(|| Key::robot(&museum(), "tug", RobotTopic::Goal), |topic| Key::goal(&museum(), "tug", topic));
        let replies = self.session.get(format!("{key}?{parameters}")).timeout(PATIENCE).wait().unwrap();
        let mut refusal = ErrorReply::new(ErrorCode::Internal, &format!("nobody answers {key}?{parameters}"));
        for reply in replies {
            match reply.result() {
                Ok(sample) => return Ok(serde_json::from_slice(&sample.payload().to_bytes()).unwrap()),
                Err(error) => refusal = serde_json::from_slice(&error.payload().to_bytes()).unwrap_or(refusal),
            }
        }
        Err(refusal)
    }

    /// Asks until the robot's word satisfies `wanted`; no answer and no robot yet are asked again.
    fn until(
        &self,
        what: &str,
        topic: Option<GoalTopic>,
        parameters: &str,
        wanted: impl Fn(&GoalStatus) -> bool,
    ) -> GoalStatus {
        let begin = Instant::now();
        loop {
            let said = self.ask(topic, parameters);
            if let Some(status) = said.as_ref().ok().filter(|status| wanted(status)) {
                return status.clone();
            }
            assert!(begin.elapsed() < PATIENCE, "{what}: {said:?}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Sends the robot as soon as it knows where it is.
    fn send_first(&self, parameters: &str) -> GoalStatus {
        self.until("it knows its place and drives", None, parameters, |_| true)
    }

    fn arrives(&self, id: &str) -> GoalStatus {
        let status =
            self.until("it arrives", Some(GoalTopic::Status), &format!("id={id}"), |status| status.state.is_final());
        assert_eq!(status.state, GoalState::Arrived, "{status:?}");
        status
    }

    /// The next pose that the robot tells.
    fn pose(&mut self) -> [f64; 3] {
        self.poses.mark_unchanged();
        let begin = Instant::now();
        loop {
            if let Some(at) = self.poses.has_changed().unwrap().then(|| *self.poses.borrow_and_update()).flatten() {
                return at;
            }
            assert!(begin.elapsed() < PATIENCE, "it tells its pose");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn apart([ax, ay, _]: [f64; 3], [bx, by, _]: [f64; 3]) -> f64 {
    (ax - bx).hypot(ay - by)
}

/// A node with a path from the map's beginning that is long enough to be stopped on: x,y.
fn far_node(session: &Session) -> String {
    let get = |selector: &str| {
        let reply = session.get(selector).timeout(PATIENCE).wait().unwrap().recv().unwrap();
        reply.result().ok().map(|sample| sample.payload().to_bytes().into_owned())
    };
    let nodes: NodesReply =
        serde_json::from_slice(&get("fht/museum/nodes?near=0,0;radius=30;limit=200").unwrap()).unwrap();
    let lengths = nodes.nodes.iter().filter_map(|node| {
        let to = format!("{},{}", node.x, node.y);
        let path: PathReply = serde_json::from_slice(&get(&format!("fht/museum/path?from=0,0;to={to}"))?).unwrap();
        Some((path.length_m, to))
    });
    let far = lengths.filter(|(metres, _)| *metres > FAR_M).min_by(|a, b| a.0.total_cmp(&b.0));
    far.expect("the rooms are large enough").1
}

#[test]
fn a_robot_is_sent_twice_by_other_peoples_programs_over_a_server_that_is_started_anew() {
    let zenoh = zenoh_cli(env!("CARGO_TARGET_TMPDIR"));
    let mut site = Site::start("20");
    let cli = |args: &[&str]| {
        let output = run(Command::new(&zenoh).args(["--connect", &site.endpoint]).args(args));
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    site.until("it knows its place", Some(GoalTopic::Status), "", |status| status.state == GoalState::Idle);
    let begin = Instant::now();
    // As a person does: again, while it looks for its place. The same goal is one goal.
    let sent: GoalStatus = loop {
        let (said, refused) = cli(&["get", "-s", "fht/museum/robots/tug/goal?id=1;to=far", "--decoder", "json"]);
        if let Ok(status) = serde_json::from_str(&said) {
            break status;
        }
        assert!(refused.contains("NOT_LOCALIZED") && begin.elapsed() < PATIENCE, "{said} {refused}");
    };
    assert_eq!((sent.state, sent.id.as_deref()), (GoalState::Driving, Some("1")));
    assert!(sent.to_go_m.is_some_and(|metres| metres > 1.0) && sent.stamp_us.is_some(), "{sent:?}");
    let (_, refused) = cli(&["get", "-s", "fht/museum/robots/tug/goal?id=x;to=upstairs", "--decoder", "json"]);
    assert!(
        refused.contains("UNKNOWN_PLACE") && refused.contains("no place called upstairs (there is: far, home)"),
        "{refused}"
    );
    let far = site.arrives("1").goal.unwrap();
    assert!(apart(site.pose(), [far[0], far[1], 0.0]) < 0.5);

    site.server.take().unwrap().kill().unwrap();
    let data = site.folder.path().join("data");
    site.server = Some(Process::map_server(executable(), &data, &site.endpoint, PATIENCE).unwrap());
    site.until("it is back", Some(GoalTopic::Status), "id=1", |status| status.state == GoalState::Arrived);
    let goal = r#"{"id": "2", "x": 0, "y": 0, "yaw": 1.5708}"#;
    let cli = |args: &[&str]| run(Command::new(&zenoh).args(["--connect", &site.endpoint]).args(args));
    cli(&["put", "-k", "fht/museum/robots/tug/goal", "-v", goal]);
    assert_eq!(site.arrives("2").goal, Some([0.0, 0.0]));
    let at = site.pose();
    assert!(apart(at, [0.0; 3]) < 0.5 && (at[2] - std::f64::consts::FRAC_PI_2).abs() < 0.1, "{at:?}");

    // Operators' commands: the words and the code are of one judgement.
    let said = site.operate(&["send", "museum", "tug", "far", "--id", "3", "--wait-arrived"]).unwrap();
    assert!(said.starts_with("tug: goal 3 ARRIVED"), "{said}");
    let said = site.operate(&["send", "museum", "tug", "500,500", "--wait-arrived"]).unwrap_err();
    assert!(said.contains("is not on the map"), "{said}");
    let near = ["send", "museum", "tug", "60,0", "--to-nearest", "--id", "4", "--json"];
    let status: GoalStatus = serde_json::from_str(&site.operate(&near).unwrap()).unwrap();
    assert_eq!(status.state, GoalState::Driving);
    site.operate(&["send", "museum", "tug", "home", "--id", "5"]).unwrap();
    let said = site.operate(&["cancel", "museum", "tug", "4"]).unwrap();
    assert!(said.starts_with("tug: goal 4 CANCELLED") && said.contains("; goal 5 is next"), "{said}");
    site.operate(&["cancel", "museum", "tug", "5"]).unwrap();
    let said = site.operate(&["cancel", "museum", "tug", "nothing"]).unwrap_err();
    assert!(said.contains("knows of no goal nothing"), "{said}");
    let said = site.operate(&["send", "museum", "tow", "far"]).unwrap_err();
    assert!(said.contains("does client-robot serve run"), "{said}");
}

#[test]
fn a_goal_waits_is_replaced_and_cancelled_and_a_flood_does_no_harm() {
    let mut site = Site::start("5");
    site.send_first("id=a;to=far");
    // One is next, and the newest of those.
    assert_eq!(site.ask(None, "id=b;to=home").unwrap().state, GoalState::Waiting);
    assert_eq!(site.ask(None, "id=c;to=home").unwrap().state, GoalState::Waiting);
    let replaced = site.ask(Some(GoalTopic::Status), "id=b").unwrap();
    assert_eq!((replaced.state, replaced.waiting.as_deref()), (GoalState::Cancelled, Some("c")));
    assert!(replaced.reason.unwrap().contains("goal c was sent in its place"));
    assert_eq!(site.ask(None, "id=c;to=home").unwrap().state, GoalState::Waiting, "the same goal again");
    let other = site.ask(None, "id=c;to=far").unwrap_err();
    assert_eq!(other.code, ErrorCode::BadRequest, "{other}");
    // A goal that is not on the map takes nobody's place.
    let outside = site.ask(None, "id=o;x=500;y=500").unwrap_err();
    assert_eq!(outside.code, ErrorCode::OutOfMap, "{outside}");
    assert_eq!(site.ask(Some(GoalTopic::Status), "id=c").unwrap().state, GoalState::Waiting);

    // On the way it is told to stand, at once.
    let begun = site.pose();
    while apart(site.pose(), begun) < 0.5 {}
    assert_eq!(site.ask(Some(GoalTopic::Cancel), "").unwrap().id.as_deref(), Some("a"));
    let stands = site.pose();
    for _ in 0..5 {
        assert!(apart(site.pose(), stands) < 0.5, "it stands where it was told to");
    }
    let last = [site.pose(), site.pose()];
    assert!(apart(last[0], last[1]) < 0.05, "{last:?}");
    for id in ["a", "c"] {
        assert_eq!(site.ask(Some(GoalTopic::Status), &format!("id={id}")).unwrap().state, GoalState::Cancelled);
    }
    let nothing = site.ask(Some(GoalTopic::Cancel), "").unwrap_err();
    assert_eq!(nothing.code, ErrorCode::UnknownGoal);

    // What nobody should say, ten thousand times, and goals as fast as they can be put.
    let key = Key::robot(&museum(), "tug", RobotTopic::Goal).to_string();
    let wild = [
        vec![0xff, 0xfe, 0x00],
        vec![b'['; 3 << 20],
        br#"{"id": "w", "x": 1e999, "y": 0}"#.to_vec(),
        br#"{"id": "w", "x": 1e300, "y": 0}"#.to_vec(),
    ];
    for bad in wild {
        site.session.put(&key, bad).wait().unwrap();
    }
    for number in 0..10_000 {
        let junk = if number % 2 == 0 { "{".to_owned() } else { format!(r#"{{"id": "f{number}", "to": "nowhere"}}"#) };
        site.session.put(&key, junk).wait().unwrap();
    }
    for bad in ["id=d", "id=d;to=far;too=1", "id=d;x=1;y=nan", "id=d/e;to=far", "id=d;x=1;y=2;yaw=90"] {
        assert_eq!(site.ask(None, bad).unwrap_err().code, ErrorCode::BadRequest, "{bad}");
    }
    assert_eq!(site.until("it hears", None, "id=e;to=home", |_| true).state, GoalState::Driving);
    site.arrives("e");
}

#[test]
fn a_second_robot_of_the_name_is_refused_and_the_first_says_its_last_word() {
    let mut site = Site::start("20");
    site.send_first("id=a;to=far");
    let args = serve(&site.endpoint, "20");
    let said = outcome(Role::ClientRobot, &args.iter().map(String::as_str).collect::<Vec<_>>()).unwrap_err();
    assert!(said.contains("a robot called tug is there already"), "{said}");

    let heard =
        site.session.declare_subscriber(Key::goal(&museum(), "tug", GoalTopic::Status).to_string()).wait().unwrap();
    let id = site.ask(None, "id=b;to=home").unwrap().id;
    let waiting = start(
        Role::MapServer,
        ["send", "museum", "tug", "far", "--id", "c", "--wait-arrived", "--connect", &site.endpoint],
    );
    site.until("the goal is there", Some(GoalTopic::Status), "id=c", |status| !status.state.is_final());
    let asked = Instant::now();
    let process = site.robot.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &process]).status().unwrap().success());
    let robot = std::mem::replace(&mut site.robot, start(Role::MapServer, ["maps", "--connect", &site.endpoint]));
    let printed = robot.finish(PATIENCE).unwrap();
    println!("ended after {:.0} ms", asked.elapsed().as_secs_f64() * 1e3);
    assert!(printed.starts_with("tug is at (") && printed.contains(") on map museum and takes goals\n"), "{printed}");
    assert!(printed.contains("CANCELLED: the robot takes no more goals"), "{printed}");
    // Who waits for an arrival hears the last word, too.
    match waiting.finish(PATIENCE) {
        Err(ProcessError::Failed { stderr, .. }) => {
            assert!(stderr.contains("goal c is CANCELLED: the robot takes no more goals"), "{stderr}");
        }
        other => panic!("{other:?}"),
    }
    let mut last = Vec::new();
    while let Ok(Some(sample)) = heard.recv_timeout(Duration::from_secs(2)) {
        let status: GoalStatus = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
        last.extend(status.state.is_final().then_some(status.id));
    }
    assert!(last.contains(&id), "{last:?}");
    let gone = site.ask(Some(GoalTopic::Status), "").unwrap_err();
    assert!(gone.code == ErrorCode::UnknownRobot && gone.message.contains("does client-robot serve run"), "{gone}");
}

#[test]
fn a_goal_that_was_put_and_refused_is_told_to_who_asks_and_a_robot_started_anew_has_not_arrived() {
    let mut site = Site::start("2");
    site.send_first("id=home;to=home");
    site.arrives("home");
    let key = Key::robot(&museum(), "tug", RobotTopic::Goal).to_string();
    site.session.put(&key, r#"{"id": "p", "to": "upstairs"}"#).wait().unwrap();
    let refused = site.until("it is refused", Some(GoalTopic::Status), "id=p", |_| true);
    assert_eq!((refused.state, refused.code), (GoalState::Failed, Some(ErrorCode::UnknownPlace)), "{refused:?}");
    assert!(refused.reason.unwrap().contains("no place called upstairs"));

    let waiting = start(
        Role::MapServer,
        ["send", "museum", "tug", "far", "--id", "c", "--wait-arrived", "--connect", &site.endpoint],
    );
    site.until("it drives", Some(GoalTopic::Status), "id=c", |status| status.state == GoalState::Driving);
    // Its word that it drives is on its way to the sender.
    std::thread::sleep(Duration::from_secs(2));
    site.robot.kill().unwrap();
    site.robot = start(Role::ClientRobot, serve(&site.endpoint, "20"));
    match waiting.finish(PATIENCE) {
        Err(ProcessError::Failed { stderr, status, .. }) => {
            assert!(stderr.contains("tug did not arrive: goal c is ") && stderr.contains("started anew"), "{stderr}");
            assert_eq!(status.code(), Some(1), "what was given is not wrong: {stderr}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_robot_whose_map_was_replaced_by_another_one_of_the_name_forgets_its_place_and_its_goals() {
    let mut site = Site::start("2");
    site.send_first("id=a;to=far");
    site.ask(None, "id=b;to=home").unwrap();
    site.pose();
    site.operate(&["delete", "museum", "--reason", "begun anew", "--grace", "0s"]).unwrap();
    put(&site.session, &museum(), &corridors());
    for id in ["a", "b"] {
        let id = format!("id={id}");
        let ended = site.until("it fails", Some(GoalTopic::Status), &id, |status| status.state.is_final());
        assert_eq!((ended.state, ended.code), (GoalState::Failed, Some(ErrorCode::Conflict)), "{ended:?}");
    }
    // It does not say any more that it knows where it is, and takes no goal.
    let begin = Instant::now();
    while site.poses.borrow_and_update().is_some() {
        assert!(begin.elapsed() < PATIENCE, "it says where it was");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(site.ask(None, "id=c;x=1;y=0").unwrap_err().code, ErrorCode::NotLocalized);
}

#[test]
fn a_zone_that_is_drawn_while_a_robot_drives_holds_at_once() {
    let mut site = Site::start("5");
    site.send_first("id=home;to=home");
    site.arrives("home");
    let places: RulesReply = {
        let key = Key::topic(&museum(), Topic::Rules).to_string();
        let reply = site.session.get(key).timeout(PATIENCE).wait().unwrap().recv().unwrap();
        serde_json::from_slice(&reply.result().unwrap().payload().to_bytes()).unwrap()
    };
    let [x, y, _] = places.places.iter().find(|place| place.name == "far").unwrap().pose;
    let (west, south, east, north) = (x - 0.4, y - 0.4, x + 0.4, y + 0.4);
    let corners = format!("{west},{south} {east},{south} {east},{north} {west},{north}");
    // The operator tells robots and server in the same moment, and either may be first.
    for round in 0..3 {
        let (there, back) = (format!("there{round}"), format!("back{round}"));
        site.ask(None, &format!("id={there};to=far")).unwrap();
        let begun = site.pose();
        while apart(site.pose(), begun) < 0.5 {}
        site.operate(&["zone", "museum", "shut", &corners]).unwrap();
        let ended =
            site.until("it stops", Some(GoalTopic::Status), &format!("id={there}"), |status| status.state.is_final());
        assert_eq!((ended.state, ended.code), (GoalState::Failed, Some(ErrorCode::KeepOut)), "{round}: {ended:?}");
        site.operate(&["zone", "museum", "shut", "--remove"]).unwrap();
        site.ask(None, &format!("id={back};to=home")).unwrap();
        site.arrives(&back);
    }
}

#[test]
fn a_map_that_is_imported_after_the_old_one_was_deleted_is_another_one() {
    let site = Site::start("2");
    site.send_first("id=home;to=home");
    site.arrives("home");
    let other = site.folder.path().join("other.fht");
    put(&site.session, &"other".parse().unwrap(), &corridors());
    let file = other.to_str().unwrap();
    site.operate(&["export", "other", file, "--wait", "60"]).unwrap();
    site.operate(&["delete", "museum", "--reason", "another one comes", "--grace", "0s"]).unwrap();
    // The robot has asked for the head meanwhile.
    std::thread::sleep(Duration::from_secs(5));
    site.ask(None, "id=a;to=far").unwrap();
    site.operate(&["import", file, "--map", "museum"]).unwrap();
    let ended = site.until("it fails", Some(GoalTopic::Status), "id=a", |status| status.state.is_final());
    assert_eq!((ended.state, ended.code), (GoalState::Failed, Some(ErrorCode::Conflict)), "{ended:?}");
}
