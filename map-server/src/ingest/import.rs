//! Takes in increments that do not come from their writers: maps from files, and what storages
//! hold.

use crate::ingest::batch::Batch;
use crate::ingest::check::{Arrival, Checked, Refusal, check, check_stamp};
use crate::ingest::intake::Intake;
use crate::ingest::pipeline::Ingest;
use crate::store::{CompactedRecord, CompactionFloor, IncrementOrigin, StoreError};
use fht_map::crdt::reorder_buffer::ReorderBuffer;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::Series;
use fht_proto::{CompactedSeries, MapName, VersionVector, encode};

impl Ingest {
    /// Whether a map is there that nobody wrote who wrote the map with the vector `whole`: nothing
    /// tells how the two lie to each other.
    #[must_use]
    pub fn is_of_others(&self, map: &MapName, whole: &VersionVector) -> bool {
        self.catalog.view(map).is_some_and(|view| {
            let vector = &view.head.vector;
            vector.version() > 0 && vector.meet(whole).version() == 0
        })
    }

    /// Takes in a part of a map from a file, as if its authors had sent it now. Compacted series go
    /// only into a map that has nothing but compacted series.
    ///
    /// # Errors
    /// [`StoreError`]: the log is no longer usable. The inner error is the first piece that was
    /// refused; those before it are in.
    pub fn import(&mut self, map: &MapName, series: Series, now_us: u64) -> Result<Result<(), Refusal>, StoreError> {
        if let Some(damage) = self.catalog.damage(map) {
            return Ok(Err(Refusal::Damaged(damage)));
        }
        if let Some(deletion) = self.catalog.deletion(map).filter(|record| record.last.is_none()) {
            return Ok(Err(Refusal::Deleted(deletion.deletion.sentence(map))));
        }
        for compacted in &series.folds {
            if let Err(refusal) = self.import_compacted(map, compacted, now_us)? {
                return Ok(Err(refusal));
            }
        }
        let times_us = (self.newest_stamp_us(), now_us);
        let mut batch = Batch::default();
        let mut outcome = Ok(());
        for increment in series.increments {
            let key = Key::increment(map, increment.author, increment.number).to_string();
            let arrival = Arrival { key, payload: encode(&increment).map_err(Refusal::from) };
            outcome = self.check_and_sort(arrival, times_us, &mut batch)?;
            if outcome.is_err() {
                break;
            }
        }
        self.commit(&batch)?;
        Ok(outcome)
    }

    /// Takes in what storages hold of a map: places and bytes, and how many storages hold each.
    /// What is out of order waits, or is left out.
    ///
    /// # Errors
    /// [`StoreError`]: the log is no longer usable.
    pub fn restore(&mut self, kept: impl IntoIterator<Item = (Arrival, usize)>) -> Result<(), StoreError> {
        let mut batch = Batch::default();
        let mut bytes = 0;
        for (arrival, copies) in kept {
            let key = arrival.key.clone();
            // What a server has accepted is accepted whatever its stamp.
            let outcome = match check(arrival, &self.limits) {
                Ok(checked) => {
                    bytes += checked.bytes.len();
                    self.sort(Checked { origin: IncrementOrigin::Storages { copies }, ..checked }, &mut batch)?
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

    fn import_compacted(
        &mut self,
        map: &MapName,
        series: &CompactedSeries,
        now_us: u64,
    ) -> Result<Result<(), Refusal>, StoreError> {
        if self.log.is_shared() {
            return Ok(Err(Refusal::CompactedShared));
        }
        let (mut vector, bytes_before) = self
            .maps
            .get(map)
            .map_or((VersionVector::default(), 0), |intake| (intake.sequence.vector().clone(), intake.bytes));
        if series.last <= vector.get(series.author) {
            return Ok(Ok(()));
        }
        let floor = self.log.reader().floor(map)?;
        if floor.version != vector.version() || series.first != vector.get(series.author) + 1 {
            return Ok(Err(Refusal::CompactedBeside));
        }
        let newest_us = series.rests.iter().map(|rest| rest.hlc_us).max().unwrap_or(0);
        if let Err(refusal) = check_stamp(newest_us, self.newest_stamp_us(), &self.limits, now_us) {
            return Ok(Err(refusal));
        }
        let bytes = match encode(series) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(error.into())),
        };
        let (author, first, last, length) = (series.author, series.first, series.last, bytes.len() as u64);
        let elements = series.rests.iter().map(|rest| rest.ops.len()).sum();
        if let Err(refusal) = self.check_room(map, author, length, elements) {
            return Ok(Err(refusal));
        }
        vector.set(author, last);
        let record = CompactedRecord { author, first, last, bytes };
        let floor = CompactionFloor { version: vector.version(), vector: vector.clone() };
        self.log.add_compacted(map, &floor, &[record])?;
        self.forget_deletion(map)?;
        let series = std::slice::from_ref(series);
        let added = self.catalog.apply(map, series, &[], vector.clone(), length, self.log.as_ref())?;
        let sequence = ReorderBuffer::starting_at(vector, self.limits.early.clone());
        let mut by_author = self.maps.remove(map).map(|intake| intake.by_author).unwrap_or_default();
        by_author.entry(author).or_default().add(length, added.by_author.iter().map(|(_, elements)| elements).sum());
        let intake = Intake { sequence, bytes: bytes_before + length, elements: added.total, by_author };
        self.maps.insert(map.clone(), intake);
        Ok(Ok(()))
    }
}
