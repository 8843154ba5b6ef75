//! A live copy of the map over Zenoh.
//!
//! The subscription comes first and the catching up after it, so that no increment falls between the two. What is taken in and
//! what is asked for is decided in [`crate::sync`]; here are the session and the thread that carry it out.

use crate::ask::read_head;
pub use crate::ask::{AskError, ask, ask_head};
use crate::closures::Closures;
use crate::follow::FollowConfig;
use crate::sync::{Question, Running, Sync, SyncConfig};
use fht_map::{MapState, Replica, Rules};
use fht_proto::envelope::MAX_BODY_BYTES;
use fht_proto::keys::{Key, RobotTopic, Topic, increments_of, robots_of};
use fht_proto::query::{RulesReply, Snapshot};
use fht_proto::{Increment, MapName, ReleaseId, VersionVector, decode};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Arc, OnceLock, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};
use zenoh::handlers::{CallbackDrop, RingChannel, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, Reply};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// How late a question may be put that nothing but the time calls for.
const LONGEST_SLEEP: Duration = Duration::from_millis(100);

/// Longest message that is read: a body and the envelope around it.
const MAX_MESSAGE_BYTES: usize = MAX_BODY_BYTES + 64;

/// How a replica keeps up.
#[derive(Clone, Debug)]
pub struct ReplicaConfig {
    /// Samples that may wait to be taken in; what comes when the queue is full is dropped, and asked for later. Default 1024.
    pub queue: usize,
    /// How long to wait for an answer, seconds. Default 5.
    pub timeout_s: f64,
    /// How long increments that the head shows may be under way before they are asked for, seconds. Default 0.15.
    pub grace_s: f64,
    /// How long the copy may have increments that the server does not tell of before it is fetched anew, seconds. Default 10.
    pub ahead_s: f64,
    /// The head is asked for this often, in case its publication was lost, seconds. Default 2.
    pub head_every_s: f64,
    /// About how much is asked for at one time, bytes: what may be under way on the link. Default 64 KiB.
    pub part_bytes: usize,
    /// In pieces of about so many bytes: what is lost when the link breaks. Default 4 KiB.
    pub piece_bytes: usize,
}

impl Default for ReplicaConfig {
    fn default() -> Self {
        Self {
            queue: 1024,
            timeout_s: 5.0,
            grace_s: 0.15,
            ahead_s: 10.0,
            head_every_s: 2.0,
            part_bytes: 64 << 10,
            piece_bytes: 4 << 10,
        }
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
    /// The release that is run; none: the copy as it is.
    running: RwLock<Option<Running>>,
    /// The thread that takes in and asks, once it runs: it sleeps while nothing comes.
    thread: OnceLock<Thread>,
    stop: AtomicBool,
    /// Counts changes, so that a reader sees cheaply whether there is anything new.
    changes: AtomicU64,
    /// Messages refused since the start.
    refused: AtomicU64,
    /// Messages dropped since the start, for want of room.
    dropped: AtomicU64,
    /// Bytes of answers that brought increments.
    fetched_bytes: AtomicU64,
}

impl Shared {
    /// Something has come. Never waits.
    fn wake(&self) {
        if let Some(thread) = self.thread.get() {
            thread.unpark();
        }
    }

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
        // Never waits: Zenoh's thread that runs this also brings the answers, here and to the rest of the program.
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
        let follow = FollowConfig {
            behind: Duration::from_secs_f64(config.grace_s.max(0.0)),
            ahead: Duration::from_secs_f64(config.ahead_s.max(0.0)),
            ..FollowConfig::default()
        };
        let sync = SyncConfig {
            follow,
            head_every: Duration::from_secs_f64(config.head_every_s.max(0.0)),
            ..SyncConfig::default()
        };
        let (to_events, events) = channel();
        let worker = Worker {
            session: session.clone(),
            map: map.clone(),
            config,
            shared: Arc::clone(&shared),
            _subscribers: [subscriber, blocked],
            increments,
            heads,
            events,
            to_events,
            sync: Sync::new(sync),
            part: (0, false),
            link_seen_at: Instant::now(),
            closures: Arc::clone(&closures),
            knows_blocked: false,
        };
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

/// What a question to the server led to.
enum Event {
    /// A piece of what the question of this number asked for.
    Piece(u64, Vec<u8>),
    /// The question for a part of this number has ended.
    PartEnded(u64),
    /// The question for the head has ended.
    Head(Option<Vec<u8>>),
    /// The question for what is blocked has ended.
    Rules(Option<Vec<u8>>),
}

struct Worker {
    session: Session,
    map: MapName,
    config: ReplicaConfig,
    shared: Arc<Shared>,
    _subscribers: [Subscriber<()>; 2],
    increments: Receiver<Sample>,
    heads: Subscriber<RingChannelHandler<Sample>>,
    events: Receiver<Event>,
    to_events: Sender<Event>,
    sync: Sync,
    /// The number of the last question for a part, and whether it is under way.
    part: (u64, bool),
    link_seen_at: Instant,
    closures: Arc<Closures>,
    /// Whether nothing was said of what is blocked without being heard here, as far as that is known.
    knows_blocked: bool,
}

impl Worker {
    fn run(mut self) {
        while !self.is_stopped() {
            self.ask_what_is_due();
            self.show_running();
            // Until something comes, or it may be time to ask. What came meanwhile has woken it already.
            std::thread::park_timeout(LONGEST_SLEEP);
            while let Ok(sample) = self.increments.try_recv() {
                self.take_live(&sample);
            }
            if let Ok(Some(sample)) = self.heads.try_recv() {
                match read_head(&sample.payload().to_bytes(), &self.map) {
                    Ok(head) => self.sync.head_published(&head),
                    Err(error) => self.refuse(&error),
                }
            }
            while let Ok(event) = self.events.try_recv() {
                self.take_event(event);
            }
            self.watch_link();
        }
    }

    /// A question that was put just when the link broke is not answered, and Zenoh does not say so before its time is up: without a link it has
    /// ended.
    fn watch_link(&mut self) {
        let (number, is_under_way) = self.part;
        if !is_under_way || self.link_seen_at.elapsed() < LONGEST_SLEEP {
            return;
        }
        self.link_seen_at = Instant::now();
        let info = self.session.info();
        let is_linked = info.routers_zid().wait().next().is_some() || info.peers_zid().wait().next().is_some();
        if !is_linked {
            tracing::debug!("the link is lost, and with it what was asked for");
            self.take_event(Event::PartEnded(number));
        }
    }

    fn is_stopped(&self) -> bool {
        self.shared.stop.load(Ordering::Acquire)
    }

    fn refuse(&self, reason: &dyn std::fmt::Display) {
        self.shared.refused.fetch_add(1, Ordering::Relaxed);
        tracing::warn!("message refused: {reason}");
    }

    fn note_changes(&self, applied: usize) {
        if applied > 0 {
            self.shared.changes.fetch_add(1, Ordering::Release);
        }
    }

    /// Lets the robot see what it is to run.
    fn show_running(&self) {
        let id = |running: Option<&Running>| running.map(|running| running.id.clone());
        let mut shown = self.shared.running.write().unwrap_or_else(PoisonError::into_inner);
        if id(shown.as_ref()) != id(self.sync.running()) {
            *shown = self.sync.running().cloned();
            drop(shown);
            self.note_changes(1);
        }
    }

    fn ask_what_is_due(&mut self) {
        loop {
            let was_trusted = !self.sync.is_refetching();
            let Some(question) = self.sync.poll(&self.shared.read(), Instant::now()) else { return };
            if was_trusted && self.sync.is_refetching() {
                tracing::warn!(map = %self.map, "this copy of the map is not the server's; fetching it anew");
            }
            let asked = match &question {
                Question::Head => self.ask_head(),
                Question::Since(have) => self.ask_part(&format!("{}?vector={have}", self.topic(Topic::Since))),
                Question::At { vector, have } => {
                    self.ask_part(&format!("{}?vector={vector};have={have}", self.topic(Topic::Snapshot)))
                }
            };
            if let Err(error) = asked {
                tracing::debug!(%error, "a question cannot be put");
                let ended = if question == Question::Head { Event::Head(None) } else { Event::PartEnded(self.part.0) };
                self.take_event(ended);
                return;
            }
        }
    }

    /// Tells this thread what a question has led to, from another one.
    fn teller(&self) -> impl Fn(Event) + Send + std::marker::Sync + 'static {
        let (events, shared) = (self.to_events.clone(), Arc::clone(&self.shared));
        move |event| {
            let _ = events.send(event); // it has ended: nobody wants to know
            shared.wake();
        }
    }

    fn ask_head(&self) -> Result<(), zenoh::Error> {
        self.ask_first(Topic::Head, Event::Head)
    }

    /// Puts a question of which the first answer counts; its end is told in any case.
    fn ask_first(&self, topic: Topic, event: fn(Option<Vec<u8>>) -> Event) -> Result<(), zenoh::Error> {
        let timeout = Duration::from_secs_f64(self.config.timeout_s.clamp(0.0, 1.0));
        let (answer, ended) = (self.teller(), self.teller());
        let is_answered = Arc::new(AtomicBool::new(false));
        let was_answered = Arc::clone(&is_answered);
        let callback = move |reply: Reply| {
            if let Ok(sample) = reply.result()
                && !is_answered.swap(true, Ordering::AcqRel)
            {
                answer(event(Some(sample.payload().to_bytes().into_owned())));
            }
        };
        let drop = move || {
            if !was_answered.load(Ordering::Acquire) {
                ended(event(None));
            }
        };
        self.session.get(self.topic(topic).to_string()).timeout(timeout).with(CallbackDrop { callback, drop }).wait()
    }

    fn topic(&self, topic: Topic) -> Key {
        Key::topic(&self.map, topic)
    }

    /// Asks for a part of what is lacking. The answer waits behind live increments, and is dropped rather than that a
    /// link is closed over it.
    fn ask_part(&mut self, question: &str) -> Result<(), zenoh::Error> {
        let number = self.part.0 + 1;
        self.part = (number, true);
        let timeout = Duration::from_secs_f64(self.config.timeout_s.max(0.0));
        let ReplicaConfig { part_bytes, piece_bytes, .. } = self.config;
        let selector = format!("{question};max_bytes={part_bytes};piece_bytes={piece_bytes}");
        let (piece, ended, counting) = (self.teller(), self.teller(), Arc::clone(&self.shared));
        let callback = move |reply: Reply| match reply.result() {
            Ok(sample) => {
                counting.fetched_bytes.fetch_add(sample.payload().len() as u64, Ordering::Relaxed);
                piece(Event::Piece(number, sample.payload().to_bytes().into_owned()));
            }
            Err(error) => tracing::debug!("nothing fetched: {}", String::from_utf8_lossy(&error.payload().to_bytes())),
        };
        let drop = move || ended(Event::PartEnded(number));
        self.session
            .get(selector)
            .timeout(timeout)
            .priority(Priority::DataLow)
            .congestion_control(CongestionControl::Drop)
            // Every piece counts, although all come under one key.
            .consolidation(ConsolidationMode::None)
            .with(CallbackDrop { callback, drop })
            .wait()
    }

    fn take_event(&mut self, event: Event) {
        let now = Instant::now();
        match event {
            Event::Head(payload) => {
                let head = payload.map(|payload| read_head(&payload, &self.map));
                if let Some(Err(error)) = &head {
                    self.refuse(error);
                }
                self.follow_blocked(head.is_some());
                self.sync.head_answered(&self.shared.read(), head.and_then(Result::ok), now);
            }
            Event::Rules(payload) => self.take_rules(payload.as_deref()),
            Event::Piece(number, _) | Event::PartEnded(number) if self.part != (number, true) => {}
            Event::Piece(_, bytes) => match decode::<Snapshot>(&bytes) {
                Ok(series) => {
                    let applied = self.sync.piece(&mut self.shared.write(), series);
                    self.note_changes(applied);
                }
                Err(error) => self.refuse(&error),
            },
            Event::PartEnded(number) => {
                self.part = (number, false);
                let is_replaced = self.sync.part_ended(&mut self.shared.write(), now);
                self.note_changes(usize::from(is_replaced));
            }
        }
    }

    /// What is blocked is said once: a robot that was not there, or out of reach, asks the server what it has heard.
    fn follow_blocked(&mut self, is_answered: bool) {
        if is_answered && !self.knows_blocked {
            self.knows_blocked = self.ask_first(Topic::Rules, Event::Rules).is_ok();
        } else {
            self.knows_blocked &= is_answered;
        }
    }

    fn take_rules(&mut self, payload: Option<&[u8]>) {
        match payload.map(serde_json::from_slice::<RulesReply>) {
            Some(Ok(rules)) if rules.map == self.map => self.closures.take_known(rules.blocked),
            Some(Ok(rules)) => self.refuse(&format!("rules of {} for {}", rules.map, self.map)),
            Some(Err(error)) => self.refuse(&error),
            // Asked again when the server is there.
            None => self.knows_blocked = false,
        }
    }

    /// Takes in what a writer has put.
    fn take_live(&mut self, sample: &Sample) {
        match live_increment(sample, &self.map) {
            Ok(increment) => {
                let applied = self.sync.live(&mut self.shared.write(), increment);
                self.note_changes(applied);
            }
            Err(reason) => self.refuse(&reason),
        }
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
