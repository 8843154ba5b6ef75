//! From arrivals to acknowledgement: check, put in order, store in one commit, apply, announce. Nothing here knows the
//! network, so that all of it can be tested with bytes.

use crate::catalog::{Catalog, MapView};
use crate::check::{Arrival, Checked, Refusal, check, check_stamp, map_of};
use crate::config::Limits;
use crate::log::{Floor, FoldRecord, IncrementLog, Origin, Record, StoreError, Stored};
use crate::nursery::Nursery;
use crate::refusals::{Notice, Refusals};
use crate::retention::{Retained, retain};
use crate::throttle::Throttle;
use fht_map::sequence::{Offered, Sequence};
use fht_proto::keys::Key;
use fht_proto::query::Snapshot;
use fht_proto::{AuthorId, Fold, Increment, MapName, VersionVector, encode};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Refusals are logged at most this often.
const LOG_PERIOD: Duration = Duration::from_secs(1);
/// A writer is told of a kind of refusal at most this often.
const NOTICE_PERIOD: Duration = Duration::from_secs(1);

/// The one writer of a log.
#[derive(Debug)]
pub struct Ingest {
    log: Arc<dyn IncrementLog>,
    catalog: Arc<Catalog>,
    limits: Limits,
    maps: BTreeMap<MapName, Intake>,
    nursery: Nursery,
    throttle: Throttle,
    refusals: Refusals,
}

/// What others should hear of a batch.
#[derive(Debug, Default)]
pub struct Taken {
    /// The maps whose heads the writers should see now: those that have grown, and those that were sent increments which they
    /// already had.
    pub announce: BTreeSet<MapName>,
    /// What writers are told of refused increments.
    pub notices: Vec<Notice>,
    /// What storages keep although another increment of that author and number is in the log.
    pub disputed: Vec<Checked>,
}

/// What the writer knows of one map.
#[derive(Debug)]
struct Intake {
    sequence: Sequence<Checked>,
    bytes: u64,
    /// At least as many as the map has.
    elements: usize,
}

/// What became of an increment that there is room for.
enum Placed {
    /// It is in the batch, or waits for the gap before it to close.
    Kept,
    /// It came too early to be kept.
    Dropped,
    /// Another one of its number waits already.
    Conflict,
}

/// What one batch adds to the store.
#[derive(Debug, Default)]
struct Batch {
    records: Vec<Record>,
    by_key: BTreeMap<(MapName, AuthorId, u64), usize>,
    increments: BTreeMap<MapName, Vec<Increment>>,
    added_bytes: BTreeMap<MapName, u64>,
    refused: BTreeMap<MapName, u64>,
    taken: Taken,
}

impl Ingest {
    /// Goes on where log and catalog are; `catalog` must have been loaded from the log.
    #[must_use]
    pub fn new(log: Arc<dyn IncrementLog>, catalog: Arc<Catalog>, limits: Limits) -> Self {
        let intake = |view: &MapView| Intake {
            sequence: Sequence::starting_at(view.head.vector.clone(), limits.early.clone()),
            bytes: view.head.bytes,
            elements: view.state.elements(),
        };
        let maps = catalog.views().iter().map(|view| (view.head.map.clone(), intake(view))).collect();
        let nursery = Nursery::new(limits.early.clone(), limits.max_nursery_bytes);
        Self {
            log,
            catalog,
            limits,
            maps,
            nursery,
            throttle: Throttle::new(LOG_PERIOD),
            refusals: Refusals::new(NOTICE_PERIOD),
        }
    }

    /// Takes in what arrived until `now_us` (microseconds since the Unix epoch). On return, all that the heads in the
    /// catalog cover is durable.
    ///
    /// # Errors
    /// [`StoreError`]: the store is not usable any more; nothing of this batch was acknowledged.
    pub fn take(&mut self, arrivals: Vec<Arrival>, now_us: u64) -> Result<Taken, StoreError> {
        let mut batch = Batch::default();
        for arrival in arrivals {
            let key = arrival.key.clone();
            if let Err(refusal) = self.check_and_sort(arrival, now_us, &mut batch)? {
                self.log_refusal(&key, &refusal);
                batch.taken.notices.extend(self.notice(&key, &refusal));
                if let Some(map) = map_of(&key) {
                    *batch.refused.entry(map).or_default() += 1;
                }
            }
        }
        self.commit(&batch)?;
        for (map, count) in batch.refused {
            self.catalog.count_refused(&map, count);
        }
        Ok(batch.taken)
    }

    /// Folds all of a map but its newest `keep` versions ([`retain`]).
    ///
    /// # Errors
    /// [`StoreError`]: nothing has changed.
    pub fn retain(&mut self, map: &MapName, keep: u64) -> Result<Option<Retained>, StoreError> {
        let retained = retain(map, keep, &self.catalog, self.log.as_ref())?;
        if let Some((intake, retained)) = self.maps.get_mut(map).zip(retained.as_ref()) {
            intake.bytes = retained.bytes;
        }
        Ok(retained)
    }

    /// Takes in a part of a map from a file: as if its authors had sent it now. What was folded goes only into a map that has nothing but
    /// what was folded.
    ///
    /// # Errors
    /// [`StoreError`]: the log is not usable any more. The inner one: the first piece that was refused; those before it are in.
    pub fn import(&mut self, map: &MapName, series: Snapshot, now_us: u64) -> Result<Result<(), Refusal>, StoreError> {
        for fold in &series.folds {
            if let Err(refusal) = self.import_fold(map, fold, now_us)? {
                return Ok(Err(refusal));
            }
        }
        let mut batch = Batch::default();
        let mut outcome = Ok(());
        for increment in series.increments {
            let key = Key::increment(map, increment.author, increment.number).to_string();
            let arrival = Arrival { key, payload: encode(&increment).map_err(Refusal::from) };
            outcome = self.check_and_sort(arrival, now_us, &mut batch)?;
            if outcome.is_err() {
                break;
            }
        }
        self.commit(&batch)?;
        Ok(outcome)
    }

    /// Takes in what storages keep of a map: places and bytes, with how many of them hold each. What is not in order waits, or is left
    /// out.
    ///
    /// # Errors
    /// [`StoreError`]: the log is not usable any more.
    pub fn restore(&mut self, kept: impl IntoIterator<Item = (Arrival, usize)>) -> Result<(), StoreError> {
        let mut batch = Batch::default();
        let mut bytes = 0;
        for (arrival, copies) in kept {
            let key = arrival.key.clone();
            // What servers let in is taken whatever the time.
            let outcome = match check(arrival, &self.limits, 0) {
                Ok(checked) => {
                    bytes += checked.bytes.len();
                    self.sort(Checked { origin: Origin::Storages { copies }, ..checked }, &mut batch)?
                }
                Err(refusal) => Err(refusal),
            };
            if let Err(refusal) = outcome {
                self.log_refusal(&key, &refusal);
            }
            if bytes >= self.limits.max_batch_bytes {
                self.commit(&std::mem::take(&mut batch))?;
                bytes = 0;
            }
        }
        self.commit(&batch)
    }

    fn import_fold(&mut self, map: &MapName, fold: &Fold, now_us: u64) -> Result<Result<(), Refusal>, StoreError> {
        if self.log.is_shared() {
            return Ok(Err(Refusal::FoldShared));
        }
        let (vector, bytes_before) = self
            .maps
            .get(map)
            .map_or((VersionVector::default(), 0), |intake| (intake.sequence.vector().clone(), intake.bytes));
        if fold.last <= vector.get(fold.author) {
            return Ok(Ok(()));
        }
        let floor = self.log.floor(map)?;
        if floor.version != vector.version() || fold.first != vector.get(fold.author) + 1 {
            return Ok(Err(Refusal::FoldBeside));
        }
        let newest_us = fold.rests.iter().map(|rest| rest.hlc_us).max().unwrap_or(0);
        if let Err(refusal) = check_stamp(newest_us, &self.limits, now_us) {
            return Ok(Err(refusal));
        }
        let bytes = match encode(fold) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(error.into())),
        };
        let elements = fold.rests.iter().map(|rest| rest.ops.len()).sum();
        if let Err(refusal) = self.room(map, fold.author, bytes.len() as u64, elements) {
            return Ok(Err(refusal));
        }
        let mut vector = vector;
        vector.set(fold.author, fold.last);
        let length = bytes.len() as u64;
        let record = FoldRecord { author: fold.author, first: fold.first, last: fold.last, bytes };
        self.log.add_folds(map, &Floor { version: vector.version(), vector: vector.clone() }, &[record])?;
        let elements =
            self.catalog.apply(map, std::slice::from_ref(fold), &[], vector.clone(), length, self.log.as_ref())?;
        let sequence = Sequence::starting_at(vector, self.limits.early.clone());
        self.maps.insert(map.clone(), Intake { sequence, bytes: bytes_before + length, elements });
        Ok(Ok(()))
    }

    /// Makes a batch durable, then visible.
    fn commit(&mut self, batch: &Batch) -> Result<(), StoreError> {
        if !batch.records.is_empty() {
            self.log.append(&batch.records)?;
        }
        for (map, increments) in &batch.increments {
            let Some(intake) = self.maps.get_mut(map) else { continue }; // nothing is in a batch without one
            let bytes = batch.added_bytes.get(map).copied().unwrap_or(0);
            let vector = intake.sequence.vector().clone();
            intake.elements = self.catalog.apply(map, &[], increments, vector, bytes, self.log.as_ref())?;
        }
        Ok(())
    }

    fn log_refusal(&mut self, key: &str, refusal: &Refusal) {
        if let Some(suppressed) = self.throttle.pass(Instant::now()) {
            let key: String = key.chars().take(120).collect();
            tracing::warn!(%key, suppressed, "increment refused: {refusal}");
        }
    }

    /// What the writer is told, if the key names one and it was not told the same a moment ago.
    fn notice(&mut self, key: &str, refusal: &Refusal) -> Option<Notice> {
        let Ok(Key::Increment { map, author, .. }) = key.parse() else { return None };
        let notice = Notice { map, author, reply: refusal.reply() };
        self.refusals.pass(&notice, Instant::now()).then_some(notice)
    }

    /// Whether there is room for so many more bytes and elements by `author` in a map.
    fn room(&self, map: &MapName, author: AuthorId, bytes: u64, elements: usize) -> Result<(), Refusal> {
        let limits = &self.limits;
        let total = |of: fn(&Intake) -> u64| self.maps.values().map(of).fold(0, u64::saturating_add);
        if total(|intake| intake.bytes).saturating_add(bytes) > limits.max_total_bytes {
            return Err(Refusal::Full("bytes in all maps"));
        }
        if total(|intake| intake.elements as u64) + elements as u64 > limits.max_total_elements as u64 {
            return Err(Refusal::Full("nodes and edges in all maps"));
        }
        let (known_bytes, known_elements) = match self.maps.get(map) {
            None if self.maps.len() >= limits.max_maps => return Err(Refusal::Full("maps")),
            None => (0, 0),
            Some(intake) => {
                let vector = intake.sequence.vector();
                let is_new = vector.get(author) == 0;
                if is_new && vector.iter().count() >= VersionVector::MAX_AUTHORS {
                    return Err(Refusal::Full("authors of this map"));
                }
                (intake.bytes, intake.elements)
            }
        };
        if known_bytes.saturating_add(bytes) > limits.max_map_bytes {
            return Err(Refusal::Full("bytes in this map"));
        }
        if known_elements + elements > limits.max_map_elements {
            return Err(Refusal::Full("nodes and edges in this map"));
        }
        Ok(())
    }

    fn check_and_sort(
        &mut self,
        arrival: Arrival,
        now_us: u64,
        batch: &mut Batch,
    ) -> Result<Result<(), Refusal>, StoreError> {
        match check(arrival, &self.limits, now_us) {
            Ok(checked) => self.sort(checked, batch),
            Err(refusal) => Ok(Err(refusal)),
        }
    }

    /// Puts an increment in its place: into the batch, aside until the gap before it closes, or nowhere.
    fn sort(&mut self, checked: Checked, batch: &mut Batch) -> Result<Result<(), Refusal>, StoreError> {
        let (map, author, number) = (checked.map.clone(), checked.increment.author, checked.increment.number);
        if self.maps.get(&map).is_some_and(|intake| number <= intake.sequence.vector().get(author)) {
            let same = match batch.by_key.get(&(map.clone(), author, number)) {
                Some(&index) => batch.records.get(index).is_some_and(|record| record.bytes == checked.bytes),
                None => match self.log.stored(&map, author, number)? {
                    Stored::Increment(bytes) => bytes == checked.bytes,
                    // Nobody can tell any more.
                    Stored::Folded => true,
                    Stored::Absent => false,
                },
            };
            if checked.origin != Origin::Writer {
                batch.taken.disputed.extend((!same).then_some(checked));
                return Ok(Ok(()));
            }
            // The writer has missed a head: it is told again.
            batch.taken.announce.insert(map);
            return Ok(if same { Ok(()) } else { Err(Refusal::Conflict) });
        }
        // No operation makes more than one element. What is kept was let in by a server already, and must be let in by all.
        let elements = checked.increment.ops.len();
        if checked.origin == Origin::Writer
            && let Err(refusal) = self.room(&map, author, checked.bytes.len() as u64, elements)
        {
            return Ok(Err(refusal));
        }
        match self.offer(checked, batch) {
            Placed::Conflict => return Ok(Err(Refusal::Conflict)),
            Placed::Dropped => {
                tracing::debug!(%map, %author, number, "too early to be kept; its writer will send it again");
            }
            Placed::Kept => {}
        }
        Ok(Ok(()))
    }

    /// Offers an increment to its map's sequence and puts what is ready into the batch. A map begins with the first increment
    /// of any author.
    fn offer(&mut self, checked: Checked, batch: &mut Batch) -> Placed {
        let number = checked.increment.number;
        if number > 1 && !self.maps.contains_key(&checked.map) {
            return Placed::from(&self.nursery.keep(checked));
        }
        let nursery = &mut self.nursery;
        let begin = |map: &MapName| Intake { sequence: nursery.take(map), bytes: 0, elements: 0 };
        let intake = self.maps.entry(checked.map.clone()).or_insert_with_key(begin);
        let first_sequence = intake.sequence.vector().version() + 1;
        let (author, stamp_us, memory) = (checked.increment.author, checked.increment.hlc_us, checked.memory_bytes());
        let offered = intake.sequence.offer(author, number, stamp_us, memory, checked);
        let placed = Placed::from(&offered);
        if let Offered::Ready(ready) = offered {
            for (sequence, item) in (first_sequence..).zip(ready) {
                intake.bytes += item.bytes.len() as u64;
                intake.elements += item.increment.ops.len();
                batch.add(sequence, item);
            }
        }
        placed
    }
}

impl From<&Offered<Checked>> for Placed {
    fn from(offered: &Offered<Checked>) -> Self {
        match offered {
            Offered::Conflict => Self::Conflict,
            Offered::Dropped => Self::Dropped,
            Offered::Ready(_) | Offered::Waiting | Offered::Past => Self::Kept,
        }
    }
}

impl Batch {
    fn add(&mut self, sequence: u64, item: Checked) {
        let Checked { map, increment, bytes, origin } = item;
        let (author, number) = (increment.author, increment.number);
        self.by_key.insert((map.clone(), author, number), self.records.len());
        *self.added_bytes.entry(map.clone()).or_default() += bytes.len() as u64;
        self.increments.entry(map.clone()).or_default().push(increment);
        self.taken.announce.insert(map.clone());
        self.records.push(Record { map, sequence, author, number, bytes, origin });
    }
}
