//! A live copy of the map over Zenoh.
//!
//! The subscription comes first and the catching up after it, so that no increment falls between
//! the two. What is taken in and what is asked for is decided in [`crate::sync`]; here are the
//! session and the thread that carry it out.

mod config;
mod notices;
mod shared;
mod worker;

pub use self::config::ReplicaConfig;
use self::shared::Shared;
use self::worker::{Arrivals, Worker};
use crate::closures::Closures;
use fht_map::{MapState, Replica, Rules};
use fht_proto::api::keys::{Key, RobotTopic, Topic, increments_of, robots_of};
use fht_proto::{MapName, ReleaseId, VersionVector};
use std::sync::atomic::Ordering;
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, PoisonError, RwLockReadGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use zenoh::handlers::RingChannel;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

/// Why there is no replica.
#[derive(Debug, thiserror::Error)]
pub enum ReplicaError {
    /// Zenoh refused.
    #[error("the map cannot be subscribed: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// The thread could not be started.
    #[error("no thread for the replica: {0}")]
    Thread(#[from] std::io::Error),
}

/// A live copy of one map. It ends when dropped.
pub struct LiveReplica {
    shared: Arc<Shared>,
    closures: Arc<Closures>,
    thread: Option<JoinHandle<()>>,
}

impl LiveReplica {
    /// Subscribes to a map and starts catching up in the background, for the robot of this name.
    ///
    /// # Errors
    /// If Zenoh refuses the subscriptions.
    pub fn start(session: &Session, map: &MapName, robot: &str, config: ReplicaConfig) -> Result<Self, ReplicaError> {
        let shared = Arc::new(Shared::default());
        let (queue, increments) = sync_channel(config.queue.max(1));
        let counting = Arc::clone(&shared);
        // Never waits: Zenoh's thread that runs this also brings the answers, here and to the rest
        // of the program.
        let arrive = move |sample: Sample| {
            if queue.try_send(sample).is_err() {
                counting.dropped.fetch_add(1, Ordering::Relaxed);
            }
            counting.wake();
        };
        let subscriber = session.declare_subscriber(increments_of(map)).callback(arrive).wait()?;
        let closures = Arc::new(Closures::new(robot));
        let hearing = Arc::clone(&closures);
        let report = move |sample: Sample| hearing.take(&sample);
        let blocked = session.declare_subscriber(robots_of(map, RobotTopic::Blocked)).callback(report).wait()?;
        let head_key = Key::topic(map, Topic::Head).to_string();
        let heads = session.declare_subscriber(head_key).with(RingChannel::new(1)).wait()?;
        let worker = Worker::new(
            session.clone(),
            map.clone(),
            config,
            Arc::clone(&shared),
            Arc::clone(&closures),
            Arrivals { _subscribers: [subscriber, blocked], increments, heads },
        );
        let thread = std::thread::Builder::new().name("replica".to_owned()).spawn(move || worker.run())?;
        // It has not slept before this for longer than it would without being woken.
        let _ = shared.thread.set(thread.thread().clone());
        Ok(Self { shared, closures, thread: Some(thread) })
    }

    /// The copy, for reading. Hold it briefly: nothing is taken in meanwhile.
    pub fn read(&self) -> RwLockReadGuard<'_, Replica> {
        self.shared.read()
    }

    /// The map that the robot runs: the release that is enabled, or else the copy as it is.
    #[must_use]
    pub fn running(&self) -> Arc<MapState> {
        let running = self.shared.running.read().unwrap_or_else(PoisonError::into_inner);
        match running.as_ref() {
            Some(running) => Arc::clone(&running.state),
            // A copy costs little: it shares everything with the map.
            None => Arc::new(self.shared.read().state().clone()),
        }
    }

    /// The release that the robot runs; none: the copy as it is.
    #[must_use]
    pub fn release(&self) -> Option<ReleaseId> {
        let running = self.shared.running.read().unwrap_or_else(PoisonError::into_inner);
        running.as_ref().map(|running| running.id.clone())
    }

    /// What operators and other robots have closed, now.
    #[must_use]
    pub fn rules(&self) -> Arc<Rules> {
        self.closures.rules(&self.shared.read())
    }

    /// A number that changes whenever the copy does, or what is run.
    #[must_use]
    pub fn changes(&self) -> u64 {
        *self.shared.changes.borrow()
    }

    /// A number that changes when another map has come to the name: what a robot knew by the old
    /// one, its place too, is void.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.shared.generation.load(Ordering::Acquire)
    }

    /// The number of [`changes`](Self::changes), to be waited for.
    #[must_use]
    pub fn watch_changes(&self) -> watch::Receiver<u64> {
        self.shared.changes.subscribe()
    }

    /// Messages refused since the start.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.shared.refused.load(Ordering::Relaxed)
    }

    /// Messages dropped since the start because too many were waiting. Nothing is lost by it: they
    /// are asked for later.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }

    /// Bytes of answers that brought what was asked for, since the start.
    #[must_use]
    pub fn fetched_bytes(&self) -> u64 {
        self.shared.fetched_bytes.load(Ordering::Relaxed)
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
        self.shared.wake();
        if let Some(thread) = self.thread.take() {
            // It stops within one wait; a panic in it has been reported already.
            let _ = thread.join();
        }
    }
}
