//! A run begins: what the last run of this robot has left in its spool ([`crate::spool`]) is delivered before anything else, and the run goes
//! on from a head that covers all of it. What the server has of it already is read back first: behind another run's increments nothing is
//! put. A server that has less than it had acknowledged is another one, or lags behind; going on there would give numbers twice.

use crate::publish::{ASK_AGAIN, PublishError, Publisher, find_head};
use crate::spool::{Origin, Spool, SpoolError};
use crate::window::Backlog;
use fht_proto::query::{ErrorCode, Head};
use fht_proto::{AuthorId, MapName, VersionVector};
use std::path::PathBuf;
use std::pin::pin;
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use zenoh::Session;

/// Why what the last run has left is not delivered. It stays where it is.
#[derive(Debug, thiserror::Error)]
pub enum DeliverError {
    /// The server has lost what it had acknowledged, or is another one.
    #[error(
        "map '{map}' is at '{found}' on the map server, and this robot has seen it at '{expected}': this is another server, or one that \
         lags behind. Start again later, or remove {} if that map is gone for good", file.display()
    )]
    Behind {
        /// The map.
        map: MapName,
        /// What the server has.
        found: VersionVector,
        /// What it, or another one, has had.
        expected: VersionVector,
        /// The spool.
        file: PathBuf,
    },
    /// The last run began the map, and so has another robot, in another frame.
    #[error(
        "another robot has begun map '{map}' since the last run of this one, which had begun it, too: what that left in {} is of another \
         frame. Remove that file to join the map", file.display()
    )]
    BegunByAnother {
        /// The map.
        map: MapName,
        /// The spool.
        file: PathBuf,
    },
    /// The server does not acknowledge it.
    #[error(
        "the map server has acknowledged nothing for {seconds} s; {waiting} increments of the last run still wait in {}; may this robot \
         write? (access control drops silently)", file.display()
    )]
    Late {
        /// How long was waited.
        seconds: u64,
        /// How many still wait.
        waiting: u64,
        /// The spool.
        file: PathBuf,
    },
    /// The server has something else under the same numbers.
    #[error(
        "what the last run left in {} cannot be delivered: {reason}. Give every robot a --robot of its own; remove that file if what it \
         holds is not wanted any more", file.display()
    )]
    Taken {
        /// The spool.
        file: PathBuf,
        /// What the server has.
        reason: String,
    },
    /// The server cannot be asked, or refuses it.
    #[error("{error}; what the last run has left waits in {}", file.display())]
    Publish {
        /// Why.
        error: PublishError,
        /// The spool.
        file: PathBuf,
    },
    /// The spool cannot be read.
    #[error(transparent)]
    Spool(#[from] SpoolError),
}

/// Delivers what is in `spool`, and returns the head after it; `None` when the server has no such map. Waits for `patience` where nothing
/// moves.
///
/// # Errors
/// [`DeliverError`].
pub async fn deliver(
    session: &Session,
    map: &MapName,
    author: AuthorId,
    spool: &Spool,
    patience: Duration,
) -> Result<Option<Head>, DeliverError> {
    Delivery { session, map, author, spool, patience }.run().await
}

struct Delivery<'a> {
    session: &'a Session,
    map: &'a MapName,
    author: AuthorId,
    spool: &'a Spool,
    patience: Duration,
}

impl Delivery<'_> {
    async fn run(&self) -> Result<Option<Head>, DeliverError> {
        let backlog = self.spool.backlog()?;
        let origin = self.spool.origin()?;
        let mut expected = origin.as_ref().map(|origin| origin.basis.clone()).unwrap_or_default();
        expected.set(self.author, backlog.acknowledged);
        let head = self.reach(&expected).await?;
        if backlog.encoded.is_empty() {
            return Ok(head);
        }
        let found = head.as_ref().map(|head| head.vector.clone()).unwrap_or_default();
        self.check_frame(origin.as_ref(), &expected, &found)?;
        expected.set(self.author, backlog.written());
        self.publish(backlog, head).await?;
        self.reach(&expected).await
    }

    /// Whether what waits is of the frame of the map that is `found`, if nothing of it is there that would tell.
    fn check_frame(
        &self,
        origin: Option<&Origin>,
        expected: &VersionVector,
        found: &VersionVector,
    ) -> Result<(), DeliverError> {
        let (map, file) = (self.map.clone(), self.spool.file().to_owned());
        let Some(origin) = origin.filter(|_| found.get(self.author) == 0) else { return Ok(()) };
        let has_others = found.iter().any(|(author, count)| count > origin.basis.get(author));
        match origin.is_founder {
            true if has_others => Err(DeliverError::BegunByAnother { map, file }),
            // It found its place by what others had made.
            false if found.iter().next().is_none() => {
                Err(DeliverError::Behind { map, found: found.clone(), expected: expected.clone(), file })
            }
            _ => Ok(()),
        }
    }

    async fn publish(&self, backlog: Backlog, head: Option<Head>) -> Result<(), DeliverError> {
        let (waiting, written) = (backlog.encoded.len(), backlog.written());
        tracing::info!("delivering {waiting} increments that the last run has left");
        let (session, map, spool) = (self.session.clone(), self.map.clone(), self.spool.clone());
        let mut publisher = Publisher::new(session, map, self.author, backlog, Some(spool));
        let mut progress = publisher.progress();
        let work = async move {
            if let Some(head) = head {
                publisher.verify(head).await?;
            }
            // Nothing is added to it: it ends when all is acknowledged.
            let (_, nothing) = mpsc::channel(1);
            if publisher.is_done() { Ok(()) } else { publisher.run(nothing).await.map(|_| ()) }
        };
        let mut work = pin!(work);
        let file = || self.spool.file().to_owned();
        loop {
            let acknowledged = progress.borrow().acknowledged;
            let moves = progress.wait_for(|now| now.acknowledged > acknowledged);
            tokio::select! {
                outcome = &mut work => return outcome.map_err(|error| self.failed(error)),
                moved = tokio::time::timeout(self.patience, moves) => if moved.is_err() {
                    let waiting = written - acknowledged;
                    return Err(DeliverError::Late { seconds: self.patience.as_secs(), waiting, file: file() });
                }
            }
        }
    }

    fn failed(&self, error: PublishError) -> DeliverError {
        let file = self.spool.file().to_owned();
        let reason = match &error {
            PublishError::Foreign(foreign) => foreign.to_string(),
            PublishError::Taken(taken) => taken.to_string(),
            PublishError::Refused(reply) if reply.code == ErrorCode::Conflict => reply.message.clone(),
            _ => return DeliverError::Publish { error, file },
        };
        DeliverError::Taken { file, reason }
    }

    /// The head, once it covers what is `expected`. Of several servers one may lag behind.
    async fn reach(&self, expected: &VersionVector) -> Result<Option<Head>, DeliverError> {
        let file = || self.spool.file().to_owned();
        let begin = Instant::now();
        loop {
            let head = find_head(self.session, self.map, self.patience).await;
            let head = head.map_err(|error| DeliverError::Publish { error, file: file() })?;
            let found = head.as_ref().map(|head| head.vector.clone()).unwrap_or_default();
            if found.covers(expected) {
                return Ok(head);
            }
            if begin.elapsed() >= self.patience {
                let (map, expected) = (self.map.clone(), expected.clone());
                return Err(DeliverError::Behind { map, found, expected, file: file() });
            }
            tokio::time::sleep(ASK_AGAIN).await;
        }
    }
}
