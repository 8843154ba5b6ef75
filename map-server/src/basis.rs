//! A state that paths are planned on: the newest one, or a release. Its free space is made when somebody first asks for a path, and again
//! when what is closed has changed.

use crate::log::{IncrementLog, StoreError};
use fht_map::{FreeSpace, MapState, Rules};
use fht_proto::{Fold, Increment, MapName, Release, ReleaseId, VersionVector, decode};
use std::sync::{Arc, Mutex, PoisonError};

/// A state of a map, and its free space.
#[derive(Debug)]
pub struct Basis {
    release: Option<ReleaseId>,
    version: u64,
    state: Arc<MapState>,
    space: Mutex<Option<(Arc<Rules>, Arc<FreeSpace>)>>,
}

impl Basis {
    /// The newest state.
    #[must_use]
    pub fn of_head(state: &Arc<MapState>, version: u64) -> Self {
        Self { release: None, version, state: Arc::clone(state), space: Mutex::default() }
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
            space: Mutex::default(),
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
        // A panic while it was made leaves what was there before.
        let mut space = self.space.lock().unwrap_or_else(PoisonError::into_inner);
        match space.as_ref() {
            Some((made_under, free)) if Arc::ptr_eq(made_under, rules) || made_under.closes_the_same(rules) => {
                Arc::clone(free)
            }
            _ => {
                let free = Arc::new(FreeSpace::of(&self.state, &rules.space_config()));
                *space = Some((Arc::clone(rules), Arc::clone(&free)));
                free
            }
        }
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
