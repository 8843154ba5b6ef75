//! What happens, as events for those who watch: maps that grow, robots that move.
//!
//! What comes over Zenoh is only a hint that something has happened: what is told is read from the
//! server's own maps. Several hints within a moment are one event.

use crate::catalog::MapView;
use crate::query::AnswerSources;
use crate::web::growth::growth;
use fht_proto::MapName;
use fht_proto::api::fleet::RobotPose;
use fht_proto::api::goal::GoalStatus;
use fht_proto::api::keys::{ALL_ROBOT_TOPICS, ALL_ROBOTS, GoalTopic, Key, PREFIX, RobotTopic, Topic};
use fht_web::{EventHub, WebEvent};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::task::{AbortHandle, spawn_blocking};
use tokio::time::{MissedTickBehavior, interval};
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

/// Events are made so often.
const EVERY: Duration = Duration::from_millis(100);
/// Longest message of a robot that is read.
const MAX_BYTES: usize = 4096;
/// So many robots of all maps may move within a moment; more are not shown in it.
const MAX_POSES: usize = 2000;

/// What robots have said last, a number of them at most.
struct Latest<T> {
    of: BTreeMap<MapName, BTreeMap<String, T>>,
    count: usize,
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Self { of: BTreeMap::new(), count: 0 }
    }
}

impl<T> Latest<T> {
    fn note(&mut self, map: MapName, robot: String, said: T) {
        let is_known = self.of.get(&map).is_some_and(|robots| robots.contains_key(&robot));
        if is_known || self.count < MAX_POSES {
            self.count += usize::from(!is_known);
            self.of.entry(map).or_default().insert(robot, said);
        }
    }
}

/// What was heard since events were made last.
#[derive(Default)]
struct Heard {
    heads: BTreeSet<MapName>,
    /// Maps on which something was reported blocked.
    blocked: BTreeSet<MapName>,
    poses: Latest<RobotPose>,
    goals: Latest<GoalStatus>,
    gone: BTreeSet<(MapName, String)>,
}

impl Heard {
    fn is_empty(&self) -> bool {
        let says_nothing = self.poses.count + self.goals.count == 0;
        says_nothing && self.heads.is_empty() && self.blocked.is_empty() && self.gone.is_empty()
    }
}

/// Robots that have moved.
#[derive(Serialize)]
struct Moved<'a> {
    robots: Vec<&'a RobotPose>,
}

/// Where robots are sent, and how far they are.
#[derive(Serialize)]
struct Sent<'a> {
    goals: Vec<&'a GoalStatus>,
}

/// A robot that has gone.
#[derive(Serialize)]
struct Gone<'a> {
    robot: &'a str,
}

struct Teller {
    sources: AnswerSources,
    hub: EventHub,
    heard: Mutex<Heard>,
    /// The maps that somebody watches, as they were shown last.
    shown: Mutex<BTreeMap<MapName, MapView>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Teller {
    /// Takes what came. Never blocks for long: the network's threads call it.
    fn hear(&self, sample: &Sample) {
        match sample.key_expr().as_str().parse() {
            Ok(Key::Topic { map, topic: Topic::Head }) if self.sources.catalog.view(&map).is_some() => {
                locked(&self.heard).heads.insert(map);
            }
            Ok(Key::RobotTopic { map, robot, topic: RobotTopic::Pose }) if self.hub.is_watched(Some(&map)) => {
                if let Some(pose) = read(sample).filter(|pose: &RobotPose| pose.robot == robot) {
                    locked(&self.heard).poses.note(map, robot, pose);
                }
            }
            Ok(Key::Goal { map, robot, topic: GoalTopic::Status }) if self.hub.is_watched(Some(&map)) => {
                if let Some(goal) = read(sample).filter(|goal: &GoalStatus| goal.robot == robot) {
                    locked(&self.heard).goals.note(map, robot, goal);
                }
            }
            Ok(Key::RobotTopic { map, topic: RobotTopic::Blocked, .. }) if self.hub.is_watched(Some(&map)) => {
                locked(&self.heard).blocked.insert(map);
            }
            Ok(Key::Robot { map, robot }) if sample.kind() == SampleKind::Delete => {
                let mut heard = locked(&self.heard);
                if self.hub.is_watched(Some(&map)) && heard.gone.len() < MAX_POSES {
                    heard.gone.insert((map, robot));
                }
            }
            _ => {}
        }
    }

    /// Whether there is nothing to tell, and nobody to tell it to.
    fn is_idle(&self) -> bool {
        locked(&self.heard).is_empty() && self.hub.watched().is_empty() && locked(&self.shown).is_empty()
    }

    /// Tells what was heard to those who watch.
    fn tell(&self) {
        let heard = std::mem::take(&mut *locked(&self.heard));
        for (map, goals) in &heard.goals.of {
            self.say(Some(map), WebEvent::new("goals", &Sent { goals: goals.values().collect() }));
        }
        for (map, poses) in &heard.poses.of {
            self.say(Some(map), WebEvent::new("robots", &Moved { robots: poses.values().collect() }));
        }
        for (map, robot) in &heard.gone {
            self.say(Some(map), WebEvent::new("gone", &Gone { robot }));
        }
        for map in &heard.blocked {
            self.say(Some(map), WebEvent::new("blocked", map));
        }
        for map in &heard.heads {
            if let Some(view) = self.sources.catalog.view(map) {
                self.say(None, WebEvent::new("head", view.head.as_ref()));
            }
        }
        self.tell_growth();
    }

    fn say(&self, map: Option<&MapName>, event: Option<WebEvent>) {
        if let Some(event) = event {
            self.hub.publish(map, event);
        }
    }

    fn tell_growth(&self) {
        let (watched, mut shown) = (self.hub.watched(), locked(&self.shown));
        shown.retain(|map, _| watched.contains(map));
        for map in watched {
            let Some(view) = self.sources.catalog.view(&map) else {
                shown.remove(&map);
                continue;
            };
            match shown.get(&map) {
                Some(before) if Arc::ptr_eq(&before.head, &view.head) => continue,
                Some(before) => {
                    let grown = growth(before, &view);
                    self.say(Some(&map), WebEvent::new("grown", &grown));
                }
                None => {}
            }
            // Who has read the map before it was watched sees by the version that it has grown.
            self.say(Some(&map), WebEvent::new("head", view.head.as_ref()));
            shown.insert(map, view);
        }
    }
}

/// What a robot says, if it makes sense.
fn read<T: DeserializeOwned>(sample: &Sample) -> Option<T> {
    let is_short = sample.kind() == SampleKind::Put && sample.payload().len() <= MAX_BYTES;
    is_short.then(|| serde_json::from_slice(&sample.payload().to_bytes()).ok()).flatten()
}

/// Tells until it is dropped.
pub(super) struct Feed {
    _heads: Subscriber<()>,
    _topics: Subscriber<()>,
    _goals: Subscriber<()>,
    _tokens: Subscriber<()>,
    telling: AbortHandle,
}

impl Feed {
    /// Tells `hub` what happens to the maps of `sources`.
    ///
    /// # Errors
    /// When Zenoh refuses the subscriptions.
    pub(super) async fn start(session: &Session, sources: &AnswerSources, hub: EventHub) -> Result<Self, zenoh::Error> {
        let (heard, shown) = (Mutex::default(), Mutex::default());
        let teller = Arc::new(Teller { sources: sources.clone(), hub, heard, shown });
        let hear = || {
            let teller = Arc::clone(&teller);
            move |sample: Sample| teller.hear(&sample)
        };
        let heads = format!("{PREFIX}/*/{}", Topic::Head.as_str());
        let (heads, topics, goals) = (
            session.declare_subscriber(heads).callback(hear()).await?,
            session.declare_subscriber(ALL_ROBOT_TOPICS).callback(hear()).await?,
            session.declare_subscriber(format!("{ALL_ROBOTS}/goal/status")).callback(hear()).await?,
        );
        let tokens = session.liveliness().declare_subscriber(ALL_ROBOTS).callback(hear()).await?;
        let telling = tokio::spawn(tell_for_ever(teller)).abort_handle();
        Ok(Self { _heads: heads, _topics: topics, _goals: goals, _tokens: tokens, telling })
    }
}

async fn tell_for_ever(teller: Arc<Teller>) {
    let mut tick = interval(EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tick.tick().await;
        if teller.is_idle() {
            continue;
        }
        let teller = Arc::clone(&teller);
        // A large map takes a while to compare.
        if let Err(error) = spawn_blocking(move || teller.tell()).await {
            tracing::error!("events are not told: {error}");
        }
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.telling.abort();
    }
}
