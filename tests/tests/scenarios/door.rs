//! Connections that do not become sessions keep nobody out, and the operator is told of them: a
//! map-server alone, as in `deploy/`, as a process.

use crate::programs::executable;
use crate::site::{PATIENCE, ask, certificates, config, free_endpoint, guarded, in_file, shipped, try_once};
use fht_demo::{Process, ProcessError, Role};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// More than Zenoh's own `accept_pending`.
const IDLE: usize = 101;
/// Twenty-five a second: twice of what once kept others out.
const BAD_EVERY: Duration = Duration::from_millis(40);
/// How many robots come meanwhile.
const ROBOTS: usize = 7;

/// Connections, each with a certificate of the site, that say nothing after the TLS handshake.
struct Idle(Vec<Child>);

impl Idle {
    fn connect(address: &str) -> Self {
        let own = |end: &str| certificates().join(format!("explorer-stranger.{end}"));
        let children = (0..IDLE).map(|_| {
            let mut command = Command::new("openssl");
            command.args(["s_client", "-quiet", "-connect", address]);
            command.arg("-cert").arg(own("pem")).arg("-key").arg(own("key"));
            command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
        });
        Self(children.collect())
    }
}

impl Drop for Idle {
    fn drop(&mut self) {
        for child in &mut self.0 {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Ends the bad handshakes, also when a robot is not let in.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn shake_hands_badly(address: &str, is_over: &AtomicBool) {
    while !is_over.load(Ordering::Relaxed) {
        if let Ok(mut stream) = TcpStream::connect(address) {
            let _ = stream.set_read_timeout(Some(Duration::from_millis(5)));
            let _ = stream.write_all(b"\x16\x03\x01 no handshake at all, no handshake at all");
            let _ = stream.read(&mut [0; 16]);
        }
        std::thread::sleep(BAD_EVERY);
    }
}

/// How long robots take until they are answered, one after the other.
async fn enter(endpoint: &str) -> Vec<Duration> {
    let mut took = Vec::new();
    for _ in 0..ROBOTS {
        let begin = Instant::now();
        let session = try_once(config(&shipped("explorer.json5", "explorer-ana", &[], &[endpoint]))).await;
        let session = session.unwrap_or_else(|error| panic!("robot {} is not let in: {error}", took.len() + 1));
        assert!(ask(&session, "fht/maps").await.iter().any(Result::is_ok), "and asks in vain");
        took.push(begin.elapsed());
        session.close().await.unwrap();
    }
    took.sort();
    took
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn bad_handshakes_and_silent_connections_keep_nobody_out() {
    let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
    let address = endpoint.trim_start_matches("tls/");
    let file = in_file(dir.path(), "server", &guarded("server-alone.json5", "server-maps", &[&endpoint]));
    let data = dir.path().join("data");
    let args = ["--data".as_ref(), data.as_os_str(), "--zenoh-config".as_ref(), file.as_os_str()];
    let programs = executable();
    let mut server = Process::start(programs, Role::MapServer, args).unwrap();
    server.wait_until_listening(&format!("tcp/{address}"), PATIENCE).unwrap();

    // The port is open before the server answers.
    let first = try_once(config(&shipped("explorer.json5", "explorer-ana", &[], &[&endpoint]))).await.unwrap();
    let begin = Instant::now();
    while !ask(&first, "fht/maps").await.iter().any(Result::is_ok) {
        assert!(begin.elapsed() < PATIENCE, "the server answers nobody");
    }
    first.close().await.unwrap();

    let is_over = AtomicBool::new(false);
    let bad = std::thread::scope(|scope| {
        scope.spawn(|| shake_hands_badly(address, &is_over));
        let _over = Over(&is_over);
        tokio::task::block_in_place(|| tokio::runtime::Handle::current().block_on(enter(&endpoint)))
    });
    let idle = Idle::connect(address);
    let silent = enter(&endpoint).await;
    drop(idle);
    eprintln!("median beside bad handshakes {:?}, beside silent connections {:?}", bad[ROBOTS / 2], silent[ROBOTS / 2]);
    let Err(ProcessError::Late { stderr, .. }) = server.finish(Duration::ZERO) else { panic!("the server has ended") };
    assert!(stderr.contains("failed TLS handshake(s)"), "{stderr}");
}
