//! What has arrived and waits to be taken in: bounded in bytes, and taken all at once, so that whatever came while the last
//! commit was under way goes into the next one. Beside it, a few jobs of operators for the one thread that writes.

use crate::check::Arrival;
use crate::ingest::Ingest;
use crate::log::StoreError;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Something that an operator wants done by the thread that writes. It has told the operator before it returns; an error is one after which
/// the log is not usable any more.
pub type Job = Box<dyn FnOnce(&mut Ingest) -> Result<(), StoreError> + Send>;

/// What the thread that writes has to do next.
#[derive(Default)]
pub struct Work {
    /// Increments to be taken in, in order; before the jobs.
    pub arrivals: Vec<Arrival>,
    /// Jobs, in order.
    pub jobs: Vec<Job>,
}

#[derive(Default)]
struct Waiting {
    arrivals: VecDeque<Arrival>,
    jobs: Vec<Job>,
    bytes: usize,
    dropped: u64,
    closed: bool,
}

/// A queue between the network's threads and the one that stores.
pub struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    max_bytes: usize,
}

impl std::fmt::Debug for Queue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Queue").field("max_bytes", &self.max_bytes).finish_non_exhaustive()
    }
}

impl Queue {
    /// Jobs that may wait.
    const MAX_JOBS: usize = 16;

    /// An empty queue for at most so many bytes.
    #[must_use]
    pub fn new(max_bytes: usize) -> Self {
        Self { waiting: Mutex::default(), changed: Condvar::new(), max_bytes }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an arrival, or drops it if there is no room: its writer sends it again, since no head covers it. Never waits.
    pub fn push(&self, arrival: Arrival) {
        let mut waiting = self.lock();
        let bytes = arrival.memory_bytes();
        if waiting.closed || waiting.bytes + bytes > self.max_bytes {
            waiting.dropped += 1;
            return;
        }
        waiting.bytes += bytes;
        waiting.arrivals.push_back(arrival);
        drop(waiting);
        self.changed.notify_one();
    }

    /// Adds a job, or drops it if too many wait, or the queue is closed.
    pub fn push_job(&self, job: Job) {
        let mut waiting = self.lock();
        if waiting.closed || waiting.jobs.len() >= Self::MAX_JOBS {
            drop(waiting);
            drop(job);
            return;
        }
        waiting.jobs.push(job);
        drop(waiting);
        self.changed.notify_one();
    }

    /// Waits for work and takes all jobs and about `max_bytes` of arrivals. `None` when the queue is closed and empty.
    #[must_use]
    pub fn take(&self, max_bytes: usize) -> Option<Work> {
        let idle = |waiting: &mut Waiting| waiting.arrivals.is_empty() && waiting.jobs.is_empty() && !waiting.closed;
        let mut waiting = self.changed.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        let (mut batch, mut batch_bytes) = (Vec::new(), 0);
        while batch_bytes < max_bytes
            && let Some(arrival) = waiting.arrivals.pop_front()
        {
            let bytes = arrival.memory_bytes();
            waiting.bytes -= bytes;
            batch_bytes += bytes;
            batch.push(arrival);
        }
        let work = Work { arrivals: batch, jobs: std::mem::take(&mut waiting.jobs) };
        (!work.arrivals.is_empty() || !work.jobs.is_empty()).then_some(work)
    }

    /// How many arrivals were dropped since this was last asked.
    #[must_use]
    pub fn take_dropped(&self) -> u64 {
        std::mem::take(&mut self.lock().dropped)
    }

    /// Takes nothing more in.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }
}
