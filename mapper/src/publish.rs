//! Increments to the server: each is put the moment it exists, and kept until the server's head covers it. After a
//! lost link or a restarted server the rest is sent again from there.

use fht_proto::query::Head;
use fht_proto::{AuthorId, CodecError, Increment, MapName, encode, keys};
use std::collections::BTreeMap;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};

/// Increments that may wait between the robot's loop and the publisher.
const QUEUE: usize = 1024;
/// Increments on the way to the server without an acknowledgement.
const WINDOW: usize = 256;
/// The head is asked for this often while something is not acknowledged.
const RESEND_PERIOD: Duration = Duration::from_secs(1);

/// Why publishing ended.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// The session failed for good.
    #[error("the connection to the map server failed: {0}")]
    Session(#[from] zenoh::Error),
    /// An increment that the server would refuse: a defect of this program.
    #[error("an increment cannot be sent: {0}")]
    Increment(#[from] CodecError),
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
    progress: watch::Receiver<Progress>,
}

impl Outbox {
    /// Hands an increment over. Waits when the queue is full, which takes a server that is gone for long: what is not
    /// acknowledged is kept by the publisher, not here.
    pub fn send(&self, increment: Increment) -> bool {
        self.increments.blocking_send(increment).is_ok()
    }

    /// How far publishing has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.progress.borrow().clone()
    }

    /// Ends the stream of increments; the publisher then finishes once all are acknowledged.
    #[must_use]
    pub fn close(self) -> watch::Receiver<Progress> {
        self.progress
    }
}

/// Increments of one author that the server does not have yet.
#[derive(Default)]
struct Unacknowledged {
    encoded: BTreeMap<u64, Vec<u8>>,
    /// Number of the last one put since the last loss.
    sent: u64,
    acknowledged: u64,
}

impl Unacknowledged {
    fn acknowledge(&mut self, number: u64) {
        self.acknowledged = self.acknowledged.max(number);
        self.encoded = self.encoded.split_off(&(self.acknowledged + 1));
        self.sent = self.sent.max(self.acknowledged);
    }

    /// The next to be put, if the window has room.
    fn next(&self) -> Option<(u64, &Vec<u8>)> {
        let next = self.sent + 1;
        let has_room = next - self.acknowledged <= WINDOW as u64;
        self.encoded.get(&next).filter(|_| has_room).map(|bytes| (next, bytes))
    }
}

/// Makes an outbox and the future that empties it over `session`. The future ends when the outbox is closed and all is
/// acknowledged.
pub fn outbox(
    session: zenoh::Session,
    map: MapName,
    author: AuthorId,
) -> (Outbox, impl Future<Output = Result<Progress, PublishError>>) {
    let (increments, incoming) = mpsc::channel(QUEUE);
    let (report, progress) = watch::channel(Progress::default());
    (Outbox { increments, progress }, publish(session, map, author, incoming, report))
}

async fn publish(
    session: zenoh::Session,
    map: MapName,
    author: AuthorId,
    mut incoming: mpsc::Receiver<Increment>,
    report: watch::Sender<Progress>,
) -> Result<Progress, PublishError> {
    let head_key = keys::Key::topic(&map, keys::Topic::Head).to_string();
    let heads = session.declare_subscriber(&head_key).await?;
    let mut queue = Unacknowledged::default();
    let mut is_open = true;
    let mut tick = tokio::time::interval(RESEND_PERIOD);
    tick.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    let mut acknowledged_at_tick = 0;
    loop {
        while let Some((number, bytes)) = queue.next() {
            let key = keys::Key::increment(&map, author, number).to_string();
            report.send_modify(|progress| progress.wire_bytes += bytes.len() as u64);
            session
                .put(key, bytes.clone())
                .encoding(Encoding::APPLICATION_OCTET_STREAM)
                .congestion_control(CongestionControl::Block)
                .priority(Priority::Data)
                .await?;
            queue.sent = number;
        }
        if !is_open && queue.encoded.is_empty() {
            return Ok(report.borrow().clone());
        }
        tokio::select! {
            next = incoming.recv(), if is_open => match next {
                Some(increment) => {
                    let bytes = encode(&increment)?;
                    report.send_modify(|progress| {
                        progress.written = increment.number;
                        progress.map_bytes += bytes.len() as u64;
                    });
                    queue.encoded.insert(increment.number, bytes);
                }
                None => is_open = false,
            },
            head = heads.recv_async() => {
                let head = head?;
                take_head(&head.payload().to_bytes(), author, &mut queue, &report);
            }
            _ = tick.tick() => {
                if queue.encoded.is_empty() {
                    continue;
                }
                // No news since the last tick: the server may be new, or increments or heads were lost. Ask, and send
                // again from where the server is.
                if queue.acknowledged == acknowledged_at_tick {
                    ask_head(&session, &head_key, author, &mut queue, &report).await?;
                    queue.sent = queue.acknowledged;
                }
                acknowledged_at_tick = queue.acknowledged;
            }
        }
    }
}

fn take_head(payload: &[u8], author: AuthorId, queue: &mut Unacknowledged, report: &watch::Sender<Progress>) {
    match serde_json::from_slice::<Head>(payload) {
        Ok(head) => {
            queue.acknowledge(head.vector.get(author));
            report.send_modify(|progress| {
                progress.acknowledged = queue.acknowledged;
                progress.head = Some(head);
            });
        }
        Err(error) => tracing::warn!("a head that cannot be read: {error}"),
    }
}

async fn ask_head(
    session: &zenoh::Session,
    head_key: &str,
    author: AuthorId,
    queue: &mut Unacknowledged,
    report: &watch::Sender<Progress>,
) -> Result<(), PublishError> {
    let replies = session.get(head_key).timeout(RESEND_PERIOD).await?;
    while let Ok(reply) = replies.recv_async().await {
        if let Ok(sample) = reply.result() {
            take_head(&sample.payload().to_bytes(), author, queue, report);
        }
    }
    Ok(())
}

/// The head of a map as the server has it now; `None` when no server answers within `timeout` or it has no such map.
///
/// # Errors
/// When the session fails.
pub async fn current_head(
    session: &zenoh::Session,
    map: &MapName,
    timeout: Duration,
) -> Result<Option<Head>, PublishError> {
    let key = keys::Key::topic(map, keys::Topic::Head).to_string();
    let replies = session.get(key).timeout(timeout).await?;
    while let Ok(reply) = replies.recv_async().await {
        if let Ok(sample) = reply.result()
            && let Ok(head) = serde_json::from_slice(&sample.payload().to_bytes())
        {
            return Ok(Some(head));
        }
    }
    Ok(None)
}
