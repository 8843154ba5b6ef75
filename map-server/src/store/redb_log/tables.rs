//! The tables of a store, and what its failures are called.

use crate::store::error::StoreError;
use redb::TableDefinition;

pub(super) const INCREMENTS: TableDefinition<'_, (&str, u32, u64), &[u8]> = TableDefinition::new("increments");
pub(super) const LOG: TableDefinition<'_, (&str, u64), (u32, u64)> = TableDefinition::new("log");
pub(super) const COMPACTED: TableDefinition<'_, (&str, u32, u64), (u64, &[u8])> = TableDefinition::new("folds");
pub(super) const FLOORS: TableDefinition<'_, (&str, u32), u64> = TableDefinition::new("floors");
pub(super) const FLOOR_VERSIONS: TableDefinition<'_, &str, u64> = TableDefinition::new("floor versions");
pub(super) const META: TableDefinition<'_, &str, u64> = TableDefinition::new("meta");

pub(super) fn reading(error: impl Into<redb::Error>) -> StoreError {
    StoreError::Disk { action: "read", reason: error.into().to_string() }
}

pub(super) fn writing(error: impl Into<redb::Error>) -> StoreError {
    StoreError::Disk { action: "written", reason: error.into().to_string() }
}
