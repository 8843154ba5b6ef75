//! What has arrived and waits to be taken in: bounded in bytes, and taken all at once, so that whatever came while the last
//! commit was under way goes into the next one.

use crate::check::Arrival;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

#[derive(Debug, Default)]
struct Waiting {
    arrivals: VecDeque<Arrival>,
    bytes: usize,
    dropped: u64,
    closed: bool,
}

/// A queue between the network's threads and the one that stores.
#[derive(Debug)]
pub struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
    max_bytes: usize,
}

impl Queue {
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

    /// Waits for arrivals and takes about `max_bytes` of them, at least one. `None` when the queue is closed and empty.
    #[must_use]
    pub fn take(&self, max_bytes: usize) -> Option<Vec<Arrival>> {
        let idle = |waiting: &mut Waiting| waiting.arrivals.is_empty() && !waiting.closed;
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
        (!batch.is_empty()).then_some(batch)
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
