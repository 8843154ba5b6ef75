//! The other explorers of the same map, over Zenoh: what they write, where they are going, what
//! they have seen; what is closed; and what this one says of itself.

use crate::explore::Teammate;
use crate::mapping::Mapper;
use crate::team::founding::Founding;
use fht_client::{LiveReplica, Presence, ReplicaConfig, ReplicaError};
use fht_map::MapState;
use fht_proto::api::fleet::{ExplorerGoal, RobotRole};
use fht_proto::api::keys::{Key, RobotTopic, robots_of};
use fht_proto::api::reply::Head;
use fht_proto::model::validate::Validate;
use fht_proto::{AuthorId, MapName, SeenArea, VersionVector, decode, encode};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// What others write and say is taken in this often, microseconds of the sensors' time.
const LISTEN_EVERY_US: u64 = 1_000_000;
/// What the robot has seen it tells this often, microseconds.
const TELL_EVERY_US: u64 = 5_000_000;
/// Longest message of another explorer that is read, bytes.
const MAX_BYTES: usize = 1 << 20;
/// A goal that was not said again for so long is none: goals are said every second of the sensors'
/// time, which a slow simulation stretches.
const GOAL_LASTS: Duration = Duration::from_secs(30);
/// Explorers of one map that are listened to.
const MAX_FELLOWS: usize = 64;
/// How an explorer begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapEntry {
    /// Its frame is the map's.
    Found {
        /// Increments of earlier runs of this robot.
        stored: u64,
    },
    /// It has to find its place in a map that exists, or that another explorer is about to begin.
    Join {
        /// Increments of earlier runs of this robot.
        stored: u64,
    },
}

/// Why a map cannot be joined.
#[derive(Debug, thiserror::Error)]
pub enum EnterError {
    /// It does not come.
    #[error("the map '{map}' did not arrive within {seconds} s")]
    Incomplete {
        /// Its name.
        map: MapName,
        /// How long was waited.
        seconds: u64,
    },
    /// Nobody can find a place in it.
    #[error(
        "the map '{map}' has {nodes} nodes, none of which is a main node: nobody can find its place in it; choose another --map"
    )]
    NoMainNodes {
        /// Its name.
        map: MapName,
        /// Nodes.
        nodes: usize,
    },
    /// Zenoh refused a question.
    #[error("who else explores is not known: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
}

/// What one explorer has said last.
#[derive(Default)]
struct Fellow {
    is_there: bool,
    goal: Option<ExplorerGoal>,
    /// When it said that.
    said: Option<Instant>,
    /// What it has seen, of which its increments are not all here.
    offered: Option<SeenArea>,
    seen: Option<SeenArea>,
}

impl Fellow {
    /// Whether it has nothing left to see, and all that it has written of that is here.
    fn has_finished(&self) -> bool {
        self.goal.as_ref().is_some_and(|goal| goal.finished) && !self.is_awaited()
    }

    /// Whether increments of what it says to have seen are still on their way.
    fn is_awaited(&self) -> bool {
        self.offered.as_ref().is_some_and(|area| area.upto > 0)
    }
}

/// What all have said, by name.
#[derive(Default)]
struct Heard {
    fellows: BTreeMap<String, Fellow>,
}

impl Heard {
    fn of(&mut self, robot: &str) -> Option<&mut Fellow> {
        // Names are free to invent.
        let has_room = self.fellows.len() < MAX_FELLOWS || self.fellows.contains_key(robot);
        has_room.then(|| self.fellows.entry(robot.to_owned()).or_default())
    }

    fn take_message(&mut self, own: &str, sample: &Sample) -> Result<(), String> {
        let key = sample.key_expr().as_str().parse();
        let Ok(Key::RobotTopic { robot, topic, .. }) = key else { return Ok(()) };
        if robot == own || sample.kind() != SampleKind::Put {
            return Ok(());
        }
        if sample.payload().len() > MAX_BYTES {
            return Err(format!("{} bytes of {robot} are too many", sample.payload().len()));
        }
        let payload = sample.payload().to_bytes();
        match topic {
            RobotTopic::Goal if fht_proto::api::request::is_goal(&payload) => {}
            RobotTopic::Goal => {
                let goal: ExplorerGoal = serde_json::from_slice(&payload).map_err(|error| error.to_string())?;
                goal.validate().map_err(|error| error.to_string())?;
                self.of(&robot).into_iter().for_each(|fellow| {
                    (fellow.goal, fellow.said) = (Some(goal.clone()), Some(Instant::now()));
                });
            }
            RobotTopic::Seen => {
                let area: SeenArea = decode(&payload).map_err(|error| error.to_string())?;
                if area.author != AuthorId::of_robot(&robot) {
                    return Err(format!("{robot} tells what {} has seen", area.author));
                }
                self.of(&robot).into_iter().for_each(|fellow| fellow.offered = Some(area.clone()));
            }
            RobotTopic::Pose | RobotTopic::Status | RobotTopic::Blocked => {}
        }
        Ok(())
    }

    fn take_token(&mut self, own: &str, sample: &Sample) {
        if let Ok(Key::RobotTopic { robot, .. }) = sample.key_expr().as_str().parse()
            && robot != own
            && let Some(fellow) = self.of(&robot)
        {
            let is_there = sample.kind() == SampleKind::Put;
            if is_there && !fellow.is_there {
                // Who comes back begins anew, and says again what still holds.
                *fellow = Fellow::default();
            }
            fellow.is_there = is_there;
        }
    }

    /// Those who are there, and those who have said that they have nothing left to see.
    fn mates(&self) -> Vec<Teammate> {
        let told = self.fellows.iter().filter_map(|(robot, fellow)| Some((robot, fellow, fellow.goal.as_ref()?)));
        told.filter(|(_, fellow, _)| fellow.is_there || fellow.has_finished())
            .map(|(robot, fellow, goal)| {
                // One that is lost, or hangs, goes nowhere.
                let is_old = fellow.said.is_none_or(|said| said.elapsed() > GOAL_LASTS);
                let target = goal.target.filter(|_| !is_old);
                let finished = fellow.has_finished();
                let finishing = !is_old && !finished && (goal.finishing || goal.finished);
                let goal = ExplorerGoal { target, finished, finishing, ..goal.clone() };
                Teammate::new(AuthorId::of_robot(robot), &goal)
            })
            .collect()
    }
}

/// The other explorers, and this one's word to them.
pub struct Peers {
    session: Session,
    map: MapName,
    robot: String,
    replica: LiveReplica,
    heard: Arc<Mutex<Heard>>,
    _subscribers: [Subscriber<()>; 3],
    presence: Presence,
    _token: LivelinessToken,
    /// Says that this explorer begins the map.
    claim: Option<LivelinessToken>,
    /// Whose word of what they have seen counts.
    believed: BTreeSet<String>,
    taken_changes: Option<u64>,
    /// The increments of the state that the mapper was given last.
    taken: VersionVector,
    listened_us: Option<u64>,
    told_us: Option<u64>,
}

impl Peers {
    /// Begins to listen, and holds a token that says that an explorer of this name is there.
    ///
    /// # Errors
    /// If Zenoh refuses the subscriptions.
    pub fn start(session: &Session, map: &MapName, robot: &str) -> Result<Self, ReplicaError> {
        let heard = Arc::new(Mutex::new(Heard::default()));
        let hear = |topic: RobotTopic| {
            let (heard, own) = (Arc::clone(&heard), robot.to_owned());
            let take = move |sample: Sample| {
                let taken = lock(&heard).take_message(&own, &sample);
                taken.unwrap_or_else(|reason| tracing::warn!("another explorer's word was refused: {reason}"));
            };
            session.declare_subscriber(robots_of(map, topic)).callback(take).wait()
        };
        let (goals, seen) = (hear(RobotTopic::Goal)?, hear(RobotTopic::Seen)?);
        let (tokens, own) = (Arc::clone(&heard), robot.to_owned());
        let token = move |sample: Sample| lock(&tokens).take_token(&own, &sample);
        let tokens = session
            .liveliness()
            .declare_subscriber(robots_of(map, RobotTopic::Goal))
            .history(true)
            .callback(token)
            .wait()?;
        Ok(Self {
            presence: Presence::new(session, map, robot, RobotRole::Explorer).map_err(zenoh::Error::from)?,
            _token: session.liveliness().declare_token(Key::robot(map, robot, RobotTopic::Goal).to_string()).wait()?,
            claim: None,
            replica: LiveReplica::start(session, map, robot, ReplicaConfig::default())?,
            session: session.clone(),
            map: map.clone(),
            robot: robot.to_owned(),
            heard,
            _subscribers: [goals, seen, tokens],
            believed: BTreeSet::new(),
            taken_changes: None,
            taken: VersionVector::default(),
            listened_us: None,
            told_us: None,
        })
    }

    /// Whether this explorer begins the map or joins it: `head` is what the server has. Of several
    /// that find no map, one begins it. Waits for the copy of the map, for as long as `patience`.
    ///
    /// # Errors
    /// [`EnterError`].
    pub fn enter(&mut self, head: Option<&Head>, patience: Duration) -> Result<MapEntry, EnterError> {
        let vector = head.map(|head| head.vector.clone()).unwrap_or_default();
        let map = || self.map.clone();
        if !self.replica.wait_for(&vector, patience) {
            return Err(EnterError::Incomplete { map: map(), seconds: patience.as_secs() });
        }
        let stored = vector.get(AuthorId::of_robot(&self.robot));
        let counts = self.replica.read().state().counts();
        let nodes = counts.main_nodes + counts.support_nodes;
        if counts.main_nodes == 0 && nodes > 0 {
            return Err(EnterError::NoMainNodes { map: map(), nodes });
        }
        if counts.main_nodes == 0 {
            let founding = Founding::new(&self.session, &self.map, &self.robot, &self.replica);
            self.claim = founding.claim(patience)?;
        }
        let is_founder = self.claim.is_some();
        Ok(if is_founder { MapEntry::Found { stored } } else { MapEntry::Join { stored } })
    }

    /// The map as it is here.
    #[must_use]
    pub fn map(&self) -> MapState {
        self.replica.read().state().clone()
    }

    /// Once per frame, before it is mapped: lets the mapper know what others wrote and said, and
    /// tells them what it is about. The server has this robot's increments up to `acknowledged`.
    pub fn exchange(&mut self, mapper: &mut Mapper, time_us: u64, acknowledged: u64) {
        if self.listened_us.is_some_and(|at_us| time_us < at_us.saturating_add(LISTEN_EVERY_US)) {
            return;
        }
        self.listened_us = Some(time_us);
        let changes = self.replica.changes();
        if self.taken_changes.replace(changes) != Some(changes) {
            let (map, vector) = {
                let replica = self.replica.read();
                (replica.state().clone(), replica.vector().clone())
            };
            mapper.take_shared_map(&map, acknowledged);
            self.taken = vector;
        }
        mapper.set_rules(self.replica.rules());
        let (mates, areas) = self.listen();
        mapper.set_teammates(mates);
        if let Some(areas) = areas {
            mapper.take_seen_areas(&areas);
        }
        self.publish_whereabouts(mapper);
        if self.told_us.is_none_or(|at_us| time_us >= at_us.saturating_add(TELL_EVERY_US)) {
            self.told_us = Some(time_us);
            self.tell_seen(mapper);
        }
    }

    /// After the last frame, before the map is finished: the others wait for the last of it.
    pub fn begin_finish(&self, mapper: &Mapper) {
        self.tell_goal(mapper.goal().map(|goal| ExplorerGoal { finished: false, finishing: true, ..goal }));
    }

    /// After the last of the map: the others learn that this robot has nothing left to see.
    pub fn finish(&mut self, mapper: &Mapper) {
        self.tell_seen(mapper);
        self.presence.publish_last(&mapper.whereabouts(), self.vector(mapper), None);
        self.tell_goal(mapper.goal());
    }

    /// The increments of the mapper's map: what of it was taken from others, and all that this
    /// robot has written. Of the others' nothing counts for a robot that has not found its place.
    #[must_use]
    pub fn taken(&self, mapper: &Mapper) -> VersionVector {
        let mut vector = if mapper.is_placed() { self.taken.clone() } else { VersionVector::default() };
        let author = AuthorId::of_robot(&self.robot);
        vector.set(author, mapper.written().max(vector.get(author)));
        vector
    }

    /// The increments that this robot has: its copy's, and all that it has written, of which some
    /// may be on their way to the server and back.
    fn vector(&self, mapper: &Mapper) -> VersionVector {
        let mut vector = self.replica.read().vector().clone();
        let author = AuthorId::of_robot(&self.robot);
        vector.set(author, mapper.written().max(vector.get(author)));
        vector
    }

    /// The others, and what they have seen if there is news of that.
    fn listen(&mut self) -> (Vec<Teammate>, Option<Vec<SeenArea>>) {
        let heard = Arc::clone(&self.heard);
        let mut heard = lock(&heard);
        let vector = self.replica.read().vector().clone();
        let mut is_news = false;
        for fellow in heard.fellows.values_mut() {
            if let Some(area) = fellow.offered.take_if(|area| area.upto > 0 && vector.get(area.author) >= area.upto) {
                fellow.seen = Some(area);
                is_news = true;
            }
        }
        // One that died may have seen what it made no nodes of.
        let counts = |fellow: &Fellow| fellow.seen.is_some() && (fellow.is_there || fellow.has_finished());
        let believed: BTreeSet<String> =
            heard.fellows.iter().filter(|(_, fellow)| counts(fellow)).map(|(robot, _)| robot.clone()).collect();
        is_news |= believed != self.believed;
        let areas = || believed.iter().filter_map(|robot| heard.fellows.get(robot)?.seen.clone()).collect();
        let areas = is_news.then(areas);
        let mates = heard.mates();
        drop(heard);
        self.believed = believed;
        (mates, areas)
    }

    fn publish_whereabouts(&self, mapper: &Mapper) {
        if !mapper.has_whereabouts() {
            return;
        }
        self.presence.publish(&mapper.whereabouts(), self.vector(mapper), None);
        self.tell_goal(mapper.goal());
    }

    fn tell_goal(&self, goal: Option<ExplorerGoal>) {
        if let Some(goal) = goal {
            self.presence.put_json(RobotTopic::Goal, &goal);
        }
    }

    fn tell_seen(&self, mapper: &Mapper) {
        match mapper.seen().as_ref().map(encode).transpose() {
            Ok(Some(bytes)) => self.presence.put(RobotTopic::Seen, bytes, Encoding::APPLICATION_OCTET_STREAM),
            Ok(None) => {}
            Err(error) => tracing::warn!("what was seen cannot be told: {error}"),
        }
    }
}

// A panic while it was held is a bug, and leaves every word whole.
fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    heard.lock().unwrap_or_else(PoisonError::into_inner)
}
