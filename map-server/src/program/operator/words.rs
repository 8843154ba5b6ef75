//! Replies as text.

use fht_proto::api::reply::{Head, MapsReply, ReleaseView, ReleasesReply, RuleView, RulesReply};
use std::time::{Duration, UNIX_EPOCH};

/// Why a release that is enabled is not used.
const NOT_USED: &str = "not used: not all of it is here, or its digest is wrong";

/// What robots use; `is_unused`: whether that is not the release which is enabled.
pub(super) fn use_in_words(enabled: Option<&str>, is_unused: bool) -> String {
    match enabled {
        None => "robots use the newest state".to_owned(),
        Some(release) if is_unused => format!("release {release} is enabled, but {NOT_USED}"),
        Some(release) => format!("robots use {release}"),
    }
}

/// So many of something, whose name only needs an `s` where there are several.
pub(super) fn counted(count: u64, one: &str) -> String {
    let end = if count == 1 { "" } else { "s" };
    format!("{count} {one}{end}")
}

pub(super) fn maps_in_words(reply: &MapsReply) -> String {
    if reply.maps.is_empty() {
        return "no maps yet".to_owned();
    }
    let line = |head: &Head| {
        if head.damaged {
            return format!("{}: damaged, and offline: see map-server check", head.map);
        }
        format!(
            "{}: version {}, {}, {}, {}, {}, {}, {} refused",
            head.map,
            head.version,
            counted(head.main_nodes as u64, "main node"),
            counted(head.support_nodes as u64, "support node"),
            counted(head.edges as u64, "edge"),
            counted(head.bytes, "byte"),
            use_in_words(head.enabled.as_deref(), head.enabled_unused),
            counted(head.refused, "increment")
        ) + &clock_in_words(head).map(|words| format!("; {words}")).unwrap_or_default()
            + &deletion_in_words(head)
    };
    reply.maps.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Whether the server answers, and what is wrong with it.
pub(super) fn health_in_words(reply: &MapsReply) -> String {
    let mut lines = vec![format!("the server answers; it has {}", counted(reply.maps.len() as u64, "map"))];
    lines.extend(reply.read_only.iter().map(|reason| {
        format!("its disk cannot be written, so that it takes nothing in and tries again by itself: {reason}")
    }));
    lines.extend(reply.warning.clone());
    let damaged = reply.maps.iter().filter(|head| head.damaged);
    lines.extend(damaged.map(|head| format!("map {} is damaged, and offline: see map-server check", head.map)));
    let clocks = reply.maps.iter().filter_map(|head| Some(format!("map {}: {}", head.map, clock_in_words(head)?)));
    lines.extend(clocks);
    lines.join("\n")
}

/// That a map was written with a clock that is ahead of this machine's, if by more than a writer
/// may be.
fn clock_in_words(head: &Head) -> Option<String> {
    /// No difference between two machines that set their clocks.
    const MUCH: Duration = Duration::from_secs(60);
    let ahead = Duration::from_micros(head.clock_us).checked_sub(UNIX_EPOCH.elapsed().ok()?)?;
    let ahead = Duration::from_secs(ahead.as_secs());
    let words = || {
        format!(
            "its newest change is stamped {} ahead of this machine's clock, and later ones go on from there",
            humantime::format_duration(ahead)
        )
    };
    (ahead > MUCH).then(words)
}

fn deletion_in_words(head: &Head) -> String {
    head.deletion.as_ref().map(|deletion| format!("; {}", deletion.sentence(&head.map))).unwrap_or_default()
}

pub(super) fn releases_in_words(reply: &ReleasesReply) -> String {
    if reply.releases.is_empty() {
        return format!("map {} (version {}) has no releases; robots use its newest state", reply.map, reply.version);
    }
    let line = |release: &ReleaseView| {
        let mark = if release.enabled { "ENABLED" } else { "" };
        let lack = if release.available { "" } else { NOT_USED };
        let line = format!("{}@{}  version {:<6} {mark} {lack}", release.name, release.author, release.version);
        line.trim_end().to_owned()
    };
    reply.releases.iter().map(line).collect::<Vec<_>>().join("\n")
}

pub(super) fn rules_in_words(reply: &RulesReply) -> String {
    let places = reply.places.iter().map(|place| {
        let [x, y, yaw] = place.pose;
        format!("place {} at {x:.2},{y:.2}, {:.0}°", place.name, yaw.to_degrees())
    });
    let zones = reply.zones.iter().map(|zone| {
        let rule = match zone.rule {
            RuleView::KeepOut => "keep out".to_owned(),
            RuleView::SpeedLimit(mps) => format!("at most {mps} m/s"),
        };
        let corners: Vec<String> = zone.corners.iter().map(|[x, y]| format!("{x},{y}")).collect();
        format!("zone {}: {rule}, corners {}", zone.name, corners.join(" "))
    });
    let edges = reply.closed_edges.iter().map(|[a, b]| format!("edge {a} {b}: closed"));
    let blocked = reply.blocked.iter().map(|by| {
        let (edges, places) = (by.edges.len(), by.places.len());
        let (edges, places) = (counted(edges as u64, "edge"), counted(places as u64, "place"));
        format!("{} found {edges} and {places} blocked, for {:.0} s more", by.robot, by.for_s)
    });
    let plan = reply.floor_plan.iter().map(|plan| {
        let [x, y, yaw] = plan.map_from_image;
        let (image, scale, yaw_deg) = (&plan.image, plan.metres_per_pixel, yaw.to_degrees());
        format!("floor plan {image}: {scale} m a pixel, lower left corner at {x:.2},{y:.2}, {yaw_deg:.1}°")
    });
    let datum = reply.datum.iter().map(|datum| {
        let (latitude, longitude, yaw_deg) = (datum.latitude, datum.longitude, datum.yaw.to_degrees());
        format!("the origin is at latitude {latitude}, longitude {longitude}; x points {yaw_deg:.1}° from east")
    });
    let lines: Vec<String> = places.chain(zones).chain(edges).chain(blocked).chain(plan).chain(datum).collect();
    if lines.is_empty() { format!("map {} has no places, zones or closed edges", reply.map) } else { lines.join("\n") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_a_map_lies_is_told() {
        let reply = serde_json::from_str::<RulesReply>(
            r#"{"map": "m", "version": 1, "places": [], "zones": [], "closed_edges": [], "blocked": [],
                "floor_plan": {"image": "a.png", "metres_per_pixel": 0.05, "map_from_image": [-12.5, -8, 1.5708]},
                "datum": {"latitude": 52.5186, "longitude": -13.3973, "yaw": 0.7854}}"#,
        );
        let words = reply.map(|reply| rules_in_words(&reply)).unwrap_or_else(|error| error.to_string());
        assert_eq!(
            words,
            "floor plan a.png: 0.05 m a pixel, lower left corner at -12.50,-8.00, 90.0°\n\
             the origin is at latitude 52.5186, longitude -13.3973; x points 45.0° from east"
        );
    }

    #[test]
    fn one_is_told_as_one() {
        let said = [0, 1, 2].map(|count| counted(count, "increment"));
        assert_eq!(said, ["0 increments", "1 increment", "2 increments"]);
        let reply = |maps: &str| serde_json::from_str::<MapsReply>(&format!(r#"{{"maps": [{maps}]}}"#));
        assert!(reply("").is_ok_and(|reply| health_in_words(&reply) == "the server answers; it has 0 maps"));
    }
}
