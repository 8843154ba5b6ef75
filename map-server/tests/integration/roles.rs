//! Roles and quotas, with a server process and without: an explorer does what explorers do and no
//! more, and one explorer leaves room for all others; what was let in before the roles is named,
//! and can be taken back.

use crate::support::{Server, ask, client, free_endpoint, head_when, increment, museum, node, until_up};
use fht_map::{WriterRole, WriterRoles};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, MapsReply};
use fht_proto::{
    AuthorId, EdgeKey, FixedPoint, FixedPose, Increment, MapName, NodeKind, Op, ReleaseId, Zone, ZoneRule, encode,
};
use map_server::catalog::Catalog;
use map_server::config::{Limits, Quotas};
use map_server::ingest::{Arrival, Ingest};
use map_server::store::{IncrementLog, MemoryLog};
use serde_json::Value;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant, UNIX_EPOCH};
use zenoh::Session;
use zenoh::qos::CongestionControl;

const ROLES: &str = "{explorers: ['ana', 'ben'], clients: ['tug'], operators: ['desk']}";
const PATIENCE: Duration = Duration::from_secs(60);

fn author(name: &str) -> AuthorId {
    AuthorId::of_robot(name)
}

fn now_us() -> u64 {
    UNIX_EPOCH.elapsed().unwrap().as_micros() as u64
}

/// Stamped now: newer than what operators' commands have written.
fn of(name: &str, number: u64, ops: Vec<Op>) -> Increment {
    Increment { author: author(name), number, hlc_us: now_us(), ops }
}

fn puts(name: &str, number: u64, first: u32, count: u32) -> Increment {
    let put = |number| Op::PutNode {
        id: node(author(name), number),
        kind: NodeKind::Support,
        pose: FixedPose::from_metres(f64::from(number % 1000), 0.0, 0.0),
    };
    of(name, number, (first..first + count).map(put).collect())
}

/// A server process with the list of roles, and a session with it.
struct Guarded {
    endpoint: String,
    session: Session,
    dir: tempfile::TempDir,
    server: Server,
}

impl Guarded {
    async fn start(more: &[&str]) -> Self {
        Self::on(tempfile::tempdir().unwrap(), true, more).await
    }

    async fn on(dir: tempfile::TempDir, is_guarded: bool, more: &[&str]) -> Self {
        let endpoint = free_endpoint();
        let roles = dir.path().join("roles.json5");
        std::fs::write(&roles, ROLES).unwrap();
        let with_roles = ["--roles", roles.to_str().unwrap()];
        let args = if is_guarded { [&with_roles[..], more].concat() } else { more.to_vec() };
        let server = Server::with(&dir.path().join("data"), &endpoint, &args, &dir.path().join("log"));
        let session = client(&endpoint).await;
        until_up(&session).await;
        Self { endpoint, session, dir, server }
    }

    /// Ends it; what it kept stays.
    async fn end(mut self) -> tempfile::TempDir {
        self.session.close().await.unwrap();
        assert_eq!(self.server.terminate(), Some(0));
        self.dir
    }

    fn said(&self) -> String {
        std::fs::read_to_string(self.dir.path().join("log")).unwrap()
    }

    fn try_run(&self, args: &[&str]) -> Result<Value, String> {
        let output = Command::new(env!("CARGO_BIN_EXE_map-server"))
            .args(args)
            .args(["--connect", &self.endpoint, "--json", "--operator", "desk"])
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        if output.status.success() {
            Ok(serde_json::from_slice(&output.stdout).unwrap())
        } else {
            Err(text(output.stderr))
        }
    }

    fn run(&self, args: &[&str]) -> Value {
        self.try_run(args).unwrap_or_else(|complaint| panic!("{args:?}: {complaint}"))
    }

    async fn put(&self, map: &MapName, increment: &Increment) {
        let key = Key::increment(map, increment.author, increment.number).to_string();
        // None is dropped where the processors are busy.
        let put = self.session.put(key, encode(increment).unwrap());
        put.congestion_control(CongestionControl::Block).await.unwrap();
    }

    /// Puts it until its writer is told why not.
    async fn refused(&self, map: &MapName, increment: &Increment) -> ErrorReply {
        let key = Key::refused(map, increment.author).to_string();
        let told = self.session.declare_subscriber(key).await.unwrap();
        let begin = Instant::now();
        loop {
            self.put(map, increment).await;
            if let Ok(Ok(sample)) = tokio::time::timeout(Duration::from_secs(1), told.recv_async()).await {
                return serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
            }
            assert!(begin.elapsed() < PATIENCE, "nobody tells its writer");
        }
    }

    /// Puts it until a head covers it.
    async fn taken(&self, map: &MapName, increment: &Increment) -> Head {
        let refused = self.session.declare_subscriber(Key::refused(map, increment.author).to_string()).await.unwrap();
        let begin = Instant::now();
        loop {
            self.put(map, increment).await;
            for reply in ask(&self.session, &format!("fht/{map}/head")).await.into_iter().flatten() {
                let head: Head = serde_json::from_slice(&reply).unwrap();
                if head.vector.get(increment.author) >= increment.number {
                    return head;
                }
            }
            let why = || refused.drain().last().map(|sample| sample.payload().try_to_string().unwrap().into_owned());
            assert!(
                begin.elapsed() < PATIENCE,
                "{}/{} of {map} is not taken: {:?}",
                increment.author,
                increment.number,
                why()
            );
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// A corridor by ana, and what an operator has decided on it.
    async fn decide(&self, nodes: u64) {
        for number in 1..=nodes {
            self.put(&museum(), &increment(author("ana"), number)).await;
        }
        head_when(&self.session, |head| head.vector.get(author("ana")) == nodes).await;
        self.run(&["place", "museum", "dock", "5,0,180"]);
        self.run(&["zone", "museum", "stairs", "3,-1.5 4,-1.5 4,0.3 3,0.3"]);
        self.run(&["release", "create", "museum", "first"]);
        self.run(&["release", "enable", "museum", "first"]);
    }

    /// What holds, without the version.
    fn decided(&self) -> (Value, Value) {
        let mut rules = self.run(&["rules", "museum"]);
        rules.as_object_mut().unwrap().remove("version");
        (rules, self.run(&["release", "list", "museum"])["releases"].clone())
    }
}

fn small_zone() -> Zone {
    let corners = [(90_000, 0), (90_200, 0), (90_200, 200)].map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm });
    Zone { rule: ZoneRule::KeepOut, corners: corners.to_vec() }
}

/// What an explorer tried on a map of others.
fn attacks() -> Vec<Op> {
    let (dock, stairs) = ("dock".parse().unwrap(), "stairs".parse().unwrap());
    let (a, b) = (node(author("ana"), 1), node(author("ana"), 2));
    let first = ReleaseId { author: author("desk"), name: "first".parse().unwrap() };
    vec![
        Op::SetPlace { name: dock, pose: Some(FixedPose::from_metres(1.0, 0.0, 0.0)) },
        Op::SetZone { name: stairs, zone: Some(small_zone()) },
        Op::RemoveRelease { id: first },
        Op::Enable { release: None },
        Op::SetClosed { edge: EdgeKey::new(a, b), closed: true },
        Op::SetPose { id: a, pose: FixedPose::from_metres(500.0, 0.0, 0.0) },
        Op::PutNode { id: node(author("ana"), 4000), kind: NodeKind::Support, pose: FixedPose::default() },
    ]
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_explorer_decides_nothing_and_a_client_and_a_stranger_write_nothing() {
    let site = Guarded::start(&[]).await;
    site.decide(12).await;
    let before = (site.decided(), head_when(&site.session, |_| true).await.digest);
    for op in attacks() {
        let told = site.refused(&museum(), &of("ben", 1, vec![op.clone()])).await;
        assert!(told.code == ErrorCode::NotPermitted && told.message.starts_with("ben: explorers may not"), "{told}");
        // Nor hidden among what is allowed.
        let mut hidden = puts("ben", 1, 0, 2);
        hidden.ops.push(op);
        assert_eq!(site.refused(&museum(), &hidden).await.code, ErrorCode::NotPermitted);
    }
    let tug = site.refused(&museum(), &puts("tug", 1, 0, 1)).await;
    assert_eq!((tug.code, tug.message.as_str()), (ErrorCode::NotPermitted, "tug: clients may not write"));
    let stranger = site.refused(&museum(), &puts("eve", 1, 0, 1)).await;
    assert!(stranger.message.contains("is nobody in the list of roles"), "{stranger}");
    tokio::time::sleep(Duration::from_millis(1100)).await; // it is told each reason once a second
    let complaint = Command::new(env!("CARGO_BIN_EXE_map-server"))
        .args(["place", "museum", "mine", "2,0", "--operator", "ben", "--connect", &site.endpoint])
        .output()
        .unwrap();
    let complaint = String::from_utf8(complaint.stderr).unwrap();
    assert!(complaint.contains("ben: explorers may not name, move or remove places"), "{complaint}");

    let after = head_when(&site.session, |_| true).await;
    assert_eq!((site.decided(), after.digest), before);
    assert!(after.refused >= 16, "they are counted: {}", after.refused);
    assert!(site.said().contains("ben: explorers may not draw, change or remove zones"), "{}", site.said());
    // Each still does what it is there for.
    site.taken(&museum(), &puts("ben", 1, 0, 2)).await;
    site.run(&["place", "museum", "dock", "6,0,90"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_explorer_retires_some_nodes_of_others_and_never_all_of_them() {
    let site = Guarded::start(&[]).await;
    site.decide(12).await;
    let remove = |numbers: std::ops::Range<u32>| -> Vec<Op> {
        numbers.map(|number| Op::RemoveNode { id: node(author("ana"), number) }).collect()
    };
    let all = site.refused(&museum(), &of("ben", 1, remove(0..12))).await;
    assert!(all.code == ErrorCode::NotPermitted && all.message.contains("its quota of 3"), "{all}");
    let blind = (0..12).map(|number| Op::SetFreeSpace { id: node(author("ana"), number), rect: None }).collect();
    assert_eq!(site.refused(&museum(), &of("ben", 1, blind)).await.code, ErrorCode::NotPermitted);
    // Doubt as explorers have it goes through, and no further by instalments.
    site.taken(&museum(), &of("ben", 1, remove(0..2))).await;
    site.taken(&museum(), &of("ben", 2, remove(2..3))).await;
    let more = site.refused(&museum(), &of("ben", 3, remove(3..4))).await;
    assert!(more.message.contains("has taken away 3 nodes of others within an hour"), "{more}");
    let head = head_when(&site.session, |_| true).await;
    assert_eq!(head.main_nodes + head.support_nodes, 9);
    let own = Op::SetTrust { id: node(author("ana"), 5), percent: 60 };
    site.taken(&museum(), &of("ben", 3, vec![own])).await;
    // Its own it may take away, and an operator anything.
    site.taken(&museum(), &of("ana", 13, remove(3..8))).await;
    site.taken(&museum(), &of("desk", head.vector.get(author("desk")) + 1, remove(8..12))).await;
    assert_eq!(head_when(&site.session, |_| true).await.support_nodes, 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_explorer_fills_neither_the_maps_nor_the_room_of_others() {
    let site = Guarded::start(&["--max-map-elements", "40000", "--max-total-elements", "100000"]).await;
    site.decide(12).await;
    let map = |index: usize| -> MapName { format!("junk-{index}").parse().unwrap() };
    // 256 maps of one node.
    for index in 0..256 {
        site.put(&map(index), &puts("ben", 1, 0, 1)).await;
    }
    let told = site.refused(&map(300), &puts("ben", 1, 0, 1)).await;
    let expected = "explorer ben has used up its quota of maps: 64 (an operator raises it with map-server quota set)";
    assert_eq!((told.code, told.message.as_str()), (ErrorCode::Full, expected));
    let reply = ask(&site.session, "fht/maps").await.remove(0).unwrap();
    assert_eq!(serde_json::from_slice::<MapsReply>(&reply).unwrap().maps.len(), 65);
    // A flood of nodes, on the map of others and on its own.
    for (at, until) in [(museum(), 4_u64), (map(0), 5), (map(1), 7)] {
        let mut codes = Vec::new();
        let begun = u64::from(at != museum());
        for number in begun + 1..=until + 1 {
            let flood = puts("ben", number, 10 + 4096 * number as u32, 4096);
            if number <= until {
                site.put(&at, &flood).await;
            } else {
                codes.push(site.refused(&at, &flood).await);
            }
        }
        let last = codes.pop().unwrap();
        assert!(last.code == ErrorCode::Full && last.message.starts_with("explorer ben has used up"), "{at}: {last}");
    }
    // Everybody else writes on: here, on a new map, and people on all of them.
    site.taken(&museum(), &increment(author("ana"), 13)).await;
    site.taken(&"annex".parse().unwrap(), &puts("ana", 1, 0, 3)).await;
    site.taken(&map(0), &puts("ana", 1, 0, 3)).await;
    site.run(&["place", "museum", "quay", "6,0"]);
    site.run(&["release", "create", "museum", "second"]);
    // What is deleted gives its room back.
    for junk in ["junk-0", "junk-1"] {
        site.run(&["delete", junk, "--reason", "a flood", "--grace", "0s"]);
    }
    site.taken(&map(300), &puts("ben", 1, 0, 4096)).await;
    // The same counts after a restart.
    let dir = site.end().await;
    let site = Guarded::on(dir, true, &["--max-map-elements", "40000", "--max-total-elements", "100000"]).await;
    let told = site.refused(&map(301), &puts("ben", 1, 0, 1)).await;
    assert_eq!(told.message, expected);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_operator_sees_quotas_and_sets_one() {
    let site = Guarded::start(&[]).await;
    site.taken(&museum(), &puts("ana", 1, 0, 3)).await;
    site.taken(&museum(), &puts("ben", 1, 0, 2)).await;
    let of = |quotas: &Value, name: &str| {
        let writers = quotas["writers"].as_array().unwrap();
        writers.iter().find(|view| view["writer"] == name).unwrap_or_else(|| panic!("no {name}: {quotas}")).clone()
    };
    let shown = site.run(&["quota", "show", "museum"]);
    let names: Vec<&str> =
        shown["writers"].as_array().unwrap().iter().filter_map(|view| view["writer"].as_str()).collect();
    assert_eq!(names, ["ana", "ben", "desk"], "a client writes nothing");
    let ben = of(&shown, "ben");
    assert_eq!((&ben["role"], &ben["is_own"]), (&Value::from("explorer"), &Value::from(false)));
    assert_eq!((&ben["map_elements"]["used"], &ben["maps"]["used"]), (&Value::from(2), &Value::from(1)));

    let set = site.run(&["quota", "set", "museum", "ben", "--map-share", "0", "--increments-per-s", "10"]);
    let ben = of(&set, "ben");
    assert_eq!((&ben["is_own"], &ben["map_elements"]["most"]), (&Value::from(true), &Value::from(0)));
    assert_eq!(of(&set, "ana"), of(&shown, "ana"), "nobody else's");
    let told = site.refused(&museum(), &puts("ben", 2, 10, 1)).await;
    assert_eq!(
        (told.code, told.message.as_str()),
        (
            ErrorCode::Full,
            "explorer ben has used up its quota of bytes in this map: 0 (an operator raises it with map-server quota set)"
        )
    );
    site.taken(&museum(), &puts("ana", 2, 10, 1)).await;

    assert_eq!(of(&site.run(&["quota", "set", "museum", "ben", "--of-role"]), "ben")["is_own"], false);
    site.taken(&museum(), &puts("ben", 2, 10, 1)).await;

    for (args, complaint) in [
        (&["quota", "set", "museum", "tug", "--map-share", "1"][..], "nobody called tug may write here"),
        (&["quota", "set", "museum", "ben", "--map-share", "7"], "map_share=7: 0 to 1 are allowed"),
        (&["quota", "show", "nowhere"], "there is no map nowhere"),
    ] {
        let said = site.try_run(args).unwrap_err();
        assert!(said.contains(complaint), "{args:?}: {said}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_was_let_in_before_the_roles_is_named_and_taken_back() {
    let open = Guarded::on(tempfile::tempdir().unwrap(), false, &[]).await;
    open.decide(12).await;
    let before = open.decided().0;
    let [place, zone, ..]: [Op; 7] = attacks().try_into().unwrap();
    open.taken(&museum(), &of("ben", 1, vec![place])).await;
    open.taken(&museum(), &puts("ben", 2, 0, 1)).await;
    let digest = open.taken(&museum(), &of("ben", 3, vec![zone])).await.digest;
    assert_ne!(open.decided().0, before);

    let site = Guarded::on(open.end().await, true, &[]).await;
    let said = site.said();
    assert!(said.contains("map museum has 2 increments of ben that its role does not allow"), "{said}");
    assert_eq!(head_when(&site.session, |_| true).await.digest, digest, "what is stored is not judged");
    let roles = site.dir.path().join("roles.json5");
    let undo = ["undo", "museum", "--author", "ben", "--against-roles", roles.to_str().unwrap()];
    assert_eq!(site.run(&undo)["undone"], serde_json::json!([1, 3]));
    assert_eq!(site.decided().0, before);
    assert_eq!(head_when(&site.session, |_| true).await.main_nodes, 3, "what was permitted stays");
    let none = site.try_run(&[&undo[..3], &["ana"], &undo[4..]].concat()).unwrap_err();
    assert!(none.contains("has written nothing in this map that is to be taken back"), "{none}");
}

#[test]
fn a_server_that_strangers_reach_says_so_unless_that_is_meant() {
    let dir = tempfile::tempdir().unwrap();
    let roles = dir.path().join("roles.json5");
    std::fs::write(&roles, ROLES).unwrap();
    let says = |more: &[&str], listen: &str| {
        let (data, log) = (dir.path().join("data"), dir.path().join("log"));
        let endpoint = free_endpoint().replace("127.0.0.1", listen);
        let mut server = Server::with(&data, &endpoint, more, &log);
        let begin = Instant::now();
        loop {
            let said = std::fs::read_to_string(&log).unwrap();
            if said.contains("map-server: 0 maps in ") {
                server.terminate();
                return said;
            }
            assert!(begin.elapsed() < PATIENCE, "{said}");
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    let open = says(&[], "0.0.0.0");
    assert!(open.contains("there is no access control, and every stranger who reaches it may write and"), "{open}");
    let known = says(&["--roles", roles.to_str().unwrap()], "0.0.0.0");
    assert!(known.contains("may write under any name in the list of roles"), "{known}");
    assert!(!says(&["--open"], "0.0.0.0").contains("no access control"));
    assert!(!says(&[], "127.0.0.1").contains("no access control"));
    std::fs::write(&roles, "{explorers: ['ana', 'ana']}").unwrap();
    let refused = Command::new(env!("CARGO_BIN_EXE_map-server")).arg("--roles").arg(&roles).output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && said.contains("the name 'ana' is listed twice"), "{said}");
}

/// An ingest without a network, for what depends on the clock.
struct Bench {
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

impl Bench {
    fn new(limits: Limits, quotas: Quotas) -> Self {
        let log: Arc<dyn IncrementLog> = Arc::new(MemoryLog::new());
        let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
        let members = [(WriterRole::Explorer, "ana"), (WriterRole::Explorer, "ben"), (WriterRole::Operator, "desk")];
        let roles: WriterRoles = members.into_iter().collect();
        let ingest = Ingest::new(log, Arc::clone(&catalog), limits).guarded_by(roles, quotas).unwrap();
        Self { catalog, ingest }
    }

    /// The codes of the refusals.
    fn take(&mut self, increments: &[Increment], now_us: u64) -> Vec<ErrorCode> {
        let arrival = |increment: &Increment| Arrival {
            key: Key::increment(&museum(), increment.author, increment.number).to_string(),
            payload: Ok(encode(increment).unwrap()),
        };
        let outcome = self.ingest.take_arrivals(increments.iter().map(arrival).collect(), now_us).unwrap();
        outcome.notices.into_iter().map(|notice| notice.reply.code).collect()
    }

    fn written(&self, name: &str) -> u64 {
        self.catalog.view(&museum()).map_or(0, |view| view.head.vector.get(author(name)))
    }
}

#[test]
fn who_writes_too_fast_waits_and_nothing_is_lost() {
    let now_us = now_us() + 1_000_000;
    let mut quotas = Quotas::default();
    quotas.explorers.increments_per_s = 2.0;
    let mut bench = Bench::new(Limits::default(), quotas);
    let all: Vec<Increment> = (1..=30).map(|number| puts("ben", number, number as u32, 1)).collect();
    assert_eq!(bench.take(&all, now_us), [ErrorCode::Busy]);
    assert!(!ErrorCode::Busy.is_permanent_refusal());
    assert_eq!(bench.written("ben"), 20, "a burst of ten seconds");
    assert!(bench.take(&[puts("ana", 1, 0, 1)], now_us).is_empty(), "others are not held up");
    bench.take(&all[20..], now_us + 2_000_000);
    assert_eq!(bench.written("ben"), 24);
    // The clock is set back by half an hour, and time passes as before.
    let set_back_us = now_us - 1_800_000_000;
    bench.take(&all[24..], set_back_us);
    bench.take(&all[24..], set_back_us + 2_000_000);
    assert_eq!(bench.written("ben"), 28);
    bench.take(&all[28..], set_back_us + 60_000_000);
    assert_eq!(bench.written("ben"), 30);
}

#[test]
fn nodes_of_others_can_be_retired_again_after_an_hour_and_none_by_a_gap() {
    let now_us = now_us() + 1_000_000;
    let mut bench = Bench::new(Limits::default(), Quotas::default());
    assert!(bench.take(&[puts("ana", 1, 0, 40)], now_us).is_empty());
    let remove = |number: u64, nodes: std::ops::Range<u32>| {
        of("ben", number, nodes.map(|number| Op::RemoveNode { id: node(author("ana"), number) }).collect())
    };
    // Ahead of a gap nothing is counted, and so nothing is kept.
    let ahead: Vec<Increment> =
        (2..6).map(|number| remove(number, 10 * (number as u32 - 2)..10 * (number as u32 - 1))).collect();
    assert!(bench.take(&ahead, now_us).is_empty());
    assert!(bench.take(&[puts("ben", 1, 0, 1)], now_us).is_empty());
    assert_eq!(bench.written("ben"), 1);
    assert_eq!(bench.take(&ahead, now_us), [ErrorCode::NotPermitted]);
    assert_eq!(bench.written("ben"), 2, "ten of forty");
    bench.take(&ahead[1..], now_us + 3_600_000_000);
    assert_eq!(bench.written("ben"), 2, "eight of thirty");
    bench.take(&[remove(3, 10..18)], now_us + 3_600_000_000);
    assert_eq!(bench.written("ben"), 3);
}

#[test]
fn explorers_leave_the_last_tenth_to_operators() {
    let now_us = now_us() + 1_000_000;
    let limits = Limits { max_map_elements: 1000, ..Limits::default() };
    let mut bench = Bench::new(limits, Quotas::default());
    assert!(bench.take(&[puts("ana", 1, 0, 500), puts("ben", 1, 0, 400)], now_us).is_empty());
    for name in ["ana", "ben"] {
        assert_eq!(bench.take(&[puts(name, 2, 1000, 1)], now_us), [ErrorCode::Full], "{name}");
    }
    assert!(bench.take(&[puts("desk", 1, 0, 90)], now_us).is_empty());
    assert_eq!(bench.take(&[puts("desk", 2, 100, 20)], now_us), [ErrorCode::Full], "a limit is a limit");
    // The same map, whoever reads it: the roles are no part of it.
    assert_eq!(bench.catalog.view(&museum()).unwrap().head.support_nodes, 990);
}
