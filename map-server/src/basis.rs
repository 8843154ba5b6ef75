//! A state that paths are planned on: the newest one, or a release. Its free space is made when somebody first asks for a path, and again
//! when what is closed has changed.

use crate::log::{IncrementLog, StoreError};
use fht_map::{FreeSpace, IndexConfig, MapIndex, MapState, Rules};
use fht_proto::{Fold, Increment, MapName, Release, ReleaseId, VersionVector, decode};
use std::sync::{Arc, OnceLock, PoisonError, RwLock, TryLockError};
use std::time::{Duration, Instant};

/// A state of a map, and its free space.
#[derive(Debug)]
pub struct Basis {
    release: Option<ReleaseId>,
    version: u64,
    state: Arc<MapState>,
    space: RwLock<Option<Made>>,
    index: OnceLock<Box<MapIndex>>,
}

/// A free space.
#[derive(Clone, Debug)]
struct Made {
    under: Arc<Rules>,
    free: Arc<FreeSpace>,
    took: Duration,
}

impl Made {
    fn is_under(&self, rules: &Arc<Rules>) -> bool {
        Arc::ptr_eq(&self.under, rules) || self.under.closes_the_same(rules)
    }
}

/// A free space that takes no longer is made before the state is shown, so that no query waits for it.
const SHORT: Duration = Duration::from_millis(250);

impl Basis {
    /// The newest state.
    #[must_use]
    pub fn of_head(state: &Arc<MapState>, version: u64) -> Self {
        Self { release: None, version, state: Arc::clone(state), space: RwLock::default(), index: OnceLock::new() }
    }

    /// A release of `map`; `None` if not all of its increments are in the log, or they do not add up to it.
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
        Ok(state.filter(|state| state.digest() == release.digest).map(|state| Self {
            release: Some(id.clone()),
            version: release.vector.version(),
            state: Arc::new(state),
            space: RwLock::default(),
            index: OnceLock::new(),
        }))
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

    /// The free space under `rules`. Who asks first makes it, and others who ask meanwhile wait.
    #[must_use]
    pub fn free_space(&self, rules: &Arc<Rules>) -> Arc<FreeSpace> {
        if let Some(free) = self.free_space_at_hand(rules) {
            return free;
        }
        // A panic while it was made leaves what was there before.
        let mut space = self.space.write().unwrap_or_else(PoisonError::into_inner);
        match space.as_ref() {
            Some(made) if made.is_under(rules) => Arc::clone(&made.free),
            _ => {
                let begin = Instant::now();
                let free = Arc::new(FreeSpace::of(&self.state, &rules.space_config()));
                *space = Some(Made { under: Arc::clone(rules), free: Arc::clone(&free), took: begin.elapsed() });
                free
            }
        }
    }

    /// The free space under `rules`, if it is there. Never waits.
    #[must_use]
    pub fn free_space_at_hand(&self, rules: &Arc<Rules>) -> Option<Arc<FreeSpace>> {
        let space = match self.space.try_read() {
            Ok(space) => space,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return None,
        };
        space.as_ref().filter(|made| made.is_under(rules)).map(|made| Arc::clone(&made.free))
    }

    /// Makes the free space, if somebody wanted that of `before`, which this replaces, and it was quickly made.
    pub fn prepare_as(&self, before: &Self) {
        let Ok(made) = before.space.try_read().map(|made| made.clone()) else { return };
        if std::ptr::eq(self, before) || self.release.is_some() {
            return;
        }
        if let Some(made) = made.filter(|made| made.took < SHORT) {
            // What robots found blocked stays; should it not, whoever asks makes it again.
            let _ = self.free_space(&Arc::new(Rules::of(&self.state, made.under.blocked.clone())));
        }
    }

    /// The index of a state that does not change any more, a release. Who asks first makes it.
    #[must_use]
    pub fn index(&self) -> &MapIndex {
        self.index.get_or_init(|| Box::new(MapIndex::new(&self.state, IndexConfig::default())))
    }
}

/// The state of `map` at `vector`, from the log; `None` if the log does not have all of it.
///
/// # Errors
/// [`StoreError`].
pub fn state_at(map: &MapName, vector: &VersionVector, log: &dyn IncrementLog) -> Result<Option<MapState>, StoreError> {
    let damaged = |reason: String| StoreError::Damaged { map: map.to_string(), reason };
    let lacking = log.lacking(map, &VersionVector::default(), vector, usize::MAX)?;
    let (mut state, mut have) = (MapState::new(), VersionVector::default());
    for bytes in &lacking.folds {
        let fold: Fold = decode(bytes).map_err(|error| damaged(error.to_string()))?;
        state.apply_fold(&fold);
        have.set(fold.author, fold.last);
    }
    for bytes in &lacking.increments {
        let increment: Increment = decode(bytes).map_err(|error| damaged(error.to_string()))?;
        state.apply(&increment);
        have.set(increment.author, increment.number);
    }
    Ok((have == *vector).then_some(state))
}
