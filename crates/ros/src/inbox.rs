//! What arrives waits here, and no more of it than is wanted: the oldest goes first.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// A queue of bounded length between Zenoh's threads and one reader.
pub(crate) struct Inbox<T> {
    depth: usize,
    waiting: Mutex<Waiting<T>>,
    arrived: Notify,
}

struct Waiting<T> {
    items: VecDeque<T>,
    dropped: u64,
}

impl<T> Inbox<T> {
    /// Keeps at most `depth` items, at least one.
    pub(crate) fn new(depth: usize) -> Self {
        let waiting = Waiting { items: VecDeque::new(), dropped: 0 };
        Self { depth: depth.max(1), waiting: Mutex::new(waiting), arrived: Notify::new() }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting<T>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Never waits: if there is no room, the oldest item is dropped.
    pub(crate) fn push(&self, item: T) {
        let mut waiting = self.lock();
        if waiting.items.len() >= self.depth {
            waiting.items.pop_front();
            waiting.dropped += 1;
        }
        waiting.items.push_back(item);
        drop(waiting);
        self.arrived.notify_one();
    }

    /// The oldest item, if there is one.
    pub(crate) fn take(&self) -> Option<T> {
        self.lock().items.pop_front()
    }

    /// Waits for the next item. Cancel safe.
    pub(crate) async fn next(&self) -> T {
        loop {
            let arrived = self.arrived.notified();
            if let Some(item) = self.take() {
                return item;
            }
            arrived.await;
        }
    }

    /// How many items were dropped.
    pub(crate) fn dropped(&self) -> u64 {
        self.lock().dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_dropped() {
        let inbox = Inbox::new(3);
        for number in 0..10 {
            inbox.push(number);
        }
        assert_eq!(std::iter::from_fn(|| inbox.take()).collect::<Vec<_>>(), [7, 8, 9]);
        assert_eq!(inbox.dropped(), 7);
    }
}
