//! What takes the newest increments of an author back: operations that bring about the state which
//! the map would have without them.
//!
//! Nothing is removed from the map: the inverse is an increment like any other, so it can be taken
//! back, too. What others have written since at the same thing stays, and the whole is refused.

mod element;
mod way_back;

pub use element::InverseError;

use crate::crdt::compaction::whole;
use crate::crdt::register::content_hash;
use crate::crdt::state::MapState;
use element::Element;
use fht_proto::model::compaction::Series;
use fht_proto::{AuthorId, CompactedSeries, Increment, Op, ReleaseId, Stamp};
use std::collections::{BTreeMap, BTreeSet};
use way_back::WayBack;

/// What takes increments back.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverse {
    /// Number of the first increment that is taken back.
    pub first: u64,
    /// Number of the last one.
    pub last: u64,
    /// The operations, to be written by anybody with a newer stamp.
    pub ops: Vec<Op>,
    /// What they do, a sentence each.
    pub words: Vec<String>,
}

/// The newest write to something.
#[derive(Clone, Copy)]
struct Newest<'a> {
    stamp: Stamp,
    op: &'a Op,
}

type Writes<'a> = BTreeMap<Element, Newest<'a>>;

fn note<'a>(writes: &mut Writes<'a>, element: Element, stamp: Stamp, op: &'a Op) {
    let write = Newest { stamp, op };
    let newest = writes.entry(element).or_insert(write);
    // As registers decide.
    let order = stamp.cmp(&newest.stamp).then_with(|| content_hash(op).cmp(&content_hash(newest.op)));
    if order.is_gt() {
        *newest = write;
    }
}

/// Up to this number the increments of `author` are folded, and cannot be taken back; 0: none are.
#[must_use]
pub fn folded_upto(map: &Series, author: AuthorId) -> u64 {
    map.folds.iter().filter(|fold| fold.author == author).map(|fold| fold.last).max().unwrap_or(0)
}

/// Why none of an author's increments is taken back, whichever are meant.
fn nothing_of(map: &Series, author: AuthorId) -> InverseError {
    match folded_upto(map, author) {
        0 => InverseError::NoneSuch { author },
        last => InverseError::Compacted { author, last, later: 0 },
    }
}

/// What takes the newest `count` increments of `author` back. `map` is all of the map.
///
/// # Errors
/// [`InverseError`].
pub fn inverse(map: &Series, author: AuthorId, count: u64) -> Result<Inverse, InverseError> {
    let folded = folded_upto(map, author);
    let own = || map.increments.iter().filter(|increment| increment.author == author);
    let last = own().map(|increment| increment.number).max().unwrap_or(0).max(folded);
    if last == 0 {
        return Err(InverseError::NoneSuch { author });
    }
    let later = last - folded;
    if folded > 0 && count > later {
        return Err(InverseError::Compacted { author, last: folded, later });
    }
    if count == 0 || count > last {
        return Err(InverseError::TooFew { author, written: last, count });
    }
    let first = last - count + 1;
    take_back(map, (author, author), (first, last), Overwritten::Refused, |increment| increment.number >= first)
}

/// What takes those increments of `author` back that `is_undone` finds, whichever they are; `by`
/// is who will write that. Of what was folded nothing is taken back.
///
/// # Errors
/// [`InverseError`].
pub fn inverse_of(
    map: &Series,
    author: AuthorId,
    by: AuthorId,
    is_undone: impl Fn(&Increment) -> bool,
) -> Result<Inverse, InverseError> {
    let numbers = || {
        let own = map.increments.iter().filter(|increment| increment.author == author && is_undone(increment));
        own.map(|increment| increment.number)
    };
    let ends = numbers().min().zip(numbers().max()).ok_or_else(|| nothing_of(map, author))?;
    take_back(map, (author, by), ends, Overwritten::Refused, &is_undone)
}

/// What takes everything of `author` back, of whom nothing is believed any more; `by` is who will
/// write that. What others have written over since stays as they wrote it, and so does what was
/// folded ([`folded_upto`]).
///
/// # Errors
/// [`InverseError`].
pub fn inverse_of_all(map: &Series, author: AuthorId, by: AuthorId) -> Result<Inverse, InverseError> {
    let numbers = || map.increments.iter().filter(|one| one.author == author).map(|one| one.number);
    let ends = numbers().min().zip(numbers().max()).ok_or_else(|| nothing_of(map, author))?;
    take_back(map, (author, by), ends, Overwritten::Left, |_| true)
}

/// What becomes of something that others have written over since.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Overwritten {
    /// Nothing is taken back.
    Refused,
    /// It stays as they wrote it.
    Left,
}

/// Things that others have changed since and put back as they had been written, with the stamp of
/// that first writing. What is compared is the state, and not who wrote last: it is as if nobody
/// had touched them. Whoever writes what is there anyway wants it there: then it is not so.
type PutBack = BTreeMap<Element, Stamp>;

fn put_back_since(map: &Series, kept: &[&Increment], mine: &Writes<'_>, others: &Writes<'_>) -> PutBack {
    let ends_alike = |(element, own): &(&Element, &Newest<'_>)| {
        let newest = others.get(element);
        element.is_one_value() && newest.is_some_and(|newest| newest.stamp > own.stamp && newest.op == own.op)
    };
    let mut put_back: PutBack =
        mine.iter().filter(ends_alike).map(|(element, own)| (element.clone(), own.stamp)).collect();
    if put_back.is_empty() {
        return put_back;
    }
    let mut since: BTreeMap<Element, Vec<(Stamp, &Op)>> = BTreeMap::new();
    for (stamp, op) in kept.iter().copied().flat_map(Increment::stamped) {
        let element = Element::of(stamp.author, op);
        if is_moot(&put_back, &element, stamp) {
            since.entry(element).or_default().push((stamp, op));
        }
    }
    put_back.retain(|element, _| {
        let (Some(own), Some(writes)) = (mine.get(element), since.get_mut(element)) else { return false };
        writes.sort_by_key(|(stamp, _)| *stamp);
        let before = std::iter::once(own.op).chain(writes.iter().map(|(_, op)| *op));
        !before.zip(writes.iter()).any(|(before, (_, op))| before == *op && *op == own.op)
    });
    // What was folded cannot be left out of what is begun from.
    for (stamp, _, op) in map.folds.iter().flat_map(CompactedSeries::stamped) {
        let element = Element::of(stamp.author, op);
        if put_back.get(&element).is_some_and(|own| stamp > *own) {
            put_back.remove(&element);
        }
    }
    put_back
}

/// Whether a write has touched something, or has put it back, that is as if it never was.
fn is_moot(put_back: &PutBack, element: &Element, stamp: Stamp) -> bool {
    put_back.get(element).is_some_and(|own| stamp > *own)
}

/// The newest writes of others to what is `mine`.
fn writes_of_others<'a>(map: &'a Series, kept: &[&'a Increment], mine: &Writes<'_>, put_back: &PutBack) -> Writes<'a> {
    let mut others = Writes::new();
    for (stamp, op) in folded_and_kept(map, kept) {
        let element = Element::of(stamp.author, op);
        if mine.contains_key(&element) && !is_moot(put_back, &element, stamp) {
            note(&mut others, element, stamp, op);
        }
    }
    others
}

fn folded_and_kept<'a>(map: &'a Series, kept: &[&'a Increment]) -> impl Iterator<Item = (Stamp, &'a Op)> {
    let of_folds = map.folds.iter().flat_map(CompactedSeries::stamped).map(|(stamp, _, op)| (stamp, op));
    of_folds.chain(kept.iter().copied().flat_map(Increment::stamped))
}

/// The map without what is taken back, and without what is moot.
fn state_before(map: &Series, kept: &[&Increment], put_back: &PutBack) -> MapState {
    let mut before = MapState::new();
    map.folds.iter().for_each(|fold| before.apply_fold(fold));
    for increment in kept {
        let is_whole = increment.stamped().all(|(stamp, op)| !is_moot(put_back, &Element::of(stamp.author, op), stamp));
        if is_whole {
            before.apply(increment);
        } else {
            // Writes are stamped by their place: those that are moot give way to what was before.
            let mut fold = whole(increment);
            for rest in &mut fold.rests {
                rest.ops.retain(|(index, op)| {
                    let stamp = Stamp { hlc_us: increment.hlc_us, author: increment.author, op: *index };
                    !is_moot(put_back, &Element::of(increment.author, op), stamp)
                });
            }
            before.apply_fold(&fold);
        }
    }
    before
}

fn take_back(
    map: &Series,
    (author, by): (AuthorId, AuthorId),
    (first, last): (u64, u64),
    overwritten: Overwritten,
    is_undone: impl Fn(&Increment) -> bool,
) -> Result<Inverse, InverseError> {
    let (undone, kept): (Vec<_>, Vec<_>) =
        map.increments.iter().partition(|increment| increment.author == author && is_undone(increment));
    let mut mine = Writes::new();
    for (stamp, op) in undone.iter().flat_map(|increment| increment.stamped()) {
        note(&mut mine, Element::of(author, op), stamp, op);
    }
    let others = writes_of_others(map, &kept, &mine, &PutBack::new());
    let put_back = match overwritten {
        Overwritten::Refused => put_back_since(map, &kept, &mine, &others),
        Overwritten::Left => PutBack::new(),
    };
    let others = if put_back.is_empty() { others } else { writes_of_others(map, &kept, &mine, &put_back) };
    let mut releases: BTreeSet<ReleaseId> = folded_and_kept(map, &kept)
        .filter_map(|(stamp, op)| match Element::of(stamp.author, op) {
            Element::Release(id) => Some(id),
            _ => None,
        })
        .collect();
    let is_over = |element: &Element, own: &Newest<'_>| others.get(element).filter(|newest| newest.stamp > own.stamp);
    if overwritten == Overwritten::Refused
        && let Some((element, newest)) = mine.iter().find_map(|(element, own)| Some((element, is_over(element, own)?)))
    {
        return Err(InverseError::Overwritten { what: element.to_string(), by: newest.stamp.author });
    }
    mine.retain(|element, own| is_over(element, own).is_none());
    releases.extend(mine.keys().filter_map(|element| match element {
        Element::Release(id) => Some(id.clone()),
        _ => None,
    }));
    let before = state_before(map, &kept, &put_back);
    let mut now = before.clone();
    undone.iter().for_each(|increment| now.apply(increment));

    let mut way = WayBack::new(by, before, now, releases);
    for (element, newest) in &mine {
        way.take_back(element, newest.op, others.get(element).map(|newest| newest.op))?;
    }
    let (ops, words) = way.end()?;
    if ops.is_empty() {
        return Err(InverseError::Unchanged { author, first, last });
    }
    Ok(Inverse { first, last, ops, words })
}
