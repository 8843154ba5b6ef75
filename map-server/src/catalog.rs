//! The maps in memory, as queries see them. Readers take a shared view and release the lock at
//! once; the one writer changes a copy, which shares everything that stays the same, and puts it in
//! the map's place.
//!
//! | module | idea |
//! | --- | --- |
//! | `view` | one map at one version |
//! | `planning_state` | a state that paths are planned on: the newest, or a release |
//! | `head_index` | finds things in the newest state of a large map |
//! | `known_operators` | who is an operator, for the journal of what operators do |
//! | `replay` | a state of a map, from the log |
//! | `loading` | maps from the log, at the start and again |
//! | `deletions` | the maps that will be deleted, or were |

mod deletions;
mod head_index;
mod known_operators;
mod loading;
mod planning_state;
mod replay;
mod view;

pub use known_operators::KnownOperators;
pub use planning_state::PlanningState;
pub use replay::state_at;
pub use view::MapView;

use crate::store::{DeletionRecord, IncrementLog, StoreError};
use fht_map::{MapIndex, OperatorJournal};
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, CompactedSeries, Increment, MapName, VersionVector};
use std::collections::BTreeMap;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use view::head_of;

/// All maps of the server.
#[derive(Debug, Default)]
pub struct Catalog {
    maps: RwLock<BTreeMap<MapName, MapView>>,
    deletions: RwLock<BTreeMap<MapName, DeletionRecord>>,
    /// The maps that cannot be read, and why.
    damaged: RwLock<BTreeMap<MapName, String>>,
    operators: KnownOperators,
}

/// What was added to a map, in elements ([`fht_map::MapState::elements`]).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AddedElements {
    /// How many the map then has.
    pub total: usize,
    /// How many each series and each increment has added, in order.
    pub by_author: Vec<(AuthorId, usize)>,
}

impl Catalog {
    // A panic while the lock was held is a bug; the maps are replaced by whole operations and stay
    // usable.
    fn read(&self) -> RwLockReadGuard<'_, BTreeMap<MapName, MapView>> {
        self.maps.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, BTreeMap<MapName, MapView>> {
        self.maps.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// A catalog without maps. Of those `operators` the journals of maps tell whatever they do.
    #[must_use]
    pub fn of_nothing(operators: KnownOperators) -> Self {
        Self { operators, ..Self::default() }
    }

    /// A map as it is now.
    #[must_use]
    pub fn view(&self, map: &MapName) -> Option<MapView> {
        self.read().get(map).cloned()
    }

    /// Reads the index of a map's newest state, and that state; `None` if there is no such map.
    pub fn with_index<T>(&self, map: &MapName, read: impl FnOnce(&MapView, &MapIndex) -> T) -> Option<T> {
        let index = self.view(map)?.index;
        index.with(|| self.view(map), read)
    }

    /// The heads of all maps, by name.
    #[must_use]
    pub fn heads(&self) -> Vec<Arc<Head>> {
        self.read().values().map(|view| Arc::clone(&view.head)).collect()
    }

    /// All maps, by name.
    #[must_use]
    pub fn views(&self) -> Vec<MapView> {
        self.read().values().cloned().collect()
    }

    /// Applies compacted series and increments that are durable, `bytes` long in all; `vector` is
    /// what the map then contains. Returns what that has added. For one thread at a time.
    ///
    /// # Errors
    /// [`StoreError`] when the release that is enabled now cannot be read.
    pub fn apply(
        &self,
        map: &MapName,
        compacted: &[CompactedSeries],
        increments: &[Increment],
        vector: VersionVector,
        bytes: u64,
        log: &dyn IncrementLog,
    ) -> Result<AddedElements, StoreError> {
        // On a copy, so that readers wait only while it takes the old one's place.
        let old = self.view(map);
        let mut state = old.as_ref().map(|view| view.state.as_ref().clone()).unwrap_or_default();
        let mut by_author = Vec::with_capacity(compacted.len() + increments.len());
        for series in compacted {
            let before = state.elements();
            state.apply_fold(series);
            by_author.push((series.author, state.elements() - before));
        }
        for increment in increments {
            let before = state.elements();
            state.apply(increment);
            by_author.push((increment.author, state.elements() - before));
        }
        let (old_bytes, refused) = old.as_ref().map_or((0, 0), |view| (view.head.bytes, view.head.refused));
        let mut head = head_of(map, &state, vector, old_bytes + bytes, refused);
        if let Some(view) = &old {
            head.deletion.clone_from(&view.head.deletion);
            head.reports_cleared = view.head.reports_cleared;
        }
        let added = AddedElements { total: state.elements(), by_author };
        let mut view = MapView::new(state, head, old.as_ref(), log)?;
        drop(old);
        for series in compacted {
            self.operators.tell(&mut view.journal, series.author);
            OperatorJournal::take_fold(&mut view.journal, series);
        }
        for increment in increments {
            self.operators.tell(&mut view.journal, increment.author);
            OperatorJournal::take(&mut view.journal, increment);
        }
        let rests = compacted.iter().flat_map(|series| &series.rests);
        let compacted_ops = rests.flat_map(|rest| rest.ops.iter().map(|(_, op)| op));
        let ops = compacted_ops.chain(increments.iter().flat_map(|increment| &increment.ops));
        let (index, state) = (Arc::clone(&view.index), Arc::clone(&view.state));
        let replaced = index.follow_ops(&state, ops, || self.write().insert(map.clone(), view));
        drop(replaced); // dropping a large map takes a while; the lock is free by now
        Ok(added)
    }

    /// Adds to the count of refused increments, if there is such a map.
    pub fn count_refused(&self, map: &MapName, count: u64) {
        if let Some(view) = self.write().get_mut(map) {
            Arc::make_mut(&mut view.head).refused += count;
        }
    }

    /// Operators have cleared what robots reported blocked. The head that says so; `None` if there
    /// is no such map.
    pub fn count_cleared(&self, map: &MapName) -> Option<Arc<Head>> {
        let mut maps = self.write();
        let head = &mut maps.get_mut(map)?.head;
        let cleared = &mut Arc::make_mut(head).reports_cleared;
        *cleared = cleared.wrapping_add(1);
        Some(Arc::clone(head))
    }

    /// Shows in all heads whether the server takes nothing in at present.
    pub fn set_read_only(&self, read_only: bool) {
        self.write().values_mut().for_each(|view| Arc::make_mut(&mut view.head).read_only = read_only);
    }

    /// Sets how many bytes a map's increments take up after a compaction, and what is left of those
    /// that were folded.
    pub fn set_folded(&self, map: &MapName, bytes: u64, left: &[CompactedSeries]) {
        if let Some(view) = self.write().get_mut(map) {
            Arc::make_mut(&mut view.head).bytes = bytes;
            left.iter().for_each(|series| OperatorJournal::take_fold(&mut view.journal, series));
        }
    }
}
