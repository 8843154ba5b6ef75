//! What a certificate of the site that is in no list can do to its routers, and to who is connected
//! to them: routers and server as in `deploy/`, as processes; the attacker is a Zenoh session.

use crate::programs::{executable, start};
use crate::site::{
    MOMENT, PATIENCE, ask, author, config, free_endpoint, guarded, in_file, make_certificates, put, shipped,
    shipped_with, try_once, write,
};
use fht_demo::{Process, Role};
use fht_proto::api::reply::Head;
use fht_session::SessionConfig;
use fht_tests::router;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use zenoh::Session;

/// So long the server's questions may take, whoever else is there.
const SOON: Duration = Duration::from_secs(2);

/// Three routers, each connected to the others, and the map-server at the first.
struct Routers {
    dir: TempDir,
    endpoints: Vec<String>,
    /// By their places in the list of endpoints.
    routers: Vec<Process>,
    _server: Process,
}

impl Routers {
    async fn start() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let endpoints: Vec<String> = (0..3).map(|_| free_endpoint()).collect();
        let routers = (0..3).map(|at| start_router(dir.path(), &endpoints, at)).collect();
        let all: Vec<&str> = endpoints.iter().map(String::as_str).collect();
        let file = in_file(dir.path(), "server", &shipped("server.json5", "server-maps", &[], &all));
        let data = dir.path().join("data");
        let args = ["--data".as_ref(), data.as_os_str(), "--zenoh-config".as_ref(), file.as_os_str()];
        let server = start(Role::MapServer, args);
        let site = Self { dir, endpoints, routers, _server: server };
        let ana = site.robot("explorer", "explorer-ana", &[0]).await;
        write(&ana, "ana", 1).await;
        ana.close().await.unwrap();
        site
    }

    /// A session of the fleet, which knows the routers at these places.
    async fn robot(&self, role: &str, own: &str, at: &[usize]) -> Session {
        let endpoints: Vec<&str> = at.iter().map(|&at| self.endpoints[at].as_str()).collect();
        let text = shipped(&format!("{role}.json5"), own, &[], &endpoints);
        let file = in_file(self.dir.path(), &format!("{own}-{at:?}"), &text);
        fht_session::open(&SessionConfig::from_options(Vec::new(), Some(file))).await.unwrap()
    }

    /// A session with a certificate that no list has, with further options.
    async fn stranger(&self, mode: &str, at: &[usize], options: &[(&str, String)]) -> Result<Session, zenoh::Error> {
        let endpoints: Vec<&str> = at.iter().map(|&at| self.endpoints[at].as_str()).collect();
        let mut config = config(&shipped("explorer.json5", "explorer-stranger", &[], &endpoints));
        for (key, value) in [
            ("mode", format!("{mode:?}")),
            ("connect/timeout_ms", "0".to_owned()),
            ("listen/endpoints", "[]".to_owned()),
        ] {
            config.insert_json5(key, &value).unwrap();
        }
        for (key, value) in options {
            config.insert_json5(key, value).unwrap();
        }
        zenoh::open(config).await
    }
}

/// Like `zenohd -e`, with each other router.
fn start_router(dir: &Path, endpoints: &[String], at: usize) -> Process {
    let own = ["router-a", "router-b", "router-c"][at];
    let file = in_file(dir, own, &guarded("router.json5", own, &[&endpoints[at]]));
    let mut command = Command::new(executable());
    command.args(["role", router::NAME, "--", "-c"]).arg(file);
    for (_, other) in endpoints.iter().enumerate().filter(|(other, _)| *other != at) {
        command.args(["-e", other]);
    }
    let mut router = Process::run(router::NAME, command).unwrap();
    router.wait_until_listening(&endpoints[at].replace("tls/", "tcp/"), PATIENCE).unwrap();
    router
}

/// How many of five questions are answered soon.
async fn answered(robot: &Session) -> usize {
    let mut answered = 0;
    for _ in 0..5 {
        let replies = tokio::time::timeout(SOON, ask(robot, "fht/museum/head")).await.unwrap_or_default();
        answered += usize::from(replies.iter().any(Result::is_ok));
    }
    answered
}

/// The first head that a robot is told; how long that took.
async fn answered_after(robot: &Session, patience: Duration) -> (Head, Duration) {
    let begin = Instant::now();
    loop {
        let replies = tokio::time::timeout(SOON, ask(robot, "fht/museum/head")).await.unwrap_or_default();
        if let Some(head) = replies.into_iter().find_map(Result::ok) {
            return (serde_json::from_slice(&head).unwrap(), begin.elapsed());
        }
        assert!(begin.elapsed() < patience, "no answer within {patience:?}");
        tokio::time::sleep(MOMENT / 4).await;
    }
}

/// What a router weighs its own links with is what it says; strangers may say so, too.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stranger_in_mode_router_draws_nothing_that_goes_between_the_routers() {
    let site = Routers::start().await;
    let tug = site.robot("client", "client-tug", &[1]).await;
    let ana = site.robot("explorer", "explorer-ana", &[2]).await;
    assert_eq!((answered(&tug).await, answered(&ana).await), (5, 5));
    let mut weights = Vec::new();
    for at in 0..3 {
        let session = site.robot("operator", "operator-desk", &[at]).await;
        let ids = session.info().routers_zid().await.map(|id| format!("{{dst_zid: '{id}', weight: 1}}"));
        weights.extend(ids);
        session.close().await.unwrap();
    }
    assert_eq!(weights.len(), 3);
    let option = ("routing/router/linkstate/transport_weights", format!("[{}]", weights.join(",")));
    let stranger = site.stranger("router", &[0, 1, 2], &[option]).await.unwrap();
    let begin = Instant::now();
    while stranger.info().routers_zid().await.count() < 3 {
        assert!(begin.elapsed() < PATIENCE, "the attacker is at all routers");
        tokio::time::sleep(MOMENT / 4).await;
    }
    // Routers compute their ways anew a moment after a change.
    tokio::time::sleep(SOON).await;
    assert_eq!((answered(&tug).await, answered(&ana).await), (5, 5), "questions go from router to router");
    let heard = tug.declare_subscriber("fht/museum/inc/**").await.unwrap();
    tokio::time::sleep(MOMENT).await;
    put(&ana, "ana", "ana", 2).await;
    let sample = tokio::time::timeout(PATIENCE, heard.recv_async()).await.expect("an increment").unwrap();
    assert!(sample.key_expr().as_str().contains(&author("ana").to_string()));
    stranger.close().await.unwrap();
}

/// Every reply tells the server's id. A router takes one session of each id.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_whose_id_somebody_else_has_taken_goes_on_with_another() {
    let mut site = Routers::start().await;
    let tug = site.robot("client", "client-tug", &[1]).await;
    let replies = tug.get("fht/museum/head").await.unwrap();
    let id = replies.recv_async().await.unwrap().replier_id().unwrap().zid();
    let mut taken = Vec::new();
    for at in [1, 2] {
        taken.push(site.stranger("client", &[at], &[("id", format!("\"{id}\""))]).await.unwrap());
    }
    site.routers[0].kill().unwrap();
    let (before, took) = answered_after(&tug, Duration::from_secs(30)).await;
    eprintln!("answered again after {took:?}");
    // It serves as before: what is written is stored, and its own.
    let ana = site.robot("explorer", "explorer-ana", &[2]).await;
    assert!(write(&ana, "ana", 2).await.version > before.version);
    for session in taken {
        session.close().await.unwrap();
    }
}

/// A frozen process keeps its connections, and its kernel takes new ones.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_frozen_router_costs_less_than_fifteen_seconds() {
    let site = Routers::start().await;
    // The server is at the first router, too.
    let tug = site.robot("client", "client-tug", &[0, 1, 2]).await;
    assert_eq!(answered(&tug).await, 5);
    let signal = |name: &str| {
        let id = site.routers[0].id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    };
    signal("-STOP");
    tokio::time::sleep(MOMENT).await;
    let (_, took) = answered_after(&tug, Duration::from_secs(15)).await;
    eprintln!("answered again after {took:?}");
    signal("-CONT");
}

/// With the steps of the README, which the robots that stay survive.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_renewed_authority_lets_in_everybody_but_the_revoked() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("certificates");
    let make = |args: &str| {
        let made = make_certificates(&out, &args.split(' ').collect::<Vec<_>>());
        assert!(made.status.success(), "{args}: {}", String::from_utf8_lossy(&made.stderr));
    };
    let members = ["router a localhost 127.0.0.1", "explorer ana"];
    for args in ["authority", "explorer gone"].into_iter().chain(members) {
        make(args);
    }
    make("renew-authority");
    members.into_iter().for_each(make);
    let enters = async |own: &str, endpoint: &str| {
        let text = shipped_with(&out, "explorer.json5", own, &[], &[endpoint]);
        try_once(config(&text)).await.is_ok()
    };
    for (router, is_over) in [("old/router-a", false), ("router-a", false), ("router-a", true)] {
        if is_over {
            make("finish-authority");
        }
        let endpoint = free_endpoint();
        let text = shipped_with(&out, "router.json5", router, &[&endpoint], &[]);
        let session = zenoh::open(config(&text)).await.unwrap();
        assert!(enters("explorer-ana", &endpoint).await, "{router}");
        assert_eq!(enters("old/explorer-gone", &endpoint).await, !is_over, "{router}");
        session.close().await.unwrap();
    }
}
