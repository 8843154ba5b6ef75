//! Traces of queries: a collector that is not ours understands them, and one that is away or slow
//! costs nobody an answer.

use crate::support::{ANA, Server, ask, bytes, client, free_endpoint, head_when, key, until_up};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Prints a line for each span of the requests, whose lengths and bytes come on standard input.
const READER: &str = "
import json, struct, sys
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
while head := sys.stdin.buffer.read(4):
    request = ExportTraceServiceRequest.FromString(sys.stdin.buffer.read(struct.unpack('>I', head)[0]))
    for of in request.resource_spans:
        service = {it.key: it.value.string_value for it in of.resource.attributes}['service.name']
        for span in (span for scope in of.scope_spans for span in scope.spans):
            print(json.dumps({
                'service': service, 'name': span.name, 'trace': span.trace_id.hex(), 'id': span.span_id.hex(),
                'parent': span.parent_span_id.hex(), 'begin': span.start_time_unix_nano,
                'end': span.end_time_unix_nano, 'status': span.status.code,
                'is': {it.key: it.value.string_value for it in span.attributes}}))
";
const PATIENCE: Duration = Duration::from_secs(60);

/// A server that exports as `environment` says.
fn traced(folder: &Path, endpoint: &str, environment: &[(&str, &str)]) -> Server {
    Server::in_environment(&folder.join("data"), endpoint, &[], environment, &folder.join("log"))
}

/// Takes requests over HTTP, and hands on their bodies.
fn collector() -> (String, Receiver<Vec<u8>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("http://{}", listener.local_addr().unwrap());
    let (sender, bodies) = channel();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let _ = sender.send(take(stream));
        }
    });
    (endpoint, bodies)
}

fn take(stream: TcpStream) -> Vec<u8> {
    let mut reader = BufReader::new(stream);
    let (mut head, mut length) = (String::new(), 0);
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).unwrap();
        if let Some((_, value)) = line.split_once(':').filter(|(name, _)| name.eq_ignore_ascii_case("content-length")) {
            length = value.trim().parse().unwrap();
        }
        if line.trim().is_empty() {
            break;
        }
        head += &line;
    }
    assert!(head.starts_with("POST /v1/traces HTTP/1.1\r\n"), "{head}");
    assert!(head.to_lowercase().contains("content-type: application/x-protobuf"), "{head}");
    let mut body = vec![0; length];
    reader.read_exact(&mut body).unwrap();
    reader
        .get_mut()
        .write_all(b"HTTP/1.1 200 OK\r\nContent-Type: application/x-protobuf\r\nContent-Length: 0\r\n\r\n")
        .unwrap();
    body
}

/// What somebody else reads in them.
fn spans(bodies: &[Vec<u8>]) -> Vec<Value> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("opentelemetry-proto");
    let python = crate::packages::environment(&folder, &["opentelemetry-proto==1.30.0"]).join("python");
    let mut reader =
        Command::new(python).args(["-c", READER]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = reader.stdin.take().unwrap();
    for body in bodies {
        input.write_all(&u32::try_from(body.len()).unwrap().to_be_bytes()).unwrap();
        input.write_all(body).unwrap();
    }
    drop(input);
    let output = reader.wait_with_output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_query_is_one_trace_with_what_came_of_it() {
    let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
    let (collector, bodies) = collector();
    let environment = [("OTEL_EXPORTER_OTLP_ENDPOINT", collector.as_str()), ("OTEL_BSP_SCHEDULE_DELAY", "100")];
    let mut server = traced(dir.path(), &endpoint, &environment);
    let session = client(&endpoint).await;
    until_up(&session).await;
    for number in 1..=6 {
        session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
    }
    head_when(&session, |head| head.version == 6).await;
    assert!(ask(&session, "fht/museum/path?from=0,0;to=5,0").await[0].is_ok());
    assert!(ask(&session, "fht/museum/diff?from=2").await[0].is_ok());
    assert!(ask(&session, "fht/louvre/rules").await[0].is_err());
    assert!(ask(&session, "fht/museum/admin/retain?keep=1000").await[0].is_ok());

    // A query's span is sent after those of its steps.
    let mut all = Vec::new();
    for asked in ["museum/head", "path?from=0,0;to=5,0", "museum/diff?from=2", "louvre/rules", "admin/retain?keep"] {
        let has = |body: &Vec<u8>| body.windows(asked.len()).any(|bytes| bytes == asked.as_bytes());
        while !all.iter().any(has) {
            all.push(bodies.recv_timeout(PATIENCE).unwrap_or_else(|error| panic!("{asked}: {error}")));
        }
    }
    assert_eq!(server.terminate(), Some(0));
    let spans = spans(&all);
    let mut traces: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    spans.iter().for_each(|span| traces.entry(span["trace"].as_str().unwrap()).or_default().push(span));
    for (name, asked, map, outcome, steps) in [
        ("head", "fht/museum/head", "museum", "answered", &["compute", "reply"][..]),
        ("path", "fht/museum/path?from=0,0;to=5,0", "museum", "answered", &["compute", "reply"][..]),
        ("diff", "fht/museum/diff?from=2", "museum", "answered", &["compute", "reply", "wait"][..]),
        ("rules", "fht/louvre/rules", "louvre", "refused", &["compute", "reply", "wait"][..]),
    ] {
        let is_asked = |span: &Value| span["parent"] == "" && span["is"]["fht.asked"] == asked;
        let is_root = |span: &&&Value| is_asked(span) && span["is"]["fht.outcome"] == outcome;
        let of = traces
            .values()
            .find(|spans| spans.iter().any(|span| is_root(&span)))
            .unwrap_or_else(|| panic!("{asked}: {spans:?}"));
        let root = of.iter().find(is_root).unwrap();
        let is = &root["is"];
        assert_eq!((root["name"].as_str(), root["service"].as_str()), (Some(name), Some("map-server")));
        assert_eq!((is["fht.map"].as_str(), is["fht.outcome"].as_str()), (Some(map), Some(outcome)), "{root}");
        assert_eq!(is["fht.over"], "zenoh");
        let mut names: Vec<&str> =
            of.iter().filter(|span| span["parent"] == root["id"]).map(|span| span["name"].as_str().unwrap()).collect();
        names.sort_unstable();
        if ["head", "path"].contains(&name) {
            names.retain(|step| *step != "wait"); // when its mesh is not made yet, or others are first
        }
        assert_eq!(names, steps, "{of:?}");
        let within = |span: &&&Value| {
            span["begin"].as_u64() >= root["begin"].as_u64() && span["end"].as_u64() <= root["end"].as_u64()
        };
        assert!(of.iter().all(|span| within(&span)), "{of:?}");
    }
    let refused = spans.iter().find(|span| span["is"]["fht.outcome"] == "refused").unwrap();
    assert!(refused["is"]["error.type"] == "UNKNOWN_MAP" && refused["status"] == 0, "an asker's mistake: {refused}");
    let order = spans.iter().find(|span| span["name"] == "admin/retain").unwrap();
    assert_eq!(order["is"]["fht.outcome"], "answered");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_collector_that_is_away_or_slow_costs_nobody_an_answer() {
    let away = fht_reserved_port::reserve().unwrap();
    // It accepts, and says nothing.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    for (collector, is_told) in [(away, true), (silent.local_addr().unwrap(), false)] {
        let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
        let collector = format!("http://{collector}");
        let environment = [
            ("OTEL_EXPORTER_OTLP_ENDPOINT", collector.as_str()),
            ("OTEL_BSP_SCHEDULE_DELAY", "50"),
            ("OTEL_BSP_MAX_QUEUE_SIZE", "16"),
        ];
        let mut server = traced(dir.path(), &endpoint, &environment);
        let session = client(&endpoint).await;
        until_up(&session).await;
        let said =
            || std::fs::read_to_string(dir.path().join("log")).unwrap().matches("do not reach their collector").count();
        let begun = Instant::now();
        // Many times what the queue holds.
        for _ in 0..200 {
            assert!(ask(&session, "fht/maps").await[0].is_ok());
        }
        while is_told && said() == 0 {
            assert!(begun.elapsed() < PATIENCE, "nobody was told");
            tokio::time::sleep(Duration::from_millis(50)).await;
            let _ = ask(&session, "fht/maps").await;
        }
        tokio::time::sleep(Duration::from_millis(300)).await;
        assert_eq!(server.terminate(), Some(0), "and it ends");
        assert!(said() <= 1, "once");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_is_exported_unless_it_is_said_where_to_and_in_words_that_are_understood() {
    let nothing: &[(&str, &str)] = &[];
    for (environment, words) in [
        (nothing, None),
        (&[("OTEL_EXPORTER_OTLP_ENDPOINT", "https://collector:4318")][..], Some("must begin with http://")),
    ] {
        let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
        let mut server = traced(dir.path(), &endpoint, environment);
        let session = client(&endpoint).await;
        until_up(&session).await;
        assert_eq!(server.terminate(), Some(0));
        let said = std::fs::read_to_string(dir.path().join("log")).unwrap();
        assert_eq!(said.contains("traces"), words.is_some(), "{said}");
        assert!(words.is_none_or(|words| said.contains(words)), "{said}");
    }
}
