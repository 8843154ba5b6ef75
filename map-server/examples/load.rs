//! How much load a server takes: durable increments per second over Zenoh on this machine, and how
//! long a path takes on the resulting map.
//!
//! ```text
//! cargo run --release -p map-server --example load -- 5000
//! cargo run --release -p map-server --example load -- 1000000 0
//! ```
//!
//! The first number counts the nodes. Every so many-th is a main node, as the second number says
//! (0: none; default 5).
#![allow(clippy::unwrap_used)] // a measurement may panic

use fht_proto::api::keys::Key;
use fht_proto::api::reply::Head;
use fht_proto::{
    AuthorId, Descriptor, EdgeKey, FixedPose, Increment, MapName, ModelId, NodeId, NodeKind, Op, Rect, ScanRecord,
    Signature, encode,
};
use map_server::{ServerConfig, ServerEndpoints, ServerError, run};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use zenoh::Session;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;

/// Increments that are put ahead of the acknowledgement.
const WINDOW: u64 = 1000;
/// Nodes in a row of the map's grid, at least.
const ROW: u32 = 50;
const QUERIES: usize = 300;

/// The grid: how many nodes are in a row, and every how many-th is a main node.
#[derive(Clone, Copy)]
struct Grid {
    row: u32,
    main_every: u32,
}

/// A node of a grid with 2 m between neighbours.
fn increment(grid: Grid, author: AuthorId, number: u64) -> Increment {
    let index = number as u32 - 1;
    let id = |index: u32| NodeId { author, number: index };
    let Grid { row, main_every } = grid;
    let (x, y) = (f64::from(index % row) * 2.0, f64::from(index / row) * 2.0);
    let is_main = main_every > 0 && index.is_multiple_of(main_every);
    let pose = FixedPose::from_metres(x, y, 0.0);
    let rect = Rect::around(pose.position, (x - 1.5, y - 1.5), (x + 1.5, y + 1.5));
    let kind = if is_main { NodeKind::Main } else { NodeKind::Support };
    let mut ops = vec![Op::PutNode { id: id(index), kind, pose }, Op::SetFreeSpace { id: id(index), rect: Some(rect) }];
    if is_main {
        let components: Vec<f32> = (0..320).map(|i| ((i * (index + 1)) as f32 * 0.37).sin()).collect();
        let descriptor = Some(Descriptor::quantise(ModelId(1), &components));
        let scan = ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.017,
            ranges_mm: vec![5000; 360],
        };
        ops.push(Op::SetSignature { id: id(index), signature: Signature { descriptor, scan } });
    }
    let before = [(!index.is_multiple_of(row)).then(|| index - 1), index.checked_sub(row)];
    ops.extend(before.into_iter().flatten().map(|other| Op::PutEdge { edge: EdgeKey::new(id(other), id(index)) }));
    Increment { author, number, hlc_us: number, ops }
}

/// Questions that were asked again: the server's router drops a large answer now and then when they
/// are asked for back to back.
static PUT_AGAIN: AtomicU64 = AtomicU64::new(0);

async fn get(session: &Session, selector: &str) -> Vec<u8> {
    let mut reason = String::new();
    for _ in 0..5 {
        let replies = session.get(selector).timeout(Duration::from_secs(1)).await.unwrap();
        match replies.recv_async().await.unwrap().into_result() {
            Ok(sample) => return sample.payload().to_bytes().into_owned(),
            Err(error) => reason = String::from_utf8_lossy(&error.payload().to_bytes()).into_owned(),
        }
        PUT_AGAIN.fetch_add(1, Ordering::Relaxed);
    }
    panic!("{selector}: {reason}")
}

/// The next published head, or the answer to a question for it if none arrives.
async fn next_head(session: &Session, heads: &Subscriber<FifoChannelHandler<Sample>>) -> Head {
    let payload = match tokio::time::timeout(Duration::from_millis(500), heads.recv_async()).await {
        Ok(sample) => sample.unwrap().payload().to_bytes().into_owned(),
        Err(_) => get(session, "fht/load/head").await,
    };
    serde_json::from_slice(&payload).unwrap()
}

/// A running server and a client of it.
struct Setup {
    grid: Grid,
    session: Session,
    stop: oneshot::Sender<()>,
    server: JoinHandle<Result<(), ServerError>>,
    _dir: tempfile::TempDir,
}

async fn set_up(grid: Grid, count: u64) -> Setup {
    let dir = tempfile::tempdir_in(".").unwrap();
    let endpoint = "tcp/127.0.0.1:17449".to_owned();
    let link = ServerEndpoints { listen: vec![endpoint.clone()], ..ServerEndpoints::default() };
    let mut config = ServerConfig::new(dir.path().to_owned(), link);
    config.limits.max_map_elements = config.limits.max_map_elements.max(4 * count as usize);
    config.limits.max_total_elements = config.limits.max_total_elements.max(4 * count as usize);
    let (stop, stopped) = oneshot::channel::<()>();
    let server = tokio::spawn(run(config, async { _ = stopped.await }));
    tokio::time::sleep(Duration::from_millis(500)).await;
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"client\"").unwrap();
    config.insert_json5("connect/endpoints", &format!("[\"{endpoint}\"]")).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let session = zenoh::open(config).await.unwrap();
    while session.get("fht/maps").await.unwrap().recv_async().await.is_err() {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    Setup { grid, session, stop, server, _dir: dir }
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() {
    let argument = |at: usize, default: u64| std::env::args().nth(at).map_or(default, |text| text.parse().unwrap());
    let (count, main_every) = (argument(1, 5000), argument(2, 5) as u32);
    let grid = Grid { row: ROW.max((count as f64).sqrt() as u32), main_every };
    let setup = set_up(grid, count).await;
    measure_ingest(&setup, count).await;
    measure_topics(&setup, count).await;
    measure_paths(&setup, count).await;
    println!("{} questions got no answer within a second and were put again", PUT_AGAIN.load(Ordering::Relaxed));
    setup.stop.send(()).unwrap();
    setup.server.await.unwrap().unwrap();
}

async fn measure_ingest(Setup { grid, session, .. }: &Setup, count: u64) {
    let heads = session.declare_subscriber("fht/load/head").await.unwrap();
    let map: MapName = "load".parse().unwrap();
    let author = AuthorId(1);
    let encoded: Vec<Vec<u8>> = (1..=count).map(|number| encode(&increment(*grid, author, number)).unwrap()).collect();
    let (start, mut sent, mut acknowledged, mut published) = (Instant::now(), 0, 0, 0_u32);
    while acknowledged < count {
        while sent < count.min(acknowledged + WINDOW) {
            sent += 1;
            let key = Key::increment(&map, author, sent).to_string();
            let put = session.put(key, encoded[sent as usize - 1].clone());
            put.congestion_control(CongestionControl::Block).await.unwrap();
        }
        let head = next_head(session, &heads).await;
        acknowledged = acknowledged.max(head.vector.get(author));
        published += 1;
    }
    let seconds = start.elapsed().as_secs_f64();
    let bytes: usize = encoded.iter().map(Vec::len).sum();
    println!(
        "ingest: {count} increments ({bytes} bytes) durable in {seconds:.2} s: {:.0}/s, {published} commits seen",
        count as f64 / seconds
    );

    // One at a time: how long a writer waits for its acknowledgement.
    let mut waits = Vec::new();
    for number in count + 1..=count + 50 {
        let start = Instant::now();
        let key = Key::increment(&map, author, number).to_string();
        session.put(key, encode(&increment(*grid, author, number)).unwrap()).await.unwrap();
        while next_head(session, &heads).await.version < number {}
        waits.push(start.elapsed());
    }
    report("acknowledgement of one increment", waits);
}

async fn measure_topics(Setup { grid, session, .. }: &Setup, count: u64) {
    let (width, rows) = (f64::from(grid.row - 1) * 2.0, count as u32 / grid.row);
    for selector in [
        "fht/load/head".to_owned(),
        "fht/load/nodes?near=20,20;radius=5".to_owned(),
        "fht/load/path?from=0.5,0.5;to=9,9".to_owned(),
        format!("fht/load/path?from=0.5,0.5;to={},{}", width - 1.0, (rows - 1) * 2),
        "fht/load/since?vector=;max_bytes=16384".to_owned(),
        "fht/load/since?vector=;max_bytes=32768".to_owned(),
        "fht/load/since?vector=;max_bytes=60000".to_owned(),
        "fht/load/since?vector=".to_owned(),
    ] {
        let mut waits = Vec::new();
        let mut length = 0;
        for _ in 0..QUERIES {
            let start = Instant::now();
            length = get(session, &selector).await.len();
            waits.push(start.elapsed());
        }
        report(&format!("{selector} ({length} bytes)"), waits);
    }
}

/// Paths between evenly distributed pairs, from the steps of a generator.
async fn measure_paths(Setup { grid, session, .. }: &Setup, count: u64) {
    let (row, rows) = (u64::from(grid.row), count / u64::from(grid.row));
    let mut waits = Vec::new();
    for pair in 0..QUERIES as u64 {
        let place = |salt: u64| {
            let drawn = ((2 * pair + salt + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20) % (row * rows);
            format!("{:.1},{:.1}", (drawn % row) as f64 * 2.0 + 0.3, (drawn / row) as f64 * 2.0 + 0.3)
        };
        let start = Instant::now();
        get(session, &format!("fht/load/path?from={};to={}", place(0), place(1))).await;
        waits.push(start.elapsed());
    }
    report("paths between pairs drawn evenly", waits);
}

fn report(what: &str, mut waits: Vec<Duration>) {
    waits.sort();
    let at = |fraction: f64| waits[((waits.len() - 1) as f64 * fraction) as usize].as_secs_f64() * 1e3;
    println!("{what}: median {:.2} ms, 99 % {:.2} ms", at(0.5), at(0.99));
}
