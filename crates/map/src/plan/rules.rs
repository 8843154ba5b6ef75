//! What operators and robots have closed: what paths keep out of, and where they are slow. Server
//! and robots plan under the same rules by the same code.

use crate::crdt::state::MapState;
use crate::navmesh::free_space::{FreeSpace, SpaceConfig};
use crate::plan::blocked::BlockedBy;
use crate::plan::node_route::{NodeRoute, NodeRouteConfig, PathEnds, RouteError, RouteGraph};
use crate::plan::shortest_path;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Obeyed, SpeedLimit};
use fht_proto::{EdgeKey, FixedPoint, Footprint, Label, Zone, ZoneRule};
use std::collections::BTreeSet;

/// What holds on a map now.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rules {
    /// Zones that no robot's centre may enter, by name.
    pub keep_out: Vec<(Label, Zone)>,
    /// Zones of limited speed, by name.
    pub slow: Vec<(Label, Zone)>,
    /// Edges that operators have closed.
    pub closed: BTreeSet<EdgeKey>,
    /// What robots found blocked.
    pub blocked: Vec<BlockedBy>,
}

/// Why there is no path under the rules.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// The map itself has none.
    #[error(transparent)]
    Route(#[from] RouteError),
    /// The goal is where no robot may be.
    #[error("({:.2}, {:.2}) lies in the zone {zone}, which robots keep out of", goal.x(), goal.y())]
    GoalKeptOut {
        /// The goal.
        goal: FixedPoint,
        /// The zone's name.
        zone: Label,
    },
    /// There is none that obeys all rules.
    #[error("{route}; these are closed: {}", closed.join(", "))]
    Closed {
        /// What planning said.
        route: RouteError,
        /// What is closed, for people.
        closed: Vec<String>,
    },
}

impl PlanError {
    /// The same, for programs.
    #[must_use]
    pub fn code(&self) -> ErrorCode {
        match self {
            Self::Route(route) | Self::Closed { route, .. } => match route {
                RouteError::NoPath { .. } => ErrorCode::NoPath,
                RouteError::OutOfMap { .. } => ErrorCode::OutOfMap,
            },
            Self::GoalKeptOut { .. } => ErrorCode::KeepOut,
        }
    }
}

impl From<PlanError> for ErrorReply {
    fn from(error: PlanError) -> Self {
        Self::new(error.code(), &error.to_string())
    }
}

impl Rules {
    /// The rules of a map: what its operators wrote, and what robots report.
    #[must_use]
    pub fn of(map: &MapState, blocked: Vec<BlockedBy>) -> Self {
        let zones = |is_wanted: fn(ZoneRule) -> bool| {
            let zones = map.annotations().zones().filter(move |(_, zone)| is_wanted(zone.rule));
            zones.map(|(name, zone)| (name.clone(), zone.clone())).collect()
        };
        Self {
            keep_out: zones(|rule| rule == ZoneRule::KeepOut),
            slow: zones(|rule| matches!(rule, ZoneRule::SpeedLimit(_))),
            closed: map.closed_edges().collect(),
            blocked,
        }
    }

    /// How free space is made of a map under these rules, for robots like the explorers.
    #[must_use]
    pub fn space_config(&self) -> SpaceConfig {
        self.space_config_for(&Footprint::default())
    }

    /// How free space is made of a map under these rules, for robots of a footprint.
    #[must_use]
    pub fn space_config_for(&self, footprint: &Footprint) -> SpaceConfig {
        SpaceConfig {
            blocked: self.blocked.iter().flat_map(|by| &by.places).copied().collect(),
            keep_out: self.keep_out.iter().map(|(_, zone)| zone.corners.clone()).collect(),
            closed: self.closed.iter().chain(self.blocked.iter().flat_map(|by| &by.edges)).copied().collect(),
            ..SpaceConfig::of(footprint)
        }
    }

    /// Whether two sets of rules leave the same space free.
    #[must_use]
    pub fn closes_the_same(&self, other: &Self) -> bool {
        (&self.keep_out, &self.closed, &self.blocked) == (&other.keep_out, &other.closed, &other.blocked)
    }

    /// Whether everything that `other` closes is closed here, too.
    #[must_use]
    pub fn closes_all_of(&self, other: &Self) -> bool {
        let places = |rules: &Self| -> BTreeSet<FixedPoint> {
            rules.blocked.iter().flat_map(|by| by.places.iter().copied()).collect()
        };
        let edges = |rules: &Self| -> BTreeSet<EdgeKey> {
            rules.closed.iter().chain(rules.blocked.iter().flat_map(|by| &by.edges)).copied().collect()
        };
        other.keep_out.iter().all(|(_, zone)| self.keep_out.iter().any(|(_, known)| known.corners == zone.corners))
            && edges(self).is_superset(&edges(other))
            && places(self).is_superset(&places(other))
    }

    /// How fast a robot may drive at a place, metres per second; none if nothing limits it.
    #[must_use]
    pub fn speed_limit_mps(&self, place: FixedPoint) -> Option<f64> {
        let limit = |zone: &Zone| match zone.rule {
            ZoneRule::SpeedLimit(mm_per_s) if zone.contains(place) => Some(f64::from(mm_per_s) * 1e-3),
            _ => None,
        };
        self.slow.iter().filter_map(|(_, zone)| limit(zone)).min_by(f64::total_cmp)
    }

    /// What a path obeys.
    #[must_use]
    pub fn obeyed(&self) -> Vec<Obeyed> {
        let zones = self.keep_out.iter().map(|(name, _)| Obeyed::KeepOut { zone: name.to_string() });
        let edges = self.closed.iter().map(|edge| Obeyed::ClosedEdge { edge: edge.to_texts() });
        let robots: BTreeSet<&String> = self.blocked.iter().map(|by| &by.robot).collect();
        let robots = robots.into_iter().map(|robot| Obeyed::Blocked { robot: robot.clone() });
        zones.chain(edges).chain(robots).collect()
    }

    /// Where a route must be driven slowly.
    #[must_use]
    pub fn speed_limits(&self, route: &NodeRoute) -> Vec<SpeedLimit> {
        let points: Vec<FixedPoint> = route.waypoints.iter().map(|waypoint| waypoint.point).collect();
        self.speed_limits_along(&points)
    }

    /// Where a way through these points must be driven slowly.
    #[must_use]
    pub fn speed_limits_along(&self, points: &[FixedPoint]) -> Vec<SpeedLimit> {
        let limits = self.slow.iter().flat_map(|(name, zone)| {
            let ZoneRule::SpeedLimit(mm_per_s) = zone.rule else { return Vec::new() };
            let limit = |along_m| SpeedLimit { zone: name.to_string(), max_mps: f64::from(mm_per_s) / 1000.0, along_m };
            inside(points, zone).into_iter().map(limit).collect()
        });
        let mut limits: Vec<SpeedLimit> = limits.collect();
        limits.sort_by(|a, b| a.along_m[0].total_cmp(&b.along_m[0]));
        limits
    }

    /// Plans from `from` to `to` through `space`, which must have been made of the same map with
    /// [`space_config`](Self::space_config).
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn plan(
        &self,
        graph: impl RouteGraph,
        space: &FreeSpace,
        from: FixedPoint,
        to: FixedPoint,
        config: &NodeRouteConfig,
    ) -> Result<NodeRoute, PlanError> {
        self.obeyed_by(to, config.ends, || shortest_path::plan(graph, space, from, to, config))
    }

    /// The same over nodes and edges alone: the route that people see on the map.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn plan_over_nodes(
        &self,
        graph: impl RouteGraph,
        space: &FreeSpace,
        from: FixedPoint,
        to: FixedPoint,
        config: &NodeRouteConfig,
    ) -> Result<NodeRoute, PlanError> {
        self.obeyed_by(to, config.ends, || shortest_path::plan_over_nodes(graph, space, from, to, config))
    }

    /// The same from one node to another.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn plan_between_nodes<G: RouteGraph>(
        &self,
        graph: G,
        space: &FreeSpace,
        ends: [G::Node; 2],
    ) -> Result<NodeRoute, PlanError> {
        let to = graph.point(ends[1]).map(|end| end.point).unwrap_or_default();
        self.obeyed_by(to, PathEnds::Known, || shortest_path::plan_between_nodes(graph, space, ends))
    }

    /// What is closed, for people who ask why there is no path: what robots found blocked first,
    /// since that is new and nobody may know of it, then edges, then zones.
    fn closed_in_words(&self) -> Vec<String> {
        let mut obeyed = self.obeyed();
        obeyed.sort_by_key(|rule| match rule {
            Obeyed::Blocked { .. } => 0,
            Obeyed::ClosedEdge { .. } => 1,
            Obeyed::KeepOut { .. } => 2,
        });
        let more = obeyed.len().saturating_sub(MOST_NAMED);
        let named = obeyed.iter().take(MOST_NAMED).map(in_words);
        named.chain((more > 0).then(|| format!("{more} more (rules)"))).collect()
    }

    fn obeyed_by(
        &self,
        to: FixedPoint,
        ends: PathEnds,
        plan: impl FnOnce() -> Result<NodeRoute, RouteError>,
    ) -> Result<NodeRoute, PlanError> {
        let zone = self.keep_out.iter().find(|(_, zone)| zone.contains(to));
        if let Some((zone, _)) = zone.filter(|_| ends != PathEnds::ToNearest) {
            return Err(PlanError::GoalKeptOut { goal: to, zone: zone.clone() });
        }
        plan().map_err(|route| {
            // What is closed has nothing to do with where the map ends.
            let is_far = matches!(route, RouteError::OutOfMap { .. });
            let closed = self.closed_in_words();
            if closed.is_empty() || is_far { PlanError::Route(route) } else { PlanError::Closed { route, closed } }
        })
    }
}

/// So many of the things that are closed are named when there is no path.
const MOST_NAMED: usize = 4;

fn in_words(obeyed: &Obeyed) -> String {
    match obeyed {
        Obeyed::KeepOut { zone } => format!("zone {zone}"),
        Obeyed::ClosedEdge { edge: [a, b] } => format!("edge {a} {b}"),
        Obeyed::Blocked { robot } => format!("what {robot} found blocked"),
    }
}

/// The parts of a way that lie in a zone: where they begin and end, metres along the way. To the
/// millimetre.
fn inside(points: &[FixedPoint], zone: &Zone) -> Vec<[f64; 2]> {
    let mut parts: Vec<[f64; 2]> = Vec::new();
    let mut gone_m = 0.0;
    for pair in points.windows(2) {
        let length_m = pair[0].distance(pair[1]);
        let mut shares: Vec<f64> = zone.sides().filter_map(|side| crossing((pair[0], pair[1]), side)).collect();
        shares.extend([0.0, 1.0]);
        shares.sort_by(f64::total_cmp);
        for share in shares.windows(2).filter(|share| share[1] > share[0]) {
            let at = |share: f64| {
                let between = |a: f64, b: f64| a + share * (b - a);
                FixedPoint::from_metres(between(pair[0].x(), pair[1].x()), between(pair[0].y(), pair[1].y()))
            };
            if !zone.contains(at(0.5 * (share[0] + share[1]))) {
                continue;
            }
            let round = |metres: f64| (metres * 1000.0).round() / 1000.0;
            let (begin, end) = (round(gone_m + share[0] * length_m), round(gone_m + share[1] * length_m));
            match parts.last_mut() {
                Some(last) if last[1] >= begin => last[1] = end,
                _ => parts.push([begin, end]),
            }
        }
        gone_m += length_m;
    }
    parts
}

/// Where a line is crossed by a side, as a share of the line.
fn crossing((a, b): (FixedPoint, FixedPoint), (c, d): (FixedPoint, FixedPoint)) -> Option<f64> {
    let (line, side) = ([b.x() - a.x(), b.y() - a.y()], [d.x() - c.x(), d.y() - c.y()]);
    let to_side = [c.x() - a.x(), c.y() - a.y()];
    let area = line[0] * side[1] - line[1] * side[0];
    if area == 0.0 {
        return None;
    }
    let along_line = (to_side[0] * side[1] - to_side[1] * side[0]) / area;
    let along_side = (to_side[0] * line[1] - to_side[1] * line[0]) / area;
    ((0.0..=1.0).contains(&along_line) && (0.0..=1.0).contains(&along_side)).then_some(along_line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{AuthorId, NodeId};

    #[test]
    fn of_much_that_is_closed_the_reports_are_named_first_and_the_rest_is_counted() {
        let corners = [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)].map(|(x, y)| FixedPoint::from_metres(x, y)).to_vec();
        let zone = |number: u32| {
            (
                format!("zone-{number}").parse().expect("a label"),
                Zone { rule: ZoneRule::KeepOut, corners: corners.clone() },
            )
        };
        let [a, b] = [1, 2].map(|number| NodeId { author: AuthorId(1), number });
        let blocked = |robot: &str| BlockedBy {
            robot: robot.to_owned(),
            edges: BTreeSet::from([EdgeKey::new(a, b)]),
            places: BTreeSet::new(),
        };
        let mut rules =
            Rules { keep_out: (0..8).map(zone).collect(), blocked: vec![blocked("amr-7")], ..Rules::default() };
        let refusal = |rules: &Rules| {
            let [from, to] = [FixedPoint::default(), FixedPoint::from_metres(9.0, 9.0)];
            let none = || Err(RouteError::no_path(from, to));
            rules.obeyed_by(to, PathEnds::Unknown, none).map_err(|error| error.to_string())
        };
        let said = refusal(&rules).expect_err("there is none");
        let expected =
            "; these are closed: what amr-7 found blocked, zone zone-0, zone zone-1, zone zone-2, 5 more (rules)";
        assert!(said.ends_with(expected), "{said}");
        rules.keep_out.truncate(3);
        let said = refusal(&rules).expect_err("there is none");
        assert!(said.ends_with("what amr-7 found blocked, zone zone-0, zone zone-1, zone zone-2"), "{said}");
    }

    #[test]
    fn a_way_is_slow_where_it_lies_in_the_zone() {
        let corners = [(1.0, -1.0), (2.0, -1.0), (2.0, 3.0), (1.0, 3.0)];
        let corners = corners.iter().map(|&(x, y)| FixedPoint::from_metres(x, y)).collect();
        let zone = Zone { rule: ZoneRule::SpeedLimit(300), corners };
        let way: Vec<FixedPoint> = [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (1.5, 2.0)]
            .iter()
            .map(|&(x, y)| FixedPoint::from_metres(x, y))
            .collect();
        assert_eq!(inside(&way, &zone), [[1.0, 2.0], [8.0, 8.5]]);
        assert_eq!(inside(&way[..1], &zone), [[0.0; 2]; 0]);
    }
}
