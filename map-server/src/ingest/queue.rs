//! What has arrived and waits to be taken in. It is bounded in bytes and taken all at once, so that
//! everything that arrived during the last commit goes into the next one. Operators' jobs for the
//! writer wait here as well.

use crate::ingest::check::Arrival;
use crate::ingest::pipeline::Ingest;
use crate::store::StoreError;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Something that an operator wants the writer to do. It has answered the operator before it
/// returns; after an error the log is no longer usable.
pub type WriterJob = Box<dyn FnOnce(&mut Ingest) -> Result<(), StoreError> + Send>;

/// What the writer has to do next.
#[derive(Default)]
pub struct WriterWork {
    /// Increments, in order; to be taken in before the jobs are done.
    pub arrivals: Vec<Arrival>,
    /// Jobs, in order.
    pub jobs: Vec<WriterJob>,
}

impl WriterWork {
    fn is_empty(&self) -> bool {
        self.arrivals.is_empty() && self.jobs.is_empty()
    }
}

#[derive(Default)]
struct Waiting {
    arrivals: VecDeque<Arrival>,
    jobs: Vec<WriterJob>,
    bytes: usize,
    dropped: u64,
    closed: bool,
}

/// A queue between the network's threads and the writer.
pub struct WriterQueue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    max_bytes: usize,
}

impl std::fmt::Debug for WriterQueue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WriterQueue").field("max_bytes", &self.max_bytes).finish_non_exhaustive()
    }
}

impl WriterQueue {
    /// How many jobs may wait.
    const MAX_JOBS: usize = 16;

    /// An empty queue for at most `max_bytes`.
    #[must_use]
    pub fn new(max_bytes: usize) -> Self {
        Self { waiting: Mutex::default(), changed: Condvar::new(), max_bytes }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an arrival, or drops it if there is no room: its writer sends it again, since no head
    /// covers it. Never blocks.
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

    /// Adds a job, or drops it if too many are waiting, or the queue is closed.
    pub fn push_job(&self, job: WriterJob) {
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

    /// Waits for work and takes all jobs and about `max_bytes` of arrivals. `None` when the queue
    /// is closed and empty.
    #[must_use]
    pub fn take_work(&self, max_bytes: usize) -> Option<WriterWork> {
        /// Nobody waits for longer.
        const FOR_EVER: Duration = Duration::from_secs(10_000_000);
        loop {
            let work = self.take_work_within(max_bytes, FOR_EVER)?;
            if !work.is_empty() {
                return Some(work);
            }
        }
    }

    /// The same, which is nothing if none comes within `patience`.
    #[must_use]
    pub fn take_work_within(&self, max_bytes: usize, patience: Duration) -> Option<WriterWork> {
        let idle = |waiting: &mut Waiting| waiting.arrivals.is_empty() && waiting.jobs.is_empty() && !waiting.closed;
        let waited = self.changed.wait_timeout_while(self.lock(), patience, idle);
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let (mut batch, mut batch_bytes) = (Vec::new(), 0);
        while batch_bytes < max_bytes
            && let Some(arrival) = waiting.arrivals.pop_front()
        {
            let bytes = arrival.memory_bytes();
            waiting.bytes -= bytes;
            batch_bytes += bytes;
            batch.push(arrival);
        }
        let work = WriterWork { arrivals: batch, jobs: std::mem::take(&mut waiting.jobs) };
        (!work.is_empty() || !waiting.closed).then_some(work)
    }

    /// How many arrivals were dropped since the last call.
    #[must_use]
    pub fn take_dropped(&self) -> u64 {
        std::mem::take(&mut self.lock().dropped)
    }

    /// Accepts nothing more.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }
}
