//! What an operator changes, as operations: the map's state and the order decide alone.

use crate::catalog::{MapView, state_at};
use crate::query::{find_release, internal};
use crate::store::{IncrementLog, Lacking};
use fht_map::crdt::inverse::{Inverse, InverseError, inverse};
use fht_map::{DoubtfulWords, MapState, check_place, check_zone};
use fht_proto::api::reply::{ErrorCode, ErrorReply, Series, known_names};
use fht_proto::api::request::bad_request;
use fht_proto::{
    AuthorId, EdgeKey, FixedPose, Increment, Label, NodeId, Op, Release, ReleaseId, ReleaseName, VersionVector, Zone,
    decode,
};
use fht_web::{MapChange, MapChangeOrder};
use std::collections::BTreeSet;

/// So many increments are taken back at a time.
const MAX_UNDONE: u64 = 100;

/// What is to be written; nothing if the map is so already.
#[derive(Debug, Default)]
pub(super) struct PlannedEdit {
    pub(super) ops: Vec<Op>,
    /// The number that the increment must have, where it stands on those before it.
    pub(super) number: Option<u64>,
    /// Which increments that takes back, and what that does.
    pub(super) undone: Option<([u64; 2], Vec<String>)>,
}

impl From<Op> for PlannedEdit {
    fn from(op: Op) -> Self {
        Self { ops: vec![op], ..Self::default() }
    }
}

/// What `author` has to write for an order to be carried out.
///
/// # Errors
/// Why it cannot be.
pub(super) fn plan(
    view: &MapView,
    log: &dyn IncrementLog,
    author: AuthorId,
    order: &MapChangeOrder,
) -> Result<PlannedEdit, ErrorReply> {
    let is_sure = order.force;
    match &order.change {
        MapChange::Place { name, pose } => place(&view.state, name, *pose, is_sure),
        MapChange::Zone { name, zone } => draw(&view.state, name, zone.as_ref(), is_sure),
        MapChange::Closed { edge, closed } => close(&view.state, *edge, *closed),
        MapChange::Erased { nodes } => erase(&view.state, nodes),
        MapChange::FloorPlan(plan) => {
            let is_so = view.state.annotations().floor_plan() == plan.as_ref();
            Ok(unless(is_so, Op::SetFloorPlan { plan: plan.clone() }))
        }
        MapChange::Datum(datum) => {
            let is_so = view.state.annotations().datum() == *datum;
            Ok(unless(is_so, Op::SetDatum { datum: *datum }))
        }
        MapChange::Release { name } => release(view, author, name),
        MapChange::Enable { release } => enable(view, release.as_deref()),
        MapChange::Undo { count } => undo(view, log, author, *count),
    }
}

fn unless(is_so: bool, op: Op) -> PlannedEdit {
    if is_so { PlannedEdit::default() } else { op.into() }
}

fn doubted(doubt: DoubtfulWords) -> ErrorReply {
    bad_request(format!("{doubt}; with force it is written all the same"))
}

fn place(state: &MapState, name: &Label, pose: Option<FixedPose>, is_sure: bool) -> Result<PlannedEdit, ErrorReply> {
    let annotations = state.annotations();
    let known = annotations.place(name);
    if pose.is_none() && known.is_none() {
        let names = known_names(annotations.places().map(|(name, _)| name));
        return Err(ErrorReply::new(ErrorCode::UnknownPlace, &format!("there is no place called {name} ({names})")));
    }
    if known == pose {
        return Ok(PlannedEdit::default());
    }
    if let Some(pose) = pose.filter(|_| !is_sure) {
        check_place(state, pose.position).map_err(doubted)?;
    }
    Ok(Op::SetPlace { name: name.clone(), pose }.into())
}

fn draw(state: &MapState, name: &Label, zone: Option<&Zone>, is_sure: bool) -> Result<PlannedEdit, ErrorReply> {
    let known = state.annotations().zones().find(|(known, _)| *known == name).map(|(_, zone)| zone);
    if zone.is_none() && known.is_none() {
        let names = known_names(state.annotations().zones().map(|(name, _)| name));
        return Err(bad_request(format!("there is no zone {name} ({names})")));
    }
    if known == zone {
        return Ok(PlannedEdit::default());
    }
    if let Some(zone) = zone {
        zone.check_border().map_err(|reason| bad_request(format!("zone {name}: {reason}")))?;
        if !is_sure {
            check_zone(state, zone).map_err(doubted)?;
        }
    }
    Ok(Op::SetZone { name: name.clone(), zone: zone.cloned() }.into())
}

fn close(state: &MapState, edge: EdgeKey, closed: bool) -> Result<PlannedEdit, ErrorReply> {
    let is_closed = state.closed_edges().any(|known| known == edge);
    // One that was closed while it was there can be opened when it is not.
    if !is_closed && !state.has_edge(edge) {
        let [a, b] = edge.to_texts();
        return Err(ErrorReply::new(ErrorCode::UnknownNode, &format!("no edge joins {a} and {b}")));
    }
    if is_closed == closed { Ok(PlannedEdit::default()) } else { Ok(Op::SetClosed { edge, closed }.into()) }
}

/// Nodes that are not there are as they should be.
fn erase(state: &MapState, nodes: &[NodeId]) -> Result<PlannedEdit, ErrorReply> {
    let known: BTreeSet<NodeId> = nodes.iter().copied().filter(|id| state.node(*id).is_some()).collect();
    if known.is_empty() {
        return Err(ErrorReply::new(ErrorCode::UnknownNode, "the map has none of these nodes"));
    }
    let ops = known.into_iter().map(|id| Op::RemoveNode { id }).collect();
    Ok(PlannedEdit { ops, ..PlannedEdit::default() })
}

fn release(view: &MapView, author: AuthorId, name: &ReleaseName) -> Result<PlannedEdit, ErrorReply> {
    let (annotations, head) = (view.state.annotations(), &view.head);
    if annotations.releases().any(|known| known.id.name == *name) {
        let text = format!("there is a release {name} already; releases never change");
        return Err(ErrorReply::new(ErrorCode::Conflict, &text));
    }
    if annotations.deleted_releases().any(|id| id.author == author && id.name == *name) {
        let text = format!("a release {name} was deleted before: choose another name");
        return Err(ErrorReply::new(ErrorCode::Conflict, &text));
    }
    let release = Release { vector: head.vector.clone(), digest: head.digest };
    Ok(Op::PutRelease { name: name.clone(), release }.into())
}

fn enable(view: &MapView, release: Option<&str>) -> Result<PlannedEdit, ErrorReply> {
    let annotations = view.state.annotations();
    let unknown = |text: String| ErrorReply::new(ErrorCode::UnknownVersion, &text);
    let id: Option<ReleaseId> = release.map(|text| find_release(&view.state, text)).transpose().map_err(unknown)?;
    if annotations.enabled().map(|enabled| enabled.id) == id.as_ref() {
        return Ok(PlannedEdit::default());
    }
    let vector = id.as_ref().and_then(|id| annotations.release(id)).map(|release| &release.release.vector);
    if let Some(vector) = vector.filter(|vector| !view.head.vector.covers(vector)) {
        return Err(unknown(format!("this server does not have all of that release yet: {vector}")));
    }
    Ok(Op::Enable { release: id }.into())
}

/// Everything that a map consists of.
fn whole(view: &MapView, log: &dyn IncrementLog) -> Result<Series, ErrorReply> {
    let (map, vector) = (&view.head.map, &view.head.vector);
    let lacking = log.reader().lacking(map, &VersionVector::default(), vector, usize::MAX);
    let Lacking { compacted, increments } = lacking.map_err(internal)?;
    let mut series = Series::default();
    for bytes in &compacted {
        series.folds.push(decode(bytes).map_err(internal)?);
    }
    for bytes in &increments {
        series.increments.push(decode(bytes).map_err(internal)?);
    }
    Ok(series)
}

fn undo(view: &MapView, log: &dyn IncrementLog, author: AuthorId, count: u64) -> Result<PlannedEdit, ErrorReply> {
    if !(1..=MAX_UNDONE).contains(&count) {
        return Err(bad_request(format!("count must be 1 to {MAX_UNDONE}")));
    }
    let refused = |error: InverseError| ErrorReply::new(ErrorCode::Conflict, &error.to_string());
    let Inverse { first, last, ops, words } = inverse(&whole(view, log)?, author, count).map_err(refused)?;
    if ops.len() > Increment::MAX_OPS {
        let text = "that takes more than one increment: take it back with map-server undo";
        return Err(bad_request(text.to_owned()));
    }
    for op in &ops {
        if let Op::PutRelease { release, .. } = op {
            let state = state_at(&view.head.map, &release.vector, log).map_err(internal)?;
            if state.is_none_or(|state| state.digest() != release.digest) {
                return Err(bad_request("the state of the deleted release was folded away".to_owned()));
            }
        }
    }
    // What somebody else writes under this name meanwhile would be undone once more, or not at all.
    let number = Some(view.head.vector.get(author) + 1);
    Ok(PlannedEdit { ops, number, undone: Some(([first, last], words)) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::Catalog;
    use crate::store::MemoryLog;
    use fht_proto::{FixedPoint, MapName, NodeKind, Rect};

    const ANA: AuthorId = AuthorId(10);

    fn node(number: u32) -> NodeId {
        NodeId { author: ANA, number }
    }

    /// Two nodes and an edge, which come as a robot would put them.
    fn site() -> (MapName, Catalog, MemoryLog) {
        let (map, log): (MapName, _) = ("m".parse().unwrap_or_else(|error| panic!("{error}")), MemoryLog::new());
        let catalog = Catalog::default();
        let mut ops = Vec::new();
        for (number, x) in [(0, 0.0), (1, 1.0)] {
            let pose = FixedPose::from_metres(x, 0.0, 0.0);
            let rect = Rect::around(pose.position, (x - 2.0, -2.0), (x + 2.0, 2.0));
            ops.push(Op::PutNode { id: node(number), kind: NodeKind::Support, pose });
            ops.push(Op::SetFreeSpace { id: node(number), rect: Some(rect) });
        }
        ops.push(Op::PutEdge { edge: EdgeKey::new(node(0), node(1)) });
        let increment = Increment { author: ANA, number: 1, hlc_us: 1, ops };
        let mut vector = VersionVector::default();
        vector.set(ANA, 1);
        let applied = catalog.apply(&map, &[], &[increment], vector, 1, &log);
        assert!(applied.is_ok(), "{applied:?}");
        (map, catalog, log)
    }

    #[test]
    fn what_changes_nothing_is_not_written_and_what_is_not_there_is_told() {
        let (map, catalog, log) = site();
        let view = catalog.view(&map).unwrap_or_else(|| panic!("it is there"));
        let edge = EdgeKey::new(node(0), node(1));
        let label: Label = "dock".parse().unwrap_or_else(|error| panic!("{error}"));
        let planned = |change: MapChange, force: bool| {
            let order = MapChangeOrder { map: map.clone(), change, force };
            plan(&view, &log, ANA, &order).map(|edit| edit.ops.len()).map_err(|error| error.code)
        };
        let at = |x: f64| MapChange::Place { name: label.clone(), pose: Some(FixedPose::from_metres(x, 0.0, 0.0)) };
        assert_eq!(planned(at(1.0), false), Ok(1));
        assert_eq!((planned(at(50.0), false), planned(at(50.0), true)), (Err(ErrorCode::BadRequest), Ok(1)));
        let gone = MapChange::Place { name: label.clone(), pose: None };
        assert_eq!(planned(gone, false), Err(ErrorCode::UnknownPlace));
        let closed = |edge, closed| planned(MapChange::Closed { edge, closed }, false);
        assert_eq!((closed(edge, true), closed(edge, false)), (Ok(1), Ok(0)));
        assert_eq!(closed(EdgeKey::new(node(0), node(7)), true), Err(ErrorCode::UnknownNode));
        let erased = |nodes: Vec<NodeId>| planned(MapChange::Erased { nodes }, false);
        assert_eq!(erased(vec![node(0), node(1), node(0), node(9)]), Ok(2));
        assert_eq!(erased(vec![node(9)]), Err(ErrorCode::UnknownNode));
        assert_eq!(planned(MapChange::Enable { release: None }, false), Ok(0));
        let spring = MapChange::Enable { release: Some("spring".to_owned()) };
        assert_eq!(planned(spring, false), Err(ErrorCode::UnknownVersion));
        assert_eq!(planned(MapChange::Undo { count: 0 }, false), Err(ErrorCode::BadRequest));
        let corners = [(0, 0), (1000, 1000), (1000, 0), (0, 1000)];
        let corners = corners.map(|(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).to_vec();
        let knot = Some(Zone { rule: fht_proto::ZoneRule::KeepOut, corners });
        assert_eq!(planned(MapChange::Zone { name: label, zone: knot }, true), Err(ErrorCode::BadRequest));
    }
}
