//! A state of a map, from the log.

use crate::catalog::known_operators::KnownOperators;
use crate::store::{IncrementLog, Piece, StoreError};
use fht_map::{MapState, OperatorJournal};
use fht_proto::{AuthorId, CodecError, CompactedSeries, Increment, MapName, VersionVector, decode};
use std::sync::Arc;

/// What the pieces of a map's log add up to so far.
#[derive(Default)]
pub(super) struct MapReplay {
    pub(super) state: MapState,
    pub(super) vector: VersionVector,
    /// Length of the pieces, bytes.
    pub(super) bytes: u64,
    pub(super) journal: Arc<OperatorJournal>,
}

/// Why a piece of a log does not fit.
pub(super) enum ReplayError {
    Codec(CodecError),
    OutOfPlace,
}

impl From<CodecError> for ReplayError {
    fn from(error: CodecError) -> Self {
        Self::Codec(error)
    }
}

impl ReplayError {
    /// The same as an error of the log, with the piece that it is about.
    pub(super) fn in_log(self, map: &str, author: AuthorId, last: u64) -> StoreError {
        let reason = match self {
            Self::Codec(CodecError::Version { found }) => {
                return StoreError::IncrementFormat { map: map.to_owned(), found };
            }
            Self::Codec(other) => format!("increment {author}/{last}: {other}"),
            Self::OutOfPlace => format!("increment {author}/{last} is out of place"),
        };
        StoreError::Damaged { map: map.to_owned(), reason }
    }
}

impl MapReplay {
    /// Adds the piece of `author` that ends at `last`; the pieces of each author must come in
    /// order. Of `operators` the journal tells whatever they did.
    pub(super) fn add(
        &mut self,
        (author, last): (AuthorId, u64),
        piece: Piece<'_>,
        operators: &KnownOperators,
    ) -> Result<(), ReplayError> {
        let next = self.vector.get(author) + 1;
        if next == 1 {
            operators.tell(&mut self.journal, author);
        }
        let bytes = match piece {
            Piece::Compacted(bytes) => {
                let series: CompactedSeries = decode(bytes)?;
                if (series.author, series.last, series.first) != (author, last, next) {
                    return Err(ReplayError::OutOfPlace);
                }
                self.state.apply_fold(&series);
                OperatorJournal::take_fold(&mut self.journal, &series);
                bytes
            }
            Piece::Increment(bytes) => {
                let increment: Increment = decode(bytes)?;
                if (increment.author, increment.number) != (author, last) || last != next {
                    return Err(ReplayError::OutOfPlace);
                }
                self.state.apply(&increment);
                OperatorJournal::take(&mut self.journal, &increment);
                bytes
            }
        };
        self.vector.set(author, last);
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}

/// The state of `map` at `vector`, from the log; `None` if the log does not have all of it.
///
/// # Errors
/// [`StoreError`].
pub fn state_at(map: &MapName, vector: &VersionVector, log: &dyn IncrementLog) -> Result<Option<MapState>, StoreError> {
    let damaged = |reason: String| StoreError::Damaged { map: map.to_string(), reason };
    let lacking = log.reader().lacking(map, &VersionVector::default(), vector, usize::MAX)?;
    let (mut state, mut have) = (MapState::new(), VersionVector::default());
    for bytes in &lacking.compacted {
        let series: CompactedSeries = decode(bytes).map_err(|error| damaged(error.to_string()))?;
        state.apply_fold(&series);
        have.set(series.author, series.last);
    }
    for bytes in &lacking.increments {
        let increment: Increment = decode(bytes).map_err(|error| damaged(error.to_string()))?;
        state.apply(&increment);
        have.set(increment.author, increment.number);
    }
    Ok((have == *vector).then_some(state))
}
