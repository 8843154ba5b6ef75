//! The smallest map with a way in it, for tests with other people's programs.

use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, MapName, NodeId, NodeKind, Op, Rect, encode};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(30);

/// An L of two corridors: nodes at (0, 0), (5, 0) and (5, 3).
#[must_use]
pub fn corridors() -> Vec<Increment> {
    let author = AuthorId::of_robot("explorer");
    let id = |number: u32| NodeId { author, number };
    let node = |number: u32, x: f64, y: f64| {
        let pose = FixedPose::from_metres(x, y, 0.0);
        let rect = Rect::around(pose.position, (x - 1.0, y - 1.0), (x + 1.0, y + 1.0));
        [
            Op::PutNode { id: id(number), kind: NodeKind::Support, pose },
            Op::SetFreeSpace { id: id(number), rect: Some(rect) },
        ]
    };
    let join = |a: u32, b: u32| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) };
    let first = [node(0, 0.0, 0.0), node(1, 5.0, 0.0)].concat();
    let second = [node(2, 5.0, 3.0).to_vec(), vec![join(0, 1), join(1, 2)]].concat();
    (1..).zip([first, second]).map(|(number, ops)| Increment { author, number, hlc_us: number, ops }).collect()
}

/// Puts increments until the server has acknowledged them.
///
/// # Panics
/// When it does not within half a minute.
pub fn put(session: &Session, map: &MapName, increments: &[Increment]) {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        // Again until acknowledged: a server that listens may not have subscribed yet.
        for increment in increments {
            let key = Key::increment(map, increment.author, increment.number).to_string();
            session.put(key, encode(increment).expect("it is valid")).wait().expect("Zenoh takes it");
        }
        let replies = session.get(Key::topic(map, Topic::Head).to_string()).wait().expect("Zenoh asks");
        for reply in replies {
            let Ok(sample) = reply.result() else { continue };
            let head: Head = serde_json::from_slice(&sample.payload().to_bytes()).expect("a head");
            if increments.iter().all(|increment| head.vector.get(increment.author) >= increment.number) {
                return;
            }
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("the increments were not acknowledged");
}
