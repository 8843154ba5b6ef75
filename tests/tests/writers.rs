//! Writers and the map server: who may write, and what a writer learns when it may not.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_link::LinkConfig;
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op};
use fht_tests::process::free_endpoint;
use map_server::config::Limits;
use map_server::{ServerConfig, ServerError};
use mapper::publish::{Progress, PublishError, find_head, outbox};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
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
        let server_link = map_server::config::LinkConfig { listen: vec![endpoint.clone()], ..Default::default() };
        let config = ServerConfig { limits, ..ServerConfig::new(data.path().to_owned(), server_link) };
        let (stop, stopped) = oneshot::channel::<()>();
        let server = tokio::spawn(map_server::run(config, async { _ = stopped.await }));
        let session = fht_link::open(&LinkConfig::from_options(vec![endpoint], None)).await.unwrap();
        assert_eq!(find_head(&session, &museum(), PATIENCE).await.unwrap(), None);
        Self { session, stop, server, _data: data }
    }

    /// A whole run of `count` increments.
    async fn write(&self, count: u64, x: f64) -> Result<Progress, PublishError> {
        let (outbox, publisher) = outbox(self.session.clone(), museum(), author(), 0);
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
async fn silence_is_not_taken_for_an_unknown_map() {
    let endpoint = free_endpoint().unwrap();
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"router\"").unwrap();
    config.insert_json5("listen/endpoints", &format!("[\"{endpoint}\"]")).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let router = zenoh::open(config).await.unwrap();
    let robot = fht_link::open(&LinkConfig::from_options(vec![endpoint], None)).await.unwrap();
    let unknown = find_head(&robot, &museum(), Duration::from_millis(500)).await.unwrap_err();
    assert!(matches!(unknown, PublishError::NoAnswer { .. }), "{unknown}");

    // Busy twice, then the truth.
    let asked = AtomicU64::new(0);
    router
        .declare_queryable(Key::topic(&museum(), Topic::Head).to_string())
        .callback(move |query| {
            let is_busy = asked.fetch_add(1, Ordering::Relaxed) < 2;
            let code = if is_busy { ErrorCode::Internal } else { ErrorCode::UnknownMap };
            let reply = ErrorReply { code, message: "so it is".to_owned() };
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
