//! The robot's side of the publisher: increments go in, and how far they have come is seen.

use super::PublishError;
use super::progress::Progress;
use super::publisher::Publisher;
use super::spool::Spool;
use super::window::{Backlog, WindowConfig};
use fht_proto::{AuthorId, Increment, MapName};
use std::sync::Arc;
use tokio::sync::{Notify, mpsc, watch};

/// Increments that may wait between the robot's loop and the publisher.
const QUEUE: usize = 1024;

/// The robot's side of the publisher.
pub struct Outbox {
    increments: mpsc::Sender<Increment>,
    closed: Closed,
}

/// An outbox into which nothing more comes.
pub struct Closed {
    progress: watch::Receiver<Progress>,
    leave: Arc<Notify>,
}

impl Closed {
    /// How far publishing has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.progress.borrow().clone()
    }

    /// The publisher ends although not all is acknowledged, once what waits is in the spool, if
    /// there is one.
    pub fn leave(&self) {
        self.leave.notify_one();
    }
}

impl Outbox {
    /// Hands an increment over from a thread without an async runtime. Waits when the queue is
    /// full, which takes a server that is gone for long: what is not acknowledged is kept by the
    /// publisher, not here. False when the publisher has ended.
    pub fn send(&self, increment: Increment) -> bool {
        self.increments.blocking_send(increment).is_ok()
    }

    /// Hands an increment over without waiting.
    ///
    /// # Errors
    /// When the queue is full: the increment.
    pub fn offer(&self, increment: Increment) -> Result<(), Increment> {
        match self.increments.try_send(increment) {
            Err(mpsc::error::TrySendError::Full(increment)) => Err(increment),
            // Nobody takes it any more; the publisher says why.
            Ok(()) | Err(mpsc::error::TrySendError::Closed(_)) => Ok(()),
        }
    }

    /// Hands an increment over; waits when the queue is full. False when the publisher has ended.
    pub async fn deliver(&self, increment: Increment) -> bool {
        self.increments.send(increment).await.is_ok()
    }

    /// Whether the publisher has ended, which it does early only for a reason: see its result.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.increments.is_closed()
    }

    /// How far publishing has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.closed.progress()
    }

    /// Ends the stream of increments; the publisher then finishes once all are acknowledged.
    #[must_use]
    pub fn close(self) -> Closed {
        self.closed
    }
}

/// Makes an outbox and the future that empties it over `session`. `stored` are the increments of
/// earlier runs of this author, which the server has; what they have left in `spool` has been
/// delivered. The future ends when the outbox is closed and all is acknowledged, or with the reason
/// why that cannot be.
pub fn outbox(
    session: zenoh::Session,
    map: MapName,
    author: AuthorId,
    stored: u64,
    spool: Option<Spool>,
    window: WindowConfig,
) -> (Outbox, impl Future<Output = Result<Progress, PublishError>>) {
    let (increments, incoming) = mpsc::channel(QUEUE);
    let publisher = Publisher::new(session, map, author, Backlog::after(stored), spool, window);
    let closed = Closed { progress: publisher.progress(), leave: Arc::clone(&publisher.leave) };
    (Outbox { increments, closed }, publisher.run(incoming))
}
