//! Goals over Zenoh: what operators send a robot, and what it replies and publishes about that.
//!
//! Callbacks only queue what comes, up to a limit; the robot's loop takes it in, and a thread of
//! its own sends, so that no slow link holds the robot.

mod inbox;

use self::inbox::{Addressed, Ask, Inbox, Request};
use crate::goals::GoalQueue;
use crate::mission::MapSource;
use crate::serving::{GoalDesk, locate};
use fht_proto::MapName;
use fht_proto::api::goal::{GoalOrder, GoalState, GoalStatus};
use fht_proto::api::keys::{GoalTopic, Key, RobotTopic, goals_of};
use fht_proto::api::reply::ErrorReply;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use zenoh::bytes::Encoding;
use zenoh::key_expr::KeyExpr;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::query::{Query, Queryable};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Between two statuses that say nothing new.
const SAY_EVERY: Duration = Duration::from_secs(1);
/// Senders that wait to hear whether there is a path.
const MAX_UNDECIDED: usize = 64;
/// Replies and statuses under way to the thread that sends them.
const MAX_UNSENT: usize = 128;

/// What is sent.
enum Outgoing {
    Reply(Query, Result<GoalStatus, ErrorReply>),
    Status(GoalStatus),
}

/// Told of each goal's news.
type OnNews = Box<dyn FnMut(&GoalStatus) + Send>;

/// The goals of one robot over Zenoh, until it is dropped: what was said is sent before that ends.
pub struct GoalService {
    inbox: Arc<Inbox>,
    /// Those who have sent a goal to which no path is known yet.
    undecided: Vec<(String, Query)>,
    said: Option<Instant>,
    on_news: OnNews,
    _answering: Queryable<()>,
    _listening: [Subscriber<()>; 2],
    outgoing: Option<SyncSender<Outgoing>>,
    sender: Option<JoinHandle<()>>,
}

impl GoalService {
    /// Takes goals for `robot` on `map`; `on_news` is told what becomes of them.
    ///
    /// # Errors
    /// When Zenoh refuses, or the system gives no thread.
    pub fn start(
        session: &Session,
        map: &MapName,
        robot: &str,
        on_news: impl FnMut(&GoalStatus) + Send + 'static,
    ) -> Result<Self, zenoh::Error> {
        let inbox = Arc::new(Inbox::default());
        let (outgoing, to_send) = sync_channel(MAX_UNSENT);
        let (keys, sending) = (OwnKeys::of(map, robot)?, session.clone());
        let send = move || send(&sending, &keys, &to_send);
        let sender = std::thread::Builder::new().name("goals".to_owned()).spawn(send)?;
        let hear = |key: Key, under: Addressed| {
            let inbox = Arc::clone(&inbox);
            let take = move |sample: Sample| {
                if sample.kind() == SampleKind::Put {
                    inbox.take_put(under, sample.payload());
                }
            };
            session.declare_subscriber(key.to_string()).callback(take).wait()
        };
        let sent = hear(Key::robot(map, robot, RobotTopic::Goal), Addressed::Goal)?;
        let cancel = GoalTopic::Cancel;
        let cancelled = hear(Key::goal(map, robot, cancel), Addressed::Topic(cancel))?;
        let asked = Arc::clone(&inbox);
        // Complete: nobody else is asked.
        let answering = session
            .declare_queryable(goals_of(map, robot))
            .complete(true)
            .callback(move |query| asked.take_query(query))
            .wait()?;
        Ok(Self {
            inbox,
            undecided: Vec::new(),
            said: None,
            on_news: Box::new(on_news),
            _answering: answering,
            _listening: [sent, cancelled],
            outgoing: Some(outgoing),
            sender: Some(sender),
        })
    }

    fn send(&self, outgoing: Outgoing) {
        let Some(sender) = &self.outgoing else { return };
        if let Err(TrySendError::Full(_)) = sender.try_send(outgoing) {
            tracing::debug!("a reply about goals is left out: too many are under way");
        }
    }

    fn offer(&mut self, goals: &mut GoalQueue, order: GoalOrder, query: Option<Query>, map: &dyn MapSource) {
        match (goals.offer(order.clone(), |order| locate(order, map)), query) {
            (Ok(_), Some(query)) if self.undecided.len() < MAX_UNDECIDED => self.undecided.push((order.id, query)),
            (Ok(status), Some(query)) => self.send(Outgoing::Reply(query, Ok(stamped(status)))),
            (Ok(_), None) => {}
            (Err(refusal), Some(query)) => self.send(Outgoing::Reply(query, Err(refusal))),
            // Whoever puts gets no reply.
            (Err(refusal), None) => goals.refuse(order, refusal),
        }
    }
}

impl GoalDesk for GoalService {
    fn exchange(&mut self, goals: &mut GoalQueue, map: &dyn MapSource) {
        for Request { ask, query } in self.inbox.take() {
            let outcome = match ask {
                Ask::Send(order) => {
                    self.offer(goals, order, query, map);
                    continue;
                }
                Ask::Cancel(id) => goals.cancel(id.as_deref()),
                Ask::Status(id) => goals.status(id.as_deref()),
            };
            if let Some(query) = query {
                self.send(Outgoing::Reply(query, outcome.map(stamped)));
            }
        }
        for order in self.inbox.take_refused() {
            goals.refuse(order, inbox::busy());
        }
        let news = goals.take_news();
        if !news.is_empty() || self.said.is_none_or(|said| said.elapsed() >= SAY_EVERY) {
            self.said = Some(Instant::now());
            for status in &news {
                (self.on_news)(status);
                self.send(Outgoing::Status(stamped(status.clone())));
            }
            if news.is_empty()
                && let Ok(status) = goals.status(None)
            {
                self.send(Outgoing::Status(stamped(status)));
            }
        }
        for (id, query) in self.undecided.extract_if(.., |(id, _)| goals.is_decided(id)).collect::<Vec<_>>() {
            self.send(Outgoing::Reply(query, verdict(goals, &id)));
        }
    }
}

/// What the sender of a goal is told: that it is refused, if there was never a path to it.
fn verdict(goals: &GoalQueue, id: &str) -> Result<GoalStatus, ErrorReply> {
    let status = goals.status(Some(id))?;
    match (status.state, status.code, &status.reason) {
        (GoalState::Failed, Some(code), Some(reason)) => Err(ErrorReply::new(code, reason)),
        _ => Ok(stamped(status)),
    }
}

fn stamped(status: GoalStatus) -> GoalStatus {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).ok();
    GoalStatus { stamp_us: now.and_then(|now| u64::try_from(now.as_micros()).ok()), ..status }
}

impl Drop for GoalService {
    fn drop(&mut self) {
        self.outgoing = None;
        // The thread sends what there is, and ends.
        if self.sender.take().is_some_and(|sender| sender.join().is_err()) {
            tracing::warn!("the thread that sends replies about goals has failed");
        }
    }
}

/// The keys that a robot replies under, also to who has asked with wildcards.
struct OwnKeys {
    goal: KeyExpr<'static>,
    cancel: KeyExpr<'static>,
    status: KeyExpr<'static>,
}

impl OwnKeys {
    fn of(map: &MapName, robot: &str) -> Result<Self, zenoh::Error> {
        let own = |key: Key| KeyExpr::try_from(key.to_string());
        Ok(Self {
            goal: own(Key::robot(map, robot, RobotTopic::Goal))?,
            cancel: own(Key::goal(map, robot, GoalTopic::Cancel))?,
            status: own(Key::goal(map, robot, GoalTopic::Status))?,
        })
    }

    fn asked(&self, query: &Query) -> &KeyExpr<'static> {
        let keys = [&self.goal, &self.cancel];
        keys.into_iter().find(|key| query.key_expr().intersects(key)).unwrap_or(&self.status)
    }
}

fn send(session: &Session, keys: &OwnKeys, outgoing: &Receiver<Outgoing>) {
    while let Ok(outgoing) = outgoing.recv() {
        let sent = match &outgoing {
            Outgoing::Reply(query, Ok(status)) => reply(query, keys.asked(query), status),
            Outgoing::Reply(query, Err(refusal)) => inbox::refuse(query, refusal),
            Outgoing::Status(status) => say(session, &keys.status, status),
        };
        if let Err(error) = sent {
            tracing::debug!("a reply about goals could not be sent: {error}"); // the asker has gone
        }
    }
}

fn reply(query: &Query, key: &KeyExpr<'static>, status: &GoalStatus) -> Result<(), zenoh::Error> {
    let json = serde_json::to_vec(status)?;
    query.reply(key, json).encoding(Encoding::APPLICATION_JSON).wait()
}

fn say(session: &Session, key: &KeyExpr<'static>, status: &GoalStatus) -> Result<(), zenoh::Error> {
    // What has ended is not said again.
    let congestion = if status.state.is_final() { CongestionControl::Block } else { CongestionControl::Drop };
    let json = serde_json::to_vec(status)?;
    session.put(key, json).encoding(Encoding::APPLICATION_JSON).congestion_control(congestion).wait()
}
