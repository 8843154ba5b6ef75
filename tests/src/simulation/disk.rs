//! A disk under a server whose machine fails at some writes: before the commit or after it, but
//! never in between, which is what `redb` promises. What was committed is there when the machine
//! comes back.

use crate::simulation::message::map;
use fht_proto::{AuthorId, MapName};
use map_server::store::{
    CompactedRecord, CompactionFloor, IncrementLog, LogReader, MemoryLog, Record, StoreError, Stored,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// The disk.
#[derive(Debug)]
pub(super) struct Disk {
    kept: MemoryLog,
    fate: Mutex<Fate>,
    /// Everything that was ever committed, for the checks: compacted increments can no longer be
    /// read.
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

    /// Does `write`, unless the machine fails before it; it may also fail after it.
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

    /// What is stored under a number, or was before it was compacted.
    pub(super) fn stored(&self, author: AuthorId, number: u64) -> Option<Vec<u8>> {
        match self.kept.stored(&map(), author, number) {
            Ok(Stored::Increment(bytes)) => Some(bytes),
            Ok(Stored::Compacted) => {
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
    fn reader(&self) -> &dyn LogReader {
        &self.kept
    }

    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        self.commit(|| {
            self.kept.append(records)?;
            self.note(records);
            Ok(())
        })
    }

    fn add_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        self.commit(|| self.kept.add_compacted(map, floor, series))
    }

    fn replace_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        self.commit(|| self.kept.replace_compacted(map, floor, series))
    }
}
