//! Clients in another language, with nothing of ours: the example in `examples/python` follows a
//! map, gets a path, reports a blocked edge and sees robots; a codec written from
//! `docs/protocol.md` reads, writes and hashes as the server does; and everything that a running
//! server says in JSON is as the schemas in `docs/schema` have it.

use crate::programs::executable;
use fht_demo::{Process, free_endpoint};
use fht_proto::api::fleet::{BlockedReport, ExplorerGoal, LocalizationState, RobotPose, RobotRole, RobotStatus};
use fht_proto::api::goal::{GoalState, GoalStatus};
use fht_proto::api::keys::{GoalTopic, Key, RobotTopic};
use fht_proto::api::reply::ErrorCode;
use fht_proto::{
    AuthorId, Datum, Descriptor, DescriptorModel, Digest, EdgeKey, FixedPoint, FixedPose, Increment, Label, MapName,
    ModelId, NodeId, NodeKind, Op, PlanImage, Release, ReleaseId, ScanRecord, Signature, VersionVector, Zone, ZoneRule,
};
use fht_session::SessionConfig;
use fht_tests::corridors::{corridors, put};
use fht_tests::packages::environment;
use serde::Serialize;
use std::io::{BufRead, BufReader, Lines};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(30);
const PACKAGES: [&str; 3] = ["eclipse-zenoh==1.10.2", "jsonschema==4.26.0", "blake3==1.0.11"];

/// A server of its own, and a session with it.
struct Site {
    endpoint: String,
    map: MapName,
    session: Session,
    _server: Process,
    _folder: tempfile::TempDir,
    _runtime: tokio::runtime::Runtime,
}

impl Site {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let endpoint = free_endpoint().unwrap();
        let server = Process::map_server(executable(), folder.path(), &endpoint, PATIENCE).unwrap();
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let config = SessionConfig::from_options(vec![endpoint.clone()], None);
        let session = runtime.block_on(fht_session::open(&config)).unwrap();
        let map = "museum".parse().unwrap();
        Self { endpoint, map, session, _server: server, _folder: folder, _runtime: runtime }
    }

    fn say<T: Serialize>(&self, topic: RobotTopic, what: &T) {
        let key = Key::robot(&self.map, "amr-7", topic).to_string();
        self.session.put(key, serde_json::to_vec(what).unwrap()).wait().unwrap();
    }
}

/// A Python program that is running, and what it prints.
struct Program {
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

/// Python with the packages. The first test makes the environment; the others wait.
fn python() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-client");
    PYTHON.get_or_init(|| environment(&folder, &PACKAGES).join("python"))
}

impl Program {
    fn start(script: &Path, arguments: &[&str]) -> Self {
        let mut command = Command::new(python());
        let mut child = command.arg(script).args(arguments).stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        Self { child, lines }
    }

    /// The rest of the next line that begins like this.
    fn line(&mut self, beginning: &str) -> String {
        let found =
            self.lines.by_ref().map(Result::unwrap).find_map(|line| Some(line.strip_prefix(beginning)?.to_owned()));
        found.unwrap_or_else(|| panic!("the program has ended without a line that begins with {beginning}"))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

fn pose_of_robot() -> RobotPose {
    RobotPose {
        robot: "amr-7".to_owned(),
        localized: true,
        state: LocalizationState::Localized,
        confidence: 0.97,
        candidates: Vec::new(),
        probabilities: Vec::new(),
        map_from_base: Some([1.0, 0.5, -1.25]),
        lost_because: None,
        stamp_us: None,
    }
}

#[test]
fn the_python_example_follows_a_map() {
    let site = Site::new();
    let [first, second] = <[Increment; 2]>::try_from(corridors()).unwrap();
    put(&site.session, &site.map, &[first.clone(), second.clone()]);

    // HOST:PORT will do, as for the programs.
    let endpoint = site.endpoint.trim_start_matches("tcp/");
    let args = [endpoint, "museum", "0,0", "5,3", "--report"];
    let mut example = Program::start(&in_repository("examples/python/follow.py"), &args);
    example.line("3 nodes, 2 edges");
    let path: Vec<serde_json::Value> = serde_json::from_str(&example.line("path: ")).unwrap();
    assert!(path.len() >= 2 && path[0]["x"] == 0.0 && path[path.len() - 1]["y"] == 3.0, "{path:?}");
    let blocked = example.line("blocked: ");
    assert!(blocked.contains("follow-py") && blocked.contains("edges"), "{blocked}");

    // The map changes: a node is moved, another is removed and takes its edge along.
    let id = |number: u32| NodeId { author: first.author, number };
    let pose = FixedPose::from_metres(5.0, 0.2, 0.0);
    let ops = vec![Op::SetPose { id: id(1), pose }, Op::RemoveNode { id: id(2) }];
    put(&site.session, &site.map, &[Increment { number: 3, hlc_us: 3, ops, ..first }]);
    example.line("2 nodes, 1 edges");

    let token = Key::Robot { map: site.map.clone(), robot: "amr-7".to_owned() }.to_string();
    let token = site.session.liveliness().declare_token(token).wait().unwrap();
    example.line("fht/museum/robots/amr-7 is here");
    site.say(RobotTopic::Pose, &pose_of_robot());
    let pose: RobotPose = serde_json::from_str(&example.line("pose: ")).unwrap();
    assert_eq!(pose, pose_of_robot());
    token.undeclare().wait().unwrap();
    example.line("fht/museum/robots/amr-7 has gone");
}

#[test]
fn the_python_example_says_what_is_missing() {
    // Without packages, whichever are installed.
    let mut python = Command::new("python3");
    let output = python.args(["-I", "-S"]).arg(in_repository("examples/python/follow.py")).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && said.lines().count() == 1, "{said}");
    assert!(said.contains("pip install eclipse-zenoh"), "{said}");
}

/// All operations that corridors do not have.
fn annotations() -> Increment {
    let author = AuthorId::of_robot("operator");
    let explorer = AuthorId::of_robot("explorer");
    let id = |number: u32| NodeId { author: explorer, number };
    let own = |number: u32| NodeId { author, number };
    let label = |name: &str| name.parse::<Label>().unwrap();
    let corners =
        [(1.0, -0.3), (2.0, -0.3), (2.0, 0.3), (1.0, 0.3)].map(|(x, y)| FixedPoint::from_metres(x, y)).to_vec();
    let mut vector = VersionVector::default();
    vector.set(explorer, 2);
    let release = ReleaseId { author, name: "2026-11-21.1".parse().unwrap() };
    let scan = ScanRecord {
        base_from_sensor: FixedPose::from_metres(0.1, 0.0, 0.0),
        angle_min: -3.1,
        angle_increment: 0.0175,
        ranges_mm: (0..360).map(|beam| 5 * (beam % 7) * 100).collect(),
    };
    let descriptor = Some(Descriptor::quantise(ModelId(7), &[0.5, -0.25, 0.125, 0.8]));
    let model = DescriptorModel { id: ModelId(7), name: "four".to_owned(), dimension: 4, match_threshold_e3: 850 };
    let pose = FixedPose::from_metres(4.5, 0.0, 1.5);
    let ops = vec![
        Op::PutModel { model },
        Op::PutNode { id: own(0), kind: NodeKind::Main, pose },
        Op::SetSignature { id: own(0), signature: Signature { descriptor, scan } },
        Op::PutEdge { edge: EdgeKey::new(own(0), id(1)) },
        Op::SetTrust { id: own(0), percent: 60 },
        Op::SetPlace { name: label("dock"), pose: Some(pose) },
        Op::SetPlace { name: label("nowhere"), pose: None },
        Op::SetZone { name: label("slow"), zone: Some(Zone { rule: ZoneRule::SpeedLimit(300), corners }) },
        Op::SetZone { name: label("gone"), zone: None },
        Op::SetClosed { edge: EdgeKey::new(id(1), id(2)), closed: true },
        Op::PutRelease { name: release.name.clone(), release: Release { vector, digest: Digest([7; 32]) } },
        Op::RemoveRelease { id: ReleaseId { author, name: "old".parse().unwrap() } },
        Op::Enable { release: None },
        Op::SetFloorPlan {
            plan: Some(PlanImage { image: "Erdgeschoß.png".to_owned(), um_per_pixel: 50_000, map_from_image: pose }),
        },
        Op::SetDatum { datum: Some(Datum::from_degrees(-33.856_784, 151.215_297, 0.5)) },
    ];
    Increment { author, number: 1, hlc_us: 10, ops }
}

#[test]
fn a_codec_written_from_the_reference_reads_writes_and_hashes_as_the_server_does() {
    let site = Site::new();
    put(&site.session, &site.map, &[corridors(), vec![annotations()]].concat());
    let script = in_repository("tests/tests/python_client/codec.py");
    let author = AuthorId::of_robot("stranger").to_string();
    let mut codec = Program::start(&script, &[&site.endpoint, "museum", &author]);
    codec.line("read 3 increments");
    codec.line("wrote 1 increment");
}

#[test]
fn what_the_server_says_is_as_the_schemas_have_it() {
    let site = Site::new();
    put(&site.session, &site.map, &[corridors(), vec![annotations()]].concat());
    let status = RobotStatus {
        robot: "amr-7".to_owned(),
        role: RobotRole::Client,
        map: site.map.clone(),
        version: 2,
        vector: [(AuthorId::of_robot("explorer"), 2)].into_iter().fold(
            VersionVector::default(),
            |mut vector, (a, n)| {
                vector.set(a, n);
                vector
            },
        ),
        release: None,
        state: LocalizationState::Localized,
        map_from_base: Some([1.0, 0.5, -1.25]),
        stamp_us: None,
    };
    let report = BlockedReport { for_s: 60.0, edges: Vec::new(), places: vec![[2.5, 1.0]] };
    site.say(RobotTopic::Status, &status);
    site.say(RobotTopic::Blocked, &report);

    let folder = in_repository("docs/schema");
    let script = in_repository("tests/tests/python_client/check_schemas.py");
    let author = AuthorId::of_robot("vandal").to_string();
    let mut check = Program::start(&script, &[&site.endpoint, "museum", folder.to_str().unwrap(), &author]);
    check.line("listening");
    site.say(RobotTopic::Pose, &pose_of_robot());
    site.say(
        RobotTopic::Goal,
        &ExplorerGoal { at: [0.0, 1.0], target: Some([4.0, 0.5]), remaining_m: 4.3, finished: false, finishing: false },
    );
    let goal = GoalStatus {
        state: GoalState::Failed,
        id: Some("7".to_owned()),
        goal: Some([4.5, 0.0]),
        goal_yaw: Some(1.25),
        to_go_m: Some(5.31),
        code: Some(ErrorCode::NoPath),
        reason: Some("nothing joins them".to_owned()),
        waiting: Some("8".to_owned()),
        stamp_us: Some(1),
        ..GoalStatus::idle("amr-7")
    };
    let key = Key::goal(&site.map, "amr-7", GoalTopic::Status).to_string();
    site.session.put(key, serde_json::to_vec(&goal).unwrap()).wait().unwrap();
    site.say(RobotTopic::Status, &status);
    site.say(RobotTopic::Blocked, &report);
    let checked = check.line("diff ");
    for file in folder.read_dir().unwrap() {
        let name = file.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned();
        assert!(name == "diff" || checked.split(' ').any(|checked| checked == name), "{name} is not among {checked}");
    }
}
