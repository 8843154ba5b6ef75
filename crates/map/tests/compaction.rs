//! Folding a log changes no state that is kept, and none that comes later.
#![allow(clippy::unwrap_used)] // tests may panic

mod drawn;

use drawn::{increments, shown, state_of};
use fht_map::crdt::compaction::{CompactionConfig, compact, whole};
use fht_map::{Accepted, MapState, Replica};
use fht_proto::model::compaction::CompactedSeries;
use fht_proto::{AuthorId, Increment, VersionVector};
use proptest::prelude::*;

/// The part of a log that a vector contains.
fn upto<'a>(log: &'a [Increment], vector: &'a VersionVector) -> impl Iterator<Item = &'a Increment> + Clone {
    log.iter().filter(|increment| increment.number <= vector.get(increment.author))
}

fn state_at(folds: &[CompactedSeries], log: &[Increment], folded: &VersionVector, vector: &VersionVector) -> MapState {
    let mut state = MapState::new();
    folds
        .iter()
        .filter(|compact| compact.last <= vector.get(compact.author))
        .for_each(|compact| state.apply_fold(compact));
    upto(log, vector).filter(|it| it.number > folded.get(it.author)).for_each(|increment| state.apply(increment));
    state
}

/// A vector within what the log has, by shares of each author's increments.
fn vector_of(log: &[Increment], shares: [u8; 3]) -> VersionVector {
    let mut vector = VersionVector::default();
    for (author, share) in (0..).map(AuthorId).zip(shares) {
        let last = log.iter().filter(|increment| increment.author == author).count() as u64;
        vector.set(author, last * u64::from(share) / 4);
    }
    vector
}

fn shares() -> impl Strategy<Value = [u8; 3]> {
    [0..=4_u8, 0..=4_u8, 0..=4_u8]
}

/// As in each author's sequence.
fn in_order(mut log: Vec<Increment>) -> Vec<Increment> {
    log.sort_by_key(|increment| (increment.author, increment.number));
    log
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn kept_states_and_later_ones_stay_what_they_are(
        log in increments().prop_map(in_order),
        folded in shares(),
        kept in prop::collection::vec(shares(), 0..4),
        again in shares(),
        max_bytes in prop::sample::select(vec![0, 400, 64 << 10]),
    ) {
        let config = CompactionConfig { max_bytes };
        let folded = vector_of(&log, folded);
        let kept: Vec<VersionVector> = kept.into_iter().map(|shares| vector_of(&log, shares)).collect();
        let whole_log: Vec<CompactedSeries> = upto(&log, &folded).map(whole).collect();
        let folds = compact(&whole_log, &folded, &kept, &config);
        let all = vector_of(&log, [4; 3]);
        for vector in kept.iter().chain([&folded, &all]) {
            let (expected, state) = (state_of(upto(&log, vector)), state_at(&folds, &log, &folded, vector));
            prop_assert_eq!(expected.digest(), state.digest(), "at {}", vector);
            prop_assert_eq!(shown(&expected), shown(&state));
        }
        // Folded once more, farther.
        let farther = folded.join(&vector_of(&log, again));
        let rest = upto(&log, &farther).filter(|it| it.number > folded.get(it.author)).map(whole);
        let longer: Vec<CompactedSeries> = folds.iter().cloned().chain(rest).collect();
        let folds = compact(&longer, &farther, &kept, &config);
        for vector in kept.iter().chain([&farther, &all]) {
            let (expected, state) = (state_of(upto(&log, vector)), state_at(&folds, &log, &farther, vector));
            prop_assert_eq!(expected.digest(), state.digest(), "after two folds, at {}", vector);
        }
    }

    #[test]
    fn a_replica_takes_folds_wherever_it_is(
        log in increments().prop_map(in_order), folded in shares(), have in shares()
    ) {
        let (folded, have) = (vector_of(&log, folded), vector_of(&log, have));
        let mut replica = Replica::default();
        for increment in upto(&log, &have) {
            prop_assert_eq!(replica.accept(increment.clone()), Accepted::Applied(1));
        }
        let whole_log: Vec<CompactedSeries> = upto(&log, &folded).map(whole).collect();
        for compact in compact(&whole_log, &folded, &[], &CompactionConfig { max_bytes: 400 }) {
            replica.accept_fold(&compact);
        }
        prop_assert_eq!(replica.vector(), &have.join(&folded));
        for increment in &log {
            let outcome = replica.accept(increment.clone());
            prop_assert!(matches!(outcome, Accepted::Applied(1) | Accepted::Duplicate), "{:?}", outcome);
        }
        prop_assert_eq!(replica.state().digest(), state_of(&log).digest());
    }
}

#[test]
fn corrections_of_corrections_are_dropped() {
    use fht_proto::{FixedPoint, FixedPose, NodeId, NodeKind, Op};
    let id = NodeId { author: AuthorId(1), number: 0 };
    let pose = |x_mm| FixedPose { position: FixedPoint { x_mm, y_mm: 0 }, yaw_e4: 0 };
    let first = Op::PutNode { id, kind: NodeKind::Support, pose: pose(0) };
    let moves = (1..100).map(|x_mm| Op::SetPose { id, pose: pose(x_mm) });
    let ops = std::iter::once(first).chain(moves);
    let log: Vec<CompactedSeries> = ops
        .zip(1..)
        .map(|(op, number)| whole(&Increment { author: AuthorId(1), number, hlc_us: number, ops: vec![op] }))
        .collect();
    let mut upto = VersionVector::default();
    upto.set(AuthorId(1), 100);
    let mut release = VersionVector::default();
    release.set(AuthorId(1), 50);
    let left = |kept: &[VersionVector]| {
        let folds = compact(&log, &upto, kept, &CompactionConfig::default());
        (folds.len(), folds.iter().flat_map(|compact| &compact.rests).map(|rest| rest.number).collect::<Vec<_>>())
    };
    assert_eq!(left(&[]), (1, vec![1, 100]));
    assert_eq!(left(&[release]), (2, vec![1, 50, 100]));
}
