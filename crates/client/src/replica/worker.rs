//! The thread that keeps a replica up with the server: it takes in what arrives and asks for what
//! is lacking.

use super::config::ReplicaConfig;
use super::notices::{Notices, replaced};
use super::shared::Shared;
use crate::closures::Closures;
use crate::queries::read_head;
use crate::staleness::StalenessConfig;
use crate::sync::{Running, Sync, SyncConfig, SyncQuestion};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, RulesReply, Series};
use fht_proto::codec::envelope::MAX_BODY_BYTES;
use fht_proto::{Increment, MapName, decode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};
use zenoh::handlers::{CallbackDrop, RingChannelHandler};
use zenoh::pubsub::Subscriber;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::{ConsolidationMode, Reply};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// How late a question may be put that nothing but the time calls for.
const LONGEST_SLEEP: Duration = Duration::from_millis(100);

/// Longest message that is read: a body and the envelope around it.
const MAX_MESSAGE_BYTES: usize = MAX_BODY_BYTES + 64;

/// What a question to the server led to.
enum Event {
    /// A piece of what the question of this number asked for.
    Piece(u64, Vec<u8>),
    /// The question for a part of this number has ended.
    PartEnded(u64),
    /// The question for the head has ended.
    Head(Option<Vec<u8>>),
    /// The server has refused the question for the head: it has no such map.
    NoMap(String),
    /// The question for what is blocked has ended.
    Rules(Option<Vec<u8>>),
}

/// What the session brings: increments in a queue, the newest head.
pub(super) struct Arrivals {
    pub(super) _subscribers: [Subscriber<()>; 2],
    pub(super) increments: Receiver<Sample>,
    pub(super) heads: Subscriber<RingChannelHandler<Sample>>,
}

/// Takes in what arrives, and asks for what is lacking.
pub(super) struct Worker {
    session: Session,
    map: MapName,
    config: ReplicaConfig,
    shared: Arc<Shared>,
    arrivals: Arrivals,
    events: Receiver<Event>,
    to_events: Sender<Event>,
    sync: Sync,
    /// The number of the last question for a part, and whether it is under way.
    part: (u64, bool),
    link_seen_at: Instant,
    closures: Arc<Closures>,
    /// Whether nothing was said of what is blocked without being heard here, as far as that is
    /// known.
    knows_blocked: bool,
    /// As the last head said it.
    reports_cleared: Option<u32>,
    notices: Notices,
}

fn warn(notice: Option<String>) {
    if let Some(notice) = notice {
        // Robots show it, unlike most of what a copy has to say.
        tracing::warn!(target: "fht_client::notice", "{notice}");
    }
}

impl Worker {
    pub(super) fn new(
        session: Session,
        map: MapName,
        config: ReplicaConfig,
        shared: Arc<Shared>,
        closures: Arc<Closures>,
        arrivals: Arrivals,
    ) -> Self {
        let follow =
            StalenessConfig { behind_s: config.grace_s, ahead_s: config.ahead_s, ..StalenessConfig::default() };
        let sync = SyncConfig { follow, head_every_s: config.head_every_s, ..SyncConfig::default() };
        let sync = Sync::new(sync).with_roles(config.roles.clone());
        let (to_events, events) = channel();
        Self {
            session,
            map,
            config,
            shared,
            arrivals,
            events,
            to_events,
            sync,
            part: (0, false),
            link_seen_at: Instant::now(),
            closures,
            knows_blocked: false,
            reports_cleared: None,
            notices: Notices::default(),
        }
    }

    /// Until the replica is dropped.
    pub(super) fn run(mut self) {
        while !self.is_stopped() {
            self.ask_what_is_due();
            self.show_running();
            // Until something comes, or it may be time to ask. What came meanwhile has woken it
            // already.
            std::thread::park_timeout(LONGEST_SLEEP);
            while let Ok(sample) = self.arrivals.increments.try_recv() {
                self.take_live(&sample);
            }
            if let Ok(Some(sample)) = self.arrivals.heads.try_recv() {
                match read_head(&sample.payload().to_bytes(), &self.map) {
                    Ok(head) => {
                        warn(self.notices.head(&head));
                        self.follow_cleared(&head);
                        self.sync.head_published(&head);
                    }
                    Err(error) => self.refuse(&error),
                }
            }
            while let Ok(event) = self.events.try_recv() {
                self.take_event(event);
            }
            self.watch_link();
        }
    }

    /// A question that was put just when the link broke is not answered, and Zenoh does not say so
    /// before its time is up: without a link it has ended.
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
            self.shared.changes.send_modify(|changes| *changes += 1);
        }
    }

    /// Lets the robot see what it is to run.
    fn show_running(&self) {
        // Of another map a release of the same id is another one.
        let state = |running: Option<&Running>| running.map(|running| Arc::as_ptr(&running.state));
        let mut shown = self.shared.running.write().unwrap_or_else(PoisonError::into_inner);
        if state(shown.as_ref()) != state(self.sync.running()) {
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
                SyncQuestion::Head => self.ask_head(),
                SyncQuestion::Since(have) => self.ask_part(&format!("{}?vector={have}", self.topic(Topic::Since))),
                SyncQuestion::At { vector, have } => {
                    self.ask_part(&format!("{}?vector={vector};have={have}", self.topic(Topic::Snapshot)))
                }
            };
            if let Err(error) = asked {
                tracing::debug!(%error, "a question cannot be put");
                let ended =
                    if question == SyncQuestion::Head { Event::Head(None) } else { Event::PartEnded(self.part.0) };
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
        let callback = move |reply: Reply| match reply.result() {
            Ok(sample) if !is_answered.swap(true, Ordering::AcqRel) => {
                answer(event(Some(sample.payload().to_bytes().into_owned())));
            }
            Ok(_) => {}
            Err(error) => match serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()) {
                Ok(refused) if refused.code == ErrorCode::UnknownMap => answer(Event::NoMap(refused.message)),
                _ => {}
            },
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

    /// Asks for a part of what is lacking. The answer waits behind live increments, and is dropped
    /// rather than that a link is closed over it.
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
                warn(self.notices.answer(head.is_some(), now));
                if let Some(Ok(head)) = &head {
                    warn(self.notices.head(head));
                    self.follow_cleared(head);
                }
                self.sync.head_answered(&self.shared.read(), head.and_then(Result::ok), now);
            }
            Event::NoMap(reason) => {
                warn(self.notices.answer(true, now));
                warn(self.notices.no_map(reason));
                self.sync.map_gone();
            }
            Event::Rules(payload) => self.take_rules(payload.as_deref()),
            Event::Piece(number, _) | Event::PartEnded(number) if self.part != (number, true) => {}
            Event::Piece(_, bytes) => match decode::<Series>(&bytes) {
                Ok(series) => {
                    let applied = self.sync.piece(&mut self.shared.write(), series);
                    self.note_changes(applied);
                }
                Err(error) => self.refuse(&error),
            },
            Event::PartEnded(number) => {
                self.part = (number, false);
                let (is_replaced, is_other) = {
                    let mut copy = self.shared.write();
                    let is_replaced = self.sync.part_ended(&mut copy, now);
                    // Whoever sees the new map sees that it is another one.
                    let generation = self.sync.generation();
                    (is_replaced, self.shared.generation.swap(generation, Ordering::AcqRel) != generation)
                };
                warn(is_other.then(|| replaced(&self.map)));
                self.note_changes(usize::from(is_replaced));
            }
        }
    }

    /// What is blocked is said once: a robot that was not there, or out of reach, asks the server
    /// what it has heard.
    fn follow_blocked(&mut self, is_answered: bool) {
        if is_answered && !self.knows_blocked {
            self.knows_blocked = self.ask_first(Topic::Rules, Event::Rules).is_ok();
        } else {
            self.knows_blocked &= is_answered;
        }
    }

    /// Operators have opened what robots reported blocked: the server says what is left.
    fn follow_cleared(&mut self, head: &Head) {
        if self.reports_cleared.replace(head.reports_cleared).is_some_and(|before| before != head.reports_cleared) {
            self.knows_blocked = self.ask_first(Topic::Rules, Event::Rules).is_ok();
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
