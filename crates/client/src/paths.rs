//! Where paths come from: the robot's own replica at once, and the server's `path` query when its
//! answer comes. The loop that drives the robot never waits for the network.

use crate::navmesh::FreeSpaceCache;
use crate::own_paths::{entry_node, with_entry, with_own};
use crate::path_reply::{UnusablePath, check_kept, planned_between};
use crate::planned_path::{PathPoint, PathSource, PlannedPath};
use crate::queries::{AskError, ask};
use crate::replica::LiveReplica;
use fht_map::{PathEnds, Rules};
use fht_perception::pose::{Point2, fixed_point};
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::keys::{Key, RobotTopic, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, PathReply};
use fht_proto::{FixedPoint, Footprint, MapName};
use fht_worker::{BackgroundWorker, Taking};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;
use zenoh::{Session, Wait};

/// A question for a path.
#[derive(Clone, Copy, Debug)]
pub struct PathQuestion<'a> {
    /// From where: `x,y` in metres, a node's id, or the name of a place.
    pub from: &'a str,
    /// Where to.
    pub to: &'a str,
    /// The robot that it must be free for.
    pub footprint: &'a Footprint,
    /// The release to plan on, or `head`; none: the one that is enabled, or else the newest state.
    pub release: Option<&'a str>,
    /// Whether the path may end at the nearest point that can be reached, if the goal cannot.
    pub to_nearest: bool,
}

/// Asks the server for a path that is free for a robot of a footprint.
///
/// # Errors
/// Why there is none.
pub fn ask_path(
    session: &Session,
    map: &MapName,
    question: &PathQuestion<'_>,
    timeout: Duration,
) -> Result<PathReply, AskError> {
    let PathQuestion { from, to, footprint, release, to_nearest } = question;
    let mut selector = format!("{}?from={from};to={to}", Key::topic(map, Topic::Path));
    if footprint.is_larger_than_explorers() {
        selector += &format!(";footprint={}", footprint.planned_as());
    }
    if let Some(release) = release {
        selector += &format!(";release={release}");
    }
    if *to_nearest {
        selector += ";to_nearest=true";
    }
    let payloads = ask(session, &selector, timeout)?;
    let first = payloads.into_iter().next().ok_or(AskError::Silent)?;
    serde_json::from_slice(&first).map_err(|error| AskError::Unreadable(error.to_string()))
}

/// How the server is asked.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ServerPathsConfig {
    /// How long the server may take, seconds. Default 5.
    pub timeout_s: f64,
    /// When its answer is taken, and free space that is made beside the loop. Default two frames
    /// after the question, for simulated time.
    pub taking: Taking,
    /// For how long others are to avoid what this robot finds blocked, seconds. Default 30, as the
    /// robot does itself.
    pub blocked_for_s: f64,
    /// The robot that paths must be free for. Default the explorers' own.
    pub footprint: Footprint,
}

impl Default for ServerPathsConfig {
    fn default() -> Self {
        Self { timeout_s: 5.0, taking: Taking::AfterFrames(2), blocked_for_s: 30.0, footprint: Footprint::default() }
    }
}

struct Question {
    from: Point2,
    to: Point2,
    entry: Option<PathPoint>,
    to_nearest: bool,
    /// What a path must keep.
    rules: Arc<Rules>,
}

/// Why the server's answer is of no use.
#[derive(Debug, thiserror::Error)]
enum NoUse {
    #[error(transparent)]
    Ask(#[from] AskError),
    #[error(transparent)]
    Path(#[from] UnusablePath),
}

/// What the server answered: a path, a refusal, or nothing of use.
type Answer = Result<Result<PlannedPath, ErrorReply>, NoUse>;

/// Paths from the replica, replaced by the server's when its answer comes and is a path. Around
/// places that this robot found blocked from the replica alone, and others are told of them.
pub struct ServerPaths<'a> {
    replica: &'a LiveReplica,
    session: Session,
    blocked_key: String,
    blocked_for_s: f64,
    footprint: Footprint,
    /// Whether paths may end at the nearest point that can be reached.
    to_nearest: bool,
    /// What others were told last.
    told: BTreeSet<FixedPoint>,
    /// What held when a path was last asked for.
    rules: Arc<Rules>,
    inquiry: BackgroundWorker<Question, Answer>,
    free_space: FreeSpaceCache,
    fallbacks: usize,
}

impl<'a> ServerPaths<'a> {
    /// Asks through `session`, from a thread of its own.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn new(
        session: &Session,
        map: MapName,
        robot: &str,
        replica: &'a LiveReplica,
        config: &ServerPathsConfig,
    ) -> std::io::Result<Self> {
        let blocked_key = Key::robot(&map, robot, RobotTopic::Blocked).to_string();
        let timeout = Duration::try_from_secs_f64(config.timeout_s).unwrap_or_default();
        let (asking, footprint) = (session.clone(), config.footprint.clone());
        let ask = move |question: Question| answer(&asking, &map, &footprint, question, timeout);
        // With an entry the server is asked twice.
        let inquiry = BackgroundWorker::newest_first("paths", config.taking, 3 * timeout, ask)?;
        Ok(Self {
            replica,
            session: session.clone(),
            blocked_key,
            blocked_for_s: config.blocked_for_s,
            footprint: config.footprint.clone(),
            to_nearest: false,
            told: BTreeSet::new(),
            rules: Arc::default(),
            inquiry,
            free_space: FreeSpaceCache::beside(config.taking).for_footprint(config.footprint.clone()),
            fallbacks: 0,
        })
    }

    /// Tells the others what this robot found blocked. Lost, it is said again with the next place.
    fn tell(&mut self, blocked: &BTreeSet<FixedPoint>) {
        if *blocked == self.told {
            return;
        }
        self.told.clone_from(blocked);
        let places = blocked.iter().take(BlockedReport::MAX_THINGS).map(|place| [place.x(), place.y()]).collect();
        let report = BlockedReport { for_s: self.blocked_for_s, edges: Vec::new(), places };
        let Ok(json) = serde_json::to_vec(&report) else { return };
        let put = self.session.put(&self.blocked_key, json).encoding(zenoh::bytes::Encoding::APPLICATION_JSON).wait();
        if let Err(error) = put {
            tracing::debug!(%error, "a blocked place was not told");
        }
    }

    /// How often the server was silent, or answered with what is no path, and the robot kept its
    /// own.
    #[must_use]
    pub fn fallbacks(&self) -> usize {
        self.fallbacks
    }
}

fn answer(session: &Session, map: &MapName, footprint: &Footprint, question: Question, timeout: Duration) -> Answer {
    let text = |point: Point2| format!("{:.3},{:.3}", point.x, point.y);
    let Question { from, to, entry, to_nearest, rules } = question;
    let mut failure = None;
    let path = with_entry(from, entry, |start| {
        let (from, to_text) = (text(start), text(to));
        let question = PathQuestion { from: &from, to: &to_text, footprint, release: None, to_nearest };
        let reply = ask_path(session, map, &question, timeout);
        let path = reply.map_err(NoUse::from).and_then(|reply| {
            check_kept(&reply, &rules)?;
            Ok(planned_between(reply, start, to)?)
        });
        path.map_err(|error| match error {
            NoUse::Ask(AskError::Refused(refusal)) if !refusal.code.is_trouble_of_the_server() => refusal,
            error => {
                let reply = ErrorReply::new(ErrorCode::Internal, &error.to_string());
                failure = Some(error);
                reply
            }
        })
    });
    failure.map_or(Ok(path), Err)
}

impl PathSource for ServerPaths<'_> {
    fn begin(&mut self, to_nearest: bool) {
        self.to_nearest = to_nearest;
        self.inquiry.cancel();
        self.free_space.forget_wish();
    }

    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.tell(blocked);
        let changes = self.replica.changes();
        let map = self.replica.running();
        self.rules = self.replica.rules();
        if blocked.is_empty() {
            let (entry, to_nearest) = (entry_node(&map, &self.footprint, from), self.to_nearest);
            self.inquiry.replace(Question { from, to, entry, to_nearest, rules: Arc::clone(&self.rules) });
        } else {
            self.inquiry.cancel();
        }
        let rules = if blocked.is_empty() {
            Arc::clone(&self.rules)
        } else {
            Arc::new(with_own(self.rules.as_ref().clone(), blocked))
        };
        let ends = if self.to_nearest { PathEnds::ToNearest } else { PathEnds::Unknown };
        self.free_space.plan_between(&map, changes, (from, to, ends), &rules)
    }

    fn is_outdated(&self) -> bool {
        !self.rules.closes_the_same(&self.replica.rules())
    }

    fn speed_limit_mps(&self, place: Point2) -> Option<f64> {
        self.replica.rules().speed_limit_mps(fixed_point(place))
    }

    fn is_pending(&self) -> bool {
        self.inquiry.is_pending() || self.free_space.is_pending()
    }

    fn revised(&mut self) -> Option<Result<PlannedPath, ErrorReply>> {
        // Both are taken each frame; of two that come together the server's counts.
        let answer = self.inquiry.take();
        let own = self.free_space.revised(|| self.replica.running());
        match answer {
            Some(Ok(Ok(path))) => {
                self.free_space.forget_wish();
                return Some(Ok(path));
            }
            Some(Ok(Err(refusal))) => tracing::info!(%refusal, "the server has no path"),
            Some(Err(NoUse::Path(error @ UnusablePath::Outdated))) => {
                tracing::info!("the robot's own path is kept: {error}");
            }
            Some(Err(error)) => {
                tracing::warn!(%error, "no path from the server: planning on the robot's own copy of the map");
                self.fallbacks += 1;
            }
            None => {}
        }
        own
    }
}
