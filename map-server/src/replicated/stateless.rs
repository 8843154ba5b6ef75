//! What a server has instead of a disk: it reads everything at its start, looks for gaps from then
//! on, and settles what several servers have accepted differently.

use crate::catalog::Catalog;
use crate::config::{GapFillConfig, QuorumConfig};
use crate::ingest::{Checked, Ingest, WriterQueue};
use crate::replicated::gap_fill::{self, GapFill};
use crate::replicated::quorum;
use crate::replicated::storages::Storages;
use crate::replicated::zenoh_storages::ZenohStorages;
use crate::store::{IncrementLog, StoreError};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use zenoh::Session;

/// Time between two searches for gaps.
const GAP_FILL_EVERY: Duration = Duration::from_secs(1);

/// The storages that a server stands on.
#[derive(Clone, Debug)]
pub(crate) struct Stateless {
    storages: Arc<ZenohStorages>,
    quorum: QuorumConfig,
    gaps: GapFillConfig,
}

impl Stateless {
    /// Stands on the storages that `session` reaches.
    #[must_use]
    pub(crate) fn new(session: &Session, quorum: QuorumConfig, gaps: GapFillConfig) -> Self {
        Self { storages: Arc::new(ZenohStorages::new(session.clone())), quorum, gaps }
    }

    /// The storages.
    #[must_use]
    pub(crate) fn storages(&self) -> Arc<dyn Storages> {
        Arc::clone(&self.storages) as _
    }

    /// Reads everything that the storages hold ([`gap_fill::restore`]).
    ///
    /// # Errors
    /// [`StoreError`].
    pub(crate) fn restore(&self, ingest: &mut Ingest) -> Result<(), StoreError> {
        gap_fill::restore(self.storages.as_ref(), self.quorum, ingest)
    }

    /// Starts a thread that looks for gaps, again and again, until [`close`](Self::close).
    ///
    /// # Errors
    /// When the system gives no thread.
    pub(crate) fn spawn_gap_fill(
        &self,
        catalog: Arc<Catalog>,
        queue: Arc<WriterQueue>,
    ) -> std::io::Result<JoinHandle<()>> {
        let storages = Arc::clone(&self.storages);
        let mut gaps = GapFill::new(self.gaps.clone());
        let fill = move || {
            while storages.wait(GAP_FILL_EVERY) {
                let missing = gaps.find_missing(storages.as_ref(), &catalog.heads());
                missing.into_iter().for_each(|arrival| queue.push(arrival));
            }
        };
        std::thread::Builder::new().name("gap-fill".to_owned()).spawn(fill)
    }

    /// Settles what storages hold although `log` has something else ([`quorum::settle_disputed`]).
    ///
    /// # Errors
    /// [`StoreError::Overruled`] when this server has to give way.
    pub(crate) fn settle_disputed(&self, disputed: &[Checked], log: &dyn IncrementLog) -> Result<(), StoreError> {
        quorum::settle_disputed(disputed, log, self.storages.as_ref())
    }

    /// Ends all waiting.
    pub(crate) fn close(&self) {
        self.storages.close();
    }
}
