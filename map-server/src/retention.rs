//! Folding old increments ([`fht_map::fold`]): what a map is kept for is its releases and its newest versions; what only older
//! versions needed goes.

use crate::catalog::Catalog;
use crate::log::{Floor, FoldRecord, IncrementLog, Piece, StoreError};
use fht_map::fold::{FoldConfig, fold, whole};
use fht_proto::{Fold, Increment, MapName, decode, encode};
use serde::{Deserialize, Serialize};

/// What was done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Retained {
    /// The map.
    pub map: MapName,
    /// The oldest version that can still be had as such, besides releases.
    pub oldest_version: u64,
    /// How many increments were folded now.
    pub folded: u64,
    /// Bytes of the map before.
    pub bytes_before: u64,
    /// Bytes of the map now.
    pub bytes: u64,
}

/// Folds everything of `map` but its newest `keep` versions. `None` if there is no such map. Nothing that a head or a release names changes.
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
    let floor = log.floor(map)?;
    let bytes_before = view.head.bytes;
    let unchanged = |oldest_version| {
        Ok(Some(Retained { map: map.clone(), oldest_version, folded: 0, bytes_before, bytes: bytes_before }))
    };
    let version = view.head.version.saturating_sub(keep);
    let Some(upto) = log.vector_at(map, version)?.filter(|_| version > floor.version) else {
        return unchanged(floor.version);
    };
    let damaged = |reason: String| StoreError::Damaged { map: map.to_string(), reason };
    let (mut old, mut kept_bytes) = (Vec::new(), 0);
    log.for_each(Some(map), &mut |_, author, last, piece| {
        let bytes = match piece {
            Piece::Increment(bytes) | Piece::Fold(bytes) => bytes,
        };
        if last > upto.get(author) {
            kept_bytes += bytes.len() as u64;
            return Ok(());
        }
        let unreadable = |error: fht_proto::CodecError| damaged(format!("increment {author}/{last}: {error}"));
        old.push(match piece {
            Piece::Fold(bytes) => decode::<Fold>(bytes).map_err(unreadable)?,
            Piece::Increment(bytes) => whole(&decode::<Increment>(bytes).map_err(unreadable)?),
        });
        Ok(())
    })?;
    let releases: Vec<_> = view.state.annotations().releases().map(|release| release.release.vector.clone()).collect();
    let folds = fold(&old, &upto, &releases, &FoldConfig::default());
    let record = |fold: &Fold| {
        let bytes = encode(fold).map_err(|error| damaged(error.to_string()))?;
        Ok(FoldRecord { author: fold.author, first: fold.first, last: fold.last, bytes })
    };
    let folds = folds.iter().map(record).collect::<Result<Vec<_>, StoreError>>()?;
    log.replace_folded(map, &Floor { version, vector: upto }, &folds)?;
    let bytes = kept_bytes + folds.iter().map(|fold| fold.bytes.len() as u64).sum::<u64>();
    catalog.set_bytes(map, bytes);
    let folded = version - floor.version;
    Ok(Some(Retained { map: map.clone(), oldest_version: version, folded, bytes_before, bytes }))
}
