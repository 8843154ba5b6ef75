//! Increments to the server: each is put the moment it exists, and kept until the server's head covers it and it was read back
//! ([`crate::verify`]). After a lost link or a restarted server the rest is sent again from there. With a spool ([`crate::spool`]) each is on the
//! robot's disk before it is put.

use crate::spool::{Spool, SpoolError};
use crate::verify::{Taken, Verified};
use crate::window::{Backlog, ForeignWriter, Window, WindowConfig};
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{ErrorCode, ErrorReply, Head, Snapshot};
use fht_proto::{AuthorId, CodecError, Increment, MapName, VersionVector, decode, encode};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{Notify, mpsc, watch};
use zenoh::bytes::Encoding;
use zenoh::handlers::RingChannel;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::ConsolidationMode;

/// Increments that may wait between the robot's loop and the publisher.
const QUEUE: usize = 1024;
/// How many of them are taken at a time, and written to the disk at once.
const BATCH: usize = 64;
/// How long the server has for one answer.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);
/// About how much is read back at a time, bytes.
const PART_BYTES: usize = 256 << 10;
/// Pause before a question is put again.
pub(crate) const ASK_AGAIN: Duration = Duration::from_millis(200);

/// Why publishing ended.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// The session failed for good.
    #[error("the connection to the map server failed: {0}")]
    Session(#[from] zenoh::Error),
    /// An increment that the server would refuse: a defect of this program.
    #[error("an increment cannot be sent: {0}")]
    Increment(#[from] CodecError),
    /// Whether the map exists is not known.
    #[error("no map server told within {seconds} s whether there is a map '{map}': {reason}")]
    NoAnswer {
        /// The map asked for.
        map: MapName,
        /// How long was waited.
        seconds: u64,
        /// What came instead of an answer, the last time.
        reason: String,
    },
    /// The server has increments of this author that this run has not made.
    #[error("{0}; give every robot a --robot of its own, and every run a --map of its own")]
    Foreign(#[from] ForeignWriter),
    /// The server has another increment under a number of this run.
    #[error("{0}; start this robot again, and give every robot a --robot of its own")]
    Taken(#[from] Taken),
    /// The robot's disk failed.
    #[error(transparent)]
    Spool(#[from] SpoolError),
    /// The server refuses increments of this run and would do so again.
    #[error("the map server refuses this run's increments: {}{}", .0.message, advice(.0.code))]
    Refused(ErrorReply),
}

fn advice(code: ErrorCode) -> &'static str {
    match code {
        ErrorCode::Conflict => " (another robot of the same name writes this map)",
        ErrorCode::Future => " (is this robot's clock right?)",
        _ => "",
    }
}

/// How far publishing has come.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Number of the newest increment handed over.
    pub written: u64,
    /// Number up to which the server has everything durably.
    pub acknowledged: u64,
    /// Bytes put so far, repetitions included.
    pub wire_bytes: u64,
    /// Bytes of the increments, each counted once.
    pub map_bytes: u64,
    /// The newest head.
    pub head: Option<Head>,
}

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

    /// The publisher ends although not all is acknowledged, once what waits is in the spool, if there is one.
    pub fn leave(&self) {
        self.leave.notify_one();
    }
}

impl Outbox {
    /// Hands an increment over. Waits when the queue is full, which takes a server that is gone for long: what is not
    /// acknowledged is kept by the publisher, not here. False when the publisher has ended.
    pub fn send(&self, increment: Increment) -> bool {
        self.increments.blocking_send(increment).is_ok()
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

/// Makes an outbox and the future that empties it over `session`. `stored` are the increments of earlier runs of this author, which the
/// server has; what they have left in `spool` has been delivered. The future ends when the outbox is closed and all is
/// acknowledged, or with the reason why that cannot be.
pub fn outbox(
    session: zenoh::Session,
    map: MapName,
    author: AuthorId,
    stored: u64,
    spool: Option<Spool>,
) -> (Outbox, impl Future<Output = Result<Progress, PublishError>>) {
    let (increments, incoming) = mpsc::channel(QUEUE);
    let publisher = Publisher::new(session, map, author, Backlog::after(stored), spool);
    let closed = Closed { progress: publisher.progress(), leave: Arc::clone(&publisher.leave) };
    (Outbox { increments, closed }, publisher.run(incoming))
}

pub(crate) struct Publisher {
    session: zenoh::Session,
    map: MapName,
    author: AuthorId,
    window: Window,
    verified: Verified,
    spool: Option<Spool>,
    report: watch::Sender<Progress>,
    leave: Arc<Notify>,
}

impl Publisher {
    /// Begins with `backlog`, which is in `spool` if there is one.
    pub(crate) fn new(
        session: zenoh::Session,
        map: MapName,
        author: AuthorId,
        backlog: Backlog,
        spool: Option<Spool>,
    ) -> Self {
        let begun = Progress { written: backlog.written(), acknowledged: backlog.acknowledged, ..Progress::default() };
        let verified = Verified::after(author, backlog.acknowledged);
        let window = Window::of_backlog(WindowConfig::default(), backlog);
        let (report, leave) = (watch::Sender::new(begun), Arc::new(Notify::new()));
        Self { session, map, author, window, verified, spool, report, leave }
    }

    /// How far it has come.
    pub(crate) fn progress(&self) -> watch::Receiver<Progress> {
        self.report.subscribe()
    }

    /// Whether all is acknowledged.
    pub(crate) fn is_done(&self) -> bool {
        self.window.is_empty()
    }

    /// Before anything of the backlog is put: reads back what the server has of it at `head`. It may have more, if a run that did not know of
    /// the backlog went on from there.
    pub(crate) async fn verify(&mut self, mut head: Head) -> Result<(), PublishError> {
        let stored = head.vector.get(self.author).min(self.report.borrow().written);
        head.vector.set(self.author, stored);
        while self.verified.upto() < stored {
            if !self.take(head.clone()).await? {
                tokio::time::sleep(ASK_AGAIN).await;
            }
        }
        Ok(())
    }

    /// Publishes the backlog and what is `incoming`, until that is closed and all is acknowledged.
    pub(crate) async fn run(mut self, mut incoming: mpsc::Receiver<Increment>) -> Result<Progress, PublishError> {
        // Rings: the newest head is the only one that counts, and nobody waits for a slow robot.
        let head_key = Key::topic(&self.map, Topic::Head).to_string();
        let heads = self.session.declare_subscriber(head_key).with(RingChannel::new(1)).await?;
        let refused_key = Key::refused(&self.map, self.author).to_string();
        let refusals = self.session.declare_subscriber(refused_key).with(RingChannel::new(8)).await?;
        let leave = Arc::clone(&self.leave);
        let mut is_open = true;
        let mut batch = Vec::with_capacity(BATCH);
        loop {
            self.put_all().await?;
            if !is_open && self.window.is_empty() {
                return Ok(self.report.borrow().clone());
            }
            let ask_at = self.window.ask_at();
            tokio::select! {
                count = incoming.recv_many(&mut batch, BATCH), if is_open => {
                    is_open = count > 0;
                    self.add(batch.drain(..)).await?;
                }
                () = leave.notified() => {
                    while let Ok(increment) = incoming.try_recv() {
                        batch.push(increment);
                    }
                    self.add(batch.drain(..)).await?;
                    return Ok(self.report.borrow().clone());
                }
                head = heads.recv_async() => match read_head(&head?.payload().to_bytes(), &self.map) {
                    Ok(head) => _ = self.take(head).await?,
                    Err(reason) => tracing::warn!("a head that cannot be used: {reason}"),
                },
                refusal = refusals.recv_async() => take_refusal(&refusal?.payload().to_bytes())?,
                () = tokio::time::sleep_until(ask_at.unwrap_or_else(Instant::now).into()), if ask_at.is_some() => {
                    self.ask().await?;
                }
            }
        }
    }

    async fn add(&mut self, increments: impl Iterator<Item = Increment>) -> Result<(), PublishError> {
        let encoded = increments.map(|increment| Ok((increment.number, encode(&increment)?)));
        let encoded: Vec<(u64, Vec<u8>)> = encoded.collect::<Result<_, CodecError>>()?;
        if let Some(spool) = self.spool.as_ref().filter(|_| !encoded.is_empty()) {
            spool.add(encoded.clone()).await?;
        }
        for (number, bytes) in encoded {
            self.report.send_modify(|progress| {
                progress.written = number;
                progress.map_bytes += bytes.len() as u64;
            });
            self.window.push(number, bytes);
        }
        Ok(())
    }

    async fn put_all(&mut self) -> Result<(), PublishError> {
        while let Some((number, bytes)) = self.window.next() {
            let key = Key::increment(&self.map, self.author, number).to_string();
            self.report.send_modify(|progress| progress.wire_bytes += bytes.len() as u64);
            self.session
                .put(key, bytes)
                .encoding(Encoding::APPLICATION_OCTET_STREAM)
                .congestion_control(CongestionControl::Block)
                .priority(Priority::Data)
                .await?;
            self.window.put(Instant::now());
        }
        Ok(())
    }

    /// Takes a head in; returns whether it acknowledges more than was known.
    async fn take(&mut self, head: Head) -> Result<bool, PublishError> {
        self.window.check(head.vector.get(self.author))?;
        if let Some(have) = self.verified.lacking(&head.vector) {
            self.read_back(&have).await?;
        }
        let is_news = self.window.acknowledge(self.verified.upto(), Instant::now())?;
        self.report.send_modify(|progress| {
            progress.acknowledged = self.window.acknowledged();
            progress.head = Some(head);
        });
        if let Some(spool) = self.spool.as_ref().filter(|_| is_news) {
            spool.acknowledge(self.window.acknowledged()).await?;
        }
        Ok(is_news)
    }

    /// Reads back what the server has beyond `have`, as far as it comes. What is lacking is asked for at the next head.
    async fn read_back(&mut self, have: &VersionVector) -> Result<(), PublishError> {
        let key = Key::topic(&self.map, Topic::Since);
        let selector = format!("{key}?vector={have};max_bytes={PART_BYTES}");
        let question = self.session.get(selector).timeout(ANSWER_TIMEOUT).consolidation(ConsolidationMode::None);
        let answers = question.await?;
        while let Ok(answer) = answers.recv_async().await {
            let Ok(sample) = answer.result() else { continue };
            match decode::<Snapshot>(&sample.payload().to_bytes()) {
                Ok(piece) => self.verified.compare(&piece, &self.window)?,
                Err(error) => tracing::warn!("what the server has cannot be read back: {error}"),
            }
        }
        Ok(())
    }

    /// There is no news: the server may be new, or increments or heads were lost. Asks, and sends again from where the
    /// server is.
    async fn ask(&mut self) -> Result<(), PublishError> {
        let is_news = match ask_head(&self.session, &self.map).await? {
            Answer::Head(head) => self.take(head).await?,
            Answer::NoMap => false,
            Answer::None(reason) => {
                tracing::debug!("the head is not known: {reason}");
                self.window.unanswered(Instant::now());
                return Ok(());
            }
        };
        if !is_news {
            self.window.lost();
        }
        Ok(())
    }
}

fn take_refusal(payload: &[u8]) -> Result<(), PublishError> {
    match serde_json::from_slice::<ErrorReply>(payload) {
        Ok(reply) if reply.code.is_permanent_refusal() => Err(PublishError::Refused(reply)),
        Ok(reply) => {
            tracing::warn!("the server refused an increment: {reply}");
            Ok(())
        }
        Err(error) => {
            tracing::warn!("a refusal that cannot be read: {error}");
            Ok(())
        }
    }
}

fn read_head(payload: &[u8], map: &MapName) -> Result<Head, String> {
    let head: Head = serde_json::from_slice(payload).map_err(|error| error.to_string())?;
    head.checked(map).map_err(|error| error.to_string())
}

/// What came back to the question for a head.
enum Answer {
    Head(Head),
    /// The server has no such map.
    NoMap,
    /// No server answered, or not to the question: what came instead.
    None(String),
}

async fn ask_head(session: &zenoh::Session, map: &MapName) -> Result<Answer, PublishError> {
    let key = Key::topic(map, Topic::Head).to_string();
    let replies = session.get(key).timeout(ANSWER_TIMEOUT).await?;
    let mut answer = Answer::None("nobody answered".to_owned());
    while let Ok(reply) = replies.recv_async().await {
        match reply.result() {
            Ok(sample) => match read_head(&sample.payload().to_bytes(), map) {
                Ok(head) => return Ok(Answer::Head(head)),
                Err(reason) => answer = Answer::None(format!("a head that cannot be used: {reason}")),
            },
            Err(error) => match serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()) {
                Ok(reply) if reply.code == ErrorCode::UnknownMap => answer = Answer::NoMap,
                Ok(reply) => answer = Answer::None(reply.message),
                // Zenoh's own, such as a timeout.
                Err(_) => {}
            },
        }
    }
    Ok(answer)
}

/// The head of a map as the server has it now; `None` when the server says that it has no such map. A server that is silent or
/// busy is asked again, for as long as `patience`.
///
/// # Errors
/// [`PublishError::NoAnswer`] when no server has answered by then, [`PublishError::Session`].
pub async fn find_head(
    session: &zenoh::Session,
    map: &MapName,
    patience: Duration,
) -> Result<Option<Head>, PublishError> {
    let begin = Instant::now();
    loop {
        let reason = match ask_head(session, map).await? {
            Answer::Head(head) => return Ok(Some(head)),
            Answer::NoMap => return Ok(None),
            Answer::None(reason) => reason,
        };
        if begin.elapsed() >= patience {
            return Err(PublishError::NoAnswer { map: map.clone(), seconds: patience.as_secs(), reason });
        }
        tokio::time::sleep(ASK_AGAIN).await;
    }
}
