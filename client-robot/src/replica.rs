//! A live copy of the map over Zenoh.
//!
//! The subscription comes first and the catching up after it, so that no increment falls between the two. From then on
//! increments arrive live; whenever the server's head shows more than has come, the rest is asked for with `since`. An
//! answer that breaks off is resumed by asking again, since the question names what is already here.

use fht_map::{Accepted, Replica};
use fht_proto::keys::{Key, Topic, increments_of};
use fht_proto::query::{ErrorReply, Head, Snapshot};
use fht_proto::{Increment, MapName, VersionVector, decode};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use zenoh::handlers::{FifoChannel, FifoChannelHandler, RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

/// How a replica keeps up.
#[derive(Clone, Debug)]
pub struct ReplicaConfig {
    /// Samples that may wait to be taken in; a full queue holds the sender back. Default 1024.
    pub queue: usize,
    /// How long to wait for an answer, seconds. Default 5.
    pub timeout_s: f64,
    /// How long increments that the head shows may be under way before they are asked for, seconds. Default 0.3.
    pub grace_s: f64,
    /// The head is asked for this often, in case its publication was lost, seconds. Default 2.
    pub head_every_s: f64,
}

impl Default for ReplicaConfig {
    fn default() -> Self {
        Self { queue: 1024, timeout_s: 5.0, grace_s: 0.3, head_every_s: 2.0 }
    }
}

/// Why there is no replica.
#[derive(Debug, thiserror::Error)]
pub enum ReplicaError {
    /// Zenoh refused.
    #[error("the map cannot be subscribed: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// The thread could not be started.
    #[error("no thread for the replica: {0}")]
    Thread(#[from] std::io::Error),
}

/// State that the robot reads and the replica's thread writes.
#[derive(Default)]
struct Shared {
    replica: RwLock<Replica>,
    stop: AtomicBool,
    /// Counts changes, so that a reader sees cheaply whether there is anything new.
    changes: AtomicU64,
    /// Messages refused since the start.
    refused: AtomicU64,
}

/// A live copy of one map. It ends when dropped.
pub struct LiveReplica {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl LiveReplica {
    /// Subscribes to a map and starts catching up in the background.
    ///
    /// # Errors
    /// If Zenoh refuses the subscriptions.
    pub fn start(session: &Session, map: &MapName, config: ReplicaConfig) -> Result<Self, ReplicaError> {
        let increments =
            session.declare_subscriber(increments_of(map)).with(FifoChannel::new(config.queue.max(1))).wait()?;
        let head_key = Key::topic(map, Topic::Head).to_string();
        let heads = session.declare_subscriber(head_key).with(RingChannel::new(1)).wait()?;
        let shared = Arc::new(Shared::default());
        let worker = Worker {
            session: session.clone(),
            map: map.clone(),
            config,
            shared: Arc::clone(&shared),
            increments,
            heads,
            behind_since: None,
        };
        let thread = std::thread::Builder::new().name("replica".to_owned()).spawn(move || worker.run())?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// The copy, for reading. Hold it briefly: nothing is taken in meanwhile.
    pub fn read(&self) -> RwLockReadGuard<'_, Replica> {
        // A panic while writing is a bug, but the map is changed by whole operations and stays readable.
        self.shared.replica.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// A number that changes whenever the copy does.
    #[must_use]
    pub fn changes(&self) -> u64 {
        self.shared.changes.load(Ordering::Acquire)
    }

    /// Messages refused since the start.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.shared.refused.load(Ordering::Relaxed)
    }

    /// Waits until the copy contains at least `vector`; false when the time is up.
    #[must_use]
    pub fn wait_for(&self, vector: &VersionVector, timeout: Duration) -> bool {
        let deadline = Instant::now() + timeout;
        while !self.read().vector().covers(vector) {
            if Instant::now() >= deadline {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        true
    }
}

impl Drop for LiveReplica {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // It stops within one wait; a panic in it has been reported already.
            let _ = thread.join();
        }
    }
}

/// Asks the server for a map's head.
///
/// # Errors
/// The server's reason, or a sentence if it did not answer.
pub fn ask_head(session: &Session, map: &MapName, timeout: Duration) -> Result<Head, AskError> {
    let replies = ask(session, &Key::topic(map, Topic::Head).to_string(), timeout)?;
    let first = replies.into_iter().next().ok_or(AskError::Silent)?;
    serde_json::from_slice(&first).map_err(|error| AskError::Unreadable(error.to_string()))
}

/// Why a question has no answer.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// Zenoh refused.
    #[error("the question cannot be put: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// Nobody answered in time.
    #[error("no map-server answered")]
    Silent,
    /// The server refused, with its reason.
    #[error("{0}")]
    Refused(ErrorReply),
    /// The answer cannot be read.
    #[error("the answer cannot be read: {0}")]
    Unreadable(String),
}

/// Puts a question and returns the payloads of all answers. An error reply is the outcome if nothing else came.
///
/// # Errors
/// Why there is no answer.
pub fn ask(session: &Session, selector: &str, timeout: Duration) -> Result<Vec<Vec<u8>>, AskError> {
    let replies = session.get(selector).timeout(timeout).with(FifoChannel::new(256)).wait()?;
    let mut payloads = Vec::new();
    let mut refusal = None;
    while let Ok(reply) = replies.recv() {
        match reply.result() {
            Ok(sample) => payloads.push(sample.payload().to_bytes().into_owned()),
            Err(error) => refusal = serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()).ok().or(refusal),
        }
    }
    match (payloads.is_empty(), refusal) {
        (true, Some(refusal)) => Err(AskError::Refused(refusal)),
        (true, None) => Err(AskError::Silent),
        (false, _) => Ok(payloads),
    }
}

struct Worker {
    session: Session,
    map: MapName,
    config: ReplicaConfig,
    shared: Arc<Shared>,
    increments: Subscriber<FifoChannelHandler<Sample>>,
    heads: Subscriber<RingChannelHandler<Sample>>,
    behind_since: Option<Instant>,
}

impl Worker {
    fn run(mut self) {
        let grace = Duration::from_secs_f64(self.config.grace_s);
        let head_every = Duration::from_secs_f64(self.config.head_every_s);
        self.catch_up();
        let mut asked_at = Instant::now();
        let mut head = VersionVector::default();
        while !self.shared.stop.load(Ordering::Acquire) {
            if let Ok(Some(sample)) = self.increments.recv_timeout(Duration::from_millis(50)) {
                self.take(&sample.payload().to_bytes());
                while let Ok(Some(sample)) = self.increments.try_recv() {
                    self.take(&sample.payload().to_bytes());
                }
            }
            if let Ok(Some(sample)) = self.heads.try_recv()
                && let Ok(published) = serde_json::from_slice::<Head>(&sample.payload().to_bytes())
            {
                head = head.join(&published.vector);
            }
            if asked_at.elapsed() >= head_every {
                asked_at = Instant::now();
                let timeout = Duration::from_secs_f64(self.config.timeout_s.min(1.0));
                if let Ok(answer) = ask_head(&self.session, &self.map, timeout) {
                    head = head.join(&answer.vector);
                }
            }
            if self.has(&head) {
                self.behind_since = None;
            } else if self.behind_since.get_or_insert_with(Instant::now).elapsed() >= grace {
                self.catch_up();
                self.behind_since = None;
            }
        }
    }

    fn has(&self, vector: &VersionVector) -> bool {
        self.shared.replica.read().unwrap_or_else(PoisonError::into_inner).vector().covers(vector)
    }

    /// Asks for what is missing until an answer brings nothing new.
    fn catch_up(&self) {
        let timeout = Duration::from_secs_f64(self.config.timeout_s);
        while !self.shared.stop.load(Ordering::Acquire) {
            let vector = self.shared.replica.read().unwrap_or_else(PoisonError::into_inner).vector().to_string();
            let selector = format!("{}?vector={vector}", Key::topic(&self.map, Topic::Since));
            let payloads = match ask(&self.session, &selector, timeout) {
                Ok(payloads) => payloads,
                Err(error) => {
                    tracing::debug!(%error, "not caught up");
                    return;
                }
            };
            let taken: usize = payloads.iter().map(|bytes| self.take(bytes)).sum();
            if taken == 0 {
                return;
            }
        }
    }

    /// Takes in an increment or a series of them; returns how many were applied.
    fn take(&self, bytes: &[u8]) -> usize {
        let increments = decode::<Increment>(bytes)
            .map(|increment| vec![increment])
            .or_else(|error| decode::<Snapshot>(bytes).map(|series| series.increments).map_err(|_| error));
        let increments = match increments {
            Ok(increments) => increments,
            Err(error) => {
                self.shared.refused.fetch_add(1, Ordering::Relaxed);
                tracing::warn!(%error, bytes = bytes.len(), "message refused");
                return 0;
            }
        };
        let mut applied = 0;
        let mut replica = self.shared.replica.write().unwrap_or_else(PoisonError::into_inner);
        for increment in increments {
            if let Accepted::Applied(count) = replica.accept(increment) {
                applied += count;
            }
        }
        drop(replica);
        if applied > 0 {
            self.shared.changes.fetch_add(1, Ordering::Release);
        }
        applied
    }
}
