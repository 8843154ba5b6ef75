//! Maps that will be deleted, or were, in the file.

use crate::store::error::StoreError;
use crate::store::log::DeletionRecord;
use crate::store::redb_log::tables::{COMPACTED, FLOOR_VERSIONS, FLOORS, INCREMENTS, LOG, reading, writing};
use crate::store::redb_log::{RedbLog, ends};
use fht_proto::MapName;
use redb::{ReadableTable, TableDefinition, TableError, WriteTransaction};
use std::collections::BTreeMap;

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
