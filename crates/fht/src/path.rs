//! Paths: the server's, or else planned on the own copy.

use crate::map::Map;
use crate::place::{Place, in_query, locate};
use fht_client::{
    AskError, PathPoint, PathQuestion, PlannedPath, Planner, UnusablePath, ask_path, check_kept, entry_node, planned,
    planned_between, with_entry,
};
use fht_map::PathEnds;
use fht_perception::pose::{Point2, fixed_point};
use fht_proto::Footprint;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Obeyed, PathReply, PlaceRef, SpeedLimit};
use std::future::{Future, IntoFuture};
use std::pin::Pin;
use std::sync::PoisonError;

impl Map {
    /// The shortest path between two places that obeys what operators and robots have closed, for
    /// the robot's footprint. The server plans it; when the server is silent or its answer is of no
    /// use, the path is planned on the own copy. [`Path::planner`](crate::Path::planner) tells.
    ///
    /// ```no_run
    /// # async fn ask(map: fht::Map) -> Result<(), fht::PathError> {
    /// let path = map.path("dock", (5.0, 3.0)).await?;
    /// println!("{:.1} m by way of {} points", path.length_m, path.points.len());
    /// // Not on the release that is enabled.
    /// let newest = map.path("dock", (5.0, 3.0)).on("head").await?;
    /// # Ok(())
    /// # }
    /// ```
    pub fn path(&self, from: impl Into<Place>, to: impl Into<Place>) -> PathRequest {
        let footprint = self.inner.footprint.clone();
        PathRequest { map: self.clone(), from: from.into(), to: to.into(), footprint, release: None, to_nearest: false }
    }
}

/// A path from one place to another.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// From start to goal, map frame.
    pub points: Vec<PathPoint>,
    /// Its length, metres.
    pub length_m: f64,
    /// The heading at the goal if that is a pose or a named place, map frame, radians.
    pub goal_yaw: Option<f64>,
    /// Who planned it: the server, or this program on its own copy of the map.
    pub planner: Planner,
    /// The release that it was planned on, as `name@author`; `None`: the newest state.
    pub release: Option<String>,
    /// What operators and robots have closed, and the path keeps out of.
    pub obeyed: Vec<Obeyed>,
    /// Zones of limited speed that it leads through, in the order in which they are entered.
    pub speed_limits: Vec<SpeedLimit>,
    /// How far its last point is from the goal that was asked for, metres; 0 unless
    /// [`PathRequest::to_nearest`] was asked for and the goal cannot be reached.
    pub goal_moved_m: f64,
    /// How much of it leads over ground that the map knows nothing of, metres, at its start or at
    /// its goal: drive there with care.
    pub unmapped_m: f64,
}

/// Why there is no path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PathError {
    /// There is none, or a place is unknown; the code says which, and the sentence why.
    #[error("{0}")]
    Refused(ErrorReply),
    /// A path on a certain release was asked for, which only the server plans, and it did not.
    #[error("only the server plans on a release of choice: {0}")]
    Server(#[from] AskError),
    /// The same, and it answered with what a robot should not drive.
    #[error("only the server plans on a release of choice: {0}")]
    Unusable(#[from] UnusablePath),
    /// Planning ended for no reason that it gave: a defect.
    #[error("planning failed: {0}")]
    Planning(#[from] tokio::task::JoinError),
}

impl PathError {
    /// What went wrong, if planning was refused: `NO_PATH`, `OUT_OF_MAP`, `KEEP_OUT`,
    /// `UNKNOWN_PLACE` …
    #[must_use]
    pub fn code(&self) -> Option<ErrorCode> {
        match self {
            Self::Refused(reply) => Some(reply.code),
            _ => None,
        }
    }
}

/// A question for a path; made by [`Map::path`]. Await it to ask.
#[derive(Clone, Debug)]
#[must_use = "nothing happens before it is awaited"]
pub struct PathRequest {
    map: Map,
    from: Place,
    to: Place,
    footprint: Footprint,
    release: Option<String>,
    to_nearest: bool,
}

impl PathRequest {
    /// The path is to be free for a robot of this outline. Default: what
    /// [`Connect`](crate::Connect) was told.
    pub fn footprint(mut self, footprint: Footprint) -> Self {
        self.footprint = footprint;
        self
    }

    /// Plans on this release, by its name or `name@author`, or on the newest state (`head`).
    /// Default: the release that is enabled, or else the newest state. Only the server plans on a
    /// release of choice.
    pub fn on(mut self, release: impl Into<String>) -> Self {
        self.release = Some(release.into());
        self
    }

    /// If the goal cannot be reached, the path to the nearest point that can:
    /// [`Path::goal_moved_m`] says how far that is from the goal. Default: then there is no path.
    pub fn to_nearest(mut self) -> Self {
        self.to_nearest = true;
        self
    }

    /// Zenoh's answers and the planner block, so they have a thread of their own.
    async fn ask(self) -> Result<Path, PathError> {
        tokio::task::spawn_blocking(move || self.ask_blocking()).await?
    }

    fn ask_blocking(&self) -> Result<Path, PathError> {
        let (from, to) =
            (self.from.to_ref().map_err(PathError::Refused)?, self.to.to_ref().map_err(PathError::Refused)?);
        let path = match self.ask_server(&from, &to) {
            Ok(path) => Ok(path),
            Err(PathError::Refused(reply)) if !reply.code.is_trouble_of_the_server() => Err(PathError::Refused(reply)),
            Err(PathError::Refused(reply)) if self.release.is_some() => Err(AskError::Refused(reply).into()),
            Err(error) if self.release.is_some() => Err(error),
            Err(error) => {
                tracing::warn!(%error, "no path from the server: planning on the own copy of the map");
                self.plan_here(&from, &to).map_err(PathError::Refused)
            }
        }?;
        Ok(Path { goal_yaw: self.to.yaw().or(path.goal_yaw), ..path })
    }

    fn ask_server(&self, from: &PlaceRef, to: &PlaceRef) -> Result<Path, PathError> {
        let inner = &self.map.inner;
        // A robot outside of the mapped space goes to the nearest node first.
        let start = point_of(from).unwrap_or_else(Point2::origin);
        let entry = point_of(from).and_then(|at| entry_node(&inner.replica.running(), &self.footprint, at));
        let (mut failure, mut answer) = (None, None);
        let found = with_entry(start, entry, |at| {
            let begin = if at == start { in_query(from) } else { in_query(&PlaceRef::Point(fixed_point(at))) };
            let question = PathQuestion {
                from: &begin,
                to: &in_query(to),
                footprint: &self.footprint,
                release: self.release.as_deref(),
                to_nearest: self.to_nearest,
            };
            let reply = ask_path(&inner.session, &inner.name, &question, inner.timeout);
            let path = reply.map_err(PathError::from).and_then(|reply| {
                answer = Some(reply.clone());
                check_kept(&reply, &inner.replica.rules())?;
                let is_between = point_of(from).is_some();
                Ok(usable(reply, is_between.then_some(at), point_of(to))?)
            });
            path.map_err(|error| match error {
                PathError::Server(AskError::Refused(refusal)) => refusal,
                error => {
                    let reply = ErrorReply::new(ErrorCode::Internal, &error.to_string());
                    failure = Some(error);
                    reply
                }
            })
        });
        match (found, failure, answer) {
            (_, Some(failure), _) => Err(failure),
            (Ok(path), None, Some(reply)) => Ok(answered(path, reply)),
            (Ok(_), None, None) => Err(AskError::Silent.into()),
            (Err(refusal), None, _) => Err(PathError::Refused(refusal)),
        }
    }
}

impl PathRequest {
    /// Plans on the own copy.
    fn plan_here(&self, from: &PlaceRef, to: &PlaceRef) -> Result<Path, ErrorReply> {
        let (inner, footprint) = (&self.map.inner, &self.footprint);
        let changes = inner.replica.changes();
        let running = inner.replica.running();
        let now = inner.replica.read().state().clone();
        let ((from, _), (to, goal_yaw)) = (locate(&now, &running, from)?, locate(&now, &running, to)?);
        let rules = inner.replica.rules();
        let mut cache = inner.free_space.lock().unwrap_or_else(PoisonError::into_inner);
        if cache.footprint() != footprint {
            *cache = std::mem::take(&mut *cache).for_footprint(footprint.clone());
        }
        let ends = if self.to_nearest { PathEnds::ToNearest } else { PathEnds::Unknown };
        let path = cache.plan_between(&running, changes, (from, to, ends), &rules)?;
        let points: Vec<_> = path.points.iter().map(|point| fixed_point(point.position)).collect();
        Ok(Path {
            speed_limits: rules.speed_limits_along(&points),
            obeyed: rules.obeyed(),
            release: inner.replica.release().map(|release| release.to_string()),
            points: path.points,
            length_m: path.length_m,
            goal_yaw,
            planner: path.planner,
            goal_moved_m: path.goal_moved_m,
            unmapped_m: path.unmapped_m,
        })
    }
}

impl IntoFuture for PathRequest {
    type Output = Result<Path, PathError>;
    type IntoFuture = Pin<Box<dyn Future<Output = Self::Output> + Send>>;

    fn into_future(self) -> Self::IntoFuture {
        Box::pin(self.ask())
    }
}

fn point_of(place: &PlaceRef) -> Option<Point2> {
    match place {
        PlaceRef::Point(point) => Some(Point2::new(point.x(), point.y())),
        _ => None,
    }
}

/// A path that leads where it was asked to, as far as that is known.
fn usable(reply: PathReply, from: Option<Point2>, to: Option<Point2>) -> Result<PlannedPath, UnusablePath> {
    match (from, to) {
        (Some(from), Some(to)) => planned_between(reply, from, to),
        _ => planned(reply),
    }
}

fn answered(path: PlannedPath, reply: PathReply) -> Path {
    // The way to the entry comes before what the server planned.
    let ahead_m = path.length_m - reply.length_m;
    let shift = |limit: SpeedLimit| SpeedLimit { along_m: limit.along_m.map(|along_m| along_m + ahead_m), ..limit };
    Path {
        points: path.points,
        length_m: path.length_m,
        goal_yaw: reply.goal_yaw,
        planner: path.planner,
        release: reply.release,
        obeyed: reply.obeyed,
        speed_limits: reply.speed_limits.into_iter().map(shift).collect(),
        goal_moved_m: path.goal_moved_m,
        unmapped_m: path.unmapped_m,
    }
}
