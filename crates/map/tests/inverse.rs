//! What takes an author's newest increments back brings about the map without them, and is refused
//! where others have written since.
#![allow(clippy::unwrap_used)] // tests may panic

mod drawn;

use drawn::{increments, state_of};
use fht_map::MapState;
use fht_map::crdt::compaction::whole;
use fht_map::crdt::inverse::{InverseError, folded_upto, inverse, inverse_of, inverse_of_all};
use fht_proto::model::compaction::Series;
use fht_proto::{AuthorId, Digest, FixedPose, Increment, Op, Release, ReleaseId, VersionVector};
use proptest::prelude::*;
use std::collections::BTreeMap;

const DESK: AuthorId = AuthorId(1);
const OTHER: AuthorId = AuthorId(2);

/// Increments by these authors, one operation each, a clock tick apart.
fn log(writes: &[(AuthorId, Op)]) -> Series {
    let mut increments: Vec<Increment> = Vec::new();
    for (author, op) in writes {
        let number = 1 + increments.iter().filter(|it| it.author == *author).count() as u64;
        let hlc_us = 1 + increments.len() as u64;
        increments.push(Increment { author: *author, number, hlc_us, ops: vec![op.clone()] });
    }
    Series { folds: Vec::new(), increments }
}

fn then(mut map: Series, ops: Vec<Op>) -> Series {
    let number = 1 + map.increments.iter().filter(|it| it.author == DESK).count() as u64;
    let hlc_us = 1 + map.increments.iter().map(|it| it.hlc_us).max().unwrap_or(0);
    map.increments.push(Increment { author: DESK, number, hlc_us, ops });
    map
}

fn place(x: f64) -> Op {
    Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(FixedPose::from_metres(x, 0.0, 0.0)) }
}

fn dock(map: &Series) -> Option<f64> {
    let state = state_of(&map.increments);
    state.annotations().place(&"dock".parse().unwrap()).map(|pose| pose.position.x())
}

fn opening() -> (Op, ReleaseId) {
    let mut vector = VersionVector::default();
    vector.set(DESK, 1);
    let name: fht_proto::ReleaseName = "opening".parse().unwrap();
    let release = Release { vector, digest: Digest([7; 32]) };
    (Op::PutRelease { name: name.clone(), release }, ReleaseId { author: DESK, name })
}

#[test]
fn an_undo_is_a_change_that_an_undo_takes_back() {
    let map = log(&[(OTHER, place(1.0)), (DESK, place(2.0)), (DESK, place(3.0))]);
    let once = inverse(&map, DESK, 1).unwrap();
    assert_eq!((once.first, once.last, once.words.len()), (2, 2, 1));
    assert_eq!(dock(&then(map.clone(), once.ops.clone())), Some(2.0));
    let undone = then(map.clone(), once.ops);
    let again = inverse(&undone, DESK, 1).unwrap();
    assert_eq!(dock(&then(undone.clone(), again.ops)), Some(3.0));
    assert_eq!(dock(&then(undone.clone(), inverse(&undone, DESK, 3).unwrap().ops)), Some(1.0), "beyond it");
    assert_eq!(inverse(&map, DESK, 3).unwrap_err(), InverseError::TooFew { author: DESK, written: 2, count: 3 });
    let nothing = then(undone, vec![place(2.0)]);
    assert!(matches!(inverse(&nothing, DESK, 1), Err(InverseError::Unchanged { first: 4, last: 4, .. })));
}

#[test]
fn what_others_have_written_since_stays() {
    let map = log(&[(DESK, place(1.0)), (OTHER, place(2.0))]);
    let refused = inverse(&map, DESK, 1).unwrap_err();
    assert_eq!(refused, InverseError::Overwritten { what: "place dock".to_owned(), by: OTHER });
    // What came before counts.
    let between = log(&[(DESK, place(1.0)), (OTHER, place(2.0)), (DESK, place(3.0))]);
    assert_eq!(dock(&then(between.clone(), inverse(&between, DESK, 2).unwrap().ops)), Some(2.0));
}

#[test]
fn what_others_have_touched_and_put_back_is_taken_back_as_if_they_had_not() {
    let put_back = [(OTHER, place(9.0)), (DESK, place(1.0)), (OTHER, place(2.0)), (OTHER, place(1.0))];
    let map = log(&put_back);
    assert_eq!(dock(&then(map.clone(), inverse(&map, DESK, 1).unwrap().ops)), Some(9.0), "as it was before");
    // As one who takes a merge back does: by which increments they are.
    let of_merge = inverse_of(&map, DESK, OTHER, |increment| increment.number == 1).unwrap();
    assert_eq!(of_merge.words.len(), 1);
    let mut untouched = map.clone();
    untouched.increments.truncate(2);
    assert_eq!(inverse(&untouched, DESK, 1).unwrap(), inverse(&map, DESK, 1).unwrap());
    // Taken away and put there again; and what was nothing before.
    let away = Op::SetPlace { name: "dock".parse().unwrap(), pose: None };
    let map = log(&[(DESK, place(1.0)), (OTHER, away), (OTHER, place(1.0))]);
    assert_eq!(dock(&then(map.clone(), inverse(&map, DESK, 1).unwrap().ops)), None);
    // Not what is somewhere else in the end, and not what was folded meanwhile.
    let map = log(&[(DESK, place(1.0)), (OTHER, place(1.0)), (OTHER, place(2.0))]);
    assert!(matches!(inverse(&map, DESK, 1), Err(InverseError::Overwritten { .. })));
    // Nor what another has written without changing it, at once or once it was put back: that
    // stands by itself.
    for since in [&[1.0][..], &[2.0, 1.0, 1.0], &[1.0, 2.0, 1.0]] {
        let mut writes = vec![(OTHER, place(9.0)), (DESK, place(1.0))];
        writes.extend(since.iter().map(|x| (OTHER, place(*x))));
        assert!(matches!(inverse(&log(&writes), DESK, 1), Err(InverseError::Overwritten { .. })), "{since:?}");
    }
    let mut map = log(&put_back);
    let folded = map.increments.remove(2);
    map.folds.push(whole(&folded));
    assert!(matches!(inverse(&map, DESK, 1), Err(InverseError::Overwritten { .. })));
}

#[test]
fn what_was_folded_is_not_taken_back() {
    let mut map = log(&[(DESK, place(1.0)), (DESK, place(2.0))]);
    map.folds.push(whole(&map.increments.remove(0)));
    assert!(inverse(&map, DESK, 1).is_ok(), "what was before it is known");
    for count in [2, 50] {
        let refusal = inverse(&map, DESK, count).unwrap_err();
        assert_eq!(refusal, InverseError::Compacted { author: DESK, last: 1, later: 1 });
        assert!(refusal.to_string().contains("only the last 1 can be"), "{refusal}");
    }
    // Of somebody whose increments are folded in part, the rest is.
    let rest = inverse_of_all(&map, DESK, OTHER).unwrap();
    assert_eq!((rest.first, rest.last, folded_upto(&map, DESK)), (2, 2, 1));
    map.folds.push(whole(&map.increments.remove(0)));
    let folded = InverseError::Compacted { author: DESK, last: 2, later: 0 };
    assert_eq!(inverse_of_all(&map, DESK, OTHER).unwrap_err(), folded);
    assert_eq!(inverse_of(&map, DESK, OTHER, |_| true).unwrap_err(), folded);
    assert_eq!(inverse_of_all(&map, OTHER, DESK).unwrap_err(), InverseError::NoneSuch { author: OTHER });
}

#[test]
fn releases_are_deleted_and_come_back_under_another_name() {
    let (put, id) = opening();
    let made = log(&[(DESK, place(1.0)), (DESK, put)]);
    let gone = then(made.clone(), inverse(&made, DESK, 1).unwrap().ops);
    assert!(state_of(&gone.increments).annotations().release(&id).is_none());
    let back = inverse(&gone, DESK, 1).unwrap();
    assert!(back.words[0].contains("as opening-2@00000001"), "{:?}", back.words);
    let back = then(gone, back.ops);
    let again = ReleaseId { name: "opening-2".parse().unwrap(), ..id.clone() };
    let state = state_of(&back.increments);
    assert_eq!(state.annotations().release(&again).unwrap().release.digest, Digest([7; 32]));

    // Robots use it by another operator's word: it stays.
    let used = Op::Enable { release: Some(id.clone()) };
    let mut by_other = made.clone();
    by_other.increments.push(Increment { author: OTHER, number: 1, hlc_us: 9, ops: vec![used.clone()] });
    assert_eq!(inverse(&by_other, DESK, 1).unwrap_err(), InverseError::InUse { release: id.clone() });
    // By one's own it is taken back with that.
    let own = then(made, vec![used]);
    assert!(inverse(&own, DESK, 2).is_ok());
    // What robots used is used again under its new name.
    let deleted = then(then(own, vec![Op::Enable { release: None }]), vec![Op::RemoveRelease { id }]);
    let both = then(deleted.clone(), inverse(&deleted, DESK, 2).unwrap().ops);
    assert_eq!(state_of(&both.increments).annotations().enabled().unwrap().id, &again);
    assert!(inverse(&then(deleted, vec![place(4.0)]), DESK, 1).is_ok());
}

/// What is seen of a map, but for releases, whose names do not come back, and models, which stay.
fn seen(state: &MapState) -> String {
    let nodes: Vec<_> = state.nodes().collect();
    let (edges, closed): (Vec<_>, Vec<_>) = (state.edges().collect(), state.closed_edges().collect());
    let annotations = state.annotations();
    let (places, zones): (Vec<_>, Vec<_>) = (annotations.places().collect(), annotations.zones().collect());
    format!("{nodes:?} {edges:?} {closed:?} {places:?} {zones:?}")
}

/// What of a map an operation sets as a whole, by a name for it.
fn one_value(op: &Op) -> Option<String> {
    match op {
        Op::PutEdge { edge } | Op::RemoveEdge { edge } => Some(format!("edge {edge:?}")),
        Op::SetClosed { edge, .. } => Some(format!("closure {edge:?}")),
        Op::SetPlace { name, .. } => Some(format!("place {name}")),
        Op::SetZone { name, .. } => Some(format!("zone {name}")),
        Op::SetFloorPlan { .. } => Some("floor plan".to_owned()),
        Op::SetDatum { .. } => Some("datum".to_owned()),
        _ => None,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Whoever has written what: without releases and models, which stay. What others have done to
    /// places, edges and the like since is refused, or they have put it back: it is left out, too.
    #[test]
    fn the_map_is_what_it_would_be_without_them(log in increments(), count in 1..3_u64) {
        let is_plain = |op: &Op| !matches!(
            op, Op::PutRelease { .. } | Op::RemoveRelease { .. } | Op::Enable { .. } | Op::PutModel { .. }
        );
        let tick = |(index, mut increment): (usize, Increment)| {
            increment.hlc_us = 1 + index as u64;
            increment.ops.retain(is_plain);
            increment
        };
        let increments: Vec<Increment> = log.into_iter().enumerate().map(tick).collect();
        let last = increments.iter().filter(|it| it.author == DESK).count() as u64;
        let map = Series { folds: Vec::new(), increments };
        if let Ok(back) = inverse(&map, DESK, count) {
            let is_kept = |it: &&Increment| it.author != DESK || it.number + count <= last;
            let mut without: Vec<Increment> = map.increments.iter().filter(is_kept).cloned().collect();
            // What was undone of each, when, and what others have made of it since.
            let mut newest: BTreeMap<String, (u64, Vec<Op>)> = BTreeMap::new();
            for undone in map.increments.iter().filter(|it| !is_kept(it)) {
                for (value, op) in undone.ops.iter().filter_map(|op| Some((one_value(op)?, op))) {
                    newest.insert(value, (undone.hlc_us, vec![op.clone()]));
                }
            }
            for it in &mut without {
                it.ops.retain(|op| {
                    let since = one_value(op).and_then(|value| newest.get_mut(&value));
                    let Some((_, values)) = since.filter(|(undone_us, _)| it.hlc_us > *undone_us) else { return true };
                    values.push(op.clone());
                    false
                });
            }
            for (value, (_, ops)) in newest {
                let is_put_back = ops.first() == ops.last();
                let is_meant = ops.windows(2).any(|two| two[0] == two[1] && two[0] == ops[0]);
                prop_assert!(ops.len() == 1 || is_put_back && !is_meant, "{} is somebody else's: {:?}", value, ops);
            }
            let expected = state_of(&without);
            prop_assert_eq!(seen(&state_of(&then(map.clone(), back.ops).increments)), seen(&expected));
        }
    }
}
