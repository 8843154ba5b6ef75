//! Who is no viewer, or a bad one: pages that may not connect, bytes that make no sense, those who
//! say nothing, those who take nothing, too many of them, and those without a certificate. The
//! others see the map meanwhile.
#![allow(clippy::unwrap_used)] // tests may panic

mod support;

use futures_util::{SinkExt, StreamExt};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use serde_json::{Value, json};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};
use support::{Bridge, Site, drive, node};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

const PATIENCE: Duration = Duration::from_secs(90);

async fn connect(address: SocketAddr, fields: &[(&'static str, &str)]) -> Result<WebSocketStream<TcpStream>, Error> {
    let stream = TcpStream::connect(address).await?;
    shake_hands(stream, &format!("ws://{address}/"), fields).await
}

async fn shake_hands<S: AsyncRead + AsyncWrite + Unpin>(
    stream: S,
    url: &str,
    fields: &[(&'static str, &str)],
) -> Result<WebSocketStream<S>, Error> {
    let mut request = url.into_client_request()?;
    let offer = ("sec-websocket-protocol", "foxglove.sdk.v1");
    for (name, value) in [offer].iter().chain(fields) {
        request.headers_mut().insert(*name, value.parse().unwrap());
    }
    Ok(client_async(request, stream).await?.0)
}

/// The status that says why there is no WebSocket.
fn status<S>(outcome: Result<WebSocketStream<S>, Error>) -> u16 {
    match outcome {
        Ok(_) => 101,
        Err(Error::Http(response)) => response.status().as_u16(),
        Err(error) => panic!("{error}"),
    }
}

/// A viewer that has been greeted, and subscribes to the map.
async fn viewer(bridge: &Bridge) -> WebSocketStream<TcpStream> {
    let mut socket = connect(bridge.address(), &[]).await.unwrap();
    let subscribe = json!({ "op": "subscribe", "subscriptions": [{ "id": 7, "channelId": 1 }] });
    socket.send(Message::text(subscribe.to_string())).await.unwrap();
    socket
}

/// Reads until a message satisfies `is_it`.
async fn hears<S>(socket: &mut WebSocketStream<S>, is_it: impl Fn(&Message) -> bool) -> bool
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let look = async {
        while let Some(Ok(message)) = socket.next().await {
            if is_it(&message) {
                return true;
            }
        }
        false
    };
    timeout(PATIENCE, look).await.unwrap_or_default()
}

fn tells_of(message: &Message, id: &str) -> bool {
    matches!(message, Message::Binary(bytes) if bytes.windows(id.len()).any(|window| window == id.as_bytes()))
}

fn says(message: &Message, op: &str) -> Option<Value> {
    let Message::Text(text) = message else { return None };
    serde_json::from_str::<Value>(text).ok().filter(|value| value["op"] == op)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn only_known_pages_may_connect() {
    let site = Site::with(2).await;
    let bridge = site.bridge(&["--origin", "https://viewer.example"]);
    let with = |fields: Vec<(&'static str, &'static str)>| {
        let address = bridge.address();
        async move { status(connect(address, &fields).await) }
    };
    assert_eq!(with(vec![]).await, 101);
    assert_eq!(with(vec![("origin", "https://viewer.example")]).await, 101);
    assert_eq!(with(vec![("origin", "https://evil.example")]).await, 403);
    assert_eq!(with(vec![("host", "evil.example")]).await, 421);
    assert_eq!(with(vec![("sec-websocket-protocol", "chat")]).await, 400);

    // What is no WebSocket at all.
    for request in ["GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "\0\0\0\0", "GET "] {
        let mut stream = TcpStream::connect(bridge.address()).await.unwrap();
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        // It is closed, or was never open.
        let _ = timeout(PATIENCE, stream.read_to_end(&mut answer)).await.expect("an end");
        assert!(!answer.starts_with(b"HTTP/1.1 101"));
    }
    assert_eq!(with(vec![]).await, 101);
    drop(bridge);
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_makes_no_sense_harms_nobody() {
    let mut site = Site::with(3).await;
    let bridge = site.bridge(&[]);
    let mut good = viewer(&bridge).await;
    assert!(hears(&mut good, |message| tells_of(message, "node 0000000a.2")).await);

    let mut bad = connect(bridge.address(), &[]).await.unwrap();
    let texts = ["", "{", "[1]", r#"{"op":"subscribe"}"#, r#"{"op":"setParameters","parameters":[]}"#];
    for text in texts {
        bad.send(Message::text(text)).await.unwrap();
        assert!(hears(&mut bad, |message| says(message, "status").is_some()).await, "{text}");
    }
    let bytes: [&[u8]; 4] = [&[], &[2], &[9; 40], &[2, 0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 255]];
    for bytes in bytes {
        bad.send(Message::binary(bytes.to_vec())).await.unwrap();
        assert!(hears(&mut bad, |message| says(message, "status").is_some()).await, "{bytes:?}");
    }
    let twice = json!({ "op": "subscribe", "subscriptions": [
        { "id": 1, "channelId": 1 }, { "id": 2, "channelId": 1 },
        { "id": 1, "channelId": 2 }, { "id": 9, "channelId": 99 },
    ]});
    bad.send(Message::text(twice.to_string())).await.unwrap();
    let is_refusal =
        |message: &Message| says(message, "status").is_some_and(|it| it["message"].to_string().contains("3 sub"));
    assert!(hears(&mut bad, is_refusal).await);
    // More questions at a time than may wait.
    let call =
        |number: u8| [&[2, 1, 0, 0, 0, number, 0, 0, 0, 4, 0, 0, 0][..], br#"json{"from":"0,0","to":"2,0"}"#].concat();
    for number in 0..50 {
        bad.send(Message::binary(call(number))).await.unwrap();
    }
    let is_last = |message: &Message| match message {
        Message::Text(_) => says(message, "serviceCallFailure").is_some_and(|it| it["callId"] == 49),
        Message::Binary(bytes) => bytes.first() == Some(&3) && bytes.get(5) == Some(&49),
        _ => false,
    };
    assert!(hears(&mut bad, is_last).await);
    // A message that is too long ends it.
    let _ = bad.send(Message::text("x".repeat(1 << 20))).await;
    let end = timeout(PATIENCE, async { while let Some(Ok(_)) = bad.next().await {} }).await;
    assert!(end.is_ok(), "a message that is too long ends it");

    site.write(drive(3)).await;
    assert!(hears(&mut good, |message| tells_of(message, "node 0000000a.3")).await, "the others do not notice");
    drop(bridge);
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn too_many_viewers_are_turned_away_and_who_says_nothing_makes_room() {
    let site = Site::with(2).await;
    let bridge = site.bridge(&["--max-viewers", "3"]);
    let viewers = [viewer(&bridge).await, viewer(&bridge).await];
    let mut silent = TcpStream::connect(bridge.address()).await.unwrap();
    let refused = connect(bridge.address(), &[]).await;
    assert!(refused.is_err(), "there is no room");
    let mut rest = Vec::new();
    let _ = timeout(PATIENCE, silent.read_to_end(&mut rest)).await.expect("who says nothing is given up");
    let begin = Instant::now();
    while connect(bridge.address(), &[]).await.is_err() {
        assert!(begin.elapsed() < PATIENCE, "there is room again");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    drop((viewers, bridge));
    site.end().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_takes_nothing_keeps_nobody_waiting_and_nothing_in_memory() {
    let mut site = Site::with(2).await;
    // A map of more than the buffers of the system hold, that changes as a whole.
    let many = 6000;
    let put = |shift: f64| -> Vec<Vec<fht_proto::Op>> {
        let pose = |number: u32| {
            fht_proto::FixedPose::from_metres(f64::from(number % 100), f64::from(number / 100) + shift, 0.0)
        };
        let op = |number: u32| fht_proto::Op::PutNode {
            id: node(number),
            kind: fht_proto::NodeKind::Support,
            pose: pose(number),
        };
        (2..many).map(op).collect::<Vec<_>>().chunks(1500).map(<[_]>::to_vec).collect()
    };
    for ops in put(5.0) {
        site.write(ops).await;
    }
    let bridge = site.bridge(&[]);
    let mut good = viewer(&bridge).await;
    let last = format!("node {}", node(many - 1));
    assert!(hears(&mut good, |message| tells_of(message, &last)).await);
    let slow: Vec<WebSocketStream<TcpStream>> = futures_util::future::join_all((0..8).map(|_| viewer(&bridge))).await;
    let before = bridge.memory_kib();
    for step in 0..20 {
        for ops in put(6.0 + f64::from(step)) {
            site.write(ops).await;
        }
        assert!(hears(&mut good, |message| tells_of(message, &last)).await, "the others are told at once");
    }
    let after = bridge.memory_kib();
    println!("8 viewers that take nothing: {before} KiB, after the whole map has changed 20 times {after} KiB");
    assert!(after < before + 100_000, "{before} KiB, then {after} KiB");
    drop((slow, bridge));
    site.end().await;
}

fn make(folder: &Path, arguments: &[&str]) {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/make-certificates.sh");
    let out = folder.to_str().unwrap();
    let made = Command::new("sh").arg(script).args(["--out", out, "--no-passphrase"]).args(arguments).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

/// The status that somebody gets, who shows a certificate if there is one.
async fn secured(bridge: &Bridge, folder: &Path, who: Option<&str>) -> u16 {
    let certificates = |file: PathBuf| CertificateDer::pem_file_iter(file).unwrap().map(Result::unwrap);
    let mut roots = RootCertStore::empty();
    certificates(folder.join("ca.pem")).for_each(|authority| roots.add(authority).unwrap());
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let builder = builder.with_root_certificates(roots);
    let config = match who {
        None => builder.with_no_client_auth(),
        Some(name) => {
            let chain = certificates(folder.join(format!("{name}.pem"))).collect();
            let key = PrivateKeyDer::from_pem_file(folder.join(format!("{name}.key"))).unwrap();
            builder.with_client_auth_cert(chain, key).unwrap()
        }
    };
    let stream = TcpStream::connect(bridge.address()).await.unwrap();
    let name = ServerName::try_from("localhost").unwrap();
    let stream = TlsConnector::from(Arc::new(config)).connect(name, stream).await.unwrap();
    status(shake_hands(stream, &format!("ws://localhost:{}/", bridge.address().port()), &[]).await)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_a_certificate_nobody_is_let_in_from_elsewhere() {
    let site = Site::with(2).await;
    let open = Command::new(env!("CARGO_BIN_EXE_foxglove-bridge"))
        .args(["--listen", "0.0.0.0:0", "--connect", &site.endpoint])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&open.stderr);
    assert!(open.status.code() == Some(2) && said.contains("--certificate"), "{said}");

    let folder = site.dir.path().join("tls");
    std::fs::create_dir(&folder).unwrap();
    make(&folder, &["authority"]);
    make(&folder, &["server", "maps", "localhost"]);
    make(&folder, &["client", "tug"]);
    let file = |name: &str| folder.join(name).display().to_string();
    let (certificate, key, authority) = (file("server-maps.pem"), file("server-maps.key"), file("ca.pem"));
    let files = ["--certificate", &certificate, "--key", &key, "--authority", &authority];
    let bridge = site.bridge(&files);
    assert!(bridge.url.starts_with("wss://"), "{}", bridge.url);
    assert_eq!(secured(&bridge, &folder, None).await, 401);
    assert_eq!(secured(&bridge, &folder, Some("client-tug")).await, 101);
    drop(bridge);
    site.end().await;
}
