//! What the bridge's tests share: a server, a map on it, a bridge, and somebody to wait with.
#![allow(dead_code, clippy::unwrap_used)] // every test program uses a part of it; tests may panic

use fht_proto::api::keys::Key;
use fht_proto::{
    AuthorId, EdgeKey, FixedPose, Increment, MapName, NodeId, NodeKind, Op, Rect, ScanRecord, Signature, encode,
};
use map_server::{ServerConfig, ServerEndpoints, ServerError};
use std::future::Future;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use zenoh::Session;

/// How long a state is waited for.
const PATIENCE: Duration = Duration::from_secs(90);

pub const ANA: AuthorId = AuthorId(0xa);

pub fn museum() -> MapName {
    "museum".parse().unwrap()
}

pub fn node(number: u32) -> NodeId {
    NodeId { author: ANA, number }
}

/// What adds a node a metre along y = 0, joined to the one before; every fifth has seen a wall.
pub fn drive(number: u32) -> Vec<Op> {
    let (id, x) = (node(number), f64::from(number));
    let pose = FixedPose::from_metres(x, 0.0, 0.0);
    let is_main = number.is_multiple_of(5);
    let kind = if is_main { NodeKind::Main } else { NodeKind::Support };
    let rect = Rect::around(pose.position, (x - 0.6, -1.0), (x + 0.6, 1.0));
    let mut ops = vec![Op::PutNode { id, kind, pose }, Op::SetFreeSpace { id, rect: Some(rect) }];
    if is_main {
        let scan = ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![3000; 60],
        };
        ops.push(Op::SetSignature { id, signature: Signature { descriptor: None, scan } });
    }
    ops.extend((number > 0).then(|| Op::PutEdge { edge: EdgeKey::new(node(number - 1), id) }));
    ops
}

/// Looks again and again until there is something to see.
pub async fn until<T, F: Future<Output = Option<T>>>(what: &str, look: impl Fn() -> F) -> T {
    let begin = Instant::now();
    while begin.elapsed() < PATIENCE {
        if let Some(seen) = look().await {
            return seen;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("{what} has not come to be");
}

/// A server, and a robot that writes a map on it.
pub struct Site {
    pub endpoint: String,
    pub session: Session,
    pub dir: tempfile::TempDir,
    increments: u64,
    stop: Option<oneshot::Sender<()>>,
    server: JoinHandle<Result<(), ServerError>>,
}

impl Site {
    /// A corridor of so many nodes.
    pub async fn with(nodes: u32) -> Self {
        let (endpoint, dir) = (format!("tcp/{}", fht_reserved_port::reserve().unwrap()), tempfile::tempdir().unwrap());
        let link = ServerEndpoints { listen: vec![endpoint.clone()], ..Default::default() };
        let config = ServerConfig::new(dir.path().join("maps"), link);
        let (stop, stopped) = oneshot::channel::<()>();
        let server = tokio::spawn(map_server::run(config, async { _ = stopped.await }));
        let mut link = zenoh::Config::default();
        for (name, value) in [
            ("mode", "\"client\"".to_owned()),
            ("connect/endpoints", format!("[\"{endpoint}\"]")),
            ("connect/timeout_ms", "-1".to_owned()),
            ("connect/retry", "{period_init_ms: 50, period_max_ms: 200}".to_owned()),
            ("scouting/multicast/enabled", "false".to_owned()),
        ] {
            link.insert_json5(name, &value).unwrap();
        }
        let session = zenoh::open(link).await.unwrap();
        let mut site = Self { endpoint, session, dir, increments: 0, stop: Some(stop), server };
        for number in 0..nodes {
            site.write(drive(number)).await;
        }
        site
    }

    /// Writes an increment, and waits until the server has it.
    pub async fn write(&mut self, ops: Vec<Op>) {
        self.increments += 1;
        let number = self.increments;
        let increment = Increment { author: ANA, number, hlc_us: 1_000_000 + number, ops };
        let (key, bytes) = (Key::increment(&museum(), ANA, number).to_string(), encode(&increment).unwrap());
        let has_it = || async {
            // What comes before the server is up is lost.
            self.session.put(&key, bytes.clone()).await.unwrap();
            let head = fht_client::ask_head_async(&self.session, &museum(), Duration::from_secs(2)).await.ok()?;
            (head.vector.get(ANA) >= number).then_some(())
        };
        until("the increment on the server", has_it).await;
    }

    /// What a robot says of where it is.
    pub async fn say(&self, robot: &str, pose: &serde_json::Value) {
        let key = format!("fht/museum/robots/{robot}/pose");
        self.session.put(key, pose.to_string()).await.unwrap();
    }

    /// A bridge to this server, with more flags.
    pub fn bridge(&self, flags: &[&str]) -> Bridge {
        Bridge::start(&[&["--connect", &self.endpoint, "--map", "museum"], flags].concat())
    }

    pub async fn end(mut self) {
        let _ = self.stop.take().unwrap().send(());
        self.session.close().await.unwrap();
        self.server.await.unwrap().unwrap();
    }
}

/// A bridge, killed when dropped.
pub struct Bridge {
    child: Child,
    pub url: String,
}

impl Bridge {
    fn start(args: &[&str]) -> Self {
        let program = env!("CARGO_BIN_EXE_foxglove-bridge");
        let args = [&["--listen", "127.0.0.1:0", "--wait", "60"], args].concat();
        let mut child = Command::new(program).args(args).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("map 'museum' at ").unwrap_or_else(|| panic!("{line}")).to_owned();
        Self { child, url }
    }

    pub fn address(&self) -> SocketAddr {
        self.url.split_once("://").unwrap().1.parse().unwrap()
    }

    /// Memory that it has now, KiB.
    pub fn memory_kib(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    /// SIGTERM.
    pub fn terminate(&mut self) -> ExitStatus {
        assert!(Command::new("kill").arg(self.child.id().to_string()).status().unwrap().success());
        self.child.wait().unwrap()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
