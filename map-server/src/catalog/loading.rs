//! Maps from the log: all of them as a server starts, and those that may differ after a fault of
//! the disk. A map of which something does not read is left out, and the others are served.

use crate::catalog::Catalog;
use crate::catalog::known_operators::KnownOperators;
use crate::catalog::replay::MapReplay;
use crate::catalog::view::{MapView, head_of};
use crate::store::{DeletionRecord, IncrementLog, StoreError};
use fht_map::MapState;
use fht_proto::api::reply::Head;
use fht_proto::{MapName, VersionVector};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, PoisonError, RwLock};

/// What reads of a map, or why it does not.
type Replayed = Result<MapReplay, String>;

fn map_of(name: &str) -> Result<MapName, StoreError> {
    name.parse().map_err(|error| StoreError::Damaged { map: name.to_owned(), reason: format!("{error}") })
}

/// Reads all maps of a log, or one.
fn replay(
    log: &dyn IncrementLog,
    of: Option<&MapName>,
    operators: &KnownOperators,
) -> Result<BTreeMap<MapName, Replayed>, StoreError> {
    let mut maps: BTreeMap<MapName, Replayed> = BTreeMap::new();
    log.reader().for_each(of, &mut |name, author, last, piece| {
        let replayed = maps.entry(map_of(name)?).or_insert_with(|| Ok(MapReplay::default()));
        let Ok(replay) = replayed else { return Ok(()) };
        match replay.add((author, last), piece, operators).map_err(|error| error.in_log(name, author, last)) {
            Ok(()) => {}
            // The rest of it would make no sense.
            Err(StoreError::Damaged { reason, .. }) => *replayed = Err(reason),
            Err(other) => return Err(other),
        }
        Ok(())
    })?;
    Ok(maps)
}

/// A map as queries see it, or why it cannot be shown.
fn view_of(
    map: &MapName,
    replayed: Replayed,
    deletion: Option<&DeletionRecord>,
    log: &dyn IncrementLog,
) -> Result<Result<MapView, String>, StoreError> {
    let MapReplay { state, vector, bytes, journal } = match replayed {
        Ok(replay) => replay,
        Err(reason) => return Ok(Err(reason)),
    };
    if log.reader().vector_at(map, vector.version())?.as_ref() != Some(&vector) {
        return Ok(Err("its log does not name its increments".to_owned()));
    }
    let mut head = head_of(map, &state, vector, bytes, 0);
    head.deletion = deletion.map(|record| record.deletion.clone());
    match MapView::new(state, head, None, log) {
        Ok(mut view) => {
            view.journal = journal;
            Ok(Ok(view))
        }
        Err(StoreError::Damaged { reason, .. }) => Ok(Err(reason)),
        Err(other) => Err(other),
    }
}

impl Catalog {
    /// Reads all maps from the log.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] if increments are missing or unreadable,
    /// [`StoreError::IncrementFormat`], [`StoreError::Disk`].
    pub fn load(log: &dyn IncrementLog) -> Result<Self, StoreError> {
        let catalog = Self::load_what_reads(log)?;
        let damaged = catalog.damaged.read().unwrap_or_else(PoisonError::into_inner).clone();
        let mut damaged = damaged.into_iter();
        match damaged.next() {
            None => Ok(catalog),
            Some((map, reason)) => {
                let others: String = damaged.map(|(map, reason)| format!("; map {map}: {reason}")).collect();
                Err(StoreError::Damaged { map: map.to_string(), reason: reason + &others })
            }
        }
    }

    /// Reads all maps from the log that can be read whole. The others are
    /// [`damage`](Self::damage)d.
    ///
    /// # Errors
    /// [`StoreError::IncrementFormat`], [`StoreError::Disk`]; [`StoreError::Damaged`] if a map has
    /// no name.
    pub fn load_what_reads(log: &dyn IncrementLog) -> Result<Self, StoreError> {
        Self::load_with(log, KnownOperators::default())
    }

    /// The same; of those `operators` the journals of maps tell whatever they did and do.
    ///
    /// # Errors
    /// As [`load_what_reads`](Self::load_what_reads).
    pub fn load_with(log: &dyn IncrementLog, operators: KnownOperators) -> Result<Self, StoreError> {
        let catalog = Self::load_in_parts(log, operators);
        let is_damaged = match &catalog {
            Ok(catalog) => !catalog.damaged.read().unwrap_or_else(PoisonError::into_inner).is_empty(),
            Err(error) => matches!(error, StoreError::Damaged { .. } | StoreError::Disk { action: "read", .. }),
        };
        if is_damaged {
            log.distrust();
        }
        catalog
    }

    fn load_in_parts(log: &dyn IncrementLog, operators: KnownOperators) -> Result<Self, StoreError> {
        let maps = replay(log, None, &operators)?;
        let mut deletions = log.reader().deletions()?;
        // A map that was deleted and is there has begun anew.
        deletions.retain(|map, record| record.last.is_some() != maps.contains_key(map));
        let (mut views, mut damaged) = (BTreeMap::new(), BTreeMap::new());
        for (map, replayed) in maps {
            match view_of(&map, replayed, deletions.get(&map), log)? {
                Ok(view) => _ = views.insert(map, view),
                Err(reason) => _ = damaged.insert(map, reason),
            }
        }
        deletions.retain(|map, _| !damaged.contains_key(map));
        let (maps, deletions, damaged) = (RwLock::new(views), RwLock::new(deletions), RwLock::new(damaged));
        Ok(Self { maps, deletions, damaged, operators })
    }

    /// Reads the maps anew of which the log has something else than is shown here: a commit that
    /// failed may have reached the disk all the same. For one thread at a time.
    ///
    /// # Errors
    /// As [`load_what_reads`](Self::load_what_reads).
    pub fn reconcile(&self, log: &dyn IncrementLog) -> Result<(), StoreError> {
        let stored: BTreeSet<MapName> =
            log.reader().maps()?.iter().map(|name| map_of(name)).collect::<Result<_, _>>()?;
        let mut deletions = log.reader().deletions()?;
        deletions.retain(|map, record| record.last.is_some() != stored.contains(map));
        deletions.retain(|map, _| self.damage(map).is_none());
        let shown = self.heads().into_iter().map(|head| head.map.clone());
        for map in stored.iter().cloned().chain(shown).collect::<BTreeSet<_>>() {
            if self.damage(&map).is_some() {
                continue;
            }
            let vector = log.reader().vector_at(&map, u64::MAX)?.filter(|_| stored.contains(&map));
            let head = self.view(&map).map(|view| view.head);
            if vector.as_ref() != head.as_ref().map(|head| &head.vector) {
                self.read_anew(&map, deletions.get(&map), log)?;
            }
        }
        for head in self.heads() {
            let deletion = deletions.get(&head.map).map(|record| record.deletion.clone());
            if let Some(view) = self.write().get_mut(&head.map).filter(|_| head.deletion != deletion) {
                Arc::make_mut(&mut view.head).deletion = deletion;
            }
        }
        *self.deletions.write().unwrap_or_else(PoisonError::into_inner) = deletions;
        Ok(())
    }

    fn read_anew(
        &self,
        map: &MapName,
        deletion: Option<&DeletionRecord>,
        log: &dyn IncrementLog,
    ) -> Result<(), StoreError> {
        let view = match replay(log, Some(map), &self.operators)?.remove(map) {
            None => None,
            Some(replayed) => Some(view_of(map, replayed, deletion, log)?),
        };
        let mut maps = self.write();
        let before = maps.remove(map);
        match view {
            None => {}
            Some(Ok(view)) => _ = maps.insert(map.clone(), view),
            Some(Err(reason)) => {
                tracing::error!(%map, "the map is damaged, and offline: {reason}");
                self.damaged.write().unwrap_or_else(PoisonError::into_inner).insert(map.clone(), reason);
            }
        }
        drop(maps);
        drop(before); // a large map takes a while; the lock is free by now
        Ok(())
    }

    /// Why a map that is in the log cannot be shown, and what can be done: a sentence.
    #[must_use]
    pub fn damage(&self, map: &MapName) -> Option<String> {
        let damaged = self.damaged.read().unwrap_or_else(PoisonError::into_inner);
        let reason = damaged.get(map)?;
        Some(format!(
            "map {map} is damaged, and offline: {reason}. End the server, then restore a backup, or see map-server check \
             and map-server rescue"
        ))
    }

    /// The maps that are in the log and cannot be shown, as if they were empty.
    #[must_use]
    pub fn damaged_heads(&self) -> Vec<Head> {
        let damaged = self.damaged.read().unwrap_or_else(PoisonError::into_inner);
        let nothing = MapState::new();
        let head = |map| Head { damaged: true, ..head_of(map, &nothing, VersionVector::default(), 0, 0) };
        damaged.keys().map(head).collect()
    }
}
