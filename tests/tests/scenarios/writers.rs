//! Writers and the map server: who may write, and what a writer learns when it may not.

use crate::programs::executable;
use fht_demo::free_endpoint;
use fht_proto::api::keys::{Key, RobotTopic, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector, encode};
use fht_session::SessionConfig;
use map_server::config::Limits;
use map_server::{ServerConfig, ServerError};
use mapper::publish::{
    Backlog, DeliverError, Progress, PublishError, RunOrigin, Spool, WindowConfig, deliver, find_head, outbox,
};
use std::ops::RangeInclusive;
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(20);

fn author() -> AuthorId {
    AuthorId::of_robot("explorer")
}

fn museum() -> MapName {
    "museum".parse().unwrap()
}

/// Increment `number` of a run that starts at `x` metres.
fn increment(number: u64, x: f64) -> Increment {
    let id = NodeId { author: author(), number: number as u32 };
    let pose = FixedPose::from_metres(x + number as f64, 0.0, 0.0);
    Increment { author: author(), number, hlc_us: number, ops: vec![Op::PutNode { id, kind: NodeKind::Support, pose }] }
}

struct Running {
    session: Session,
    stop: oneshot::Sender<()>,
    server: JoinHandle<Result<(), ServerError>>,
    _data: tempfile::TempDir,
}

impl Running {
    async fn start(limits: Limits) -> Self {
        let data = tempfile::tempdir().unwrap();
        let endpoint = free_endpoint().unwrap();
        let server_link = map_server::ServerEndpoints { listen: vec![endpoint.clone()], ..Default::default() };
        let config = ServerConfig { limits, ..ServerConfig::new(data.path().to_owned(), server_link) };
        let (stop, stopped) = oneshot::channel::<()>();
        let server = tokio::spawn(map_server::run(config, async { _ = stopped.await }));
        let session = fht_session::open(&SessionConfig::from_options(vec![endpoint], None)).await.unwrap();
        assert_eq!(find_head(&session, &museum(), PATIENCE).await.unwrap(), None);
        Self { session, stop, server, _data: data }
    }

    /// A whole run of `count` increments.
    async fn write(&self, count: u64, x: f64) -> Result<Progress, PublishError> {
        let (outbox, publisher) = outbox(self.session.clone(), museum(), author(), 0, None, WindowConfig::default());
        let made = tokio::task::spawn_blocking(move || {
            for number in 1..=count {
                outbox.send(increment(number, x));
            }
        });
        let outcome = tokio::time::timeout(PATIENCE, publisher).await.expect("an end");
        made.await.unwrap();
        outcome
    }

    async fn end(self) {
        self.session.close().await.unwrap();
        self.stop.send(()).unwrap();
        self.server.await.unwrap().unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_writer_of_the_same_name_ends_with_the_reason() {
    let running = Running::start(Limits::default()).await;
    let first = running.write(300, 0.0).await.unwrap();
    assert_eq!((first.acknowledged, first.wire_bytes), (300, first.map_bytes), "nothing was lost, nothing sent twice");
    // The second run is in a frame of its own.
    for count in [1, 50, 256] {
        let refused = running.write(count, 1000.0).await.unwrap_err();
        assert!(matches!(refused, PublishError::Foreign(_) | PublishError::Refused(_)), "{refused}");
        assert!(refused.to_string().contains("another robot of the same name"), "{refused}");
    }
    let head = find_head(&running.session, &museum(), PATIENCE).await.unwrap().unwrap();
    assert_eq!((head.version, head.digest), (300, first.head.unwrap().digest));
    running.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_map_ends_the_run_with_the_reason() {
    let running = Running::start(Limits { max_map_bytes: 1000, ..Limits::default() }).await;
    let refused = running.write(200, 0.0).await.unwrap_err();
    assert!(matches!(&refused, PublishError::Refused(reply) if reply.code == ErrorCode::Full), "{refused}");
    assert!(refused.to_string().contains("bytes in this map"), "{refused}");
    running.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_a_killed_run_has_left_is_delivered_and_only_to_the_server_that_knows_it() {
    let folder = tempfile::tempdir().unwrap();
    let spool = Spool::open(folder.path(), &museum(), author()).unwrap();
    let left = |numbers: RangeInclusive<u64>| numbers.map(|number| (number, encode(&increment(number, 0.0)).unwrap()));
    let running = Running::start(Limits::default()).await;
    for (first, last) in [(1, 20), (21, 30)] {
        spool.add(left(first..=last).collect()).await.unwrap();
        let head = deliver(&running.session, &museum(), "explorer", &spool, &WindowConfig::default(), PATIENCE)
            .await
            .unwrap()
            .unwrap();
        assert_eq!(head.vector.get(author()), last);
        assert_eq!(spool.backlog().unwrap(), Backlog::after(last));
    }
    // Nothing waits, and the server has everything.
    assert!(
        deliver(&running.session, &museum(), "explorer", &spool, &WindowConfig::default(), PATIENCE)
            .await
            .unwrap()
            .is_some()
    );

    // A server without the map: the run would use numbers again.
    let other = Running::start(Limits::default()).await;
    let soon = Duration::from_millis(300);
    let behind =
        deliver(&other.session, &museum(), "explorer", &spool, &WindowConfig::default(), soon).await.unwrap_err();
    assert!(matches!(behind, DeliverError::Behind { .. }), "{behind}");
    assert!(
        behind
            .to_string()
            .contains(&format!("is at '' on the map server, and this robot has seen it at '{}:30'", author()))
    );
    // Another robot of the same name has written there: nothing is put behind its increments.
    other.write(32, 1000.0).await.unwrap();
    spool.add(left(31..=40).collect()).await.unwrap();
    let taken =
        deliver(&other.session, &museum(), "explorer", &spool, &WindowConfig::default(), PATIENCE).await.unwrap_err();
    assert!(matches!(taken, DeliverError::Taken { .. }) && taken.to_string().contains("remove that file"), "{taken}");
    assert_eq!(spool.backlog().unwrap().encoded.len(), 10, "it stays there");
    let head = find_head(&other.session, &museum(), PATIENCE).await.unwrap().unwrap();
    assert_eq!(head.vector.get(author()), 32);
    other.end().await;
    running.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_spool_is_right_about_what_is_there_already_and_about_the_maps_frame() {
    // The map's frame is that of the first node.
    let node = |author, kind| {
        let id = NodeId { author, number: 0 };
        vec![Op::PutNode { id, kind, pose: FixedPose::from_metres(0.0, 0.0, 0.0) }]
    };
    let encoded = |number| {
        let mut made = increment(number, 0.0);
        made.ops.extend(node(author(), NodeKind::Support));
        (number, encode(&made).unwrap())
    };
    let [folder, other] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let open = |folder: &tempfile::TempDir| Spool::open(folder.path(), &museum(), author()).unwrap();
    let spool = open(&folder);
    let running = Running::start(Limits::default()).await;
    let send = |spool: &Spool| {
        let (session, spool) = (running.session.clone(), spool.clone());
        async move { deliver(&session, &museum(), "explorer", &spool, &WindowConfig::default(), PATIENCE).await }
    };
    // Another robot begins the map while this one, which had begun it, too, is away.
    spool.begin(RunOrigin { is_founder: true, basis: VersionVector::default() }).await.unwrap();
    spool.add((1..=3).map(encoded).collect()).await.unwrap();
    let other_author = AuthorId::of_robot("other");
    let first = Increment { author: other_author, ops: node(other_author, NodeKind::Main), ..increment(1, 0.0) };
    // So far it only says so.
    let claim = Key::robot(&museum(), "other", RobotTopic::Pose).to_string();
    let claim = running.session.liveliness().declare_token(claim).await.unwrap();
    let begins = send(&spool).await.unwrap_err();
    assert!(matches!(begins, DeliverError::BegunByAnother { .. }), "{begins}");
    claim.undeclare().await.unwrap();
    let (other_box, publisher) =
        outbox(running.session.clone(), museum(), other_author, 0, None, WindowConfig::default());
    tokio::task::spawn_blocking(move || other_box.send(first)).await.unwrap();
    publisher.await.unwrap();
    let begun = send(&spool).await.unwrap_err();
    assert!(matches!(begun, DeliverError::BegunByAnother { .. }), "{begun}");
    drop(spool);
    // What found its place in the map is in the map's frame.
    let spool = open(&other);
    let basis = find_head(&running.session, &museum(), PATIENCE).await.unwrap().unwrap().vector;
    spool.begin(RunOrigin { is_founder: false, basis }).await.unwrap();
    spool.add((1..=3).map(encoded).collect()).await.unwrap();
    assert_eq!(send(&spool).await.unwrap().unwrap().vector.get(author()), 3);
    // A run without the spool continues from there; what the spool still has, as after a kill, is
    // the same there.
    let (outbox, publisher) = outbox(running.session.clone(), museum(), author(), 3, None, WindowConfig::default());
    tokio::task::spawn_blocking(move || outbox.send(increment(4, 0.0))).await.unwrap();
    publisher.await.unwrap();
    drop(spool);
    let killed = tempfile::tempdir().unwrap();
    let spool = open(&killed);
    spool.add((1..=3).map(encoded).collect()).await.unwrap();
    assert_eq!(send(&spool).await.unwrap().unwrap().vector.get(author()), 4);
    running.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_run_that_leaves_without_its_server_has_everything_in_the_spool() {
    let folder = tempfile::tempdir().unwrap();
    let spool = Spool::open(folder.path(), &museum(), author()).unwrap();
    let mut config = zenoh::Config::default();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let alone = zenoh::open(config).await.unwrap();
    let (outbox, publisher) =
        outbox(alone.clone(), museum(), author(), 0, Some(spool.clone()), WindowConfig::default());
    let publisher = tokio::spawn(publisher);
    let written = tokio::task::spawn_blocking(move || {
        (1..=500).for_each(|number| _ = outbox.send(increment(number, 0.0)));
        outbox.close()
    });
    written.await.unwrap().leave();
    let progress = tokio::time::timeout(PATIENCE, publisher).await.unwrap().unwrap().unwrap();
    assert_eq!((progress.written, progress.acknowledged), (500, 0));
    assert_eq!(spool.backlog().unwrap().written(), 500);
    alone.close().await.unwrap();
}

/// A router, with no server behind it.
async fn bare_router(endpoint: &str) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"router\"").unwrap();
    config.insert_json5("listen/endpoints", &format!("[\"{endpoint}\"]")).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    zenoh::open(config).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_does_not_answer_is_waited_for_as_long_as_was_asked_for() {
    let endpoint = free_endpoint().unwrap();
    let router = bare_router(&endpoint).await;
    let begin = Instant::now();
    let explore = move || {
        let flags = ["role", "mapper", "--", "explore", "--no-cameras", "--wait", "7", "--connect", &endpoint];
        Command::new(executable()).args(flags).output().unwrap()
    };
    let output = tokio::task::spawn_blocking(explore).await.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for part in
        ["waiting for a map-server to tell whether", "no map server told within", "access control drops silently"]
    {
        assert!(said.contains(part), "{said}");
    }
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    router.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn silence_is_not_taken_for_an_unknown_map() {
    let endpoint = free_endpoint().unwrap();
    let router = bare_router(&endpoint).await;
    let robot = fht_session::open(&SessionConfig::from_options(vec![endpoint], None)).await.unwrap();
    let unknown = find_head(&robot, &museum(), Duration::from_millis(500)).await.unwrap_err();
    assert!(matches!(unknown, PublishError::NoAnswer { .. }), "{unknown}");

    // Busy twice, then an answer.
    let asked = AtomicU64::new(0);
    router
        .declare_queryable(Key::topic(&museum(), Topic::Head).to_string())
        .callback(move |query| {
            let is_busy = asked.fetch_add(1, Ordering::Relaxed) < 2;
            let code = if is_busy { ErrorCode::Busy } else { ErrorCode::UnknownMap };
            let reply = ErrorReply::new(code, "so it is");
            query.reply_err(serde_json::to_vec(&reply).unwrap()).wait().unwrap();
        })
        .background()
        .await
        .unwrap();
    let busy = find_head(&robot, &museum(), Duration::ZERO).await.unwrap_err();
    assert!(matches!(&busy, PublishError::NoAnswer { reason, .. } if reason == "so it is"), "{busy}");
    assert_eq!(find_head(&robot, &museum(), PATIENCE).await.unwrap(), None);
    robot.close().await.unwrap();
    router.close().await.unwrap();
}
