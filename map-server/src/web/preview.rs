//! Which paths between places would be others after a change. Nothing is written: the change is
//! made on a copy, which shares with the map all that stays the same.

use crate::catalog::MapView;
use crate::query::{AnswerSources, internal};
use fht_map::{FreeSpace, MapState, NodeRouteConfig, PlanError, Rules};
use fht_proto::api::reply::ErrorReply;
use fht_proto::api::request::bad_request;
use fht_proto::{AuthorId, FixedPoint, Footprint, Increment, MapName, Op};
use serde::Serialize;
use std::sync::Arc;

/// Paths between so many places are compared, those nearest to what changes.
const MAX_PLACES: usize = 10;
/// Paths whose lengths differ by less are the same, metres.
const SAME_M: f64 = 0.005;

/// What would change.
#[derive(Debug, Serialize)]
pub(super) struct PreviewReply {
    map: MapName,
    version: u64,
    /// How many paths were compared.
    asked: usize,
    /// Those that would be others.
    paths: Vec<ChangedPath>,
}

/// A path that would be another.
#[derive(Debug, Default, Serialize)]
struct ChangedPath {
    from: String,
    to: String,
    /// Its length, metres; absent: there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    before_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    after_m: Option<f64>,
    /// Its corners.
    #[serde(skip_serializing_if = "Option::is_none")]
    before: Option<Vec<[f64; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    after: Option<Vec<[f64; 2]>>,
    /// Why there would be none.
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

/// A map that paths are planned on.
struct Planned<'a> {
    state: &'a MapState,
    rules: &'a Rules,
    space: &'a FreeSpace,
    config: &'a NodeRouteConfig,
}

/// Length in metres, and corners.
type Way = (f64, Vec<[f64; 2]>);

impl Planned<'_> {
    fn way(&self, from: FixedPoint, to: FixedPoint) -> Result<Way, PlanError> {
        let route = self.rules.plan(self.state, self.space, from, to, self.config)?;
        let corners = route.waypoints.iter().map(|waypoint| [waypoint.point.x(), waypoint.point.y()]).collect();
        Ok(((route.length_m * 1000.0).round() / 1000.0, corners))
    }
}

/// What would be another on the map of `view` if `author` wrote `ops`.
///
/// # Errors
/// `BAD_REQUEST` if the map is too large for a mesh; `INTERNAL` if the log does not read.
pub(super) fn preview(
    view: &MapView,
    sources: &AnswerSources,
    (author, ops): (AuthorId, Vec<Op>),
    now_us: u64,
) -> Result<PreviewReply, ErrorReply> {
    let head = &view.head;
    let middle = middle_of(&view.state, &ops);
    let mut state = view.state.as_ref().clone();
    let (number, hlc_us) = (head.vector.get(author) + 1, head.clock_us + 1);
    state.apply(&Increment { author, number, hlc_us, ops });

    let planning = &view.running;
    let rules = sources.active_rules.rules(view, now_us);
    let space = planning.free_space(&rules, &Footprint::default());
    // What robots run may be a release, and another one then; operators' rules hold on it, too.
    let changed_rules = Rules::of(&state, rules.blocked.clone());
    let run = view.would_run(&Arc::new(state), sources.log.as_ref()).map_err(internal)?;
    let changed = run.state();
    let changed_space = FreeSpace::of(changed, &changed_rules.space_config());
    if space.over_budget().is_some() || changed_space.over_budget().is_some() {
        return Err(bad_request("this map is too large: paths cannot be looked at in advance".to_owned()));
    }
    let config = &sources.config.route;
    let before = Planned { state: planning.state(), rules: &rules, space: &space, config };
    let after = Planned { state: changed, rules: &changed_rules, space: &changed_space, config };
    let places = places_near(&view.state, middle);
    let mut reply = PreviewReply { map: head.map.clone(), version: head.version, asked: 0, paths: Vec::new() };
    for (index, (from, start)) in places.iter().enumerate() {
        for (to, goal) in places.iter().skip(index + 1) {
            reply.asked += 1;
            let changed = compare(before.way(*start, *goal), after.way(*start, *goal));
            reply.paths.extend(changed.map(|path| ChangedPath { from: from.clone(), to: to.clone(), ..path }));
        }
    }
    Ok(reply)
}

/// What differs, if anything does.
fn compare(before: Result<Way, PlanError>, after: Result<Way, PlanError>) -> Option<ChangedPath> {
    let is_same = match (&before, &after) {
        (Ok((before_m, _)), Ok((after_m, _))) => (before_m - after_m).abs() < SAME_M,
        (Err(_), Err(_)) => true,
        _ => false,
    };
    if is_same {
        return None;
    }
    let message = after.as_ref().err().map(ToString::to_string);
    let (before_m, before) = before.ok().unzip();
    let (after_m, after) = after.ok().unzip();
    Some(ChangedPath { before_m, before, after_m, after, message, ..ChangedPath::default() })
}

/// The middle of what operations touch; the origin if that is nothing.
fn middle_of(state: &MapState, ops: &[Op]) -> [f64; 2] {
    let of_node = |id| state.node(id).map(|node| node.pose.position);
    let mut touched: Vec<FixedPoint> = Vec::new();
    for op in ops {
        match op {
            Op::SetZone { zone: Some(zone), .. } => touched.extend(&zone.corners),
            Op::SetPlace { pose: Some(pose), .. } => touched.push(pose.position),
            Op::SetClosed { edge, .. } => touched.extend([edge.low(), edge.high()].into_iter().filter_map(of_node)),
            Op::RemoveNode { id } => touched.extend(of_node(*id)),
            Op::SetZone { name, zone: None } => {
                let known = state.annotations().zones().find(|(known, _)| *known == name);
                touched.extend(known.iter().flat_map(|(_, zone)| &zone.corners));
            }
            _ => {}
        }
    }
    let count = touched.len().max(1) as f64;
    let sum = |read: fn(&FixedPoint) -> f64| touched.iter().map(read).sum::<f64>() / count;
    [sum(|point| point.x()), sum(|point| point.y())]
}

/// Named places, the nearest ones.
fn places_near(state: &MapState, middle: [f64; 2]) -> Vec<(String, FixedPoint)> {
    let near = FixedPoint::from_metres(middle[0], middle[1]);
    let mut places: Vec<(String, FixedPoint)> =
        state.annotations().places().map(|(name, pose)| (name.to_string(), pose.position)).collect();
    places.sort_by(|a, b| a.1.distance(near).total_cmp(&b.1.distance(near)));
    places.truncate(MAX_PLACES);
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_stay_as_they_are_are_not_told() {
        let way = |length_m: f64| Ok((length_m, vec![[0.0, 0.0], [length_m, 0.0]]));
        let none = || {
            Err(PlanError::GoalKeptOut {
                goal: FixedPoint::default(),
                zone: "wet".parse().unwrap_or_else(|error| panic!("{error}")),
            })
        };
        assert!(compare(way(3.0), way(3.001)).is_none());
        assert!(compare(none(), none()).is_none());
        let longer = compare(way(3.0), way(4.0));
        assert!(longer.is_some_and(|path| path.before_m == Some(3.0) && path.after_m == Some(4.0)));
        let closed = compare(way(3.0), none());
        assert!(closed.is_some_and(|path| path.after.is_none() && path.message.is_some()));
    }
}
