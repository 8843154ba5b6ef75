//! What the server's tests share: increments, a server process, a client.
#![allow(dead_code, clippy::unwrap_used)] // every test program uses a part of it; tests may panic

pub mod disk;
pub mod site;

use fht_map::MapState;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorReply, Head};
use fht_proto::{
    AuthorId, Descriptor, EdgeKey, FixedPose, Increment, MapName, ModelId, NodeId, NodeKind, Op, Rect, ScanRecord,
    Signature, VersionVector, encode,
};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::query::ConsolidationMode;

pub const ANA: AuthorId = AuthorId(0xa);
pub const BEN: AuthorId = AuthorId(0xb);

pub fn museum() -> MapName {
    "museum".parse().unwrap()
}

pub fn node(author: AuthorId, number: u32) -> NodeId {
    NodeId { author, number }
}

/// Increment `number` of a robot that drives along y = 0, a node per metre, each joined to the one
/// before. Every fifth is a main node of typical size.
pub fn increment(author: AuthorId, number: u64) -> Increment {
    let index = number as u32 - 1;
    let id = node(author, index);
    let pose = FixedPose::from_metres(f64::from(index), 0.0, 0.0);
    let is_main = index.is_multiple_of(5);
    let kind = if is_main { NodeKind::Main } else { NodeKind::Support };
    let x = f64::from(index);
    let rect = Rect::around(pose.position, (x - 0.6, -1.0), (x + 0.6, 1.0));
    let mut ops = vec![Op::PutNode { id, kind, pose }, Op::SetFreeSpace { id, rect: Some(rect) }];
    if is_main {
        ops.push(Op::SetSignature { id, signature: signature(index) });
    }
    if index > 0 {
        ops.push(Op::PutEdge { edge: EdgeKey::new(node(author, index - 1), id) });
    }
    Increment { author, number, hlc_us: 1_000_000 + number, ops }
}

pub fn signature(seed: u32) -> Signature {
    let components: Vec<f32> = (0..320).map(|i| ((i * (seed + 1)) as f32 * 0.37).sin()).collect();
    Signature {
        descriptor: Some(Descriptor::quantise(ModelId(1), &components)),
        scan: ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.017,
            // Far outside the free space.
            ranges_mm: vec![50_000; 360],
        },
    }
}

pub fn bytes(author: AuthorId, number: u64) -> Vec<u8> {
    encode(&increment(author, number)).unwrap()
}

pub fn key(author: AuthorId, number: u64) -> String {
    Key::increment(&museum(), author, number).to_string()
}

/// What increments 1 to `count` of each author add up to.
pub fn expected(counts: &[(AuthorId, u64)]) -> (MapState, VersionVector) {
    let (mut state, mut vector) = (MapState::new(), VersionVector::default());
    for &(author, count) in counts {
        (1..=count).for_each(|number| state.apply(&increment(author, number)));
        vector.set(author, count);
    }
    (state, vector)
}

/// An endpoint with a port that nobody else gets.
pub fn free_endpoint() -> String {
    format!("tcp/{}", fht_reserved_port::reserve().unwrap())
}

/// A server process, killed when dropped.
pub struct Server(Child);

impl Server {
    pub fn start(data: &Path, endpoint: &str) -> Self {
        let program = env!("CARGO_BIN_EXE_map-server");
        let data = data.to_str().unwrap();
        let child = Command::new(program).args(["--data", data, "--listen", endpoint]).spawn().unwrap();
        Self(child)
    }

    /// One with more arguments, which writes what it says to a file.
    pub fn with(data: &Path, endpoint: &str, more: &[&str], log: &Path) -> Self {
        Self::in_environment(data, endpoint, more, &[], log)
    }

    /// One with variables of its environment, too.
    pub fn in_environment(
        data: &Path,
        endpoint: &str,
        more: &[&str],
        environment: &[(&str, &str)],
        log: &Path,
    ) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_map-server"));
        command.args(["--data", data.to_str().unwrap(), "--listen", endpoint]).args(more);
        let own = std::env::vars().filter(|(name, _)| name.starts_with("OTEL_")).map(|(name, _)| name);
        own.chain(["RUST_LOG".to_owned()]).for_each(|name| _ = command.env_remove(name));
        let file = std::fs::File::create(log).unwrap();
        Self(command.envs(environment.iter().copied()).stderr(file).spawn().unwrap())
    }

    /// One that writes more than usual of what it does to a file.
    pub fn saying_more(data: &Path, endpoint: &str, log: &Path) -> Self {
        Self::with(data, endpoint, &["-v"], log)
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        self.0.kill().unwrap();
        self.0.wait().unwrap();
    }

    /// Sends a signal, such as HUP.
    pub fn signal(&self, name: &str) {
        let number = self.0.id().to_string();
        assert!(Command::new("kill").args(["-s", name, &number]).status().unwrap().success());
    }

    /// SIGTERM, and the exit code.
    pub fn terminate(&mut self) -> Option<i32> {
        Command::new("kill").arg(self.0.id().to_string()).status().unwrap();
        self.0.wait().unwrap().code()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a server that should refuse to start; returns its exit code and what it said.
pub fn refused_start(data: &Path, endpoint: &str) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_map-server"))
        .args(["--data", data.to_str().unwrap(), "--listen", endpoint])
        .stdout(Stdio::null())
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// A client that keeps trying to connect, and drops nothing that it puts on a busy machine.
pub async fn client(endpoint: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (name, value) in [
        ("mode", "\"client\"".to_owned()),
        ("connect/endpoints", format!("[\"{endpoint}\"]")),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        ("connect/retry", "{period_init_ms: 50, period_max_ms: 200}".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "10000000".to_owned()),
        ("transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments", "10000000".to_owned()),
    ] {
        config.insert_json5(name, &value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

/// All replies to a query: payloads, or the reason.
pub async fn ask(session: &Session, selector: &str) -> Vec<Result<Vec<u8>, ErrorReply>> {
    ask_with(session, selector, Vec::new()).await
}

pub async fn ask_with(session: &Session, selector: &str, payload: Vec<u8>) -> Vec<Result<Vec<u8>, ErrorReply>> {
    // A reply in several pieces has one key for all of them.
    let get = session.get(selector).payload(payload).consolidation(ConsolidationMode::None);
    let replies = get.timeout(Duration::from_secs(5)).await.unwrap();
    let mut found = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        match reply.result() {
            Ok(sample) => found.push(Ok(sample.payload().to_bytes().into_owned())),
            // What is no JSON is Zenoh's own word that nobody has answered in time.
            Err(error) => found.extend(serde_json::from_slice(&error.payload().to_bytes()).ok().map(Err)),
        }
    }
    found
}

pub async fn head(session: &Session) -> Option<Head> {
    let replies = ask(session, &Key::topic(&museum(), Topic::Head).to_string()).await;
    let payload = replies.into_iter().next()?.ok()?;
    Some(serde_json::from_slice(&payload).unwrap())
}

/// Waits until the server's head satisfies `done`.
pub async fn head_when(session: &Session, done: impl Fn(&Head) -> bool) -> Head {
    let start = Instant::now();
    let mut last = None;
    while start.elapsed() < Duration::from_secs(30) {
        last = head(session).await;
        if let Some(head) = last.as_ref().filter(|head| done(head)) {
            return head.clone();
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("the head did not get there: {last:?}");
}

/// Writes as an explorer does, `at_once` increments at a time, from where the server is, until its
/// head satisfies `done`.
pub async fn write_until(session: &Session, at_once: u64, done: impl Fn(&Head) -> bool) -> Head {
    let begin = Instant::now();
    loop {
        let now = head(session).await.expect("the server answers");
        if done(&now) {
            return now;
        }
        let next = now.vector.get(ANA) + 1;
        for number in next..next + at_once {
            session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
        assert!(begin.elapsed() < Duration::from_secs(60), "{now:?}");
    }
}

/// Waits until a server answers.
pub async fn until_up(session: &Session) {
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(30) {
        if ask(session, "fht/maps").await.iter().any(Result::is_ok) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("no server came up");
}
