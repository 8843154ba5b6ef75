//! The figures of a server with the page: a reader that is not ours understands them, and the
//! dashboard and the alerts in `deploy/` ask for none that there is not.

use crate::support::{ANA, Server, bytes, client, free_endpoint, head_when, key, until_up};
use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Prints a line for each sample: its name, its labels, its value.
const READER: &str = "
import sys
from prometheus_client.parser import text_string_to_metric_families as families
for family in families(sys.stdin.read()):
    assert family.documentation and family.type in ('gauge', 'counter', 'histogram'), family
    for sample in family.samples:
        print(sample.name, sorted(sample.labels.items()), sample.value)
";

fn deploy(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy").join(file)
}

/// The names that begin as ours do.
fn names_in(text: &str) -> BTreeSet<String> {
    let words = text.split(|letter: char| !(letter.is_ascii_alphanumeric() || letter == '_'));
    words.filter(|word| word.starts_with("fht_")).map(str::to_owned).collect()
}

fn figures(address: SocketAddr) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).unwrap();
    let (head, body) = reply.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200") && head.contains("content-type: text/plain; version=0.0.4"), "{head}");
    body.to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn others_read_the_figures_and_the_dashboard_asks_for_those_that_there_are() {
    let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
    let address = fht_reserved_port::reserve().unwrap();
    let args = ["--web", &address.to_string()];
    let _server = Server::with(&dir.path().join("data"), &endpoint, &args, &dir.path().join("log"));
    let session = client(&endpoint).await;
    until_up(&session).await;
    session.put(key(ANA, 1), bytes(ANA, 1)).await.unwrap();
    head_when(&session, |head| head.version == 1).await;
    // The first one counts itself in the second.
    let _ = figures(address);
    let text = figures(address);

    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("prometheus-client");
    let python = crate::packages::environment(&folder, &["prometheus-client==0.26.0"]).join("python");
    let mut reader =
        Command::new(python).args(["-c", READER]).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    reader.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = reader.wait_with_output().unwrap();
    assert!(output.status.success(), "{text}");
    let samples = String::from_utf8(output.stdout).unwrap();
    assert!(samples.contains("fht_map_version [('map', 'museum')] 1"), "{samples}");
    for line in ["fht_zenoh_sessions [('kind', 'client')] 1", "fht_zenoh_sessions [('kind', 'router')] 0"] {
        assert!(samples.contains(line), "who is connected: {samples}");
    }
    assert!(samples.contains("fht_http_requests_total [('route', 'metrics'), ('status', '2xx')] 1"), "{samples}");
    assert!(samples.contains("('le', '0.05')"), "ends of buckets are numbers that people write: {samples}");

    let there = names_in(&samples);
    for file in ["grafana-dashboard.json", "prometheus-alerts.yaml"] {
        let asked = names_in(&std::fs::read_to_string(deploy(file)).unwrap());
        let missing: Vec<&String> = asked.difference(&there).collect();
        assert!(!asked.is_empty() && missing.is_empty(), "{file} asks for {missing:?}");
    }
    let dashboard = std::fs::read(deploy("grafana-dashboard.json")).unwrap();
    let dashboard: serde_json::Value = serde_json::from_slice(&dashboard).unwrap();
    let panels = dashboard["panels"].as_array().unwrap();
    let has_questions = |panel: &serde_json::Value| panel["targets"].as_array().is_some_and(|all| !all.is_empty());
    assert!(panels.len() > 5 && panels.iter().all(has_questions), "a panel shows something");
}
