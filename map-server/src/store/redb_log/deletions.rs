//! Maps that will be deleted, or were, in the file.

use crate::store::error::StoreError;
use crate::store::log::DeletionRecord;
use crate::store::redb_log::tables::{COMPACTED, FLOOR_VERSIONS, FLOORS, INCREMENTS, LOG, reading, writing};
use crate::store::redb_log::{RedbLog, ends};
use fht_proto::{MapName, VersionVector};
use redb::{ReadableTable, TableDefinition, TableError, WriteTransaction};
use std::collections::BTreeMap;

/// About how much of a map is copied at one time, bytes.
const PART_BYTES: usize = 4 << 20;

const DELETIONS: TableDefinition<'_, &str, &[u8]> = TableDefinition::new("deletions");

fn put(write: &WriteTransaction, map: &MapName, record: Option<&DeletionRecord>) -> Result<(), StoreError> {
    let mut deletions = write.open_table(DELETIONS).map_err(writing)?;
    match record {
        None => _ = deletions.remove(map.as_str()).map_err(writing)?,
        Some(record) => {
            let text = serde_json::to_vec(record);
            let text = text.map_err(|error| StoreError::Disk { action: "written", reason: error.to_string() })?;
            deletions.insert(map.as_str(), text.as_slice()).map_err(writing)?;
        }
    }
    Ok(())
}

/// Copies a map's increments, a part at a time: a map may be larger than memory should be.
fn copy_increments(write: &WriteTransaction, from: &str, to: &str) -> Result<(), StoreError> {
    let mut increments = write.open_table(INCREMENTS).map_err(writing)?;
    let (mut next, mut part) = ((0, 0), Vec::new());
    loop {
        let mut bytes = 0;
        for entry in increments.range((from, next.0, next.1)..=(from, u32::MAX, u64::MAX)).map_err(writing)? {
            let (key, value) = entry.map_err(writing)?;
            let (_, author, number) = key.value();
            bytes += value.value().len();
            part.push((author, number, value.value().to_vec()));
            if bytes >= PART_BYTES {
                break;
            }
        }
        let Some(&(author, number, _)) = part.last() else { return Ok(()) };
        next = number.checked_add(1).map_or((author.saturating_add(1), 0), |number| (author, number));
        for (author, number, bytes) in part.drain(..) {
            increments.insert((to, author, number), bytes.as_slice()).map_err(writing)?;
        }
    }
}

/// Copies how far a map is folded, and what is left of that: no larger than its state.
fn copy_folded(write: &WriteTransaction, from: &str, to: &str) -> Result<(), StoreError> {
    let mut compacted = write.open_table(COMPACTED).map_err(writing)?;
    let mut rows = Vec::new();
    for entry in compacted.range((from, 0, 0)..=(from, u32::MAX, u64::MAX)).map_err(writing)? {
        let (key, value) = entry.map_err(writing)?;
        let ((_, author, last), (first, bytes)) = (key.value(), value.value());
        rows.push((author, last, first, bytes.to_vec()));
    }
    for (author, last, first, bytes) in rows {
        compacted.insert((to, author, last), (first, bytes.as_slice())).map_err(writing)?;
    }
    let mut floors = write.open_table(FLOORS).map_err(writing)?;
    let mut rows = Vec::new();
    for entry in floors.range((from, 0)..=(from, u32::MAX)).map_err(writing)? {
        let (key, number) = entry.map_err(writing)?;
        rows.push((key.value().1, number.value()));
    }
    for (author, number) in rows {
        floors.insert((to, author), number).map_err(writing)?;
    }
    let mut versions = write.open_table(FLOOR_VERSIONS).map_err(writing)?;
    let version = versions.get(from).map_err(writing)?.map(|version| version.value());
    if let Some(version) = version {
        versions.insert(to, version).map_err(writing)?;
    }
    Ok(())
}

/// Copies the order in which a map's increments were stored: 20 bytes each.
fn copy_order(write: &WriteTransaction, from: &str, to: &str) -> Result<(), StoreError> {
    let mut log = write.open_table(LOG).map_err(writing)?;
    let mut rows = Vec::new();
    for entry in log.range((from, 0)..=(from, u64::MAX)).map_err(writing)? {
        let (key, place) = entry.map_err(writing)?;
        rows.push((key.value().1, place.value()));
    }
    for (sequence, place) in rows {
        log.insert((to, sequence), place).map_err(writing)?;
    }
    Ok(())
}

impl RedbLog {
    pub(super) fn read_deletions(&self) -> Result<BTreeMap<MapName, DeletionRecord>, StoreError> {
        self.read(|read| {
            let deletions = match read.open_table(DELETIONS) {
                Err(TableError::TableDoesNotExist(_)) => return Ok(BTreeMap::new()),
                other => other.map_err(reading)?,
            };
            let mut found = BTreeMap::new();
            for entry in deletions.iter().map_err(reading)? {
                let (map, text) = entry.map_err(reading)?;
                let name = map.value();
                let damaged = |reason: String| StoreError::Damaged { map: name.to_owned(), reason };
                let record = serde_json::from_slice(text.value()).map_err(|error| damaged(error.to_string()))?;
                found.insert(name.parse().map_err(|error| damaged(format!("{error}")))?, record);
            }
            Ok(found)
        })
    }

    pub(super) fn write_deletion(&self, map: &MapName, record: Option<&DeletionRecord>) -> Result<(), StoreError> {
        self.write(|write| put(write, map, record))
    }

    /// Copies everything of a map to another name, and notes that the map will be deleted.
    pub(super) fn write_move(
        &self,
        map: &MapName,
        to: &MapName,
        vector: &VersionVector,
        record: &DeletionRecord,
    ) -> Result<(), StoreError> {
        self.write(|write| {
            let (from, name) = (map.as_str(), to.as_str());
            copy_increments(write, from, name)?;
            copy_folded(write, from, name)?;
            copy_order(write, from, name)?;
            ends::note(write, vector.iter().map(|(author, last)| ((name, author), last)))?;
            put(write, to, None)?;
            put(write, map, Some(record))
        })
    }

    /// Removes everything of a map. What it took up in the file is used for what comes next.
    pub(super) fn write_end(&self, map: &MapName, record: &DeletionRecord) -> Result<(), StoreError> {
        self.write(|write| {
            let name = map.as_str();
            let by_author = (name, 0, 0)..=(name, u32::MAX, u64::MAX);
            let mut increments = write.open_table(INCREMENTS).map_err(writing)?;
            increments.retain_in(by_author.clone(), |_, _| false).map_err(writing)?;
            let mut compacted = write.open_table(COMPACTED).map_err(writing)?;
            compacted.retain_in(by_author, |_, _| false).map_err(writing)?;
            let mut log = write.open_table(LOG).map_err(writing)?;
            log.retain_in((name, 0)..=(name, u64::MAX), |_, _| false).map_err(writing)?;
            let mut floors = write.open_table(FLOORS).map_err(writing)?;
            floors.retain_in((name, 0)..=(name, u32::MAX), |_, _| false).map_err(writing)?;
            let mut versions = write.open_table(FLOOR_VERSIONS).map_err(writing)?;
            versions.remove(name).map_err(writing)?;
            drop((increments, compacted, log, floors, versions));
            ends::forget(write, name)?;
            put(write, map, Some(record))
        })
    }
}
