//! What is taken though a limit is reached: operators must be able to close and to take away what
//! is on a full map.

use crate::ingest::admission::Admission;
use crate::ingest::check::Checked;
use crate::ingest::pipeline::Ingest;
use fht_map::{MapState, WriterRole};
use fht_proto::{Increment, MapName, Op, VersionVector};

/// So much that makes nothing is taken into a map beyond the limits, until it is compacted or the
/// server starts again, bytes.
const BEYOND_BYTES: u64 = 1 << 20;

/// Whether operations make nothing that would take up memory for good: they take away what is
/// there, close something, or say something about the map.
fn make_nothing(ops: &[Op], state: &MapState) -> bool {
    ops.iter().all(|op| match op {
        Op::RemoveNode { id } => state.node(*id).is_some(),
        Op::RemoveEdge { edge } => state.has_edge(*edge),
        Op::SetClosed { edge, .. } => state.has_edge(*edge) || state.closed_edges().any(|closed| closed == *edge),
        Op::SetPlace { .. }
        | Op::SetZone { .. }
        | Op::PutRelease { .. }
        | Op::RemoveRelease { .. }
        | Op::Enable { .. }
        | Op::SetFloorPlan { .. }
        | Op::SetDatum { .. } => true,
        Op::PutNode { .. }
        | Op::SetPose { .. }
        | Op::SetFreeSpace { .. }
        | Op::SetSignature { .. }
        | Op::PutEdge { .. }
        | Op::PutModel { .. }
        | Op::SetTrust { .. } => false,
    })
}

impl Ingest {
    /// Whether an increment is taken though there is no room. Where nobody knows who operators are,
    /// everybody's is.
    pub(super) fn may_exceed(&self, checked: &Checked) -> bool {
        let Increment { author, number, ops, .. } = &checked.increment;
        let Some((intake, view)) = self.maps.get(&checked.map).zip(self.catalog.view(&checked.map)) else {
            return false;
        };
        let vector = intake.sequence.vector();
        let written = vector.get(*author);
        let is_let_in = written > 0 || vector.iter().count() < VersionVector::MAX_AUTHORS;
        let is_operator =
            |admission: &Admission| admission.writer(*author).is_some_and(|writer| writer.role == WriterRole::Operator);
        let own = checked.bytes.len() as u64;
        let beyond = self.beyond.get(&checked.map).copied().unwrap_or(0);
        is_let_in
            && *number == written + 1
            && self.admission.as_ref().is_none_or(is_operator)
            && self.coming(checked).0 == own
            && beyond + own <= BEYOND_BYTES
            && make_nothing(ops, &view.state)
    }

    /// Counts what is taken beyond the limits.
    pub(super) fn exceed(&mut self, map: &MapName, bytes: u64) {
        *self.beyond.entry(map.clone()).or_default() += bytes;
    }
}
