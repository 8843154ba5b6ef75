//! Increments out of the bytes of a store, whatever the file's own order of pages says.
//!
//! A store keeps its increments in leaves of a tree. A leaf begins at a whole page (4096 bytes):
//! one byte for its kind, one that is free, the number of its entries (u16), the ends of all keys
//! and of all values, counted from its beginning (u32 each; values of fixed size have no ends),
//! then the keys, then the values; all numbers little-endian. A key is the length of the map's name
//! (one byte), the name, and numbers. Leaves that are no longer in the tree may be there, too: what
//! they hold was stored once, and is never changed.
//!
//! An increment counts if its checksum holds and its key says the author and number that it says
//! itself. Nothing but its key says which map it is of: a map's name counts if the order of storing
//! names one of its increments, too, or if many entries have it, or if the record of how many
//! increments its authors have names it. That record counts if its sum holds; of those of one
//! author the greatest does, since leaves from before have lower numbers.

use crate::store::end_sum;
use fht_proto::{AuthorId, CompactedSeries, Increment, MapName, decode};
use std::collections::{BTreeMap, BTreeSet};

/// Pages begin at multiples of this, bytes.
const PAGE: usize = 4096;
/// So many entries do not have one wrong name.
const MANY: usize = 8;
/// Most entries of a leaf.
const MOST_ENTRIES: usize = 4096;

/// What was found of one author.
#[derive(Debug, Default)]
pub(super) struct FoundAuthor {
    /// By number, in their envelopes.
    pub(super) increments: BTreeMap<u64, Vec<u8>>,
    /// By their first number.
    pub(super) series: BTreeMap<u64, CompactedSeries>,
    /// Numbers that keys or the order of storing name.
    named: BTreeSet<u64>,
    /// Those that the order of storing names.
    ordered: BTreeSet<u64>,
    /// So many increments there were, as the record says; 0 if there is none.
    recorded: u64,
}

impl FoundAuthor {
    /// The number of the newest increment that there was: the newest that reads or is on record,
    /// and those after it that are named without a gap.
    pub(super) fn last(&self) -> u64 {
        let of_increments = self.increments.keys().next_back().copied().unwrap_or(0);
        let of_series = self.series.values().map(|series| series.last).max().unwrap_or(0);
        let mut last = of_increments.max(of_series).max(self.recorded);
        while self.named.contains(&(last + 1)) {
            last += 1;
        }
        last
    }

    /// Whether a record says that there were no more than that.
    pub(super) fn is_end_known(&self) -> bool {
        self.recorded > 0 && self.recorded == self.last()
    }
}

/// What was found of all maps.
pub(super) type Found = BTreeMap<MapName, BTreeMap<AuthorId, FoundAuthor>>;

/// Reads everything that still reads.
pub(super) fn scan(file: &[u8]) -> Found {
    let mut scan = Scan::default();
    for begin in (0..file.len()).step_by(PAGE) {
        scan.leaf(&file[begin..]);
    }
    scan.found.retain(|map, authors| {
        let is_ordered = |author: &FoundAuthor| author.increments.keys().any(|number| author.ordered.contains(number));
        let is_recorded = |author: &FoundAuthor| author.recorded > 0;
        authors.values().any(|author| is_recorded(author) || is_ordered(author))
            || scan.names.get(map).is_some_and(|count| *count >= MANY)
    });
    scan.found.retain(|_, authors| {
        // What else names an author of whom nothing reads may be damaged itself.
        let is_sure =
            |author: &FoundAuthor| author.recorded > 0 || !author.increments.is_empty() || !author.series.is_empty();
        authors.retain(|_, author| is_sure(author));
        !authors.is_empty()
    });
    scan.found
}

#[derive(Default)]
struct Scan {
    found: Found,
    /// How many entries have a map's name.
    names: BTreeMap<MapName, usize>,
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes: [u8; 4] = bytes.get(at..at + 4)?.try_into().ok()?;
    usize::try_from(u32::from_le_bytes(bytes)).ok()
}

fn u64_of(bytes: &[u8]) -> Option<u64> {
    bytes.try_into().ok().map(u64::from_le_bytes)
}

/// An author and a number: 12 bytes.
fn place_of(bytes: &[u8]) -> Option<(AuthorId, u64)> {
    let (author, number) = bytes.split_at_checked(4)?;
    Some((AuthorId(u32::from_le_bytes(author.try_into().ok()?)), u64_of(number)?))
}

/// A key's map and what follows it.
fn map_of(key: &[u8]) -> Option<(MapName, &[u8])> {
    let (length, rest) = key.split_first()?;
    let (name, rest) = rest.split_at_checked(usize::from(*length))?;
    Some((std::str::from_utf8(name).ok()?.parse().ok()?, rest))
}

impl Scan {
    /// Reads what may be a leaf, as one of each table.
    fn leaf(&mut self, page: &[u8]) {
        let Some(count) = page.get(2..4).and_then(|count| count.try_into().ok()).map(u16::from_le_bytes) else {
            return;
        };
        let count = usize::from(count);
        if count == 0 || count > MOST_ENTRIES {
            return;
        }
        let end = |of: usize, entry: usize| u32_at(page, 4 + 4 * (of * count + entry));
        let start = |of: usize, entry: usize, first: Option<usize>| match entry.checked_sub(1) {
            None => first,
            Some(before) => end(of, before),
        };
        for entry in 0..count {
            // Keys and values of any size: increments and compacted series.
            let key = || page.get(start(0, entry, Some(4 + 8 * count))?..end(0, entry)?);
            let value = || page.get(start(1, entry, end(0, count - 1))?..end(1, entry)?);
            if let Some((key, value)) = key().zip(value()) {
                self.stored(key, value);
            }
            // Values of 12 bytes: the order of storing, and how many increments there are.
            let key = || page.get(start(0, entry, Some(4 + 4 * count))?..end(0, entry)?);
            let value = || {
                let begin = end(0, count - 1)?.checked_add(12 * entry)?;
                page.get(begin..begin.checked_add(12)?)
            };
            if let Some((key, value)) = key().zip(value()) {
                self.ordered(key, value);
                self.recorded(key, value);
            }
        }
    }

    fn author(&mut self, map: MapName, author: AuthorId) -> &mut FoundAuthor {
        *self.names.entry(map.clone()).or_default() += 1;
        self.found.entry(map).or_default().entry(author).or_default()
    }

    fn stored(&mut self, key: &[u8], value: &[u8]) {
        let Some((map, place)) = map_of(key) else { return };
        let Some((author, number)) = place_of(place) else { return };
        if let Ok(increment) = decode::<Increment>(value) {
            if (increment.author, increment.number) == (author, number) {
                self.author(map, author).increments.insert(number, value.to_vec());
            }
        } else if let Some(Ok(series)) = value.get(8..).map(decode::<CompactedSeries>) {
            if (series.author, series.last) == (author, number) {
                self.series(map, series);
            }
        } else {
            self.named(map, author, number);
        }
    }

    /// Of two that begin alike the longer one was made later, of both.
    fn series(&mut self, map: MapName, series: CompactedSeries) {
        let known = self.author(map, series.author);
        let is_newer = known.series.get(&series.first).is_none_or(|known| known.last < series.last);
        if is_newer {
            known.series.insert(series.first, series);
        }
    }

    fn ordered(&mut self, key: &[u8], value: &[u8]) {
        let Some((map, sequence)) = map_of(key) else { return };
        if let (8, Some((author, number))) = (sequence.len(), place_of(value)) {
            self.author(map.clone(), author).ordered.insert(number);
            self.named(map, author, number);
        }
    }

    fn recorded(&mut self, key: &[u8], value: &[u8]) {
        let Some((map, author)) = map_of(key) else { return };
        let record = || {
            let author = AuthorId(u32::from_le_bytes(author.try_into().ok()?));
            let (last, sum) = value.split_at_checked(8)?;
            let last = u64_of(last)?;
            (sum == end_sum(map.as_str(), author, last).to_le_bytes()).then_some((author, last))
        };
        if let Some((author, last)) = record() {
            let known = &mut self.author(map, author).recorded;
            *known = last.max(*known);
        }
    }

    fn named(&mut self, map: MapName, author: AuthorId, number: u64) {
        self.author(map, author).named.insert(number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A leaf of one entry that says how many increments an author has.
    fn record(map: &str, author: AuthorId, last: u64, sum: u32) -> Vec<u8> {
        let length = u8::try_from(map.len()).unwrap_or_else(|error| panic!("{error}"));
        let mut key = vec![length];
        key.extend(map.bytes());
        key.extend(author.0.to_le_bytes());
        let mut leaf = vec![1, 0, 1, 0];
        let end = u32::try_from(8 + key.len()).unwrap_or_else(|error| panic!("{error}"));
        leaf.extend(end.to_le_bytes());
        leaf.extend(key);
        leaf.extend(last.to_le_bytes());
        leaf.extend(sum.to_le_bytes());
        leaf.resize(PAGE, 0);
        leaf
    }

    #[test]
    fn an_author_of_whom_nothing_reads_is_known_by_a_record_whose_sum_holds() {
        let (map, author) = ("museum", AuthorId(7));
        let older = record(map, author, 20, end_sum(map, author, 20));
        let newer = record(map, author, 26, end_sum(map, author, 26));
        let found = scan(&[newer, older].concat());
        let ends: Vec<(u64, bool)> =
            found.values().flat_map(BTreeMap::values).map(|it| (it.last(), it.is_end_known())).collect();
        assert_eq!(ends, [(26, true)]);
        for wrong in [record(map, author, 26, 0), record("musuem", author, 26, end_sum(map, author, 26))] {
            assert!(scan(&wrong).is_empty());
        }
    }
}
