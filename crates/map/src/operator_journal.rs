//! What operators have done to a map: who, when, and in words, the newest so many changes. It
//! follows the increments one by one, so that nobody reads them again when somebody asks.
//!
//! An increment does not say what its author is. It is an operator's if something in it is for
//! operators only ([`may_write`]); if its author has written such a thing to the map before, or is
//! known as one ([`OperatorJournal::know_operator`]); or if it does nothing but remove others'
//! nodes, and its author has never put one: so a part of a map is erased. Each author's increments
//! come in order, so the journal is the same whatever comes between them.
//!
//! ```
//! use fht_map::OperatorJournal;
//! use fht_proto::{AuthorId, FixedPose, Increment, Op};
//! use std::sync::Arc;
//!
//! let (author, pose) = (AuthorId::of_robot("ada"), Some(FixedPose::from_metres(5.0, 3.0, 0.0)));
//! let ops = vec![Op::SetPlace { name: "dock".parse()?, pose }];
//! let mut journal = Arc::new(OperatorJournal::default());
//! OperatorJournal::take(&mut journal, &Increment { author, number: 1, hlc_us: 7, ops });
//! let (at, change) = journal.newest_first(None).next().ok_or("nothing")?;
//! assert_eq!((at.author, change.words.join("; ")), (author, "place dock is at 5.00,3.00, 0°".to_owned()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod words;

use crate::permission::{WriterRole, may_write};
use fht_proto::api::reply::JournalCursor;
use fht_proto::{AuthorId, CompactedSeries, Increment, Op};
use std::collections::BTreeMap;
use std::ops::Bound;
use std::sync::Arc;
use words::in_words;

/// So many changes are remembered.
const MAX_CHANGES: usize = 1000;
/// … and so many bytes of them, about.
const MAX_BYTES: usize = 512 << 10;

/// What an operator did with one increment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OperatorChange {
    /// Whether the increment is folded, and these are only the words for what is left of it.
    pub is_folded: bool,
    /// What it did, a sentence each.
    pub words: Vec<String>,
}

impl OperatorChange {
    fn memory_bytes(&self) -> usize {
        size_of::<(JournalCursor, Self)>()
            + self.words.iter().map(|words| size_of::<String>() + words.len()).sum::<usize>()
    }
}

/// What an author is, as far as its increments tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Deeds {
    /// It has put nodes.
    Maps,
    /// It has written what only operators may.
    Operates,
}

/// The newest changes of operators.
#[derive(Clone, Debug, Default)]
pub struct OperatorJournal {
    changes: BTreeMap<JournalCursor, OperatorChange>,
    bytes: usize,
    writers: BTreeMap<AuthorId, Deeds>,
}

impl OperatorJournal {
    /// `author` is known to be an operator: from here on the journal tells of whatever it does.
    pub fn know_operator(journal: &mut Arc<Self>, author: AuthorId) {
        if journal.writers.get(&author) != Some(&Deeds::Operates) {
            Arc::make_mut(journal).writers.insert(author, Deeds::Operates);
        }
    }

    /// An increment has become part of the map. Copies are made only when something changes.
    pub fn take(journal: &mut Arc<Self>, increment: &Increment) {
        let Increment { author, number, hlc_us, ops } = increment;
        let at = JournalCursor { hlc_us: *hlc_us, author: *author, number: *number };
        Self::note(journal, at, ops.iter(), false);
    }

    /// What is left of folded increments has taken their place.
    pub fn take_fold(journal: &mut Arc<Self>, series: &CompactedSeries) {
        // An author's folded increments are several series if a kept release lies between them.
        let numbers = series.first..=series.last;
        let is_in = |at: &JournalCursor| at.author == series.author && numbers.contains(&at.number);
        if journal.changes.keys().any(is_in) {
            let kept = Arc::make_mut(journal);
            kept.changes.retain(|at, _| !is_in(at));
            kept.bytes = kept.changes.values().map(OperatorChange::memory_bytes).sum();
        }
        for rest in &series.rests {
            let at = JournalCursor { hlc_us: rest.hlc_us, author: series.author, number: rest.number };
            Self::note(journal, at, rest.ops.iter().map(|(_, op)| op), true);
        }
    }

    fn note<'a>(
        journal: &mut Arc<Self>,
        at: JournalCursor,
        ops: impl Iterator<Item = &'a Op> + Clone,
        is_folded: bool,
    ) {
        let known = journal.writers.get(&at.author).copied();
        let operates = || ops.clone().any(|op| may_write(WriterRole::Explorer, at.author, op).is_err());
        let deeds = match known {
            Some(Deeds::Operates) => known,
            _ if operates() => Some(Deeds::Operates),
            None if ops.clone().any(|op| matches!(op, Op::PutNode { .. })) => Some(Deeds::Maps),
            known => known,
        };
        if let Some(deeds) = deeds.filter(|_| deeds != known) {
            Arc::make_mut(journal).writers.insert(at.author, deeds);
        }
        let erases = |op: &Op| matches!(op, Op::RemoveNode { id } if id.author != at.author);
        let is_operators = match deeds {
            Some(Deeds::Operates) => true,
            Some(Deeds::Maps) => false,
            None => ops.clone().next().is_some() && ops.clone().all(erases),
        };
        if is_operators {
            let change = OperatorChange { is_folded, words: in_words(at.author, ops) };
            Arc::make_mut(journal).insert(at, change);
        }
    }

    fn insert(&mut self, at: JournalCursor, change: OperatorChange) {
        if change.words.is_empty() {
            return;
        }
        self.bytes += change.memory_bytes();
        let before = self.changes.insert(at, change);
        self.bytes -= before.as_ref().map_or(0, OperatorChange::memory_bytes);
        while self.changes.len() > MAX_CHANGES || self.bytes > MAX_BYTES {
            let Some((_, oldest)) = self.changes.pop_first() else { return };
            self.bytes -= oldest.memory_bytes();
        }
    }

    /// The changes, the newest first; those that follow `after`, if it is given.
    pub fn newest_first(&self, after: Option<JournalCursor>) -> impl Iterator<Item = (JournalCursor, &OperatorChange)> {
        let upto = after.map_or(Bound::Unbounded, Bound::Excluded);
        self.changes.range((Bound::Unbounded, upto)).rev().map(|(at, change)| (*at, change))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{FixedPose, NodeId, NodeKind};

    const ADA: AuthorId = AuthorId(1);
    const AMR: AuthorId = AuthorId(2);

    fn increment(author: AuthorId, number: u64, ops: Vec<Op>) -> Increment {
        Increment { author, number, hlc_us: 10 * number + u64::from(author.0), ops }
    }

    fn place(name: &str) -> Op {
        let name = name.parse().unwrap_or_else(|error| panic!("{error}"));
        Op::SetPlace { name, pose: Some(FixedPose::default()) }
    }

    fn put(author: AuthorId, number: u32) -> Op {
        Op::PutNode { id: NodeId { author, number }, kind: NodeKind::Support, pose: FixedPose::default() }
    }

    fn erase(author: AuthorId, number: u32) -> Op {
        Op::RemoveNode { id: NodeId { author, number } }
    }

    fn journal_of(increments: &[Increment]) -> Arc<OperatorJournal> {
        let mut journal = Arc::default();
        increments.iter().for_each(|increment| OperatorJournal::take(&mut journal, increment));
        journal
    }

    fn told(journal: &OperatorJournal) -> Vec<(u32, u64, String)> {
        let line = |(at, change): (JournalCursor, &OperatorChange)| (at.author.0, at.number, change.words.join("; "));
        journal.newest_first(None).map(line).collect()
    }

    #[test]
    fn operators_are_told_from_robots_by_what_they_write() {
        let ben = AuthorId(3);
        let all = [
            increment(AMR, 1, vec![put(AMR, 0), put(AMR, 1)]),
            increment(ADA, 1, vec![erase(AMR, 0)]),
            // A robot that has made a map retires a node of another.
            increment(AMR, 2, vec![erase(ben, 0)]),
            increment(ADA, 2, vec![place("dock")]),
            // What is an operator's is so whatever it is.
            increment(ADA, 3, vec![put(ADA, 0), put(ADA, 1)]),
        ];
        let journal = journal_of(&all);
        let dock = "place dock is at 0.00,0.00, 0°".to_owned();
        let expected = [(1, 3, "2 nodes are put".to_owned()), (1, 2, dock), (1, 1, "1 node is taken away".to_owned())];
        assert_eq!(told(&journal), expected);
        // A log is read author by author.
        let by_author = [&all[1], &all[3], &all[4], &all[0], &all[2]].map(Clone::clone);
        assert_eq!(told(&journal_of(&by_author)), expected);
    }

    #[test]
    fn pages_follow_each_other() {
        let journal = journal_of(&(1..=9).map(|number| increment(ADA, number, vec![place("a")])).collect::<Vec<_>>());
        let (mut after, mut numbers) = (None, Vec::new());
        while let Some((at, _)) = journal.newest_first(after).nth(1) {
            numbers.extend(journal.newest_first(after).take(2).map(|(at, _)| at.number));
            after = Some(at);
        }
        assert_eq!(numbers, [9, 8, 7, 6, 5, 4, 3, 2]);
    }

    #[test]
    fn little_is_remembered_of_very_much() {
        let many = (1..=1500).map(|number| increment(ADA, number, vec![place("a")]));
        let journal = journal_of(&many.collect::<Vec<_>>());
        assert_eq!((journal.changes.len(), told(&journal)[0].1), (MAX_CHANGES, 1500));
        let name = "ü".repeat(64);
        let large = (1..=900).map(|number| increment(ADA, number, (0..500).map(|_| place(&name)).collect()));
        let journal = journal_of(&large.collect::<Vec<_>>());
        assert!(journal.bytes <= MAX_BYTES && journal.changes.len() > 50, "{}", journal.changes.len());
        assert!(told(&journal)[0].2.ends_with("and 480 more"), "{:?}", told(&journal)[0]);
    }

    #[test]
    fn of_folded_changes_those_are_left_that_count() {
        let all: Vec<_> = [place("old"), place("dock"), place("quay")]
            .into_iter()
            .zip(1..)
            .map(|(op, number)| increment(ADA, number, vec![op]))
            .collect();
        let rest = |number: u64| fht_proto::model::compaction::Rest {
            number,
            hlc_us: all[number as usize - 1].hlc_us,
            ops: vec![(0, all[number as usize - 1].ops[0].clone())],
        };
        let series = CompactedSeries { author: ADA, first: 1, last: 2, rests: vec![rest(2)] };
        let mut folded = journal_of(&all);
        OperatorJournal::take_fold(&mut folded, &series);
        let mut read_anew = Arc::default();
        OperatorJournal::take_fold(&mut read_anew, &series);
        OperatorJournal::take(&mut read_anew, &all[2]);
        assert_eq!(told(&folded), told(&read_anew), "before and after a restart");
        let folded: Vec<_> = folded.newest_first(None).map(|(at, change)| (at.number, change.is_folded)).collect();
        assert_eq!(folded, [(3, false), (2, true)]);
    }

    #[test]
    fn what_is_left_of_one_series_is_told_beside_the_next() {
        let all: Vec<_> = (1..=4).map(|number| increment(ADA, number, vec![place(&format!("p{number}"))])).collect();
        let series = |first: u64, last: u64| CompactedSeries {
            author: ADA,
            first,
            last,
            rests: all[first as usize - 1..last as usize]
                .iter()
                .map(|increment| fht_proto::model::compaction::Rest {
                    number: increment.number,
                    hlc_us: increment.hlc_us,
                    ops: vec![(0, increment.ops[0].clone())],
                })
                .collect(),
        };
        let mut journal = journal_of(&all);
        for part in [series(1, 2), series(3, 4)] {
            OperatorJournal::take_fold(&mut journal, &part);
        }
        let numbers: Vec<_> = told(&journal).into_iter().map(|(_, number, _)| number).collect();
        assert_eq!(numbers, [4, 3, 2, 1]);
    }
}
