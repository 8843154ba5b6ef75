//! `rules` and `fleet`: what operators look after.

use crate::catalog::MapView;
use crate::query::active_rules::ActiveRules;
use crate::query::answer::reply::{Answer, json};
use crate::query::fleet::Fleet;
use fht_map::MapState;
use fht_proto::api::reply::{DatumView, ErrorReply, FloorPlanView, PlaceView, RulesReply, ZoneView};
use fht_proto::{MapName, RobotName};

pub(super) fn rules(view: &MapView, active: &ActiveRules, now_us: u64) -> Result<Answer, ErrorReply> {
    let map = &view.head.map;
    json(&RulesReply {
        blocked: active.blocked(map, now_us),
        ignored: active.ignored(map, now_us),
        ..written_rules(&view.state, map, view.head.version)
    })
}

/// What operators have written on a state of a map, without what robots report.
pub(crate) fn written_rules(state: &MapState, map: &MapName, version: u64) -> RulesReply {
    let annotations = state.annotations();
    let places = annotations.places().map(|(name, pose)| PlaceView {
        name: name.to_string(),
        pose: [pose.position.x(), pose.position.y(), pose.yaw()],
    });
    let zones = annotations.zones().map(|(name, zone)| ZoneView {
        name: name.to_string(),
        rule: zone.rule.into(),
        corners: zone.corners.iter().map(|corner| [corner.x(), corner.y()]).collect(),
    });
    RulesReply {
        map: map.clone(),
        version,
        places: places.collect(),
        zones: zones.collect(),
        closed_edges: state.closed_edges().map(|edge| edge.to_texts()).collect(),
        floor_plan: annotations.floor_plan().map(FloorPlanView::from),
        datum: annotations.datum().map(DatumView::from),
        blocked: Vec::new(),
        ignored: Vec::new(),
    }
}

/// The robots after one, so many at most.
pub(super) fn fleet(
    view: &MapView,
    fleet: &Fleet,
    (limit, after): (usize, Option<&RobotName>),
    now_us: u64,
) -> Result<Answer, ErrorReply> {
    json(&fleet.page(&view.head, limit, after.map_or("", RobotName::as_str), now_us))
}
