//! A site for tests: certificates from the script, and the files of `deploy/` with their paths and
//! endpoints replaced.
#![allow(dead_code, clippy::unwrap_used)] // every test program uses a part of it; tests may panic

use fht_proto::api::keys::Key;
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, encode};
use fht_session::SessionConfig;
use map_server::access::{Roles, configuration, object, parse};
use map_server::{ServerConfig, ServerEndpoints, ServerError};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use zenoh::handlers::DefaultHandler;
use zenoh::session::SessionGetBuilder;
use zenoh::{Config, Session};

pub const PATIENCE: Duration = Duration::from_secs(20);
/// Long enough on loopback for a message that is let through.
pub const MOMENT: Duration = Duration::from_millis(400);
/// The placeholders in the files.
const OWN: &str = "/etc/fht-map/tls/own";
const AUTHORITY: &str = "/etc/fht-map/tls/ca.pem";
const ROUTERS: &str = r#"["tls/router-a:7447", "tls/router-b:7447", "tls/router-c:7447"]"#;
const LISTEN: &str = r#"["tls/[::]:7447"]"#;

pub fn deploy(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy").join(file)
}

pub fn read(file: &str) -> String {
    std::fs::read_to_string(deploy(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The words after `command` of the README's command that begins with it. It may go on in the next
/// line.
pub fn readme_command(command: &str) -> Vec<String> {
    let readme = read("README.md").replace("\\\n", " ");
    let found = readme.lines().find_map(|line| line.strip_prefix(command));
    let words = found.unwrap_or_else(|| panic!("the README has no command {command}"));
    words.split_whitespace().map(str::to_owned).collect()
}

/// Runs the README's commands that make certificates, unchanged, in `folder`.
pub fn make_certificates_of_the_readme(folder: &Path) {
    let readme = read("README.md");
    let commands: Vec<&str> = readme.lines().filter(|line| line.starts_with("./make-certificates.sh ")).collect();
    assert!(commands.len() >= 7, "{commands:?}");
    for command in commands {
        let mut words = command.split_whitespace();
        let script = deploy(words.next().unwrap().trim_start_matches("./")).canonicalize().unwrap();
        let output = Command::new("sh").arg(script).args(words).current_dir(folder).output().unwrap();
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// Runs the script with `args` after `--out DIR`.
pub fn make_certificates(out: &Path, args: &[&str]) -> Output {
    Command::new("sh").arg(deploy("make-certificates.sh")).arg("--out").arg(out).args(args).output().unwrap()
}

fn made(out: &Path, args: &str) {
    let output = make_certificates(out, &args.split(' ').collect::<Vec<_>>());
    assert!(output.status.success(), "{args}: {}", String::from_utf8_lossy(&output.stderr));
}

/// An authority, and one certificate for each member of the fleet, made once for all tests of a
/// program.
pub fn certificates() -> &'static Path {
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    let dir = MADE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        for args in [
            "authority",
            "router a localhost 127.0.0.1",
            "router b localhost 127.0.0.1",
            "router c localhost 127.0.0.1",
            "server maps localhost 127.0.0.1",
            "explorer ana",
            "explorer ben",
            "client tug",
            "operator desk",
        ] {
            made(dir.path(), args);
        }
        // Another site's certificate, and one of ours that is in nobody's list.
        made(&dir.path().join("elsewhere"), "authority");
        made(&dir.path().join("elsewhere"), "explorer ana");
        made(dir.path(), "explorer stranger");
        dir
    });
    dir.path()
}

pub fn fleet() -> Roles {
    parse("{routers: ['a', 'b', 'c'], servers: ['maps'], explorers: ['ana', 'ben'], clients: ['tug'], operators: ['desk']}")
        .unwrap()
}

/// A loopback endpoint that nobody else gets.
pub fn free_endpoint() -> String {
    format!("tls/{}", fht_reserved_port::reserve().unwrap())
}

fn list(endpoints: &[&str]) -> String {
    serde_json::to_string(endpoints).unwrap()
}

/// A file of `deploy/` as on the machine whose certificate is `own` (ROLE-NAME).
pub fn shipped(file: &str, own: &str, listen: &[&str], connect: &[&str]) -> String {
    shipped_with(certificates(), file, own, listen, connect)
}

/// The same with certificates from another folder.
pub fn shipped_with(dir: &Path, file: &str, own: &str, listen: &[&str], connect: &[&str]) -> String {
    let mut text = read(file);
    assert!(text.contains(OWN) && text.contains(AUTHORITY), "{file}");
    text = text.replace(OWN, dir.join(own).to_str().unwrap());
    text = text.replace(AUTHORITY, dir.join("ca.pem").to_str().unwrap());
    text = text.replace(ROUTERS, &list(connect));
    text.replace(LISTEN, &list(listen))
}

/// The same with the fleet's access control, and as that router's own.
pub fn guarded(file: &str, own: &str, listen: &[&str]) -> String {
    configuration(object(&shipped(file, own, listen, &[])).unwrap(), &fleet(), own.strip_prefix("router-")).unwrap()
}

pub fn in_file(dir: &Path, name: &str, text: &str) -> PathBuf {
    let file = dir.join(format!("{name}.json5"));
    std::fs::write(&file, text).unwrap();
    file
}

pub fn config(text: &str) -> Config {
    let dir = tempfile::tempdir().unwrap();
    Config::from_file(in_file(dir.path(), "zenoh", text)).unwrap()
}

/// A session that gives up at once.
pub async fn try_once(mut config: Config) -> Result<Session, zenoh::Error> {
    config.insert_json5("connect/timeout_ms", "0").unwrap();
    config.insert_json5("connect/exit_on_failure", "true").unwrap();
    zenoh::open(config).await
}

/// Two routers and a map-server; the server is at the first, everybody else at the second.
pub struct Site {
    pub endpoint: String,
    routers: Vec<Session>,
    stop: oneshot::Sender<()>,
    server: JoinHandle<Result<(), ServerError>>,
    dir: tempfile::TempDir,
}

impl Site {
    pub async fn start() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let (first, second) = (free_endpoint(), free_endpoint());
        let mut routers = Vec::new();
        for (own, listen, others) in [("router-a", &first, vec![]), ("router-b", &second, vec![first.as_str()])] {
            let mut config = config(&guarded("router.json5", own, &[listen]));
            // Like `zenohd -e`.
            config.insert_json5("connect/endpoints", &list(&others)).unwrap();
            routers.push(zenoh::open(config).await.unwrap());
        }
        let file = in_file(dir.path(), "server", &shipped("server.json5", "server-maps", &[], &[&first]));
        let (stop, server) = serve(&dir.path().join("data"), file);
        let site = Self { endpoint: second, routers, stop, server, dir };
        let asking = site.session("explorer.json5", "explorer-ana").await;
        assert_eq!(mapper::publish::find_head(&asking, &museum(), PATIENCE).await.unwrap(), None);
        asking.close().await.unwrap();
        site
    }

    /// A session with one of the files, as `own`.
    pub async fn session(&self, file: &str, own: &str) -> Session {
        let dir = tempfile::tempdir().unwrap();
        let file = in_file(dir.path(), "session", &shipped(file, own, &[], &[&self.endpoint]));
        fht_session::open(&SessionConfig::from_options(Vec::new(), Some(file))).await.unwrap()
    }

    pub async fn end(self) {
        self.stop.send(()).unwrap();
        self.server.await.unwrap().unwrap();
        for router in self.routers.into_iter().rev() {
            router.close().await.unwrap();
        }
        drop(self.dir);
    }
}

/// A map-server in this process, with the fleet's roles.
pub fn serve(data: &Path, file: PathBuf) -> (oneshot::Sender<()>, JoinHandle<Result<(), ServerError>>) {
    let link = ServerEndpoints { zenoh_config: Some(file), ..ServerEndpoints::default() };
    let (stop, stopped) = oneshot::channel::<()>();
    let writers = Some(fleet().writers().unwrap().into());
    let config = ServerConfig { writers, ..ServerConfig::new(data.to_owned(), link) };
    (stop, tokio::spawn(map_server::run(config, async { _ = stopped.await })))
}

pub fn museum() -> MapName {
    "museum".parse().unwrap()
}

pub fn author(robot: &str) -> AuthorId {
    AuthorId::of_robot(robot)
}

/// Increment `number` of a robot that drives along y = 0.
pub fn increment(robot: &str, number: u64) -> Increment {
    let author = author(robot);
    let id = NodeId { author, number: number as u32 };
    let pose = FixedPose::from_metres(number as f64, 0.0, 0.0);
    Increment { author, number, hlc_us: number, ops: vec![Op::PutNode { id, kind: NodeKind::Support, pose }] }
}

/// Puts `number` of `robot`'s increments under the key of `under`.
pub async fn put(session: &Session, robot: &str, under: &str, number: u64) {
    let key = Key::increment(&museum(), author(under), number).to_string();
    session.put(key, encode(&increment(robot, number)).unwrap()).await.unwrap();
}

/// The replies: payloads, or the reason.
pub async fn ask(session: &Session, selector: &str) -> Vec<Result<Vec<u8>, String>> {
    answers(session.get(selector)).await
}

/// The same, with a payload.
pub async fn ask_with(session: &Session, selector: &str, payload: Vec<u8>) -> Vec<Result<Vec<u8>, String>> {
    answers(session.get(selector).payload(payload)).await
}

async fn answers(question: SessionGetBuilder<'_, '_, DefaultHandler>) -> Vec<Result<Vec<u8>, String>> {
    let replies = question.timeout(Duration::from_secs(3)).await.unwrap();
    let mut found = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        found.push(match reply.result() {
            Ok(sample) => Ok(sample.payload().to_bytes().into_owned()),
            Err(error) => Err(String::from_utf8_lossy(&error.payload().to_bytes()).into_owned()),
        });
    }
    found
}

/// The head of the museum.
pub async fn head(session: &Session) -> Head {
    let payload = ask(session, "fht/museum/head").await.into_iter().find_map(Result::ok).expect("a head");
    serde_json::from_slice(&payload).unwrap()
}

/// Puts as its own author until the head has it.
pub async fn write(session: &Session, robot: &str, number: u64) -> Head {
    let start = Instant::now();
    loop {
        put(session, robot, robot, number).await;
        if let Some(Ok(payload)) = ask(session, "fht/museum/head").await.into_iter().next() {
            let head: Head = serde_json::from_slice(&payload).unwrap();
            if head.vector.get(author(robot)) >= number {
                return head;
            }
        }
        assert!(start.elapsed() < PATIENCE, "{robot} cannot write");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}
