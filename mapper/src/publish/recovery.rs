//! A run begins: what the last run of this robot has left in its spool (`spool`)
//! is delivered before anything else, and the run goes on from a head that covers all of it. What
//! the server has of it already is read back first: behind another run's increments nothing is put.
//! A server that has less than it had acknowledged is another one, or lags behind; going on there
//! would give numbers twice.

use crate::publish::head::ASK_AGAIN;
use crate::publish::publisher::Publisher;
use crate::publish::{Backlog, RunOrigin, Spool, SpoolError, WindowConfig};
use crate::publish::{PublishError, find_head};
use crate::team::{CLAIM_TIME, ROLL_CALL};
use fht_proto::api::keys::{Key, RobotTopic, robots_of};
use fht_proto::api::reply::{ErrorCode, Head};
use fht_proto::{AuthorId, Increment, MapName, NodeId, Op, VersionVector, decode};
use std::path::PathBuf;
use std::pin::pin;
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

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
        "another robot begins map '{map}' or has begun it, and so had the last run of this one: what that left in {} is of another frame. \
         Start again under another --robot to join the map", file.display()
    )]
    BegunByAnother {
        /// The map.
        map: MapName,
        /// The spool.
        file: PathBuf,
    },
    /// The server does not acknowledge it.
    #[error(
        "the map server has acknowledged nothing for {seconds} s; {waiting} increments of the last run still wait in {}; {reason}",
        file.display()
    )]
    Late {
        /// How long was waited.
        seconds: u64,
        /// How many still wait.
        waiting: u64,
        /// The spool.
        file: PathBuf,
        /// What the server says, or what may be the matter.
        reason: String,
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

/// Delivers what is in `spool`, and returns the head after it; `None` when the server has no such
/// map. Waits for `patience` where nothing moves.
///
/// # Errors
/// [`DeliverError`].
pub async fn deliver(
    session: &Session,
    map: &MapName,
    robot: &str,
    spool: &Spool,
    window: &WindowConfig,
    patience: Duration,
) -> Result<Option<Head>, DeliverError> {
    Delivery { session, map, robot, author: AuthorId::of_robot(robot), spool, window, patience }.run().await
}

struct Delivery<'a> {
    session: &'a Session,
    map: &'a MapName,
    robot: &'a str,
    author: AuthorId,
    spool: &'a Spool,
    window: &'a WindowConfig,
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
        let claim = match origin {
            Some(origin) => self.check_frame(&origin, &backlog, &expected, head.as_ref()).await?,
            None => None,
        };
        expected.set(self.author, backlog.written());
        self.publish(backlog, head).await?;
        let head = self.reach(&expected).await;
        drop(claim);
        head
    }

    /// Whether what waits is of the frame of the map that the server has. If it begins the map, it
    /// is claimed as by an explorer that does (`team::peers`).
    async fn check_frame(
        &self,
        origin: &RunOrigin,
        backlog: &Backlog,
        expected: &VersionVector,
        head: Option<&Head>,
    ) -> Result<Option<LivelinessToken>, DeliverError> {
        let (map, file) = (self.map.clone(), self.spool.file().to_owned());
        let found = head.map(|head| head.vector.clone()).unwrap_or_default();
        let has_begun = head.is_some_and(|head| head.main_nodes > 0);
        // The node that the map's frame is that of.
        let first = NodeId { author: self.author, number: 0 };
        let missing = backlog.encoded.range(found.get(self.author).saturating_add(1)..);
        let begins = missing.filter_map(|(_, bytes)| decode::<Increment>(bytes).ok());
        let begins =
            begins.flat_map(|increment| increment.ops).any(|op| matches!(op, Op::PutNode { id, .. } if id == first));
        match (origin.is_founder, has_begun) {
            (true, true) if begins => Err(DeliverError::BegunByAnother { map, file }),
            (true, false) if begins => self.claim().await.map(Some),
            // It found its place by what others had made.
            (false, false) => Err(DeliverError::Behind { map, found, expected: expected.clone(), file }),
            _ => Ok(None),
        }
    }

    async fn claim(&self) -> Result<LivelinessToken, DeliverError> {
        let (map, file) = (self.map.clone(), self.spool.file().to_owned());
        let failed = |error: zenoh::Error| DeliverError::Publish { error: error.into(), file: file.clone() };
        let own = Key::robot(self.map, self.robot, RobotTopic::Pose).to_string();
        let token = self.session.liveliness().declare_token(own.as_str()).await.map_err(failed)?;
        tokio::time::sleep(CLAIM_TIME).await;
        let claims = self.session.liveliness().get(robots_of(self.map, RobotTopic::Pose));
        let claims = claims.timeout(ROLL_CALL).await.map_err(failed)?;
        while let Ok(claim) = claims.recv_async().await {
            if claim.result().is_ok_and(|sample| sample.key_expr().as_str() != own) {
                return Err(DeliverError::BegunByAnother { map, file });
            }
        }
        Ok(token)
    }

    async fn publish(&self, backlog: Backlog, head: Option<Head>) -> Result<(), DeliverError> {
        let (waiting, written) = (backlog.encoded.len(), backlog.written());
        tracing::info!("delivering {waiting} increments that the last run has left");
        let (session, map, spool) = (self.session.clone(), self.map.clone(), self.spool.clone());
        let window = self.window.clone();
        let mut publisher = Publisher::new(session, map, self.author, backlog, Some(spool), window);
        let mut progress = publisher.progress();
        let latest = progress.clone();
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
                    let (seconds, reason) = (self.patience.as_secs(), latest.borrow().reason());
                    return Err(DeliverError::Late { seconds, waiting, file: file(), reason });
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
