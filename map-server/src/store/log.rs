//! What a log of increments is. Behind the trait there is a `redb` file
//! ([`RedbLog`](crate::store::RedbLog)), memory in front of storages elsewhere
//! ([`QuorumLog`](crate::replicated::QuorumLog)), or a disk that a test lets fail.

use crate::store::error::StoreError;
use fht_proto::api::deletion::MapDeletion;
use fht_proto::{AuthorId, MapName, VersionVector};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;
use std::ops::ControlFlow;

/// Where an increment comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IncrementOrigin {
    /// From its writer.
    Writer,
    /// From storages, or from a server that has put it there.
    Storages {
        /// How many storages are known to hold it.
        copies: usize,
    },
}

/// An increment to be stored.
#[derive(Clone, Debug)]
pub struct Record {
    /// The map.
    pub map: MapName,
    /// Its place in the map's log, from 1.
    pub sequence: u64,
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
    /// The increment in its envelope.
    pub bytes: Vec<u8>,
    /// Where it comes from.
    pub origin: IncrementOrigin,
}

/// What is left of an author's increments `first` to `last`.
#[derive(Clone, Debug)]
pub struct CompactedRecord {
    /// Who wrote them.
    pub author: AuthorId,
    /// Number of the first.
    pub first: u64,
    /// Number of the last.
    pub last: u64,
    /// The compacted series in its envelope.
    pub bytes: Vec<u8>,
}

/// How far a map's log is compacted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CompactionFloor {
    /// The scalar version.
    pub version: u64,
    /// The increments.
    pub vector: VersionVector,
}

/// That a map will be deleted, or was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeletionRecord {
    /// What everybody is told.
    pub deletion: MapDeletion,
    /// What the map had when it was deleted; none while it is there.
    pub last: Option<VersionVector>,
}

/// What a log has under an author and number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stored {
    /// The increment, in its envelope.
    Increment(Vec<u8>),
    /// It was compacted together with others.
    Compacted,
    /// Nothing.
    Absent,
}

/// One piece of a log.
#[derive(Clone, Copy, Debug)]
pub enum Piece<'a> {
    /// An increment in its envelope.
    Increment(&'a [u8]),
    /// A compacted series in its envelope.
    Compacted(&'a [u8]),
}

impl<'a> Piece<'a> {
    /// The envelope.
    #[must_use]
    pub fn bytes(self) -> &'a [u8] {
        match self {
            Self::Increment(bytes) | Self::Compacted(bytes) => bytes,
        }
    }
}

/// Receives a log: map, author, the last number that a piece stands for, the piece.
pub type Visit<'a> = dyn FnMut(&str, AuthorId, u64, Piece<'_>) -> Result<(), StoreError> + 'a;

/// A part of what somebody lacks: messages in their envelopes, each author's in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Lacking {
    /// Compacted series; they come before all increments of their authors.
    pub compacted: Vec<Vec<u8>>,
    /// Increments.
    pub increments: Vec<Vec<u8>>,
}

/// What each author has written after `have`, up to `upto`: first and last number.
pub(super) fn gaps<'a>(
    have: &'a VersionVector,
    upto: &'a VersionVector,
) -> impl Iterator<Item = (AuthorId, u64, u64)> + 'a {
    upto.iter().filter_map(|(author, last)| {
        let first = have.get(author).checked_add(1)?;
        (first <= last).then_some((author, first, last))
    })
}

/// The log of all maps of a server.
///
/// A map's scalar version is the number of increments in it: version N of a map is what the first N
/// stored increments add up to.
pub trait IncrementLog: Send + Sync + Debug {
    /// What is stored.
    fn reader(&self) -> &dyn LogReader;

    /// Stores all records in one commit. On success they are all durable; on failure none is.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn append(&self, records: &[Record]) -> Result<(), StoreError>;

    /// Whether other servers stand on the same increments: then nobody may compact them, and no
    /// other server has stored them in the same order.
    fn is_shared(&self) -> bool {
        false
    }

    /// Adds compacted series to a map that has nothing else, in one commit; `floor` is how far it
    /// is compacted then.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn add_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError>;

    /// Replaces a map's increments up to `floor`, and all compacted series before, by `series`, in
    /// one commit.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn replace_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError>;

    /// Notes that a map will be deleted, or that it will not.
    ///
    /// # Errors
    /// [`StoreError::Disk`], also where maps are not deleted.
    fn set_deletion(&self, _: &MapName, _: Option<&DeletionRecord>) -> Result<(), StoreError> {
        Err(no_deletion())
    }

    /// Deletes everything of a map, and notes that, in one commit.
    ///
    /// # Errors
    /// [`StoreError::Disk`], also where maps are not deleted.
    fn delete_map(&self, _: &MapName, _: &DeletionRecord) -> Result<(), StoreError> {
        Err(no_deletion())
    }

    /// Copies everything of a map, of which `vector` says what it has, to a name under which there
    /// is nothing, and notes that the map will be deleted, in one commit.
    ///
    /// # Errors
    /// [`StoreError::Disk`], also where maps are not deleted.
    fn move_map(
        &self,
        _: &MapName,
        _to: &MapName,
        _vector: &VersionVector,
        _: &DeletionRecord,
    ) -> Result<(), StoreError> {
        Err(no_deletion())
    }

    /// Why nothing can be written at present; none: it can, as far as anybody knows. What is stored
    /// can be read meanwhile.
    fn fault(&self) -> Option<String> {
        None
    }

    /// Looks whether what it is kept in is still there, as it was left; a
    /// [`fault`](Self::fault) if not.
    fn look(&self) {}

    /// Room left on its disk, bytes; none: that is not known.
    fn free_bytes(&self) -> Option<u64> {
        None
    }

    /// Tells it that something does not read, or not as it was stored: of the rest nobody knows.
    fn distrust(&self) {}

    /// What will keep it from being written if nobody sees to it: little room on its disk.
    fn warning(&self) -> Option<String> {
        None
    }

    /// After a [`fault`](Self::fault): finds out whether the disk takes something again. What was
    /// to be stored when it failed may be there after this, or not.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`]: it does not.
    fn try_again(&self) -> Result<(), StoreError> {
        Ok(())
    }
}

/// Callers ask [`IncrementLog::is_shared`] first.
fn no_deletion() -> StoreError {
    StoreError::Disk { action: "written", reason: "maps are not deleted here".to_owned() }
}

/// What is stored in a log.
pub trait LogReader {
    /// The names of all maps.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn maps(&self) -> Result<BTreeSet<String>, StoreError> {
        let mut maps = BTreeSet::new();
        self.for_each(None, &mut |map, _, _, _| {
            maps.insert(map.to_owned());
            Ok(())
        })?;
        Ok(maps)
    }

    /// The maps that will be deleted, and those that were and have not begun anew. None where maps
    /// are not deleted.
    ///
    /// # Errors
    /// [`StoreError::Disk`], [`StoreError::Damaged`].
    fn deletions(&self) -> Result<BTreeMap<MapName, DeletionRecord>, StoreError> {
        Ok(BTreeMap::new())
    }

    /// What is stored under an author and number.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError>;

    /// Shows everything, or all of one map, to `visit`: first the compacted series, by map, author
    /// and number; then the increments, by map, author and number.
    ///
    /// # Errors
    /// [`StoreError`], and whatever `visit` returns.
    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError>;

    /// Shows what `upto` contains and `have` does not to `visit`, each author's in order, until
    /// `visit` breaks off. Compacted series that begin before `have` are shown whole.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn for_each_lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        visit: &mut dyn FnMut(Piece<'_>) -> ControlFlow<()>,
    ) -> Result<(), StoreError>;

    /// The same, until it exceeds `max_bytes`; at least one message, if any is missing.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        max_bytes: usize,
    ) -> Result<Lacking, StoreError> {
        let (mut found, mut total) = (Lacking::default(), 0);
        self.for_each_lacking(map, have, upto, &mut |piece| {
            let (kind, bytes) = match piece {
                Piece::Compacted(bytes) => (&mut found.compacted, bytes),
                Piece::Increment(bytes) => (&mut found.increments, bytes),
            };
            total += bytes.len();
            if total > max_bytes && total > bytes.len() {
                return ControlFlow::Break(());
            }
            kind.push(bytes.to_vec());
            ControlFlow::Continue(())
        })?;
        Ok(found)
    }

    /// The vector of version `version`: what the first `version` increments contain. `None` if the
    /// log is compacted beyond it.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn vector_at(&self, map: &MapName, version: u64) -> Result<Option<VersionVector>, StoreError>;

    /// How far a map is compacted.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn floor(&self, map: &MapName) -> Result<CompactionFloor, StoreError>;

    /// How many increments of a map a rescue did not find.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn lost(&self, _: &MapName) -> Result<u64, StoreError> {
        Ok(0)
    }

    /// Whether increments of a map are lost (`rescue`): what a vector covers may not be whole.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    fn has_lost(&self, map: &MapName) -> Result<bool, StoreError> {
        Ok(self.lost(map)? > 0)
    }
}
