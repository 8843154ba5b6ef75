//! A map whose limits were set below what it has: operators close, draw and take away on it all the
//! same, within a bound; nobody makes anything, and everybody is told what can be done.

use crate::support::{increment, museum, node};
use fht_map::{WriterRole, WriterRoles};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::ErrorCode;
use fht_proto::{AuthorId, EdgeKey, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Zone, ZoneRule, encode};
use map_server::catalog::Catalog;
use map_server::config::{Limits, Quotas};
use map_server::ingest::{Arrival, Ingest};
use map_server::store::{IncrementLog, MemoryLog};
use std::sync::Arc;

const NODES: u64 = 100;
const NOW_US: u64 = 1_795_000_000_000_000;

/// The writer of a server whose limits are lower than what its map has.
struct Full {
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

/// What is said to a writer whose increment is not taken, if it was not told the same just now.
type Refused = Option<(ErrorCode, String)>;

fn author(name: &str) -> AuthorId {
    AuthorId::of_robot(name)
}

fn tom(number: u32) -> NodeId {
    node(author("tom"), number)
}

impl Full {
    fn new(limits: Limits, is_guarded: bool) -> Self {
        let log: Arc<dyn IncrementLog> = Arc::new(MemoryLog::new());
        let mut before = Self::over(&log, Limits::default());
        (1..=NODES).for_each(|number| before.take(&increment(author("tom"), number)).unwrap());
        let full = Self::over(&log, limits);
        if !is_guarded {
            return full;
        }
        let roles: WriterRoles = [(WriterRole::Operator, "desk"), (WriterRole::Explorer, "tom")].into_iter().collect();
        Self { ingest: full.ingest.guarded_by(roles, Quotas::default()).unwrap(), ..full }
    }

    fn over(log: &Arc<dyn IncrementLog>, limits: Limits) -> Self {
        let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
        let ingest = Ingest::new(Arc::clone(log), Arc::clone(&catalog), limits);
        Self { catalog, ingest }
    }

    fn written(&self, author: AuthorId) -> u64 {
        self.catalog.view(&museum()).map_or(0, |view| view.head.vector.get(author))
    }

    fn take(&mut self, increment: &Increment) -> Result<(), Refused> {
        let key = Key::increment(&museum(), increment.author, increment.number).to_string();
        let arrival = Arrival { key, payload: Ok(encode(increment).unwrap()) };
        let outcome = self.ingest.take_arrivals(vec![arrival], NOW_US).unwrap();
        if self.written(increment.author) >= increment.number {
            return Ok(());
        }
        Err(outcome.notices.into_iter().next().map(|notice| (notice.reply.code, notice.reply.message)))
    }

    /// Writes the next increment of a name.
    fn write(&mut self, name: &str, op: Op) -> Result<(), Refused> {
        let number = self.written(author(name)) + 1;
        self.take(&Increment { author: author(name), number, hlc_us: 2_000_000 + number, ops: vec![op] })
    }
}

fn place(number: u64) -> Op {
    let pose = Some(FixedPose::from_metres(number as f64 / 1000.0, 0.0, 0.0));
    Op::SetPlace { name: "dock".parse().unwrap(), pose }
}

fn new_node(name: &str) -> Op {
    let id = NodeId { author: author(name), number: 1_000_000 };
    Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose::default() }
}

/// What an operator does to get out.
fn ways_out() -> Vec<Op> {
    let corners = [(0, 0), (1000, 0), (1000, 1000), (0, 1000)].map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm });
    let zone = Zone { rule: ZoneRule::KeepOut, corners: corners.to_vec() };
    vec![
        Op::SetClosed { edge: EdgeKey::new(tom(3), tom(4)), closed: true },
        Op::SetZone { name: "wet".parse().unwrap(), zone: Some(zone) },
        place(1),
        Op::RemoveEdge { edge: EdgeKey::new(tom(7), tom(8)) },
        Op::RemoveNode { id: tom(9) },
        Op::Enable { release: None },
    ]
}

#[test]
fn operators_close_and_take_away_on_a_map_that_has_more_than_it_may() {
    let low = [
        (Limits { max_map_bytes: 1000, ..Limits::default() }, "bytes in this map", "--max-map-mib"),
        (Limits { max_total_bytes: 1000, ..Limits::default() }, "bytes in all maps", "--max-total-mib"),
        (Limits { max_map_elements: 10, ..Limits::default() }, "nodes and edges in this map", "--max-map-elements"),
        (Limits { max_total_elements: 10, ..Limits::default() }, "nodes and edges in all maps", "--max-total-elements"),
    ];
    for (limits, of, flag) in low {
        for is_guarded in [false, true] {
            let mut full = Full::new(limits.clone(), is_guarded);
            for op in ways_out() {
                assert_eq!(full.write("desk", op.clone()), Ok(()), "{of}: {op:?}");
            }
            // A limit is a limit for what makes something.
            let (code, said) = full.write("desk", new_node("desk")).unwrap_err().unwrap();
            assert!(code == ErrorCode::Full && said.contains(of), "{said}");
            assert!(is_guarded || said.contains(flag), "{said}");
            assert!(full.write("desk", Op::RemoveNode { id: tom(5000) }).is_err(), "it would be remembered");
            assert!(full.write("tom", new_node("tom")).is_err());
            // Where it is known who they are, operators alone.
            assert_eq!(full.write("tom", Op::RemoveNode { id: tom(20) }).is_err(), is_guarded);
            assert_eq!(full.write("desk", Op::RemoveNode { id: tom(21) }), Ok(()));
        }
    }
}

#[test]
fn what_is_taken_beyond_a_limit_is_bounded_until_the_map_is_compacted() {
    let limits = Limits { max_map_bytes: 1000, ..Limits::default() };
    let mut full = Full::new(limits, false);
    let bytes = |full: &Full| full.catalog.view(&museum()).unwrap().head.bytes;
    let before = bytes(&full);
    let mut number = 0;
    while full.write("desk", place(number)).is_ok() {
        number += 1;
        assert!(number < 1_000_000, "it never ends");
    }
    let beyond = bytes(&full) - before;
    assert!((1 << 20) - 200 < beyond && beyond <= 1 << 20, "{beyond}");
    full.ingest.retain(&museum(), 0).unwrap();
    assert_eq!(full.write("desk", place(0)), Ok(()));
}
