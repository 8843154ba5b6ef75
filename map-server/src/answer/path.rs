//! `path`: the shortest way that obeys what operators and robots have closed.

use super::{Answer, Sources, error, internal, json, postcard};
use crate::basis::Basis;
use crate::catalog::{MapView, find_release};
use crate::live::OtherState;
use fht_map::route::Route;
use fht_map::shortest::Workspace;
use fht_map::{FreeSpace, MapIndex, MapState, PlanError, Rules};
use fht_proto::compact::{CompactPath, CompactWaypoint};
use fht_proto::query::{ErrorCode, ErrorReply, PathReply, Place, Waypoint};
use fht_proto::request::{Format, PathOn};
use fht_proto::{FixedPoint, Label, MapName, ReleaseId};
use std::cell::RefCell;
use std::sync::Arc;

pub(super) fn path(
    view: &MapView,
    sources: &Sources,
    (from, to): (&Place, &Place),
    on: &PathOn,
    format: Format,
    now_us: u64,
) -> Result<Answer, ErrorReply> {
    let basis = basis(view, sources, on)?;
    let place = |place| locate(view, basis.state(), place);
    let (from, to) = (place(from)?, place(to)?);
    let rules = sources.live.rules(view, now_us);
    let space = basis.free_space(&rules);
    let route = match space.over_budget() {
        None => rules.plan(basis.state(), &space, from, to, &sources.config.route),
        Some(_) => over_nodes(sources, &basis, &view.head.map, &rules, &space, (from, to)),
    };
    reply(view, &basis, &rules, &route.map_err(|cause| no_route(&cause))?, format)
}

/// The same, if nothing has to be waited for or made first, and it is a short search: both places in free space, of a small mesh.
pub(super) fn at_once(
    view: &MapView,
    sources: &Sources,
    (from, to): (&Place, &Place),
    on: &PathOn,
    format: Format,
    now_us: u64,
) -> Option<Result<Answer, ErrorReply>> {
    let basis = &view.running;
    if matches!(on, PathOn::Release(_)) || (*on == PathOn::Head && basis.release().is_some()) {
        return None;
    }
    let place = |place| locate(view, basis.state(), place).ok();
    let (from, to) = (place(from)?, place(to)?);
    // After every change of the map they are looked up anew: of a small map at once, too.
    let is_small = view.head.edges <= FEW_EDGES;
    let rules =
        sources.live.rules_at_hand(view, now_us).or_else(|| is_small.then(|| sources.live.rules(view, now_us)))?;
    let space = basis.free_space_at_hand(&rules)?;
    let is_short = space.over_budget().is_none() && space.triangle_count() <= sources.config.at_once_triangles;
    if !is_short || !space.contains(from) || !space.contains(to) {
        return None;
    }
    let route = rules.plan(basis.state(), &space, from, to, &sources.config.route).map_err(|cause| no_route(&cause));
    Some(route.and_then(|route| reply(view, basis, &rules, &route, format)))
}

/// Edges that are looked through for those that are closed in some ten microseconds.
const FEW_EDGES: usize = 5000;

thread_local! {
    /// What a search writes down.
    static WORK: RefCell<Workspace> = RefCell::default();
}

/// On a map without a mesh: over its index.
fn over_nodes(
    sources: &Sources,
    basis: &Basis,
    map: &MapName,
    rules: &Rules,
    space: &FreeSpace,
    ends: (FixedPoint, FixedPoint),
) -> Result<Route, PlanError> {
    let config = &sources.config.route;
    let over = |index: &MapIndex| WORK.with_borrow_mut(|work| rules.plan_over(index, space, ends, config, work));
    if basis.release().is_some() {
        return over(basis.index());
    }
    let of_head =
        sources.catalog.with_index(map, |newest, index| (newest.head.version == basis.version()).then(|| over(index)));
    // The map has grown since: rarely, and then this is right and slower.
    of_head.flatten().unwrap_or_else(|| rules.plan(basis.state(), space, ends.0, ends.1, config))
}

/// The state to plan on.
fn basis(view: &MapView, sources: &Sources, on: &PathOn) -> Result<Arc<Basis>, ErrorReply> {
    let unknown = |message: String| error(ErrorCode::UnknownVersion, message);
    let other = |release: Option<ReleaseId>, digest| OtherState { map: view.head.map.clone(), release, digest };
    match on {
        PathOn::Enabled => Ok(Arc::clone(&view.running)),
        PathOn::Head if view.running.release().is_none() => Ok(Arc::clone(&view.running)),
        PathOn::Head => {
            sources.live.other(other(None, view.head.digest), || Ok(Basis::of_head(&view.state, view.head.version)))
        }
        PathOn::Release(name) => {
            let id = find_release(&view.state, name).map_err(unknown)?;
            if view.running.release() == Some(&id) {
                return Ok(Arc::clone(&view.running));
            }
            let release = view.state.annotations().release(&id).map(|release| release.release.clone());
            let release = release.ok_or_else(|| unknown(format!("there is no release {id}")))?;
            sources.live.other(other(Some(id.clone()), release.digest), || {
                let basis = Basis::of_release(&view.head.map, &id, &release, sources.log.as_ref()).map_err(internal)?;
                basis.ok_or_else(|| unknown(format!("this server does not have all of release {id}")))
            })
        }
    }
}

/// Where a place is. Names are those of now: operators name places for robots on every release.
fn locate(view: &MapView, map: &MapState, place: &Place) -> Result<FixedPoint, ErrorReply> {
    match place {
        Place::Point(point) => Ok(*point),
        Place::Node(id) => {
            let position = map.node(*id).map(|node| node.pose.position);
            position.ok_or_else(|| error(ErrorCode::UnknownNode, format!("there is no node {id} on this map")))
        }
        Place::Named(name) => {
            let annotations = view.state.annotations();
            let known = || annotations.places().map(|(name, _)| name.clone()).take(10).collect::<Vec<Label>>();
            let pose = annotations.place(name);
            pose.map(|pose| pose.position).ok_or_else(|| no_place(name, &known()))
        }
    }
}

fn no_place(name: &Label, known: &[Label]) -> ErrorReply {
    let known: Vec<&str> = known.iter().map(Label::as_str).collect();
    let known =
        if known.is_empty() { "none has a name yet".to_owned() } else { format!("there is: {}", known.join(", ")) };
    error(ErrorCode::UnknownPlace, format!("there is no place {name} on this map ({known})"))
}

fn no_route(cause: &PlanError) -> ErrorReply {
    error(cause.code(), cause.to_string())
}

fn reply(view: &MapView, basis: &Basis, rules: &Rules, route: &Route, format: Format) -> Result<Answer, ErrorReply> {
    let (map, version) = (view.head.map.clone(), basis.version());
    match format {
        Format::Json => {
            let waypoints = route.waypoints.iter().map(|waypoint| Waypoint {
                x: waypoint.point.x(),
                y: waypoint.point.y(),
                node: waypoint.node.map(|id| id.to_string()),
            });
            json(&PathReply {
                map,
                version,
                release: basis.release().map(ToString::to_string),
                // To the millimetre, like everything else.
                length_m: (route.length_m * 1000.0).round() / 1000.0,
                waypoints: waypoints.collect(),
                obeyed: rules.obeyed(),
                speed_limits: rules.speed_limits(route),
            })
        }
        Format::Postcard => {
            let waypoints = route.waypoints.iter();
            let waypoints = waypoints.map(|waypoint| CompactWaypoint { point: waypoint.point, node: waypoint.node });
            postcard(&CompactPath { map, version, waypoints: waypoints.collect() })
        }
    }
}
