//! Maps are deleted after a grace period, in which they can be read and nobody writes them. What a
//! map had is noted, so that what its writers still send does not begin it anew.

use crate::catalog::MapView;
use crate::clock::utc_text;
use crate::ingest::check::{Checked, Refusal};
use crate::ingest::pipeline::Ingest;
use crate::store::{DeletionRecord, IncrementOrigin, StoreError};
use fht_proto::MapName;
use fht_proto::api::deletion::{DeletionOrder, MapDeletion};
use fht_proto::api::reply::Head;
use std::sync::Arc;

/// When a deletion that failed is tried again, microseconds.
const AGAIN_US: u64 = 3_600_000_000;

/// What everybody is told of an order that is given at `now_us` (microseconds since 1970).
pub(super) fn deletion_at(order: &DeletionOrder, now_us: u64) -> MapDeletion {
    let DeletionOrder { grace_s, reason, by, moved_to } = order.clone();
    let at_us = now_us + grace_s * 1_000_000;
    MapDeletion { at_us, at: utc_text(at_us), by: by.as_str().to_owned(), reason, moved_to, done: false }
}

impl Ingest {
    /// Deletes a map when the grace period is over, which begins at `now_us` (microseconds since
    /// 1970); without one at once. Returns the map's head, which says so; `None` if there is no
    /// such map.
    ///
    /// # Errors
    /// [`StoreError`]: nothing has changed.
    pub fn delete(
        &mut self,
        map: &MapName,
        order: DeletionOrder,
        now_us: u64,
    ) -> Result<Option<Arc<Head>>, StoreError> {
        let Some(view) = self.catalog.view(map) else { return Ok(None) };
        let mut deletion = deletion_at(&order, now_us);
        // Where it goes on does not change by when it is deleted.
        let before = self.catalog.deletion(map).and_then(|record| record.deletion.moved_to);
        deletion.moved_to = deletion.moved_to.or(before);
        if order.grace_s == 0 {
            return self.finish_deletion(view, deletion).map(Some);
        }
        tracing::warn!("{}", deletion.sentence(map));
        let record = DeletionRecord { deletion, last: None };
        self.log.set_deletion(map, Some(&record))?;
        self.catalog.set_deletion(map, Some(record));
        Ok(Some(self.catalog.view(map).map_or(view.head, |view| view.head)))
    }

    /// Does not delete a map after all. Returns its head; `None` if it was not to be deleted.
    ///
    /// # Errors
    /// [`StoreError`]: nothing has changed.
    pub fn undelete(&mut self, map: &MapName) -> Result<Option<Arc<Head>>, StoreError> {
        if self.catalog.deletion(map).is_none_or(|record| record.last.is_some()) {
            return Ok(None);
        }
        self.log.set_deletion(map, None)?;
        self.catalog.set_deletion(map, None);
        tracing::warn!("map {map} is not going to be deleted any more");
        Ok(self.catalog.view(map).map(|view| view.head))
    }

    /// Deletes the maps whose grace period is over at `now_us`. One that the log does not let go is
    /// tried again later.
    pub fn delete_due(&mut self, now_us: u64) {
        if self.log.fault().is_some() {
            return; // later
        }
        for map in self.catalog.due(now_us) {
            let Some((view, record)) = self.catalog.view(&map).zip(self.catalog.deletion(&map)) else { continue };
            if let Err(error) = self.finish_deletion(view, record.deletion.clone()) {
                tracing::error!("map {map} could not be deleted, and is tried again in an hour: {error}");
                let at_us = now_us + AGAIN_US;
                let deletion = MapDeletion { at_us, at: utc_text(at_us), ..record.deletion };
                self.catalog.set_deletion(&map, Some(DeletionRecord { deletion, last: None }));
            }
        }
    }

    /// Returns the last head of all.
    fn finish_deletion(&mut self, view: MapView, deletion: MapDeletion) -> Result<Arc<Head>, StoreError> {
        let mut head = view.head;
        let map = head.map.clone();
        let deletion = MapDeletion { done: true, ..deletion };
        let record = DeletionRecord { deletion: deletion.clone(), last: Some(head.vector.clone()) };
        // First: interrupted between the two, nothing is gone.
        self.forget_copy(&map, deletion.moved_to.as_ref())?;
        self.log.delete_map(&map, &record)?;
        self.catalog.set_deletion(&map, Some(record));
        self.maps.remove(&map);
        tracing::warn!("{}", deletion.sentence(&map));
        Arc::make_mut(&mut head).deletion = Some(deletion);
        Ok(head)
    }

    /// Whether an increment comes too late for its map.
    pub(super) fn check_deleted(&self, checked: Checked) -> Result<Checked, Refusal> {
        let (author, number) = (checked.increment.author, checked.increment.number);
        let Some(record) = self.catalog.deletion(&checked.map) else { return Ok(checked) };
        let is_late = match &record.last {
            None => true,
            // Whoever goes on with what is gone. A map begins anew with anybody's first increment.
            Some(last) => !self.maps.contains_key(&checked.map) && (1..number).contains(&last.get(author)),
        };
        if is_late && checked.origin == IncrementOrigin::Writer {
            Err(Refusal::Deleted(record.deletion.sentence(&checked.map)))
        } else {
            Ok(checked)
        }
    }

    /// A map that was deleted has begun anew.
    pub(super) fn forget_deletion(&self, map: &MapName) -> Result<(), StoreError> {
        if self.catalog.deletion(map).is_some_and(|record| record.last.is_some()) {
            self.log.set_deletion(map, None)?;
            self.catalog.set_deletion(map, None);
        }
        Ok(())
    }
}
