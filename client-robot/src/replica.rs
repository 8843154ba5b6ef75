//! A live copy of the map over Zenoh.
//!
//! The subscription comes first and the catching up after it, so that no increment falls between the two. From then on
//! increments arrive live; whenever the server's head shows more than has come, the rest is asked for with `since`. An
//! answer that breaks off is resumed by asking again, since the question names what is already here. When the copy turns out
//! not to be what the server has ([`crate::follow`]), the map is fetched anew and takes the copy's place in one step.

use crate::ask::read_head;
pub use crate::ask::{AskError, ask, ask_head};
use crate::follow::{Follow, FollowConfig, Step};
use fht_map::{Accepted, Replica};
use fht_proto::envelope::MAX_BODY_BYTES;
use fht_proto::keys::{Key, Topic, increments_of};
use fht_proto::query::Snapshot;
use fht_proto::{Increment, MapName, VersionVector, decode};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use zenoh::handlers::{RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Longest message that is read: a body and the envelope around it.
const MAX_MESSAGE_BYTES: usize = MAX_BODY_BYTES + 64;

/// How a replica keeps up.
#[derive(Clone, Debug)]
pub struct ReplicaConfig {
    /// Samples that may wait to be taken in; what comes when the queue is full is dropped, and asked for later. Default 1024.
    pub queue: usize,
    /// How long to wait for an answer, seconds. Default 5.
    pub timeout_s: f64,
    /// How long increments that the head shows may be under way before they are asked for, seconds. Default 0.3.
    pub grace_s: f64,
    /// How long the copy may have increments that the server does not tell of before it is fetched anew, seconds. Default 10.
    pub ahead_s: f64,
    /// The head is asked for this often, in case its publication was lost, seconds. Default 2.
    pub head_every_s: f64,
}

impl Default for ReplicaConfig {
    fn default() -> Self {
        Self { queue: 1024, timeout_s: 5.0, grace_s: 0.3, ahead_s: 10.0, head_every_s: 2.0 }
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
    /// Messages dropped since the start, for want of room.
    dropped: AtomicU64,
}

impl Shared {
    // A panic while writing is a bug, but the map is changed by whole operations and stays readable.
    fn read(&self) -> RwLockReadGuard<'_, Replica> {
        self.replica.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Replica> {
        self.replica.write().unwrap_or_else(PoisonError::into_inner)
    }
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
        let shared = Arc::new(Shared::default());
        let (queue, increments) = sync_channel(config.queue.max(1));
        let counting = Arc::clone(&shared);
        // Never waits: Zenoh's thread that runs this also brings the answers, here and to the rest of the program.
        let arrive = move |sample: Sample| {
            if queue.try_send(sample).is_err() {
                counting.dropped.fetch_add(1, Ordering::Relaxed);
            }
        };
        let subscriber = session.declare_subscriber(increments_of(map)).callback(arrive).wait()?;
        let head_key = Key::topic(map, Topic::Head).to_string();
        let heads = session.declare_subscriber(head_key).with(RingChannel::new(1)).wait()?;
        let follow = FollowConfig {
            behind: Duration::from_secs_f64(config.grace_s.max(0.0)),
            ahead: Duration::from_secs_f64(config.ahead_s.max(0.0)),
            ..FollowConfig::default()
        };
        let worker = Worker {
            session: session.clone(),
            map: map.clone(),
            config,
            shared: Arc::clone(&shared),
            _subscriber: subscriber,
            increments,
            heads,
            follow: Follow::new(follow),
        };
        let thread = std::thread::Builder::new().name("replica".to_owned()).spawn(move || worker.run())?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// The copy, for reading. Hold it briefly: nothing is taken in meanwhile.
    pub fn read(&self) -> RwLockReadGuard<'_, Replica> {
        self.shared.read()
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

    /// Messages dropped since the start because too many were waiting. Nothing is lost by it: they are asked for later.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
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

struct Worker {
    session: Session,
    map: MapName,
    config: ReplicaConfig,
    shared: Arc<Shared>,
    _subscriber: Subscriber<()>,
    increments: Receiver<Sample>,
    heads: Subscriber<RingChannelHandler<Sample>>,
    follow: Follow,
}

impl Worker {
    fn run(mut self) {
        let head_every = Duration::from_secs_f64(self.config.head_every_s.max(0.0));
        self.catch_up();
        let mut asked_at: Option<Instant> = None;
        while !self.is_stopped() {
            if let Ok(sample) = self.increments.recv_timeout(Duration::from_millis(50)) {
                self.take_live(&sample);
                while let Ok(sample) = self.increments.try_recv() {
                    self.take_live(&sample);
                }
            }
            if let Ok(Some(sample)) = self.heads.try_recv() {
                match read_head(&sample.payload().to_bytes(), &self.map) {
                    Ok(head) => self.follow.published(&head),
                    Err(error) => self.refuse(&error),
                }
            }
            if asked_at.is_none_or(|asked| asked.elapsed() >= head_every) {
                asked_at = Some(Instant::now());
                self.ask_head();
            }
            let step = {
                let replica = self.shared.read();
                self.follow.step(replica.vector(), || replica.state().digest(), Instant::now())
            };
            match step {
                Step::Wait => {}
                Step::CatchUp => {
                    let brought = self.catch_up();
                    self.follow.caught_up(brought, Instant::now());
                }
                Step::Refetch => {
                    tracing::warn!(map = %self.map, "this copy of the map is not the server's; fetching it anew");
                    let is_whole = self.refetch();
                    self.follow.refetched(is_whole, Instant::now());
                }
            }
        }
    }

    fn is_stopped(&self) -> bool {
        self.shared.stop.load(Ordering::Acquire)
    }

    fn refuse(&self, reason: &dyn std::fmt::Display) {
        self.shared.refused.fetch_add(1, Ordering::Relaxed);
        tracing::warn!("message refused: {reason}");
    }

    fn ask_head(&mut self) {
        let timeout = Duration::from_secs_f64(self.config.timeout_s.clamp(0.0, 1.0));
        match ask_head(&self.session, &self.map, timeout) {
            Ok(head) => self.follow.answered(head, self.shared.read().vector(), Instant::now()),
            Err(error) => tracing::debug!(%error, "the head is not known"),
        }
    }

    /// Asks for what a copy with `have` lacks: the first of it.
    fn since(&self, have: &VersionVector) -> Option<Vec<Increment>> {
        let timeout = Duration::from_secs_f64(self.config.timeout_s.max(0.0));
        let selector = format!("{}?vector={have}", Key::topic(&self.map, Topic::Since));
        let answers = match ask(&self.session, &selector, timeout) {
            Ok(answers) => answers,
            Err(error) => {
                tracing::debug!(%error, "nothing fetched");
                return None;
            }
        };
        let series = answers.iter().filter_map(|bytes| {
            decode::<Snapshot>(bytes).map_err(|error| self.refuse(&error)).map(|series| series.increments).ok()
        });
        Some(series.flatten().collect())
    }

    /// Asks for what is missing until an answer brings nothing new; returns how much came.
    fn catch_up(&mut self) -> usize {
        let mut brought = 0;
        while !self.is_stopped() {
            let have = self.shared.read().vector().clone();
            let Some(increments) = self.since(&have) else { break };
            let applied = self.take(increments);
            if applied == 0 {
                break;
            }
            brought += applied;
        }
        brought
    }

    /// Fetches the whole map; puts it in the copy's place when all of it has come.
    fn refetch(&self) -> bool {
        let mut fresh = Replica::default();
        loop {
            let Some(increments) = self.since(fresh.vector()).filter(|_| !self.is_stopped()) else { return false };
            let outcomes = increments.into_iter().map(|increment| fresh.accept(increment));
            if outcomes.filter(|outcome| matches!(outcome, Accepted::Applied(_))).count() == 0 {
                break;
            }
        }
        *self.shared.write() = fresh;
        self.shared.changes.fetch_add(1, Ordering::Release);
        true
    }

    /// Takes in what a writer has put.
    fn take_live(&mut self, sample: &Sample) {
        match live_increment(sample, &self.map) {
            Ok(increment) => _ = self.take(vec![increment]),
            Err(reason) => self.refuse(&reason),
        }
    }

    /// Takes in increments; returns how many were applied.
    fn take(&mut self, increments: Vec<Increment>) -> usize {
        let mut applied = 0;
        let mut replica = self.shared.write();
        for increment in increments {
            match replica.accept(increment) {
                Accepted::Applied(count) => applied += count,
                Accepted::Conflict => self.follow.conflict(),
                Accepted::Duplicate | Accepted::Early | Accepted::Dropped => {}
            }
        }
        drop(replica);
        if applied > 0 {
            self.shared.changes.fetch_add(1, Ordering::Release);
        }
        applied
    }
}

/// The increment that a sample brings, if it is the one that its key names.
fn live_increment(sample: &Sample, map: &MapName) -> Result<Increment, String> {
    let key: Key = sample.key_expr().as_str().parse().map_err(|error| format!("{error}"))?;
    let length = sample.payload().len();
    if sample.kind() != SampleKind::Put || length > MAX_MESSAGE_BYTES {
        return Err(format!("{key}: neither deletions nor {length} bytes are taken"));
    }
    let increment: Increment =
        decode(&sample.payload().to_bytes()).map_err(|error| format!("{key}: {length} bytes: {error}"))?;
    if key == Key::increment(map, increment.author, increment.number) {
        Ok(increment)
    } else {
        Err(format!("{key} brings increment {}/{}", increment.author, increment.number))
    }
}
