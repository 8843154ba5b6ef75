//! A state that paths are planned on: the newest one, or a release. Its free space is built when
//! somebody first asks for a path, and again when what is closed has changed.

use crate::catalog::replay::state_at;
use crate::store::{IncrementLog, StoreError};
use fht_map::{FreeSpace, IndexConfig, MapIndex, MapState, Rules};
use fht_proto::{Footprint, MapName, Release, ReleaseId};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, RwLock, TryLockError};
use std::time::{Duration, Instant};

/// A state of a map, and its free space.
#[derive(Debug)]
pub struct PlanningState {
    release: Option<ReleaseId>,
    version: u64,
    state: Arc<MapState>,
    /// For robots like the explorers.
    space: SpaceSlot,
    /// For larger ones; the one asked for last is at the end.
    larger: Mutex<VecDeque<Arc<SpaceSlot>>>,
    /// Free space for larger robots is built one at a time.
    building: Mutex<()>,
    index: OnceLock<Box<MapIndex>>,
}

/// How many larger footprints the free space is kept for. A fleet has few kinds of robots.
const MAX_FOOTPRINTS: usize = 6;

/// The free space for one footprint, once somebody has asked for it.
#[derive(Debug, Default)]
struct SpaceSlot {
    footprint: Footprint,
    made: RwLock<Option<BuiltSpace>>,
}

/// A free space, the rules it was built under, and how long that took.
#[derive(Clone, Debug)]
struct BuiltSpace {
    under: Arc<Rules>,
    free: Arc<FreeSpace>,
    took: Duration,
}

impl BuiltSpace {
    fn is_under(&self, rules: &Arc<Rules>) -> bool {
        Arc::ptr_eq(&self.under, rules) || self.under.closes_the_same(rules)
    }
}

/// A free space that is built within this time is built before the state is shown, so that no
/// query waits for it.
const SHORT: Duration = Duration::from_millis(250);

impl PlanningState {
    /// The newest state.
    #[must_use]
    pub fn of_head(state: &Arc<MapState>, version: u64) -> Self {
        Self::new(None, version, Arc::clone(state))
    }

    fn new(release: Option<ReleaseId>, version: u64, state: Arc<MapState>) -> Self {
        let (space, larger, building) = (SpaceSlot::default(), Mutex::default(), Mutex::default());
        Self { release, version, state, space, larger, building, index: OnceLock::new() }
    }

    /// A release of `map`; `None` if not all of its increments are in the log, or they do not add
    /// up to it.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn of_release(
        map: &MapName,
        id: &ReleaseId,
        release: &Release,
        log: &dyn IncrementLog,
    ) -> Result<Option<Self>, StoreError> {
        let state = state_at(map, &release.vector, log)?;
        let state = state.filter(|state| state.digest() == release.digest);
        Ok(state.map(|state| Self::new(Some(id.clone()), release.vector.version(), Arc::new(state))))
    }

    /// The release; none if this is the newest state.
    #[must_use]
    pub fn release(&self) -> Option<&ReleaseId> {
        self.release.as_ref()
    }

    /// The scalar version.
    #[must_use]
    pub fn version(&self) -> u64 {
        self.version
    }

    /// The state.
    #[must_use]
    pub fn state(&self) -> &Arc<MapState> {
        &self.state
    }

    /// The free space under `rules` for robots of a footprint. The first caller builds it;
    /// concurrent callers block.
    #[must_use]
    pub fn free_space(&self, rules: &Arc<Rules>, footprint: &Footprint) -> Arc<FreeSpace> {
        if !footprint.is_larger_than_explorers() {
            return self.space.free_space(&self.state, rules);
        }
        let slot = self.slot(footprint);
        if let Some(free) = slot.free_space_at_hand(rules) {
            return free;
        }
        let _building = self.building.lock().unwrap_or_else(PoisonError::into_inner);
        slot.free_space(&self.state, rules)
    }

    /// The free space under `rules` for robots of a footprint, if it is built. Never waits for one
    /// to be built.
    #[must_use]
    pub fn free_space_at_hand(&self, rules: &Arc<Rules>, footprint: &Footprint) -> Option<Arc<FreeSpace>> {
        if !footprint.is_larger_than_explorers() {
            return self.space.free_space_at_hand(rules);
        }
        self.slot(footprint).free_space_at_hand(rules)
    }

    /// Where the free space for larger robots of a footprint is kept. The one that nobody asked for
    /// for the longest time makes room.
    fn slot(&self, footprint: &Footprint) -> Arc<SpaceSlot> {
        let planned = footprint.planned_as();
        let mut slots = self.larger.lock().unwrap_or_else(PoisonError::into_inner);
        let known = slots.iter().position(|slot| slot.footprint == planned).and_then(|index| slots.remove(index));
        let slot = known.unwrap_or_else(|| Arc::new(SpaceSlot { footprint: planned, made: RwLock::default() }));
        slots.push_back(Arc::clone(&slot));
        let surplus = slots.len().saturating_sub(MAX_FOOTPRINTS);
        slots.drain(..surplus);
        slot
    }

    /// Builds the free space for robots like the explorers, if somebody wanted that of `before`,
    /// which this state replaces, and building it was fast.
    pub fn prepare_as(&self, before: &Self) {
        let Ok(made) = before.space.made.try_read().map(|made| made.clone()) else { return };
        if std::ptr::eq(self, before) || self.release.is_some() {
            return;
        }
        if let Some(made) = made.filter(|made| made.took < SHORT) {
            // What robots found blocked usually stays the same; if not, the next query builds it
            // again.
            let rules = Arc::new(Rules::of(&self.state, made.under.blocked.clone()));
            let _ = self.space.free_space(&self.state, &rules);
        }
    }

    /// The index of a state that no longer changes, a release. The first caller builds it.
    #[must_use]
    pub fn index(&self) -> &MapIndex {
        self.index.get_or_init(|| Box::new(MapIndex::new(&self.state, IndexConfig::default())))
    }
}

impl SpaceSlot {
    fn free_space(&self, state: &MapState, rules: &Arc<Rules>) -> Arc<FreeSpace> {
        if let Some(free) = self.free_space_at_hand(rules) {
            return free;
        }
        // A panic while it was built leaves what was there before.
        let mut space = self.made.write().unwrap_or_else(PoisonError::into_inner);
        match space.as_ref() {
            Some(made) if made.is_under(rules) => Arc::clone(&made.free),
            _ => {
                let begin = Instant::now();
                let free = Arc::new(FreeSpace::of(state, &rules.space_config_for(&self.footprint)));
                *space = Some(BuiltSpace { under: Arc::clone(rules), free: Arc::clone(&free), took: begin.elapsed() });
                free
            }
        }
    }

    fn free_space_at_hand(&self, rules: &Arc<Rules>) -> Option<Arc<FreeSpace>> {
        let space = match self.made.try_read() {
            Ok(space) => space,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        space.as_ref().filter(|made| made.is_under(rules)).map(|made| Arc::clone(&made.free))
    }
}
