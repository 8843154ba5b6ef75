//! A map beyond the limits of a mesh: paths over its index equal those of plain searches under the
//! same rules, even while the map changes.

use crate::support::{ANA, BEN, Server, ask, client, free_endpoint, head_when, museum, until_up};
use fht_map::index::lookup;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, Rules};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorReply, NodesReply, PathReply};
use fht_proto::{
    AuthorId, EdgeKey, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect, Zone, ZoneRule, encode,
};
use zenoh::Session;
use zenoh::qos::CongestionControl;

/// Nodes in a row, and rows.
const SIDE: u32 = 142;

fn id(column: u32, row: u32) -> NodeId {
    NodeId { author: ANA, number: row * SIDE + column }
}

fn place(column: u32, row: u32) -> (f64, f64) {
    // So that not all paths are equally long.
    (f64::from(column) * 2.0, f64::from(row) * 2.0 + f64::from((column * 7 + row * 3) % 10) * 0.05)
}

/// One row of the lattice each: a room of 1.2 m around every node, joined by corridors.
fn rows() -> Vec<Increment> {
    let row = |row: u32| {
        let ops = (0..SIDE).flat_map(|column| {
            let (x, y) = place(column, row);
            let pose = FixedPose::from_metres(x, y, 0.0);
            let rect = Rect::around(pose.position, (x - 0.6, y - 0.6), (x + 0.6, y + 0.6));
            let before = [(column > 0).then(|| id(column - 1, row)), (row > 0).then(|| id(column, row - 1))];
            let mut ops = vec![
                Op::PutNode { id: id(column, row), kind: NodeKind::Support, pose },
                Op::SetFreeSpace { id: id(column, row), rect: Some(rect) },
            ];
            ops.extend(before.into_iter().flatten().map(|it| Op::PutEdge { edge: EdgeKey::new(it, id(column, row)) }));
            ops
        });
        Increment { author: ANA, number: u64::from(row) + 1, hlc_us: 1_000_000 + u64::from(row), ops: ops.collect() }
    };
    (0..SIDE).map(row).collect()
}

struct Large {
    session: Session,
    state: MapState,
    version: u64,
}

impl Large {
    async fn put(&mut self, increment: &Increment) {
        let key = Key::increment(&museum(), increment.author, increment.number).to_string();
        let put = self.session.put(key, encode(increment).unwrap());
        put.congestion_control(CongestionControl::Block).await.unwrap();
        self.state.apply(increment);
        self.version += 1;
    }

    async fn stored(&self) {
        head_when(&self.session, |head| head.version == self.version && head.digest == self.state.digest()).await;
    }

    async fn answer(&self, selector: &str) -> Result<Vec<u8>, ErrorReply> {
        loop {
            // On a busy machine an answer may come too late.
            if let Some(answer) = ask(&self.session, selector).await.pop() {
                return answer;
            }
        }
    }

    /// Checks that paths between some places are those that a plain search finds under the same
    /// rules.
    async fn paths_are_right(&self, what: &str) {
        let rules = Rules::of(&self.state, Vec::new());
        let space = FreeSpace::of(&self.state, &rules.space_config());
        assert!(space.over_budget().is_some(), "{what}: a mesh was made");
        let corners = [((0, 0), (SIDE - 1, SIDE - 1)), ((0, SIDE - 1), (SIDE - 1, 0)), ((3, 3), (3, 90))];
        let near = [((70, 70), (71, 70)), ((70, 70), (75, 66)), ((0, 5), (140, 5))];
        for (from, to) in corners.into_iter().chain(near) {
            let point = |(column, row): (u32, u32)| {
                let (x, y) = place(column, row);
                FixedPoint::from_metres(x + 0.3, y - 0.2)
            };
            let (from, to) = (point(from), point(to));
            let expected = rules.plan(&self.state, &space, from, to, &NodeRouteConfig::default());
            let text = |point: FixedPoint| format!("{:.3},{:.3}", point.x(), point.y());
            let selector = format!("fht/museum/path?from={};to={}", text(from), text(to));
            match (self.answer(&selector).await, expected) {
                (Ok(answer), Ok(expected)) => {
                    let path: PathReply = serde_json::from_slice(&answer).unwrap();
                    let off = (path.length_m - expected.length_m).abs();
                    assert!(off < 2e-3, "{what} {selector}: {} and {}", path.length_m, expected.length_m);
                    assert_eq!(path.version, self.version, "{what}");
                }
                (Err(error), Err(expected)) => assert_eq!(error.code, expected.code(), "{what} {selector}"),
                (answer, expected) => panic!("{what} {selector}: {answer:?}, {expected:?}"),
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn paths_and_nodes_of_a_map_without_a_mesh() {
    let dir = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint();
    let _server = Server::start(dir.path(), &endpoint);
    let session = client(&endpoint).await;
    until_up(&session).await;
    let mut large = Large { session, state: MapState::new(), version: 0 };
    for increment in rows() {
        large.put(&increment).await;
    }
    large.stored().await;
    large.paths_are_right("as it is").await;

    // A bridge, a node less, and an edge less, after the index was built.
    let span = Op::PutEdge { edge: EdgeKey::new(id(10, 10), id(60, 60)) };
    let ops =
        vec![span, Op::RemoveNode { id: id(71, 70) }, Op::RemoveEdge { edge: EdgeKey::new(id(3, 40), id(3, 41)) }];
    large.put(&Increment { author: BEN, number: 1, hlc_us: 2_000_000, ops }).await;
    large.stored().await;
    large.paths_are_right("changed").await;

    // What operators close is obeyed.
    let desk = AuthorId(0xd);
    let corners = [(15.0, 15.0), (25.0, 15.0), (25.0, 25.0), (15.0, 25.0)];
    let corners = corners.iter().map(|&(x, y)| FixedPoint::from_metres(x, y)).collect();
    let ops = vec![
        Op::SetClosed { edge: EdgeKey::new(id(10, 10), id(60, 60)), closed: true },
        Op::SetClosed { edge: EdgeKey::new(id(70, 69), id(70, 70)), closed: true },
        Op::SetZone { name: "pit".parse().unwrap(), zone: Some(Zone { rule: ZoneRule::KeepOut, corners }) },
    ];
    large.put(&Increment { author: desk, number: 1, hlc_us: 3_000_000, ops }).await;
    large.stored().await;
    large.paths_are_right("closed").await;

    let near: NodesReply =
        serde_json::from_slice(&large.answer("fht/museum/nodes?near=100,100;radius=6").await.unwrap()).unwrap();
    let expected = lookup::nearest(&large.state, None, FixedPoint::from_metres(100.0, 100.0), 6.0);
    let ids: Vec<String> = expected.iter().map(|(node, _)| node.id.to_string()).collect();
    assert!(ids.len() > 20);
    assert_eq!(near.nodes.iter().map(|node| node.id.clone()).collect::<Vec<_>>(), ids);
}
