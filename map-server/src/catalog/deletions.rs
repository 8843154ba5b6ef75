//! The maps that will be deleted, or were.

use crate::catalog::Catalog;
use crate::store::DeletionRecord;
use fht_proto::MapName;
use std::sync::{Arc, PoisonError};

impl Catalog {
    /// That a map will be deleted, or was and has not begun anew.
    #[must_use]
    pub fn deletion(&self, map: &MapName) -> Option<DeletionRecord> {
        self.deletions.read().unwrap_or_else(PoisonError::into_inner).get(map).cloned()
    }

    /// The maps whose time is up at `now_us` (microseconds since 1970).
    #[must_use]
    pub fn due(&self, now_us: u64) -> Vec<MapName> {
        let deletions = self.deletions.read().unwrap_or_else(PoisonError::into_inner);
        let is_due = |record: &DeletionRecord| record.last.is_none() && record.deletion.at_us <= now_us;
        deletions.iter().filter(|(_, record)| is_due(record)).map(|(map, _)| map.clone()).collect()
    }

    /// Shows everything of a map under another name, too. For one thread at a time.
    pub fn add_copy(&self, of: &MapName, name: &MapName) {
        if let Some(view) = self.view(of) {
            self.write().insert(name.clone(), view.under(name));
        }
    }

    /// Shows that a map will be deleted, or that it will not. One that was deleted is there no
    /// more.
    pub fn set_deletion(&self, map: &MapName, record: Option<DeletionRecord>) {
        let is_gone = record.as_ref().is_some_and(|record| record.last.is_some());
        let shown = record.as_ref().map(|record| record.deletion.clone());
        let mut deletions = self.deletions.write().unwrap_or_else(PoisonError::into_inner);
        match record {
            Some(record) => _ = deletions.insert(map.clone(), record),
            None => _ = deletions.remove(map),
        }
        drop(deletions);
        if is_gone {
            let gone = self.write().remove(map);
            drop(gone); // a large map takes a while; the lock is free by now
        } else if let Some(view) = self.write().get_mut(map) {
            Arc::make_mut(&mut view.head).deletion = shown;
        }
    }
}
