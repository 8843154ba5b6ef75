//! Compaction of old increments ([`fht_map::crdt::compaction`]): the releases and the newest
//! versions of a map stay; what only older versions needed goes.

use crate::catalog::Catalog;
use crate::store::{CompactedRecord, CompactionFloor, IncrementLog, Piece, StoreError};
use fht_map::crdt::compaction::{CompactionConfig, compact, whole};
use fht_proto::{CompactedSeries, Increment, MapName, decode, encode};
use serde::{Deserialize, Serialize};

/// What a compaction has done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Retained {
    /// The map.
    pub map: MapName,
    /// The oldest version that is still available as such, apart from releases.
    pub oldest_version: u64,
    /// How many increments were compacted this time.
    pub folded: u64,
    /// Bytes of the map before.
    pub bytes_before: u64,
    /// Bytes of the map now.
    pub bytes: u64,
}

/// Compacts everything of `map` but its newest `keep` versions. `None` if there is no such map.
/// Nothing that a head or a release names changes.
///
/// # Errors
/// [`StoreError`].
pub fn retain(
    map: &MapName,
    keep: u64,
    catalog: &Catalog,
    log: &dyn IncrementLog,
) -> Result<Option<Retained>, StoreError> {
    let Some(view) = catalog.view(map) else { return Ok(None) };
    let floor = log.reader().floor(map)?;
    let bytes_before = view.head.bytes;
    let unchanged = |oldest_version| {
        Ok(Some(Retained { map: map.clone(), oldest_version, folded: 0, bytes_before, bytes: bytes_before }))
    };
    let version = view.head.version.saturating_sub(keep);
    let Some(upto) = log.reader().vector_at(map, version)?.filter(|_| version > floor.version) else {
        return unchanged(floor.version);
    };
    let damaged = |reason: String| StoreError::Damaged { map: map.to_string(), reason };
    let (mut old, mut kept_bytes) = (Vec::new(), 0);
    log.reader().for_each(Some(map), &mut |_, author, last, piece| {
        let bytes = match piece {
            Piece::Increment(bytes) | Piece::Compacted(bytes) => bytes,
        };
        if last > upto.get(author) {
            kept_bytes += bytes.len() as u64;
            return Ok(());
        }
        let unreadable = |error: fht_proto::CodecError| damaged(format!("increment {author}/{last}: {error}"));
        old.push(match piece {
            Piece::Compacted(bytes) => decode::<CompactedSeries>(bytes).map_err(unreadable)?,
            Piece::Increment(bytes) => whole(&decode::<Increment>(bytes).map_err(unreadable)?),
        });
        Ok(())
    })?;
    let releases: Vec<_> = view.state.annotations().releases().map(|release| release.release.vector.clone()).collect();
    let compacted = compact(&old, &upto, &releases, &CompactionConfig::default());
    let record = |compact: &CompactedSeries| {
        let bytes = encode(compact).map_err(|error| damaged(error.to_string()))?;
        Ok(CompactedRecord { author: compact.author, first: compact.first, last: compact.last, bytes })
    };
    let records = compacted.iter().map(record).collect::<Result<Vec<_>, StoreError>>()?;
    log.replace_compacted(map, &CompactionFloor { version, vector: upto }, &records)?;
    let bytes = kept_bytes + records.iter().map(|record| record.bytes.len() as u64).sum::<u64>();
    catalog.set_folded(map, bytes, &compacted);
    let folded = version - floor.version;
    Ok(Some(Retained { map: map.clone(), oldest_version: version, folded, bytes_before, bytes }))
}
