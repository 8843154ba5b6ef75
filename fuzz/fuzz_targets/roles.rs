#![no_main]
//! What explorers and clients may write, whatever the map is. The first half of a series is the
//! map; each increment of the second half is held against its author's role.

use fht_fuzz::decode_all;
use fht_map::{MapState, WriterRole, may_write, takes_from_others};
use fht_proto::api::reply::Series;
use fht_proto::{AuthorId, FixedPose, Increment, NodeId};
use libfuzzer_sys::fuzz_target;
use std::collections::{BTreeMap, BTreeSet};

/// What people decide: all annotations but the descriptor models, which explorers bring along.
fn decided(map: &MapState) -> String {
    let it = map.annotations();
    let (places, zones): (Vec<_>, Vec<_>) = (it.places().collect(), it.zones().collect());
    let releases: Vec<_> = it.releases().map(|release| (release.id, release.release)).collect();
    format!("{places:?} {zones:?} {releases:?} {:?}", it.enabled().map(|release| release.id))
}

/// The nodes of everybody but one author.
fn others(map: &MapState, author: AuthorId) -> BTreeMap<NodeId, FixedPose> {
    map.nodes().filter(|node| node.id.author != author).map(|node| (node.id, node.pose)).collect()
}

fn judge(map: &mut MapState, increment: &Increment) {
    let Increment { author, ops, .. } = increment;
    let allows = |role| ops.iter().all(|op| may_write(role, *author, op).is_ok());
    assert!(allows(WriterRole::Operator));
    assert_eq!(allows(WriterRole::Client), ops.is_empty());
    let (decided_before, others_before) = (decided(map), others(map, *author));
    map.apply(increment);
    if !allows(WriterRole::Explorer) {
        return;
    }
    assert_eq!(decided(map), decided_before, "an explorer decides nothing");
    let taken: BTreeSet<NodeId> = ops.iter().filter_map(|op| takes_from_others(*author, op)).collect();
    let now = others(map, *author);
    for (id, pose) in others_before {
        let is_as_before = now.get(&id) == Some(&pose);
        assert!(is_as_before || taken.contains(&id), "{id} goes or moves, and nobody counts it");
    }
}

fuzz_target!(|bytes: &[u8]| {
    for series in decode_all::<Series>(bytes) {
        let mut map = MapState::new();
        let (before, judged) = series.increments.split_at(series.increments.len() / 2);
        before.iter().for_each(|increment| map.apply(increment));
        judged.iter().for_each(|increment| judge(&mut map, increment));
    }
});
