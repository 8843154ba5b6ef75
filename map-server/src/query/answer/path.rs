//! `path`: the shortest path that obeys what operators and robots have closed.

use crate::catalog::{MapView, PlanningState};
use crate::query::active_rules::OtherState;
use crate::query::answer::release_name::find_release;
use crate::query::answer::reply::{Answer, error, internal, json, postcard};
use crate::query::answer::sources::AnswerSources;
use fht_map::graph::astar::Workspace;
use fht_map::plan::node_route::{IndexedGraph, NodeRoute};
use fht_map::{FreeSpace, MapIndex, MapState, NodeRouteConfig, PathEnds, PlanError, Rules};
use fht_proto::api::compact::{CompactPath, CompactPathWithGoal, CompactWaypoint};
use fht_proto::api::reply::{ErrorCode, ErrorReply, PathReply, PlaceRef, SpeedLimit, Waypoint, known_names};
use fht_proto::api::request::{Format, PathOn, Question};
use fht_proto::{FixedPoint, FixedPose, Footprint, MapName, ReleaseId};
use std::cell::RefCell;
use std::sync::Arc;

/// Which path is asked for, and how the answer is to be written.
pub(super) struct PathQuestion<'a> {
    from: &'a PlaceRef,
    to: &'a PlaceRef,
    on: &'a PathOn,
    footprint: Footprint,
    /// Whether the goal may be moved.
    to_nearest: bool,
    /// Whether the compact form tells what became of the goal.
    tells_goal: bool,
    format: Format,
}

impl<'a> PathQuestion<'a> {
    /// None for other questions.
    pub(super) fn of(question: &'a Question) -> Option<Self> {
        let Question::Path { from, to, on, footprint, to_nearest, goal_yaw, format } = question else { return None };
        let (footprint, tells_goal) = (footprint.clone().unwrap_or_default(), to_nearest.is_some() || *goal_yaw);
        Some(Self { from, to, on, footprint, to_nearest: *to_nearest == Some(true), tells_goal, format: *format })
    }

    fn route_config(&self, usual: &NodeRouteConfig) -> NodeRouteConfig {
        let ends = if self.to_nearest { PathEnds::ToNearest } else { PathEnds::Unknown };
        NodeRouteConfig { ends, ..usual.clone() }
    }

    /// The heading at the goal, 1e-4 rad, if that is a named place.
    fn goal_yaw_e4(&self, view: &MapView) -> Option<i16> {
        match self.to {
            PlaceRef::Named(name) => view.state.annotations().place(name).map(|pose| pose.yaw_e4),
            PlaceRef::Point(_) | PlaceRef::Node(_) => None,
        }
    }
}

pub(super) fn path(
    view: &MapView,
    sources: &AnswerSources,
    asked: &PathQuestion<'_>,
    now_us: u64,
) -> Result<Answer, ErrorReply> {
    let planning = planning_state(view, sources, asked.on)?;
    let place = |place| locate(view, planning.state(), place);
    let (from, to) = (place(asked.from)?, place(asked.to)?);
    let rules = sources.active_rules.rules(view, now_us);
    let space = planning.free_space(&rules, &asked.footprint);
    let config = asked.route_config(&sources.config.route);
    let route = match space.over_budget() {
        None => rules.plan(planning.state().as_ref(), &space, from, to, &config),
        Some(_) => over_nodes(sources, &planning, &view.head.map, &rules, &space, (from, to), &config),
    };
    reply(view, &planning, &rules, &route.map_err(|cause| no_route(&cause, &asked.footprint))?, asked)
}

/// The same, if it blocks on nothing, nothing has to be built first, and the search is short: both
/// places in free space, on a small mesh.
pub(super) fn at_once(
    view: &MapView,
    sources: &AnswerSources,
    asked: &PathQuestion<'_>,
    now_us: u64,
) -> Option<Result<Answer, ErrorReply>> {
    let planning = &view.running;
    if matches!(asked.on, PathOn::Release(_)) || (*asked.on == PathOn::Head && planning.release().is_some()) {
        return None;
    }
    let place = |place| locate(view, planning.state(), place).ok();
    let (from, to) = (place(asked.from)?, place(asked.to)?);
    // After every change of the map the rules are derived anew: at once for a small map.
    let is_small = view.head.edges <= FEW_EDGES;
    let rules = sources
        .active_rules
        .rules_at_hand(view, now_us)
        .or_else(|| is_small.then(|| sources.active_rules.rules(view, now_us)))?;
    let space = planning.free_space_at_hand(&rules, &asked.footprint)?;
    let is_short = space.over_budget().is_none() && space.triangle_count() <= sources.config.at_once_triangles;
    if !is_short || !space.contains(from) || !space.contains(to) {
        return None;
    }
    let config = asked.route_config(&sources.config.route);
    let route = rules.plan(planning.state().as_ref(), &space, from, to, &config);
    let route = route.map_err(|cause| no_route(&cause, &asked.footprint));
    Some(route.and_then(|route| reply(view, planning, &rules, &route, asked)))
}

/// Rules of so many edges are derived in some ten microseconds.
const FEW_EDGES: usize = 5000;

thread_local! {
    /// The scratch memory of searches.
    static WORK: RefCell<Workspace> = RefCell::default();
}

/// Plans with the map's index, on a map without a mesh.
fn over_nodes(
    sources: &AnswerSources,
    planning: &PlanningState,
    map: &MapName,
    rules: &Rules,
    space: &FreeSpace,
    ends: (FixedPoint, FixedPoint),
    config: &NodeRouteConfig,
) -> Result<NodeRoute, PlanError> {
    let over = |index: &MapIndex| {
        WORK.with_borrow_mut(|work| rules.plan(IndexedGraph { index, work }, space, ends.0, ends.1, config))
    };
    if planning.release().is_some() {
        return over(planning.index());
    }
    let of_head = sources
        .catalog
        .with_index(map, |newest, index| (newest.head.version == planning.version()).then(|| over(index)));
    // The map has grown meanwhile: rare, and then this is correct but slower.
    of_head.flatten().unwrap_or_else(|| rules.plan(planning.state().as_ref(), space, ends.0, ends.1, config))
}

/// The state to plan on.
fn planning_state(view: &MapView, sources: &AnswerSources, on: &PathOn) -> Result<Arc<PlanningState>, ErrorReply> {
    let unknown = |message: String| error(ErrorCode::UnknownVersion, message);
    let other = |release: Option<ReleaseId>, digest| OtherState { map: view.head.map.clone(), release, digest };
    match on {
        PathOn::Enabled => Ok(Arc::clone(&view.running)),
        PathOn::Head if view.running.release().is_none() => Ok(Arc::clone(&view.running)),
        PathOn::Head => sources
            .active_rules
            .other(other(None, view.head.digest), || Ok(PlanningState::of_head(&view.state, view.head.version))),
        PathOn::Release(name) => {
            let id = find_release(&view.state, name).map_err(unknown)?;
            if view.running.release() == Some(&id) {
                return Ok(Arc::clone(&view.running));
            }
            let release = view.state.annotations().release(&id).map(|release| release.release.clone());
            let release = release.ok_or_else(|| unknown(format!("there is no release {id}")))?;
            sources.active_rules.other(other(Some(id.clone()), release.digest), || {
                let planning =
                    PlanningState::of_release(&view.head.map, &id, &release, sources.log.as_ref()).map_err(internal)?;
                planning.ok_or_else(|| {
                    unknown(format!("this server does not have all of release {id}, or not with its digest"))
                })
            })
        }
    }
}

/// Where a place is. Names are the newest ones: operators name places for robots on every release.
fn locate(view: &MapView, map: &MapState, place: &PlaceRef) -> Result<FixedPoint, ErrorReply> {
    match place {
        PlaceRef::Point(point) => Ok(*point),
        PlaceRef::Node(id) => {
            let position = map.node(*id).map(|node| node.pose.position);
            position.ok_or_else(|| error(ErrorCode::UnknownNode, format!("there is no node {id} on this map")))
        }
        PlaceRef::Named(name) => {
            let annotations = view.state.annotations();
            annotations.place(name).map(|pose| pose.position).ok_or_else(|| {
                let known = known_names(annotations.places().map(|(name, _)| name));
                error(ErrorCode::UnknownPlace, format!("map {} has no place called {name} ({known})", view.head.map))
            })
        }
    }
}

fn no_route(cause: &PlanError, footprint: &Footprint) -> ErrorReply {
    let code = cause.code();
    if code != ErrorCode::NoPath || !footprint.is_larger_than_explorers() {
        return error(code, cause.to_string());
    }
    let radius_m = footprint.planned_as().circumscribed_radius_m();
    error(code, format!("{cause}; it must be free for a robot of {radius_m:.2} m radius"))
}

fn reply(
    view: &MapView,
    planning: &PlanningState,
    rules: &Rules,
    route: &NodeRoute,
    asked: &PathQuestion<'_>,
) -> Result<Answer, ErrorReply> {
    let (map, version) = (view.head.map.clone(), planning.version());
    // To the millimetre, like everything else.
    let in_mm = |metres: f64| (metres * 1000.0).round();
    let to_mm = |limit: SpeedLimit| SpeedLimit { along_m: limit.along_m.map(|at| in_mm(at) / 1000.0), ..limit };
    let goal_yaw_e4 = asked.goal_yaw_e4(view);
    match asked.format {
        Format::Json => {
            let waypoints = route.waypoints.iter().map(|waypoint| Waypoint {
                x: waypoint.point.x(),
                y: waypoint.point.y(),
                node: waypoint.node.map(|id| id.to_string()),
            });
            json(&PathReply {
                map,
                version,
                release: planning.release().map(ToString::to_string),
                length_m: in_mm(route.length_m) / 1000.0,
                waypoints: waypoints.collect(),
                goal_moved_m: in_mm(route.goal_moved_m) / 1000.0,
                unmapped_m: in_mm(route.unmapped_m) / 1000.0,
                goal_yaw: goal_yaw_e4.map(|yaw_e4| FixedPose { position: FixedPoint::default(), yaw_e4 }.yaw()),
                obeyed: rules.obeyed(),
                speed_limits: rules.speed_limits(route).into_iter().map(to_mm).collect(),
            })
        }
        Format::Postcard => {
            let waypoints = route.waypoints.iter();
            let waypoints = waypoints.map(|waypoint| CompactWaypoint { point: waypoint.point, node: waypoint.node });
            let path = CompactPath { map, version, waypoints: waypoints.collect() };
            if !asked.tells_goal {
                return postcard(&path);
            }
            let (goal_moved_mm, unmapped_mm) = (in_mm(route.goal_moved_m) as u32, in_mm(route.unmapped_m) as u32);
            postcard(&CompactPathWithGoal { path, goal_moved_mm, unmapped_mm, goal_yaw_e4 })
        }
    }
}
