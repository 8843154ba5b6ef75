//! A map at hand: the own copy, and the server behind it.

use crate::place::NamedPlace;
use fht_client::{AskError, FreeSpaceCache, LiveReplica, PoseReport, Presence, ask_fleet_async, ask_head_async};
use fht_map::plan::blocked::missing_node;
use fht_map::{MapState, Rules};
use fht_perception::pose::{Pose2, from_fixed};
use fht_proto::api::fleet::{BlockedReport, LocalizationState, RobotView};
use fht_proto::api::reply::Head;
use fht_proto::model::validate::Validate;
use fht_proto::{Footprint, Invalid, MapName, NodeId, NodeKind, ReleaseId, VersionVector};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

/// What all handles of one map share.
pub(crate) struct Inner {
    pub(crate) session: Session,
    pub(crate) name: MapName,
    pub(crate) footprint: Footprint,
    /// Whether authors may begin the map.
    pub(crate) may_begin: bool,
    pub(crate) timeout: Duration,
    pub(crate) replica: LiveReplica,
    pub(crate) presence: Option<Presence>,
    pub(crate) _token: Option<LivelinessToken>,
    /// What the robot said last of where it is.
    pub(crate) pose: Mutex<PoseReport>,
    /// Free space of the own copy, kept from one path to the next.
    pub(crate) free_space: Mutex<FreeSpaceCache>,
}

impl Inner {
    pub(crate) fn set_pose(&self, pose: PoseReport) {
        *self.pose.lock().unwrap_or_else(PoisonError::into_inner) = pose;
    }

    pub(crate) fn publish_pose(&self) {
        self.say(Presence::publish);
    }

    fn say(&self, publish: impl FnOnce(&Presence, &PoseReport, VersionVector, Option<String>)) {
        if let Some(presence) = &self.presence {
            let pose = self.pose.lock().unwrap_or_else(PoisonError::into_inner).clone();
            let release = self.replica.release().map(|release| release.to_string());
            publish(presence, &pose, self.replica.read().vector().clone(), release);
        }
    }
}

/// The robot's last word: where it is when the last handle of its map goes.
impl Drop for Inner {
    fn drop(&mut self) {
        self.say(Presence::publish_last);
    }
}

/// A map of the service: a live copy of it, and the server to ask. Clones are handles of the same
/// copy; the robot that connected is present until the last one is dropped.
#[derive(Clone)]
pub struct Map {
    pub(crate) inner: Arc<Inner>,
}

/// A node of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Its id.
    pub id: NodeId,
    /// A main node carries what was seen there, a support node only joins others.
    pub kind: NodeKind,
    /// Its pose in the map frame.
    pub pose: Pose2,
    /// The nodes that an edge joins it to.
    pub neighbours: Vec<NodeId>,
}

/// Why nothing was reported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// Only robots report.
    #[error("only a robot can report this: connect with Map::connect(…).robot(name)")]
    NotARobot,
    /// An edge ends at a node that the own copy does not have.
    #[error("the own copy of the map has no node {0}: it cannot be blocked")]
    NoNode(NodeId),
    /// Nobody would take the report.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl Map {
    /// The map's name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.inner.name.as_str()
    }

    /// The map as the robot is to use it: the release that is enabled, or else the newest state of
    /// the own copy. Costs little: it shares everything with the copy.
    #[must_use]
    pub fn state(&self) -> Arc<MapState> {
        self.inner.replica.running()
    }

    /// The release that [`state`](Self::state) is; `None`: the newest state.
    #[must_use]
    pub fn release(&self) -> Option<ReleaseId> {
        self.inner.replica.release()
    }

    /// The nodes of [`state`](Self::state).
    #[must_use]
    pub fn nodes(&self) -> Vec<Node> {
        let state = self.state();
        let nodes = state.nodes().map(|node| Node {
            id: node.id,
            kind: node.kind,
            pose: from_fixed(node.pose),
            neighbours: state.neighbours(node.id).map(|other| other.id).collect(),
        });
        nodes.collect()
    }

    /// The named places, by name.
    #[must_use]
    pub fn places(&self) -> Vec<NamedPlace> {
        let copy = self.inner.replica.read();
        let places = copy.state().annotations().places();
        places.map(|(name, pose)| NamedPlace { name: name.to_string(), pose: from_fixed(pose) }).collect()
    }

    /// What operators and other robots have closed, as far as the own copy knows.
    #[must_use]
    pub fn rules(&self) -> Arc<Rules> {
        self.inner.replica.rules()
    }

    /// A channel that tells whenever the own copy has changed. The number only says that it has;
    /// look at [`state`](Self::state) for how.
    ///
    /// ```no_run
    /// # async fn follow(map: fht::Map) {
    /// let mut changes = map.changes();
    /// while changes.changed().await.is_ok() {
    ///     println!("{} nodes", map.nodes().len());
    /// }
    /// # }
    /// ```
    #[must_use]
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.inner.replica.watch_changes()
    }

    /// The state of the server's map: version, digest, counts.
    ///
    /// # Errors
    /// Why there is no answer.
    pub async fn head(&self) -> Result<Head, AskError> {
        ask_head_async(&self.inner.session, &self.inner.name, self.inner.timeout).await
    }

    /// The robots that the server knows of: where they are, what they run, whether they are there.
    ///
    /// # Errors
    /// Why there is no answer.
    pub async fn robots(&self) -> Result<Vec<RobotView>, AskError> {
        Ok(ask_fleet_async(&self.inner.session, &self.inner.name, self.inner.timeout).await?.robots)
    }

    /// Publishes where the robot is, for a robot that finds out by itself; `None`: it does not
    /// know. Robots that use a [`localizer`](Self::localizer) or [`go`](Self::go) need not call
    /// this.
    pub fn set_pose(&self, map_from_base: Option<Pose2>) {
        let state = map_from_base.map_or(LocalizationState::NotLocalized, |_| LocalizationState::Localized);
        let confidence = if map_from_base.is_some() { 1.0 } else { 0.0 };
        self.inner.set_pose(PoseReport { state, confidence, map_from_base, ..PoseReport::default() });
    }

    /// Reports that the robot could not pass these edges and points (map frame). Everybody, the
    /// server included, plans around them for `lasting`, a day at most. Reports add up; one that
    /// says the same again counts anew, and an empty one takes all of the robot's back. A blocked
    /// edge closes the passages that it leads through, for everybody, as a closed one does.
    ///
    /// # Errors
    /// [`ReportError`].
    pub fn report_blocked(
        &self,
        edges: &[(NodeId, NodeId)],
        points: &[(f64, f64)],
        lasting: Duration,
    ) -> Result<(), ReportError> {
        let presence = self.inner.presence.as_ref().ok_or(ReportError::NotARobot)?;
        let report = BlockedReport {
            for_s: lasting.as_secs_f64(),
            edges: edges.iter().map(|(a, b)| [a.to_string(), b.to_string()]).collect(),
            places: points.iter().map(|&(x, y)| [x, y]).collect(),
        };
        report.validate()?;
        if let Some(missing) = missing_node(&report.edge_keys()?, [&self.newest(), &self.state()]) {
            return Err(ReportError::NoNode(missing));
        }
        presence.report_blocked(&report);
        Ok(())
    }

    /// The newest state of the own copy.
    pub(crate) fn newest(&self) -> MapState {
        self.inner.replica.read().state().clone()
    }
}

impl std::fmt::Debug for Map {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Map").field("name", &self.inner.name).finish_non_exhaustive()
    }
}
