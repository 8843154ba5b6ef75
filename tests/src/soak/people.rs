//! Who changes the map: an explorer that corrects its nodes, an operator who draws and removes
//! zones and has old increments folded.

use crate::soak::place::map;
use fht_client::author::{Authorship, write};
use fht_proto::{AuthorId, FixedPoint, FixedPose, NodeId, NodeKind, Op, VersionVector, Zone, ZoneRule};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use zenoh::Session;

const EXPLORER: &str = "walker";
const OPERATOR: &str = "desk";
/// Between two increments of the explorer, and two zones of the operator.
const WRITE_EVERY: Duration = Duration::from_secs(1);
const ZONE_EVERY: Duration = Duration::from_secs(10);
/// Old increments are folded after so many zones.
const FOLD_EVERY: u32 = 30;
/// Versions that stay.
const KEEP: u32 = 500;
const TIMEOUT: Duration = Duration::from_secs(5);

/// What the server has acknowledged.
#[derive(Debug, Default)]
pub(super) struct Acknowledged {
    authors: Mutex<BTreeMap<AuthorId, u64>>,
    count: AtomicU64,
    failures: AtomicU64,
}

impl Acknowledged {
    fn take(&self, author: AuthorId, vector: &VersionVector) {
        self.count.fetch_add(1, Ordering::Relaxed);
        self.authors.lock().unwrap_or_else(PoisonError::into_inner).insert(author, vector.get(author));
    }

    /// How many increments were acknowledged, and how many of them `vector` lacks.
    pub(super) fn lost(&self, vector: &VersionVector) -> (u64, u64) {
        let authors = self.authors.lock().unwrap_or_else(PoisonError::into_inner);
        let lacks = |(author, count): (&AuthorId, &u64)| count.saturating_sub(vector.get(*author));
        (self.count.load(Ordering::Relaxed), authors.iter().map(lacks).sum())
    }

    /// How often something was not acknowledged in time.
    pub(super) fn failures(&self) -> u64 {
        self.failures.load(Ordering::Relaxed)
    }
}

/// Writes once; what is not acknowledged is left to the next time.
async fn once(session: &Session, name: &str, ops: Vec<Op>, acknowledged: &Acknowledged) {
    let by = Authorship { name, may_begin: false, timeout: TIMEOUT };
    match write(session, &map(), by, ops).await {
        Ok(head) => acknowledged.take(AuthorId::of_robot(name), &head.vector),
        Err(error) => {
            acknowledged.failures.fetch_add(1, Ordering::Relaxed);
            tracing::debug!("{name}: {error}");
        }
    }
}

/// Moves one node to and fro.
pub(super) async fn explore(session: Session, acknowledged: Arc<Acknowledged>, is_over: Arc<AtomicBool>) {
    let id = NodeId { author: AuthorId::of_robot(EXPLORER), number: 0 };
    let pose = |turn: u32| FixedPose::from_metres(0.001 * f64::from(turn % 10), 0.0, 0.0);
    let put = Op::PutNode { id, kind: NodeKind::Support, pose: pose(0) };
    once(&session, EXPLORER, vec![put], &acknowledged).await;
    for turn in 1.. {
        if is_over.load(Ordering::Relaxed) {
            return;
        }
        once(&session, EXPLORER, vec![Op::SetPose { id, pose: pose(turn) }], &acknowledged).await;
        tokio::time::sleep(WRITE_EVERY).await;
    }
}

/// Draws a zone, removes it, draws another; has old increments folded now and then.
pub(super) async fn operate(session: Session, acknowledged: Arc<Acknowledged>, is_over: Arc<AtomicBool>) {
    for turn in 0_u32.. {
        if is_over.load(Ordering::Relaxed) {
            return;
        }
        let (x, y) = (1000 + 1000 * (turn / 2 % 30), 1000 + 1000 * (turn / 2 % 17));
        let corner = |dx: u32, dy: u32| FixedPoint { x_mm: (x + dx) as i32, y_mm: (y + dy) as i32 };
        let corners = vec![corner(0, 0), corner(1000, 0), corner(1000, 1000), corner(0, 1000)];
        let zone = turn.is_multiple_of(2).then_some(Zone { rule: ZoneRule::KeepOut, corners });
        if let Ok(name) = format!("zone-{}", turn / 2 % 5).parse() {
            once(&session, OPERATOR, vec![Op::SetZone { name, zone }], &acknowledged).await;
        }
        if turn % FOLD_EVERY == FOLD_EVERY - 1 {
            fold(&session).await;
        }
        tokio::time::sleep(ZONE_EVERY).await;
    }
}

async fn fold(session: &Session) {
    let order = format!("fht/{}/admin/retain?keep={KEEP}", map());
    if let Ok(replies) = session.get(order).timeout(TIMEOUT).await {
        while let Ok(reply) = replies.recv_async().await {
            if let Err(error) = reply.result() {
                tracing::warn!("nothing is folded: {:?}", error.payload().try_to_string());
            }
        }
    }
}
