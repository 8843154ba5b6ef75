//! What a replica's thread writes and the robot reads.

use crate::sync::Running;
use fht_map::Replica;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{OnceLock, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::Thread;
use tokio::sync::watch;

/// State that the robot reads and the replica's thread writes.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) replica: RwLock<Replica>,
    /// The release that is run; none: the copy as it is.
    pub(super) running: RwLock<Option<Running>>,
    /// The thread that takes in and asks, once it runs: it sleeps while nothing comes.
    pub(super) thread: OnceLock<Thread>,
    pub(super) stop: AtomicBool,
    /// Counts changes, so that a reader sees cheaply whether there is anything new, or waits for
    /// it.
    pub(super) changes: watch::Sender<u64>,
    /// Counts the maps that have come to the name.
    pub(super) generation: AtomicU64,
    /// Messages refused since the start.
    pub(super) refused: AtomicU64,
    /// Messages dropped since the start, for want of room.
    pub(super) dropped: AtomicU64,
    /// Bytes of answers that brought increments.
    pub(super) fetched_bytes: AtomicU64,
}

impl Shared {
    /// Something has come. Never waits.
    pub(super) fn wake(&self) {
        if let Some(thread) = self.thread.get() {
            thread.unpark();
        }
    }

    // A panic while writing is a bug, but the map is changed by whole operations and stays
    // readable.
    pub(super) fn read(&self) -> RwLockReadGuard<'_, Replica> {
        self.replica.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn write(&self) -> RwLockWriteGuard<'_, Replica> {
        self.replica.write().unwrap_or_else(PoisonError::into_inner)
    }
}
