//! `rules` and `fleet`: what operators look after.

use crate::catalog::MapView;
use crate::query::active_rules::ActiveRules;
use crate::query::answer::reply::{Answer, json};
use crate::query::fleet::Fleet;
use fht_proto::RobotName;
use fht_proto::api::reply::{ErrorReply, PlaceView, RulesReply, ZoneView};

pub(super) fn rules(view: &MapView, active: &ActiveRules, now_us: u64) -> Result<Answer, ErrorReply> {
    let annotations = view.state.annotations();
    let places = annotations.places().map(|(name, pose)| PlaceView {
        name: name.to_string(),
        pose: [pose.position.x(), pose.position.y(), pose.yaw()],
    });
    let zones = annotations.zones().map(|(name, zone)| ZoneView {
        name: name.to_string(),
        rule: zone.rule.into(),
        corners: zone.corners.iter().map(|corner| [corner.x(), corner.y()]).collect(),
    });
    let closed = view.state.closed_edges().map(|edge| edge.to_texts());
    json(&RulesReply {
        map: view.head.map.clone(),
        version: view.head.version,
        places: places.collect(),
        zones: zones.collect(),
        closed_edges: closed.collect(),
        blocked: active.blocked(&view.head.map, now_us),
        ignored: active.ignored(&view.head.map, now_us),
    })
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
