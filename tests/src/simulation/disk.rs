//! A disk under a server whose machine fails at some writes: before the commit or after it, never in between, which is what `redb`
//! promises. What was committed is there when the machine comes back.

use fht_proto::{AuthorId, MapName, VersionVector};
use map_server::log::{Floor, FoldRecord, IncrementLog, Piece, Record, StoreError, Stored, Visit};
use map_server::memory::MemoryLog;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// The disk.
#[derive(Debug)]
pub(super) struct Disk {
    kept: MemoryLog,
    fate: Mutex<Fate>,
    /// All that was ever committed, for the checks: what is folded cannot be read any more.
    history: Mutex<BTreeMap<(AuthorId, u64), Vec<u8>>>,
}

#[derive(Debug)]
struct Fate {
    rng: ChaCha8Rng,
    crash_share: f64,
    crashes: u64,
}

fn crashed() -> StoreError {
    StoreError::Disk { action: "written", reason: "the machine has failed".to_owned() }
}

impl Disk {
    pub(super) fn new(crash_share: f64, seed: u64) -> Self {
        let fate = Fate { rng: ChaCha8Rng::seed_from_u64(seed), crash_share, crashes: 0 };
        Self { kept: MemoryLog::new(), fate: Mutex::new(fate), history: Mutex::default() }
    }

    fn fate(&self) -> std::sync::MutexGuard<'_, Fate> {
        self.fate.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn calm(&self) {
        self.fate().crash_share = 0.0;
    }

    pub(super) fn crashes(&self) -> u64 {
        self.fate().crashes
    }

    /// Does `write`, unless the machine fails before it; afterwards it may fail, too.
    fn commit(&self, write: impl FnOnce() -> Result<(), StoreError>) -> Result<(), StoreError> {
        let (before, after) = {
            let mut fate = self.fate();
            let half = fate.crash_share / 2.0;
            let drawn = (fate.rng.random_bool(half), fate.rng.random_bool(half));
            fate.crashes += u64::from(drawn.0 || drawn.1);
            drawn
        };
        if before {
            return Err(crashed());
        }
        write()?;
        if after { Err(crashed()) } else { Ok(()) }
    }

    /// What is there under a number, or was before it was folded.
    pub(super) fn stored(&self, author: AuthorId, number: u64) -> Option<Vec<u8>> {
        match self.kept.stored(&super::map(), author, number) {
            Ok(Stored::Increment(bytes)) => Some(bytes),
            Ok(Stored::Folded) => {
                self.history.lock().unwrap_or_else(PoisonError::into_inner).get(&(author, number)).cloned()
            }
            Ok(Stored::Absent) | Err(_) => None,
        }
    }

    fn note(&self, records: &[Record]) {
        let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        history.extend(records.iter().map(|record| ((record.author, record.number), record.bytes.clone())));
    }
}

impl IncrementLog for Disk {
    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        self.commit(|| {
            self.kept.append(records)?;
            self.note(records);
            Ok(())
        })
    }

    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        self.kept.stored(map, author, number)
    }

    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        self.kept.for_each(of, visit)
    }

    fn for_each_lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        visit: &mut dyn FnMut(Piece<'_>) -> ControlFlow<()>,
    ) -> Result<(), StoreError> {
        self.kept.for_each_lacking(map, have, upto, visit)
    }

    fn vector_at(&self, map: &MapName, version: u64) -> Result<Option<VersionVector>, StoreError> {
        self.kept.vector_at(map, version)
    }

    fn floor(&self, map: &MapName) -> Result<Floor, StoreError> {
        self.kept.floor(map)
    }

    fn add_folds(&self, map: &MapName, floor: &Floor, folds: &[FoldRecord]) -> Result<(), StoreError> {
        self.commit(|| self.kept.add_folds(map, floor, folds))
    }

    fn replace_folded(&self, map: &MapName, floor: &Floor, folds: &[FoldRecord]) -> Result<(), StoreError> {
        self.commit(|| self.kept.replace_folded(map, floor, folds))
    }
}
