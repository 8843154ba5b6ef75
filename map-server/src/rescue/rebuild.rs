//! A whole store of what was found in a damaged one.

use crate::catalog::Catalog;
use crate::rescue::leaf_scan::{Found, FoundAuthor};
use crate::rescue::report::{RescueError, RescuedAuthor};
use crate::store::{CompactedRecord, CompactionFloor, IncrementLog, IncrementOrigin, Record, RedbLog, StoreError};
use fht_map::crdt::compaction::whole;
use fht_proto::{AuthorId, CompactedSeries, Increment, MapName, VersionVector, decode, encode};
use std::path::Path;

/// Most bytes in one commit.
const BATCH_BYTES: usize = 4 << 20;
/// So many lost numbers are named.
const NAMED: usize = 10;

/// The authors of an undamaged store, which is loaded.
pub(super) fn of_catalog(catalog: &Catalog, log: &dyn IncrementLog) -> Result<Vec<RescuedAuthor>, StoreError> {
    let mut authors = Vec::new();
    for head in catalog.heads() {
        let (floor, lost_before) = (log.reader().floor(&head.map)?, log.reader().lost(&head.map)?);
        authors.extend(head.vector.iter().map(|(author, last)| RescuedAuthor {
            map: head.map.clone(),
            author,
            last,
            lost: 0,
            first_lost: Vec::new(),
            folded: floor.vector.get(author),
            lost_before,
            is_end_known: true,
        }));
    }
    Ok(authors)
}

/// What is lost of each author.
pub(super) fn counted(found: &Found) -> Vec<RescuedAuthor> {
    let authors = found.iter().flat_map(|(map, authors)| authors.iter().map(move |(id, author)| (map, *id, author)));
    let count = |(map, author, found): (&MapName, AuthorId, &FoundAuthor)| {
        let lost: Vec<(u64, u64)> = gaps(found);
        let numbers = lost.iter().flat_map(|(first, last)| *first..=*last);
        RescuedAuthor {
            map: map.clone(),
            author,
            last: found.last(),
            lost: lost.iter().map(|(first, last)| last - first + 1).sum(),
            first_lost: numbers.take(NAMED).collect(),
            folded: series_of(found).last().map_or(0, |series| series.last),
            lost_before: 0,
            is_end_known: found.is_end_known(),
        }
    };
    authors.map(count).collect()
}

/// The compacted series that count: each begins behind the one before, the longest of those that
/// could.
fn series_of(found: &FoundAuthor) -> Vec<&CompactedSeries> {
    let mut kept: Vec<&CompactedSeries> = Vec::new();
    for series in found.series.values() {
        // One that begins within another is older: from before it was compacted once more.
        if kept.last().is_none_or(|last| series.first > last.last) {
            kept.push(series);
        }
    }
    kept
}

/// First and last numbers of what is neither an increment nor in a compacted series.
fn gaps(found: &FoundAuthor) -> Vec<(u64, u64)> {
    let mut covered: Vec<(u64, u64)> = series_of(found).iter().map(|series| (series.first, series.last)).collect();
    covered.extend(found.increments.keys().map(|number| (*number, *number)));
    covered.sort_unstable();
    let (mut gaps, mut next) = (Vec::new(), 1);
    for (first, last) in covered {
        if first > next {
            gaps.push((next, first - 1));
        }
        next = next.max(last + 1);
    }
    let last = found.last();
    if next <= last {
        gaps.push((next, last));
    }
    gaps
}

/// Writes a new store.
pub(super) fn write(found: Found, target: &Path) -> Result<(), RescueError> {
    let log = RedbLog::open(target)?;
    for (map, authors) in &found {
        let lost = authors.values().flat_map(gaps).map(|(first, last)| last - first + 1).sum();
        if lost > 0 {
            log.note_lost(map, lost)?;
        }
        let mut floor = CompactionFloor::default();
        let (mut series, mut rest) = (Vec::new(), Vec::new());
        for (author, found) in authors {
            let upto = floor_of(found);
            if upto > 0 {
                series.extend(folded(*author, found, upto).map_err(|reason| damaged(map, reason))?);
                floor.vector.set(*author, upto);
            }
            rest.extend(ordered(*author, found, upto));
        }
        floor.version = floor.vector.version();
        if !series.is_empty() {
            log.add_compacted(map, &floor, &series)?;
        }
        rest.sort_by_key(|(clock, author, number, _)| (*clock, *author, *number));
        append(&log, map, &floor.vector, rest)?;
    }
    // It must be one that a server starts with.
    Catalog::load(&log)?;
    Ok(())
}

fn damaged(map: &MapName, reason: String) -> StoreError {
    StoreError::Damaged { map: map.to_string(), reason }
}

/// Up to here an author's increments are compacted: the last gap, or the last series.
fn floor_of(found: &FoundAuthor) -> u64 {
    let of_gaps = gaps(found).last().map_or(0, |(_, last)| *last);
    let of_series = series_of(found).last().map_or(0, |series| series.last);
    of_gaps.max(of_series)
}

/// Everything up to a number as compacted series: those that there are, increments whole, and of
/// what is lost nothing.
fn folded(author: AuthorId, found: &FoundAuthor, upto: u64) -> Result<Vec<CompactedRecord>, String> {
    let series = series_of(found);
    let is_covered = |number: u64| series.iter().any(|it| (it.first..=it.last).contains(&number));
    let mut all: Vec<CompactedSeries> = series.iter().map(|series| (*series).clone()).collect();
    for (number, bytes) in found.increments.range(..=upto).filter(|(number, _)| !is_covered(**number)) {
        let increment: Increment = decode(bytes).map_err(|error| format!("increment {author}/{number}: {error}"))?;
        all.push(whole(&increment));
    }
    let lost = gaps(found).into_iter().map(|(first, last)| CompactedSeries { author, first, last, rests: Vec::new() });
    all.extend(lost);
    all.sort_by_key(|series| series.first);
    let record = |series: CompactedSeries| {
        let bytes = encode(&series).map_err(|error| error.to_string())?;
        Ok(CompactedRecord { author, first: series.first, last: series.last, bytes })
    };
    all.into_iter().map(record).collect()
}

/// What stays as it is, by a clock that never runs back within an author.
fn ordered(author: AuthorId, found: &FoundAuthor, upto: u64) -> Vec<(u64, AuthorId, u64, Vec<u8>)> {
    let mut clock = 0;
    let later = found.increments.range(upto + 1..);
    let stamped = later.map(|(number, bytes)| {
        clock = clock.max(decode::<Increment>(bytes).map_or(0, |increment| increment.hlc_us));
        (clock, author, *number, bytes.clone())
    });
    stamped.collect()
}

fn append(
    log: &RedbLog,
    map: &MapName,
    floor: &VersionVector,
    rest: Vec<(u64, AuthorId, u64, Vec<u8>)>,
) -> Result<(), StoreError> {
    let (mut batch, mut length) = (Vec::new(), 0);
    for (sequence, (_, author, number, bytes)) in (floor.version() + 1..).zip(rest) {
        length += bytes.len();
        let origin = IncrementOrigin::Writer;
        batch.push(Record { map: map.clone(), sequence, author, number, bytes, origin });
        if length >= BATCH_BYTES {
            log.append(&std::mem::take(&mut batch))?;
            length = 0;
        }
    }
    if batch.is_empty() { Ok(()) } else { log.append(&batch) }
}
