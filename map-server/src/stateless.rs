//! A server that keeps nothing itself, beside one that does: what it reads at its start, what it looks for later on, and how it settles
//! what servers have let in differently.

use crate::ServerError;
use crate::catalog::Catalog;
use crate::catch_up::{self, CatchUp, CatchUpConfig};
use crate::check::Checked;
use crate::ingest::Ingest;
use crate::log::{IncrementLog, StoreError};
use crate::queue::Queue;
use crate::quorum;
use crate::storages::over_zenoh::ZenohStorages;
use crate::storages::{QuorumConfig, Storages};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use zenoh::Session;

/// Between two rounds of looking for what was missed.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// What a server has in the place of a disk.
#[derive(Clone, Debug)]
pub struct Stateless {
    storages: Arc<ZenohStorages>,
    quorum: QuorumConfig,
}

impl Stateless {
    /// On top of the storages that `session` reaches.
    #[must_use]
    pub fn new(session: &Session, quorum: QuorumConfig) -> Self {
        Self { storages: Arc::new(ZenohStorages::new(session.clone())), quorum }
    }

    /// The storages.
    #[must_use]
    pub fn storages(&self) -> Arc<dyn Storages> {
        Arc::clone(&self.storages) as _
    }

    /// Reads all that there is ([`catch_up::restore`]).
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn restore(&self, ingest: &mut Ingest) -> Result<(), StoreError> {
        catch_up::restore(self.storages.as_ref(), self.quorum, ingest)
    }

    /// Looks for what was missed, again and again, until it is closed.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn look(&self, catalog: Arc<Catalog>, queue: Arc<Queue>) -> Result<JoinHandle<()>, ServerError> {
        let storages = Arc::clone(&self.storages);
        let mut missed = CatchUp::new(CatchUpConfig::default());
        let look = move || {
            while storages.wait(LOOK_EVERY) {
                missed.look(storages.as_ref(), &catalog.heads()).into_iter().for_each(|arrival| queue.push(arrival));
            }
        };
        std::thread::Builder::new().name("catch-up".to_owned()).spawn(look).map_err(ServerError::Runtime)
    }

    /// Settles what storages keep although `log` has something else ([`quorum::settle`]).
    ///
    /// # Errors
    /// [`StoreError::Overruled`] when this server has to give way.
    pub fn settle(&self, disputed: &[Checked], log: &dyn IncrementLog) -> Result<(), StoreError> {
        quorum::settle(disputed, log, self.storages.as_ref())
    }

    /// Waits for nothing any more.
    pub fn close(&self) {
        self.storages.close();
    }
}
