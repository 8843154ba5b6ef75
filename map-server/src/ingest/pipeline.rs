//! The one writer of a log: checks increments, puts them in order, commits them and shows them to
//! readers.

use crate::catalog::{Catalog, MapView};
use crate::clock::PassedTime;
use crate::config::Limits;
use crate::ingest::admission::Admission;
use crate::ingest::batch::{Batch, BatchOutcome};
use crate::ingest::check::{Arrival, Checked, Refusal, check, check_stamp, check_words, map_of};
use crate::ingest::intake::Intake;
use crate::ingest::pending_maps::PendingMaps;
use crate::ingest::refusals::{RefusalNotice, RefusalThrottle};
use crate::ingest::retention::{Retained, retain};
use crate::ingest::room::RoomLimit;
use crate::store::{IncrementLog, IncrementOrigin, StoreError, Stored};
use crate::throttle::Throttle;
use fht_map::crdt::reorder_buffer::{Offered, ReorderBuffer};
use fht_proto::api::keys::{Key, writer_of};
use fht_proto::{AuthorId, Increment, MapName, VersionVector};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The shortest time between two log lines about refusals.
const LOG_PERIOD: Duration = Duration::from_secs(1);
/// The shortest time between two notices of the same kind to a writer.
const NOTICE_PERIOD: Duration = Duration::from_secs(1);

/// The one writer of a log.
#[derive(Debug)]
pub struct Ingest {
    pub(super) log: Arc<dyn IncrementLog>,
    pub(super) catalog: Arc<Catalog>,
    pub(super) limits: Limits,
    pub(super) maps: BTreeMap<MapName, Intake>,
    pub(super) pending: PendingMaps,
    throttle: Throttle,
    refusals: RefusalThrottle,
    /// What rates and quotas are measured by.
    pub(super) passed: PassedTime,
    /// Who may write what, if the roles are known.
    pub(super) admission: Option<Admission>,
    /// What was taken into each map beyond the limits, bytes.
    pub(super) beyond: BTreeMap<MapName, u64>,
}

/// What became of an increment that there is room for.
enum Placed {
    /// It is in the batch, or waits for the gap before it to close.
    Kept,
    /// It arrived too early to be kept.
    Dropped,
    /// Another increment with its number is waiting already.
    Conflict,
}

impl Ingest {
    /// Continues where log and catalog are; `catalog` must have been loaded from the log.
    #[must_use]
    pub fn new(log: Arc<dyn IncrementLog>, catalog: Arc<Catalog>, limits: Limits) -> Self {
        let intake = |view: &MapView| (view.head.map.clone(), Intake::of(view, &limits.early));
        let maps = catalog.views().iter().map(intake).collect();
        let pending = PendingMaps::new(limits.early.clone(), limits.max_pending_bytes);
        Self {
            log,
            catalog,
            limits,
            maps,
            pending,
            throttle: Throttle::new(LOG_PERIOD),
            refusals: RefusalThrottle::new(NOTICE_PERIOD),
            passed: PassedTime::default(),
            admission: None,
            beyond: BTreeMap::new(),
        }
    }

    /// Takes in what arrived until `now_us` (microseconds since the Unix epoch). On return,
    /// everything that the heads in the catalog cover is durable.
    ///
    /// # Errors
    /// [`StoreError`]: the store is no longer usable; nothing of this batch was acknowledged.
    pub fn take_arrivals(&mut self, arrivals: Vec<Arrival>, now_us: u64) -> Result<BatchOutcome, StoreError> {
        let mut batch = Batch::default();
        let fault = self.log.fault();
        for arrival in arrivals {
            let key = arrival.key.clone();
            let open = |checked| self.check_open(checked, fault.as_deref());
            let stamped = |checked: Checked| self.check_stamp(checked, now_us);
            let outcome = match check(arrival, &self.limits).and_then(stamped).and_then(check_words).and_then(open) {
                Ok(checked) => match self.check_deleted(checked).and_then(|checked| self.admit(checked, now_us)) {
                    Ok(Some(checked)) => self.sort(checked, &mut batch)?,
                    Ok(None) => Ok(()),
                    Err(refusal) => Err(refusal),
                },
                Err(refusal) => Err(refusal),
            };
            if let Err(refusal) = outcome {
                self.log_refusal(&key, &refusal);
                batch.outcome.notices.extend(self.notice(&key, &refusal));
                if let Some(writer) = writer_of(&key) {
                    batch.outcome.written.entry(writer).or_default().refused += 1;
                }
                if let Some(map) = map_of(&key) {
                    *batch.refused.entry(map).or_default() += 1;
                }
            }
        }
        self.commit(&batch)?;
        for (map, count) in batch.refused {
            self.catalog.count_refused(&map, count);
        }
        Ok(batch.outcome)
    }

    /// Compacts all of a map but its newest `keep` versions (`retain`).
    ///
    /// # Errors
    /// [`StoreError`]: nothing has changed.
    pub fn retain(&mut self, map: &MapName, keep: u64) -> Result<Option<Retained>, StoreError> {
        let retained = retain(map, keep, &self.catalog, self.log.as_ref())?;
        if let Some((intake, retained)) = self.maps.get_mut(map).zip(retained.as_ref()) {
            intake.bytes = retained.bytes;
            self.beyond.remove(map);
            self.recount(map)?;
        }
        Ok(retained)
    }

    fn check_stamp(&self, checked: Checked, now_us: u64) -> Result<Checked, Refusal> {
        // A server has already accepted what storages hold, so all servers must.
        if checked.origin == IncrementOrigin::Writer {
            let clock_us = self.catalog.view(&checked.map).map_or(0, |view| view.head.clock_us);
            check_stamp(checked.increment.hlc_us, clock_us, &self.limits, now_us)?;
        }
        Ok(checked)
    }

    /// The newest stamp of all maps. What goes from one map to another is no newer.
    pub(super) fn newest_stamp_us(&self) -> u64 {
        self.catalog.heads().iter().map(|head| head.clock_us).max().unwrap_or(0)
    }

    /// Makes a batch durable, then visible.
    pub(super) fn commit(&mut self, batch: &Batch) -> Result<(), StoreError> {
        if !batch.records.is_empty() {
            self.log.append(&batch.records)?;
        }
        for (map, increments) in &batch.increments {
            self.forget_deletion(map)?;
            // Nothing is in a batch without an intake.
            let Some(intake) = self.maps.get_mut(map) else { continue };
            let bytes = batch.added_bytes.get(map).copied().unwrap_or(0);
            let vector = intake.sequence.vector().clone();
            let added = self.catalog.apply(map, &[], increments, vector, bytes, self.log.as_ref())?;
            intake.added(&added, increments);
        }
        Ok(())
    }

    pub(super) fn log_refusal(&mut self, key: &str, refusal: &Refusal) {
        if let Some(suppressed) = self.throttle.pass(Instant::now()) {
            let map = map_of(key).map(|map| map.to_string()).unwrap_or_default();
            let key: String = key.chars().take(120).collect();
            tracing::warn!(%map, %key, suppressed, "increment refused: {refusal}");
        }
    }

    /// What the writer is told, if the key names one and it was not told the same a moment ago:
    /// why, and which increment it is.
    fn notice(&mut self, key: &str, refusal: &Refusal) -> Option<RefusalNotice> {
        let (map, author) = writer_of(key)?;
        let mut reply = refusal.reply();
        // A number that is none is what is wrong, and is not told.
        if let (true, Ok(Key::Increment { number, .. })) = (refusal.is_of_contents(), key.parse()) {
            reply.message = format!("increment {number}: {}", reply.message);
        }
        let notice = RefusalNotice { map, author, reply };
        self.refusals.pass(&notice, Instant::now()).then_some(notice)
    }

    /// Checks that there is room for `bytes` and `elements` more by `author` in a map.
    pub(super) fn check_room(
        &self,
        map: &MapName,
        author: AuthorId,
        bytes: u64,
        elements: usize,
    ) -> Result<(), Refusal> {
        let limits = &self.limits;
        let total = |of: fn(&Intake) -> u64| self.maps.values().map(of).fold(0, u64::saturating_add);
        if total(|intake| intake.bytes).saturating_add(bytes) > limits.max_total_bytes {
            return Err(Refusal::Full(RoomLimit::TotalBytes));
        }
        if total(|intake| intake.elements as u64) + elements as u64 > limits.max_total_elements as u64 {
            return Err(Refusal::Full(RoomLimit::TotalElements));
        }
        let (known_bytes, known_elements) = match self.maps.get(map) {
            None if self.maps.len() >= limits.max_maps => return Err(Refusal::Full(RoomLimit::Maps)),
            None => (0, 0),
            Some(intake) => {
                let vector = intake.sequence.vector();
                let is_new = vector.get(author) == 0;
                if is_new && vector.iter().count() >= VersionVector::MAX_AUTHORS {
                    return Err(Refusal::Full(RoomLimit::Authors));
                }
                (intake.bytes, intake.elements)
            }
        };
        if known_bytes.saturating_add(bytes) > limits.max_map_bytes {
            return Err(Refusal::Full(RoomLimit::MapBytes));
        }
        if known_elements + elements > limits.max_map_elements {
            return Err(Refusal::Full(RoomLimit::MapElements));
        }
        Ok(())
    }

    /// Bytes and elements that come with an increment: its own, and with one that closes a gap also
    /// those of what has waited behind it. No operation makes more than one element.
    pub(super) fn coming(&self, checked: &Checked) -> (u64, usize) {
        let Increment { author, number, ops, .. } = &checked.increment;
        let own = (checked.bytes.len() as u64, ops.len());
        let known = self.maps.get(&checked.map).map(|intake| &intake.sequence);
        let known = known.or_else(|| self.pending.of_map(&checked.map));
        let is_next = |buffer: &&ReorderBuffer<Checked>| number.checked_sub(1) == Some(buffer.vector().get(*author));
        let waiting = known.filter(is_next).into_iter().flat_map(|buffer| buffer.waiting_of(*author));
        // One that waits under its own number gives way to it.
        let behind = waiting.filter(|waiting| waiting.increment.number > *number);
        behind.fold(own, |(bytes, elements), waiting| {
            (bytes + waiting.bytes.len() as u64, elements + waiting.increment.ops.len())
        })
    }

    /// Takes in an increment that another map had, where `newest_us` is the newest stamp of all.
    pub(super) fn check_and_sort(
        &mut self,
        arrival: Arrival,
        (newest_us, now_us): (u64, u64),
        batch: &mut Batch,
    ) -> Result<Result<(), Refusal>, StoreError> {
        let stamped =
            |checked: Checked| check_stamp(checked.increment.hlc_us, newest_us, &self.limits, now_us).map(|()| checked);
        match check(arrival, &self.limits).and_then(stamped) {
            Ok(checked) => self.sort(checked, batch),
            Err(refusal) => Ok(Err(refusal)),
        }
    }

    /// Puts an increment in its place: into the batch, aside until the gap before it closes, or
    /// nowhere.
    pub(super) fn sort(&mut self, checked: Checked, batch: &mut Batch) -> Result<Result<(), Refusal>, StoreError> {
        let (map, author, number) = (checked.map.clone(), checked.increment.author, checked.increment.number);
        if self.maps.get(&map).is_some_and(|intake| number <= intake.sequence.vector().get(author)) {
            let same = match batch.by_key.get(&(map.clone(), author, number)) {
                Some(&index) => batch.records.get(index).is_some_and(|record| record.bytes == checked.bytes),
                None => match self.log.reader().stored(&map, author, number) {
                    Ok(Stored::Increment(bytes)) => bytes == checked.bytes,
                    // It cannot be told any more.
                    Ok(Stored::Compacted) => true,
                    Ok(Stored::Absent) => false,
                    // Nor here; everything else goes on.
                    Err(error) => {
                        tracing::error!(%map, %author, number, "a stored increment cannot be read: {error}");
                        true
                    }
                },
            };
            if checked.origin != IncrementOrigin::Writer {
                batch.outcome.disputed.extend((!same).then_some(checked));
                return Ok(Ok(()));
            }
            // The writer has missed a head: it is published again.
            batch.outcome.announce.insert(map);
            return Ok(if same { Ok(()) } else { Err(Refusal::Conflict) });
        }
        // A server has already accepted what storages hold, so all servers must.
        if checked.origin == IncrementOrigin::Writer {
            let (bytes, elements) = self.coming(&checked);
            match self.check_room(&map, author, bytes, elements) {
                Ok(()) => {}
                Err(Refusal::Full(_)) if self.may_exceed(&checked) => self.exceed(&map, bytes),
                Err(refusal) => return Ok(Err(refusal)),
            }
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

    /// Offers an increment to its map's reorder buffer and puts what is ready into the batch. A map
    /// begins with the first increment of any author.
    fn offer(&mut self, checked: Checked, batch: &mut Batch) -> Placed {
        let number = checked.increment.number;
        if number > 1 && !self.maps.contains_key(&checked.map) {
            return Placed::from(&self.pending.keep(checked));
        }
        let pending = &mut self.pending;
        let begin = |map: &MapName| Intake {
            sequence: pending.take_map(map),
            bytes: 0,
            elements: 0,
            by_author: BTreeMap::new(),
        };
        let intake = self.maps.entry(checked.map.clone()).or_insert_with_key(begin);
        let first_sequence = intake.sequence.vector().version() + 1;
        let (author, stamp_us, memory) = (checked.increment.author, checked.increment.hlc_us, checked.memory_bytes());
        let offered = intake.sequence.offer(author, number, stamp_us, memory, checked);
        let placed = Placed::from(&offered);
        if let Offered::Ready(ready) = offered {
            for (sequence, item) in (first_sequence..).zip(ready) {
                let (bytes, elements) = (item.bytes.len() as u64, item.increment.ops.len());
                intake.bytes += bytes;
                intake.elements += elements;
                intake.by_author.entry(author).or_default().add(bytes, elements);
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
