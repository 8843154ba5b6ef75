//! Clients that wait for their routers, on loopback.

use fht_session::{ConnectError, open_configured, without_source_paths};
use std::net::TcpListener;
use std::time::{Duration, Instant};
use zenoh::Config;

fn free_endpoint() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    format!("tcp/{}", listener.local_addr().expect("an address"))
}

fn config(mode: &str, listen: &[&str], connect: &[&str]) -> Config {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", format!("{mode:?}")),
        ("listen/endpoints", format!("{listen:?}")),
        ("connect/endpoints", format!("{connect:?}")),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).expect("accepted");
    }
    config
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_tries_all_its_endpoints() {
    let (dead, late) = (free_endpoint(), free_endpoint());
    let client = tokio::spawn(open_configured(config("client", &[], &[&dead, &late]), None));
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert!(!client.is_finished(), "nobody is there yet");
    let router = open_configured(config("router", &[&late], &[]), None).await.expect("a router");
    let client = tokio::time::timeout(Duration::from_secs(30), client).await.expect("no end");
    let client = client.expect("no panic").expect("a session");
    client.close().await.expect("closed");
    router.close().await.expect("closed");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn patience_ends_with_the_reason() {
    let endpoints = [free_endpoint(), free_endpoint()];
    let texts: Vec<&str> = endpoints.iter().map(String::as_str).collect();
    let begin = Instant::now();
    let error =
        open_configured(config("client", &[], &texts), Some(Duration::from_millis(400))).await.expect_err("nobody");
    assert!(begin.elapsed() < Duration::from_secs(30));
    let ConnectError::Refused { reason, .. } = error else { panic!("{error}") };
    assert!(endpoints.iter().all(|endpoint| reason.contains(endpoint)), "{reason}");
    assert!(reason.contains("nobody listens there") && reason == without_source_paths(&reason), "{reason}");
}
