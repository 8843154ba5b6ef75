//! Whether a path that somebody else planned keeps what operators have closed. A robot hears of a
//! zone from the operator that draws it, as the server does: the server's answer may be of the
//! moment before.

use crate::navmesh::plane::from_segment_m;
use crate::plan::rules::Rules;
use fht_proto::api::reply::Obeyed;
use fht_proto::{FixedPoint, Zone};
use std::collections::BTreeSet;

/// Between two looks along the path, metres.
const STEP_M: f64 = 0.05;
/// Paths run along the borders of zones, rounded: only what lies this far within counts, metres.
const WITHIN_M: f64 = 0.05;

impl Rules {
    /// Whether a path keeps what operators have closed here: its planner knew of all zones and
    /// closed edges (`obeyed` is what it says it obeys), and it leads through no zone to keep out
    /// of. It may begin in one, and leads out of it then. `way` is the path's points, map frame.
    /// Which of robots' reports count is for the server to say.
    #[must_use]
    pub fn are_kept_by(&self, obeyed: &[Obeyed], way: &[FixedPoint]) -> bool {
        let known: BTreeSet<&Obeyed> = obeyed.iter().collect();
        let is_known = |rule: &Obeyed| matches!(rule, Obeyed::Blocked { .. }) || known.contains(rule);
        if !self.obeyed().iter().all(is_known) {
            return false;
        }
        let is_closed = |at: FixedPoint| self.keep_out.iter().any(|(_, zone)| is_within(zone, at));
        !looks_along(way).skip_while(|at| is_closed(*at)).any(is_closed)
    }
}

fn is_within(zone: &Zone, at: FixedPoint) -> bool {
    zone.contains(at) && zone.sides().all(|(a, b)| from_segment_m(at, a, b) > WITHIN_M)
}

fn looks_along(way: &[FixedPoint]) -> impl Iterator<Item = FixedPoint> + '_ {
    let between = way.windows(2).flat_map(|pair| {
        let (a, b) = (pair[0], pair[1]);
        let steps = (a.distance(b) / STEP_M).ceil().max(1.0) as u64;
        (0..steps).map(move |step| {
            let share = step as f64 / steps as f64;
            FixedPoint::from_metres(a.x() + share * (b.x() - a.x()), a.y() + share * (b.y() - a.y()))
        })
    });
    between.chain(way.last().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::blocked::BlockedBy;
    use fht_proto::ZoneRule;

    fn points(places: &[(f64, f64)]) -> Vec<FixedPoint> {
        places.iter().map(|&(x, y)| FixedPoint::from_metres(x, y)).collect()
    }

    fn rules(corners: &[(f64, f64)]) -> Rules {
        let zone = Zone { rule: ZoneRule::KeepOut, corners: points(corners) };
        let name = "door".parse().unwrap_or_else(|error| panic!("{error}"));
        Rules { keep_out: vec![(name, zone)], ..Rules::default() }
    }

    const DOOR: [(f64, f64); 4] = [(2.0, -1.0), (3.0, -1.0), (3.0, 1.0), (2.0, 1.0)];

    #[test]
    fn a_planner_that_does_not_know_of_a_zone_keeps_no_rules() {
        let rules = rules(&DOOR);
        let aside = points(&[(0.0, 5.0), (5.0, 5.0)]);
        assert!(!rules.are_kept_by(&[], &aside) && rules.are_kept_by(&rules.obeyed(), &aside));
        let more = [rules.obeyed(), vec![Obeyed::Blocked { robot: "tug".to_owned() }]].concat();
        assert!(rules.are_kept_by(&more, &aside), "it knows more");
    }

    #[test]
    fn a_zone_that_was_drawn_anew_is_seen_on_the_way() {
        let rules = rules(&DOOR);
        let is_kept = |way: &[(f64, f64)]| rules.are_kept_by(&rules.obeyed(), &points(way));
        assert!(!is_kept(&[(0.0, 0.0), (5.0, 0.0)]), "through it");
        assert!(is_kept(&[(0.0, 0.0), (2.0, 1.0), (3.0, 1.0), (5.0, 0.0)]), "along its border");
        assert!(is_kept(&[(2.5, 0.0), (2.5, 1.2), (5.0, 1.2)]), "out of it");
        assert!(!is_kept(&[(2.5, 0.0), (2.5, 1.2), (2.2, 0.0)]), "and not into it again");
        assert!(is_kept(&[]));
    }

    #[test]
    fn which_reports_count_is_the_servers_word() {
        let places = BTreeSet::from([FixedPoint::from_metres(2.0, 0.0)]);
        let blocked = vec![BlockedBy { robot: "tug".to_owned(), edges: BTreeSet::new(), places }];
        let rules = Rules { blocked, ..rules(&DOOR) };
        let known = [Obeyed::KeepOut { zone: "door".to_owned() }];
        assert!(rules.are_kept_by(&known, &points(&[(0.0, 5.0), (5.0, 5.0)])));
    }
}
