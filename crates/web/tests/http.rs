//! The HTTP interface without maps behind it: questions arrive as they do over Zenoh, the page is
//! served under a strict policy, and whoever is hostile is refused or bounded.
#![allow(clippy::unwrap_used)] // tests may panic

mod support;

use fht_web::{MapChange, WebError, WebEvent};
use std::net::TcpListener;
use std::time::{Duration, Instant};
use support::{Served, exchange, posted};
use tokio::io::{AsyncReadExt, AsyncWriteExt};

const JSON: &str = "Content-Type: application/json\r\n";
const UNDO: &str = r#"{"op":"undo"}"#;

fn operated() -> Served {
    Served::start(|config| config.operator = Some("ada".parse().unwrap()))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn questions_arrive_as_they_are_written_for_zenoh_or_by_browsers() {
    let site = Served::start(|_| {});
    assert_eq!(site.get("/fht/maps").await.body, r#""Maps""#);
    let zenohs = site.get("/fht/museum/path?from=0,0;to=K%C3%BCche").await;
    let browsers = site.get("/fht/museum/path?from=0%2C0&to=K%C3%BCche").await;
    assert!(zenohs.status == 200 && zenohs.body.contains("Named(Label(\\\"Küche\\\"))"), "{zenohs:?}");
    assert_eq!(zenohs.body, browsers.body);
    for (path, status, said) in [
        ("/fht/louvre/head", 404, "there is no map louvre"),
        ("/fht/museum/path?from=0,0", 400, "parameter to is missing"),
        ("/fht/museum/path?from=0,0;to=", 400, "parameter to is empty"),
        ("/fht/museum/path?from=0,0;to=1,1;colour=red", 400, "unknown parameter colour"),
        ("/fht/museum/since?piece_bytes=100", 400, "over HTTP there is one reply"),
        ("/fht/museum/dance", 404, "no question"),
        ("/fht/mu%20seum/head", 404, "no question"),
        ("/fht/museum/admin/retain", 404, "nothing is here"),
        ("/etc/passwd", 404, "nothing is here"),
        ("/page/../Cargo.toml", 404, "nothing is here"),
        ("/page/%2e%2e%2fCargo.toml", 404, "no such file"),
    ] {
        let reply = site.get(path).await;
        assert!(reply.status == status && reply.body.contains(said), "{path}: {reply:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_page_is_served_under_a_strict_policy() {
    let site = Served::start(|_| {});
    let page = site.get("/").await;
    assert!(page.status == 200 && page.body.contains("/page/main.js"), "{page:?}");
    for path in ["/", "/page/main.js", "/fht/maps", "/nowhere"] {
        let head = site.get(path).await.head;
        for field in [
            "content-security-policy: default-src 'none'; script-src 'self';",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "x-frame-options: deny",
            "cross-origin-resource-policy: same-origin",
        ] {
            assert!(head.contains(field), "{path}: {head}");
        }
        assert!(!head.contains("unsafe") && !head.contains("access-control-allow"), "{head}");
    }
    let me = site.get("/api/me").await;
    assert_eq!(me.body, r#"{"rights":"look"}"#);
    let other = site.get("/api/change/museum").await;
    assert!(other.status == 405 && other.body.contains("is a POST"), "{other:?}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_operator_changes_maps_from_the_page_and_nobody_from_elsewhere() {
    let site = operated();
    assert_eq!(site.get("/api/me").await.body, r#"{"name":"ada","role":"operator","rights":"change"}"#);
    let change = async |fields: &str, body: &str| site.post("/api/change/museum", fields, body).await;
    for (fields, body, status) in [
        ("", UNDO, 415),
        ("Content-Type: text/plain\r\n", UNDO, 415),
        ("Content-Type: application/x-www-form-urlencoded\r\n", UNDO, 415),
        ("Content-Type: application/json\r\nOrigin: http://evil.example\r\n", UNDO, 403),
        ("Content-Type: application/json\r\nOrigin: null\r\n", UNDO, 403),
        ("Content-Type: application/json\r\nSec-Fetch-Site: cross-site\r\n", UNDO, 403),
        ("Content-Type: application/json\r\nSec-Fetch-Site: same-site\r\nOrigin: http://localhost\r\n", UNDO, 403),
        (JSON, "{", 400),
        (JSON, r#"{"op":"undo","count":"many"}"#, 400),
    ] {
        let reply = change(fields, body).await;
        assert_eq!(reply.status, status, "{fields} {body}: {reply:?}");
    }
    let evil = posted("/api/change/museum", JSON, UNDO).replace("Host: localhost", "Host: evil.example");
    assert_eq!(exchange(site.connect().await, evil.as_bytes()).await.status, 421);
    assert!(site.echo.changes.lock().unwrap().is_empty());

    let from_page = "Content-Type: application/json\r\nOrigin: http://localhost\r\nSec-Fetch-Site: same-origin\r\n";
    assert_eq!(change(from_page, UNDO).await.status, 200);
    assert_eq!(change(JSON, UNDO).await.status, 200, "as curl does");
    let changes = site.echo.changes.lock().unwrap().clone();
    assert!(changes.iter().all(|(by, order)| by == "ada" && order.change == MapChange::Undo { count: 1 }));
    assert_eq!(changes.len(), 2);

    let viewer = Served::start(|_| {});
    assert_eq!(viewer.post("/api/change/museum", JSON, UNDO).await.status, 403);
    assert!(viewer.echo.changes.lock().unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_too_long_or_too_slow_is_cut_off() {
    let site = Served::start(|config| {
        config.operator = Some("ada".parse().unwrap());
        config.limits.reading = Duration::from_millis(300);
        config.limits.writing = Duration::from_millis(500);
    });
    let long = format!(r#"{{"op":"undo","x":"{}"}}"#, "x".repeat(70_000));
    let announced = posted("/api/change/museum", JSON, "").replace("Content-Length: 0", "Content-Length: 70000");
    assert_eq!(exchange(site.connect().await, announced.as_bytes()).await.status, 413);
    // Who still sends when the other end closes may miss what it says.
    let is_refused = |status: u16, with: u16| status == with || status == 0;
    let head = "POST /api/change/museum HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
                Transfer-Encoding: chunked\r\nConnection: close\r\n\r\n";
    let chunked = format!("{head}{:x}\r\n{long}\r\n0\r\n\r\n", long.len());
    assert!(is_refused(exchange(site.connect().await, chunked.as_bytes()).await.status, 413));
    let fields = format!("X: {}\r\n", "x".repeat(40_000));
    let head = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{fields}\r\n");
    assert!(is_refused(exchange(site.connect().await, head.as_bytes()).await.status, 431));

    let begin = Instant::now();
    let silent = exchange(site.connect().await, b"GET / HTTP/1.1\r\nHost: local").await;
    assert!(matches!(silent.status, 0 | 408), "{silent:?}");
    let partly = posted("/api/change/museum", JSON, UNDO).replace(UNDO, "{");
    assert_eq!(exchange(site.connect().await, partly.as_bytes()).await.status, 408);
    // Who asks for much and reads nothing.
    let mut deaf = site.connect().await;
    deaf.write_all(b"GET /api/walls/museum HTTP/1.1\r\nHost: localhost\r\n\r\n").await.unwrap();
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut got = Vec::new();
    let _ = deaf.read_to_end(&mut got).await;
    assert!(got.len() < 16 << 20, "{} bytes", got.len());
    assert!(begin.elapsed() < Duration::from_secs(15));
    assert_eq!(site.get("/fht/maps").await.status, 200);
    assert!(site.echo.changes.lock().unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn connections_and_streams_are_bounded_and_given_back() {
    let site = Served::start(|config| {
        config.limits.streams = 2;
        config.limits.connections = 8;
        config.limits.heartbeat = Duration::from_millis(100);
    });
    let mut streams = Vec::new();
    for _ in 0..2 {
        let mut stream = site.connect().await;
        stream.write_all(b"GET /api/events/museum HTTP/1.1\r\nHost: localhost\r\n\r\n").await.unwrap();
        until_read(&mut stream, "event: beat").await;
        streams.push(stream);
    }
    let refused = site.get("/api/events/museum").await;
    assert!(refused.status == 503 && refused.head.contains("retry-after: 10"), "{refused:?}");

    let museum = "museum".parse().unwrap();
    site.hub.publish(Some(&museum), WebEvent::new("head", &"<script>").unwrap());
    for stream in &mut streams {
        until_read(stream, "event: head\ndata: \"<script>\"\n\n").await;
    }
    let idle: Vec<_> = [site.connect().await, site.connect().await, site.connect().await].into_iter().collect();
    let more: Vec<_> = [site.connect().await, site.connect().await, site.connect().await].into_iter().collect();
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(site.get("/fht/maps").await.status, 0, "the ninth is closed at once");
    drop((streams, idle, more));
    let again = async || site.get("/fht/maps").await.status;
    let begin = Instant::now();
    while again().await != 200 && begin.elapsed() < Duration::from_secs(10) {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    assert_eq!(again().await, 200);
    let figures = site.get("/metrics").await.body;
    assert!(figures.contains("fht_http_event_streams 0\n"), "{figures}");
}

async fn until_read(stream: &mut tokio::net::TcpStream, expected: &str) {
    let (mut text, mut bytes) = (String::new(), [0; 4096]);
    while !text.contains(expected) {
        let read = tokio::time::timeout(Duration::from_secs(10), stream.read(&mut bytes)).await.unwrap().unwrap();
        assert!(read > 0, "the stream has ended: {text}");
        text.push_str(&String::from_utf8_lossy(&bytes[..read]));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn figures_are_in_prometheus_form() {
    let site = Served::start(|_| {});
    assert_eq!(site.get("/fht/maps").await.status, 200);
    let reply = site.get("/metrics").await;
    assert!(reply.head.contains("content-type: text/plain; version=0.0.4"), "{reply:?}");
    for line in [
        "# TYPE fht_map_version gauge",
        "fht_map_version{map=\"museum\"} 3",
        "fht_map_refused_increments_total{map=\"museum\"} 4",
        "fht_queries_total{topic=\"path\",outcome=\"busy\"} 1",
        "# TYPE fht_query_duration_seconds histogram",
        "fht_query_duration_seconds_bucket{topic=\"path\",le=\"+Inf\"} 6",
        "fht_query_duration_seconds_count{topic=\"path\"} 6",
        "fht_http_requests_total{route=\"ask\",status=\"2xx\"} 1",
        "fht_server_read_only 0",
    ] {
        assert!(reply.body.lines().any(|known| known == line), "{line}\n{}", reply.body);
    }
}

#[test]
fn strangers_are_not_let_in_by_mistake() {
    let bind = |address: &str| {
        fht_web::WebListener::bind(&fht_web::WebConfig::at(address.parse().unwrap())).map(|listener| listener.url())
    };
    for address in ["0.0.0.0:0", "[::]:0", "192.0.2.1:8080"] {
        let said = bind(address).unwrap_err();
        assert!(matches!(said, WebError::Exposed { .. }) && said.to_string().contains("--web-certificate"), "{said}");
    }
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let said = bind(&taken.local_addr().unwrap().to_string()).unwrap_err();
    assert!(matches!(said, WebError::Listen { .. }) && !said.is_input(), "{said}");
}
