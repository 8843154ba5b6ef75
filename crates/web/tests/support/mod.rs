//! What the tests share: a site without maps behind it, and a client that sends what it is told.
#![allow(dead_code, clippy::unwrap_used)] // every test program uses a part of it; tests may panic

use fht_proto::RobotName;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::api::request::{Format, Request};
use fht_web::{
    Answering, EventHub, MapChangeOrder, MapGauges, MapPort, MemberRole, PastQuestion, QueryFigures, Rights,
    ServerFigures, WallsQuestion, WebAnswer, WebConfig, WebListener,
};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;

/// Answers what it is asked with what it was asked, and notes what it is to change.
#[derive(Default)]
pub struct Echo {
    pub changes: Mutex<Vec<(String, MapChangeOrder)>>,
}

fn ready(answer: Result<String, ErrorReply>) -> Answering {
    let answer = answer.map(|text| WebAnswer { format: Format::Json, bytes: text.into_bytes() });
    Box::pin(std::future::ready(answer))
}

impl MapPort for Echo {
    fn ask(&self, request: Request) -> Answering {
        let text = format!("{request:?}");
        if text.contains("louvre") {
            return ready(Err(ErrorReply::new(ErrorCode::UnknownMap, "there is no map louvre")));
        }
        ready(Ok(serde_json::to_string(&text).unwrap()))
    }

    fn walls(&self, asked: WallsQuestion) -> Answering {
        // More than the buffers of the system hold.
        ready(Ok(format!("[{}]", "7,".repeat(8 << 20) + &asked.map.to_string().len().to_string())))
    }

    fn warnings(&self) -> Answering {
        ready(Ok(r#"{"lines":[]}"#.to_owned()))
    }

    fn past(&self, asked: PastQuestion) -> Answering {
        ready(Ok(serde_json::to_string(&format!("{asked:?}")).unwrap()))
    }

    fn preview(&self, _: RobotName, _: MapChangeOrder) -> Answering {
        ready(Ok(r#"{"paths":[]}"#.to_owned()))
    }

    fn change(&self, by: RobotName, order: MapChangeOrder) -> Answering {
        self.changes.lock().unwrap().push((by.to_string(), order));
        ready(Ok(r#"{"version":2}"#.to_owned()))
    }

    fn rights(&self, role: MemberRole, name: &RobotName) -> Rights {
        match (role, name.as_str()) {
            (_, "gone") => Rights::Nothing,
            (MemberRole::Operator, _) => Rights::Change,
            _ => Rights::Look,
        }
    }

    fn figures(&self) -> ServerFigures {
        let map = MapGauges {
            map: "museum".parse().unwrap(),
            version: 3,
            main_nodes: 1,
            support_nodes: 2,
            edges: 2,
            bytes: 300,
            refused: 4,
            robots: 2,
            late_robots: 1,
        };
        let buckets = vec![(0.001, 5), (f64::INFINITY, 1)];
        let path = QueryFigures { topic: "path", answered: 4, refused: 1, busy: 1, seconds: 0.5, buckets };
        ServerFigures { maps: vec![map], queries: vec![path], is_read_only: false, ..ServerFigures::default() }
    }
}

/// A site that is served.
pub struct Served {
    pub address: SocketAddr,
    pub hub: EventHub,
    pub echo: Arc<Echo>,
    serving: tokio::task::JoinHandle<()>,
}

impl Served {
    /// On this machine, with `change` made to the configuration.
    pub fn start(change: impl FnOnce(&mut WebConfig)) -> Self {
        let mut config = WebConfig::at("127.0.0.1:0".parse().unwrap());
        change(&mut config);
        let listener = WebListener::bind(&config).unwrap();
        let (address, hub, echo) = (listener.address(), EventHub::default(), Arc::new(Echo::default()));
        let (served, port): (_, Arc<dyn MapPort>) = (hub.clone(), Arc::clone(&echo) as Arc<dyn MapPort>);
        let serving = tokio::spawn(async move { listener.serve(port, served).await.unwrap() });
        Self { address, hub, echo, serving }
    }

    pub async fn connect(&self) -> TcpStream {
        TcpStream::connect(self.address).await.unwrap()
    }

    /// The reply to a request without a body.
    pub async fn get(&self, path: &str) -> Reply {
        let text = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        exchange(self.connect().await, text.as_bytes()).await
    }

    /// The reply to a change, with further fields.
    pub async fn post(&self, path: &str, fields: &str, body: &str) -> Reply {
        exchange(self.connect().await, posted(path, fields, body).as_bytes()).await
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

/// A change as bytes.
pub fn posted(path: &str, fields: &str, body: &str) -> String {
    let length = body.len();
    format!(
        "POST {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: {length}\r\n{fields}\r\n{body}"
    )
}

#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    pub head: String,
    pub body: String,
}

impl Reply {
    fn of(text: &str) -> Self {
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((text, ""));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        Self { status, head: head.to_ascii_lowercase(), body: body.to_owned() }
    }
}

/// Sends bytes, and reads until the other end closes.
pub async fn exchange(mut stream: impl AsyncRead + AsyncWrite + Unpin, bytes: &[u8]) -> Reply {
    let mut text = Vec::new();
    let talked = tokio::time::timeout(Duration::from_secs(20), async {
        // The other end may close before it has read all.
        let _ = stream.write_all(bytes).await;
        let _ = stream.read_to_end(&mut text).await;
    });
    talked.await.unwrap();
    Reply::of(&String::from_utf8_lossy(&text))
}
