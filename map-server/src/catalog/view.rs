//! One map at one version, as queries see it.

use crate::catalog::head_index::HeadIndex;
use crate::catalog::planning_state::PlanningState;
use crate::store::{IncrementLog, StoreError};
use fht_map::{MapState, OperatorJournal};
use fht_proto::api::reply::Head;
use fht_proto::{MapName, ReleaseId, VersionVector};
use std::sync::Arc;

/// One map at one version.
#[derive(Clone, Debug)]
pub struct MapView {
    /// The newest state.
    pub state: Arc<MapState>,
    /// Its version, vector, digest and counts.
    pub head: Arc<Head>,
    /// What robots use: the enabled release, or else the newest state.
    pub running: Arc<PlanningState>,
    /// What operators have done.
    pub journal: Arc<OperatorJournal>,
    /// Finds things in the newest state, if it is large.
    pub(super) index: Arc<HeadIndex>,
    /// An enabled release whose increments are all here but do not add up to it: they were
    /// compacted before it arrived, or its digest is wrong.
    broken: Option<ReleaseId>,
}

impl MapView {
    /// `before` is the view that this one replaces: its release need not be read again.
    pub(super) fn new(
        state: MapState,
        head: Head,
        before: Option<&Self>,
        log: &dyn IncrementLog,
    ) -> Result<Self, StoreError> {
        let state = Arc::new(state);
        let (enabled, broken) = Self::enabled_release(&state, &head, before, log)?;
        let running = enabled.unwrap_or_else(|| Arc::new(PlanningState::of_head(&state, head.version)));
        let is_unused = state.annotations().enabled().is_some_and(|release| running.release() != Some(release.id));
        let head = Head { enabled_unused: is_unused, ..head };
        if let Some(before) = before {
            running.prepare_as(&before.running);
        }
        let index = before.map(|view| Arc::clone(&view.index)).unwrap_or_default();
        let journal = before.map(|view| Arc::clone(&view.journal)).unwrap_or_default();
        Ok(Self { state, head: Arc::new(head), running, journal, index, broken })
    }

    /// The same under another name, of which nothing is counted yet.
    pub(super) fn under(self, name: &MapName) -> Self {
        let head = self.head.as_ref().clone();
        let head = Head { map: name.clone(), deletion: None, refused: 0, reports_cleared: 0, ..head };
        // An index follows one map.
        Self { head: Arc::new(head), index: Arc::default(), ..self }
    }

    /// What robots would use if `state` were the newest one.
    ///
    /// # Errors
    /// [`StoreError`].
    #[cfg(feature = "web")]
    pub(crate) fn would_run(
        &self,
        state: &Arc<MapState>,
        log: &dyn IncrementLog,
    ) -> Result<Arc<PlanningState>, StoreError> {
        let (enabled, _) = Self::enabled_release(state, &self.head, Some(self), log)?;
        Ok(enabled.unwrap_or_else(|| Arc::new(PlanningState::of_head(state, self.head.version))))
    }

    /// The enabled release, if there is one that can be planned on; and its id if it is broken.
    fn enabled_release(
        state: &MapState,
        head: &Head,
        before: Option<&Self>,
        log: &dyn IncrementLog,
    ) -> Result<(Option<Arc<PlanningState>>, Option<ReleaseId>), StoreError> {
        let Some(enabled) = state.annotations().enabled() else { return Ok((None, None)) };
        let (id, release) = (enabled.id, enabled.release);
        if let Some(before) = before.filter(|view| view.running.release() == Some(id)) {
            return Ok((Some(Arc::clone(&before.running)), None));
        }
        // Reading a release means reading the whole log: not in vain with every batch.
        let is_broken = before.is_some_and(|view| view.broken.as_ref() == Some(id));
        let is_here = head.vector.covers(&release.vector);
        let read = if is_here && !is_broken {
            let read = PlanningState::of_release(&head.map, id, release, log).map(|state| state.map(Arc::new));
            match (read, before) {
                // A server that serves goes on with what it has.
                (Err(error), Some(_)) => {
                    tracing::error!(map = %head.map, release = %id, "the release that is enabled cannot be read: {error}");
                    None
                }
                (read, _) => read?,
            }
        } else {
            None
        };
        if is_here && read.is_none() && !is_broken {
            tracing::warn!(map = %head.map, release = %id, "the release that is enabled does not add up to its digest: it is not used");
        }
        let broken = (is_here && read.is_none()).then(|| id.clone());
        // Until all of a release is here, robots go on with what they ran, and so does the server.
        let ran = before.map(|view| &view.running).filter(|running| running.release().is_some());
        Ok((read.or_else(|| ran.map(Arc::clone)), broken))
    }
}

impl AsRef<MapState> for MapView {
    fn as_ref(&self) -> &MapState {
        &self.state
    }
}

pub(super) fn head_of(map: &MapName, state: &MapState, vector: VersionVector, bytes: u64, refused: u64) -> Head {
    let counts = state.counts();
    Head {
        version: vector.version(),
        vector,
        digest: state.digest(),
        clock_us: state.max_hlc_us(),
        enabled: state.annotations().enabled().map(|release| release.id.to_string()),
        main_nodes: counts.main_nodes,
        support_nodes: counts.support_nodes,
        edges: counts.edges,
        bytes,
        refused,
        ..Head::of_nothing(map.clone())
    }
}
