//! What robots found blocked, for as long as their reports hold. Servers and robots alike keep it.
//!
//! A report closes ground for everybody, and any robot may put one: so it holds for minutes, a
//! robot closes a few things near each other, and its reports end when it goes. What is to be
//! closed for longer, operators close ([`Reports::keep`], or closures and zones in the map), and
//! they open what was reported wrongly ([`Reports::clear`]).

use crate::crdt::state::MapState;
pub use crate::plan::report_limits::{ReportLimits, ReportRefused, Reporter};
use fht_proto::api::fleet::BlockedReport;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use std::collections::{BTreeMap, BTreeSet};

/// What one robot found blocked.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockedBy {
    /// The robot.
    pub robot: String,
    /// Edges.
    pub edges: BTreeSet<EdgeKey>,
    /// Places, map frame.
    pub places: BTreeSet<FixedPoint>,
}

/// The first node at an end of `edges` that neither of two states of a map has: the newest, and the
/// one that robots use. What is not there cannot be blocked.
#[must_use]
pub fn missing_node(edges: &[EdgeKey], [newest, running]: [&MapState; 2]) -> Option<NodeId> {
    let is_there = |id: NodeId| newest.node(id).or_else(|| running.node(id)).is_some();
    edges.iter().flat_map(|edge| [edge.low(), edge.high()]).find(|id| !is_there(*id))
}

/// The middles of `edges`, as one of two states of a map has them.
#[must_use]
pub fn middles(edges: &[EdgeKey], [newest, running]: [&MapState; 2]) -> Vec<FixedPoint> {
    let place = |id: NodeId| newest.node(id).or_else(|| running.node(id)).map(|node| node.pose.position);
    let middle = |edge: &EdgeKey| {
        let (a, b) = (place(edge.low())?, place(edge.high())?);
        Some(FixedPoint::from_metres((a.x() + b.x()) / 2.0, (a.y() + b.y()) / 2.0))
    };
    edges.iter().filter_map(middle).collect()
}

/// One report that holds.
#[derive(Clone, Debug)]
struct Held {
    until_us: u64,
    by: BlockedBy,
    /// Its middle, if that is known.
    middle: Option<FixedPoint>,
    /// Whether an operator has said that it holds, whatever its robot says or does.
    is_kept: bool,
}

impl Held {
    fn things(&self) -> usize {
        self.by.edges.len() + self.by.places.len()
    }
}

/// The reports that hold. Times are the keeper's own, microseconds; they must not go back.
#[derive(Clone, Debug, Default)]
pub struct Reports {
    limits: ReportLimits,
    by_robot: BTreeMap<String, Vec<Held>>,
    /// Robots whose reports do not count, until when.
    ignored: BTreeMap<String, u64>,
    changes: u64,
}

fn micros(seconds: f64) -> u64 {
    (seconds.max(0.0) * 1e6) as u64 // saturates
}

/// The middle of points, and how far the farthest lies from it, metres.
fn extent(points: &[FixedPoint]) -> Option<(FixedPoint, f64)> {
    let count = points.len() as f64;
    let mean = |of: fn(FixedPoint) -> f64| points.iter().copied().map(of).sum::<f64>() / count;
    let middle = (!points.is_empty()).then(|| FixedPoint::from_metres(mean(FixedPoint::x), mean(FixedPoint::y)))?;
    Some((middle, points.iter().map(|point| apart_m(*point, middle)).fold(0.0, f64::max)))
}

fn apart_m(a: FixedPoint, b: FixedPoint) -> f64 {
    (a.x() - b.x()).hypot(a.y() - b.y())
}

impl Reports {
    /// Nothing is reported yet.
    #[must_use]
    pub fn new(limits: ReportLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// Takes a report of `robot` that arrived at `now_us`; `middles` are those of its edges, as far
    /// as they are known. What the robot says again holds anew; a report without edges and places
    /// takes its earlier ones back.
    ///
    /// # Errors
    /// [`ReportRefused`]; what the robot reported before stays as it is.
    pub fn take(
        &mut self,
        robot: &str,
        reporter: Reporter,
        report: &BlockedReport,
        middles: &[FixedPoint],
        now_us: u64,
    ) -> Result<(), ReportRefused> {
        use fht_proto::model::validate::Validate;
        report.validate()?;
        self.expire(now_us);
        if let Some(until_us) = self.ignored.get(robot) {
            let for_s = until_us.saturating_sub(now_us) as f64 * 1e-6;
            return Err(ReportRefused::Ignored { robot: robot.to_owned(), for_s });
        }
        if report.edges.is_empty() && report.places.is_empty() {
            self.withdraw(robot);
            return Ok(());
        }
        let edges = report.edge_keys()?.into_iter().collect();
        let places: BTreeSet<_> = report.places.iter().map(|&[x, y]| FixedPoint::from_metres(x, y)).collect();
        let points: Vec<_> = places.iter().chain(middles).copied().collect();
        let extent = extent(&points);
        let max_s = match reporter {
            Reporter::Robot { has_token: true } => self.limits.max_s,
            Reporter::Robot { has_token: false } => self.limits.without_token_max_s,
            Reporter::Trusted => f64::INFINITY,
        };
        let held = Held {
            until_us: now_us.saturating_add(micros(report.for_s.min(max_s))),
            by: BlockedBy { robot: robot.to_owned(), edges, places },
            middle: extent.map(|(middle, _)| middle),
            is_kept: false,
        };
        if reporter != Reporter::Trusted {
            self.check(&held, extent)?;
        }
        self.hold(robot, held, reporter == Reporter::Trusted);
        Ok(())
    }

    fn check(&self, held: &Held, extent: Option<(FixedPoint, f64)>) -> Result<(), ReportRefused> {
        let (things, limits) = (held.things(), &self.limits);
        if things > limits.max_things {
            return Err(ReportRefused::TooMany { things, limit: limits.max_things });
        }
        if let Some((_, distance_m)) = extent.filter(|(_, distance_m)| *distance_m > limits.radius_m) {
            return Err(ReportRefused::TooWide { distance_m, limit_m: limits.radius_m });
        }
        let others = self.by_robot.iter().filter(|(robot, _)| **robot != held.by.robot);
        let of_others: usize = others.flat_map(|(_, of_robot)| of_robot).map(Held::things).sum();
        match of_others + things > limits.max_things_on_map {
            true => Err(ReportRefused::Full { limit: limits.max_things_on_map }),
            false => Ok(()),
        }
    }

    /// Holds a report, and drops what its robot said before that is said anew, too far away, or too
    /// much.
    fn hold(&mut self, robot: &str, held: Held, is_trusted: bool) {
        let (max_things, radius_m) = (self.limits.max_things, self.limits.radius_m);
        let of_robot = self.by_robot.entry(robot.to_owned()).or_default();
        of_robot.retain(|earlier| {
            let is_same = earlier.by == held.by;
            let is_near = match (earlier.middle, held.middle) {
                (Some(a), Some(b)) => apart_m(a, b) <= radius_m,
                _ => true,
            };
            earlier.is_kept || (!is_same && (is_near || is_trusted))
        });
        of_robot.push(held);
        let mut things = 0;
        let mut stays: Vec<bool> = Vec::with_capacity(of_robot.len());
        for earlier in of_robot.iter().rev() {
            things += if earlier.is_kept { 0 } else { earlier.things() };
            stays.push(earlier.is_kept || is_trusted || things <= max_things);
        }
        let mut stays = stays.into_iter().rev();
        of_robot.retain(|_| stays.next().unwrap_or(true));
        let surplus = of_robot.len().saturating_sub(Self::MAX_OF_ONE);
        of_robot.drain(..surplus);
        self.changes += 1;
    }

    /// Reports of one author that are kept; the newest stay.
    const MAX_OF_ONE: usize = 64;

    fn withdraw(&mut self, robot: &str) {
        let Some(of_robot) = self.by_robot.get_mut(robot) else { return };
        of_robot.retain(|held| held.is_kept);
        self.changes += 1;
        self.by_robot.retain(|_, of_robot| !of_robot.is_empty());
    }

    /// A robot's liveliness token has gone: its reports do not hold for much longer.
    pub fn robot_has_gone(&mut self, robot: &str, now_us: u64) {
        let until_us = now_us.saturating_add(micros(self.limits.without_token_max_s));
        for held in self.by_robot.get_mut(robot).into_iter().flatten().filter(|held| !held.is_kept) {
            held.until_us = held.until_us.min(until_us);
        }
    }

    /// Operators open what `robot`, or everybody, has reported, and let the robot's reports not
    /// count for `ignore_s` seconds. How many reports there were; that the robot's did not count so
    /// far is one more.
    pub fn clear(&mut self, robot: Option<&str>, ignore_s: f64, now_us: u64) -> usize {
        self.expire(now_us);
        let is_meant = |name: &String| robot.is_none_or(|robot| robot == name);
        let mut cleared = self.by_robot.iter().filter(|(name, _)| is_meant(name)).map(|(_, held)| held.len()).sum();
        self.by_robot.retain(|name, _| !is_meant(name));
        if let Some(robot) = robot {
            cleared += usize::from(self.ignored.remove(robot).is_some());
            if ignore_s > 0.0 && self.ignored.len() < Self::MAX_IGNORED {
                self.ignored.insert(robot.to_owned(), now_us.saturating_add(micros(ignore_s)));
            }
        }
        self.changes += 1;
        cleared
    }

    /// Robots whose reports may be set not to count at a time.
    const MAX_IGNORED: usize = 1024;

    /// An operator has the reports of `robot` hold for `for_s` seconds, whatever the robot says or
    /// does. How many there are.
    pub fn keep(&mut self, robot: &str, for_s: f64, now_us: u64) -> usize {
        self.expire(now_us);
        let Some(of_robot) = self.by_robot.get_mut(robot) else { return 0 };
        for held in of_robot.iter_mut() {
            (held.until_us, held.is_kept) = (now_us.saturating_add(micros(for_s)), true);
        }
        self.changes += 1;
        of_robot.len()
    }

    fn expire(&mut self, now_us: u64) {
        let count = |of: &BTreeMap<String, Vec<Held>>| of.values().map(Vec::len).sum::<usize>();
        let before = count(&self.by_robot);
        self.by_robot.values_mut().for_each(|of_robot| of_robot.retain(|held| held.until_us > now_us));
        self.by_robot.retain(|_, of_robot| !of_robot.is_empty());
        self.ignored.retain(|_, until_us| *until_us > now_us);
        self.changes += u64::from(count(&self.by_robot) != before);
    }

    /// What counts as blocked at `now_us`, by robot, with the time until when.
    pub fn at(&mut self, now_us: u64) -> impl Iterator<Item = (u64, &BlockedBy)> {
        self.expire(now_us);
        self.by_robot.values().flatten().map(|held| (held.until_us, &held.by))
    }

    /// The robots whose reports do not count at `now_us`, with the time until when.
    pub fn ignored(&mut self, now_us: u64) -> impl Iterator<Item = (u64, &str)> {
        self.expire(now_us);
        self.ignored.iter().map(|(robot, until_us)| (*until_us, robot.as_str()))
    }

    /// A number that changes whenever what is blocked at `now_us` does.
    pub fn changes(&mut self, now_us: u64) -> u64 {
        self.expire(now_us);
        self.changes
    }

    /// How much robots may close.
    #[must_use]
    pub fn limits(&self) -> &ReportLimits {
        &self.limits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    const SECOND: u64 = 1_000_000;
    const THERE: Reporter = Reporter::Robot { has_token: true };

    fn report(for_s: f64, x: f64) -> BlockedReport {
        BlockedReport { for_s, edges: Vec::new(), places: vec![[x, 0.0]] }
    }

    fn take(reports: &mut Reports, robot: &str, report: &BlockedReport, now_us: u64) -> Result<(), ReportRefused> {
        reports.take(robot, THERE, report, &[], now_us)
    }

    #[test]
    fn a_report_holds_for_as_long_as_it_says() -> Result<(), ReportRefused> {
        let mut reports = Reports::default();
        take(&mut reports, "r1", &report(10.0, 1.0), 0)?;
        take(&mut reports, "r2", &report(30.0, 2.0), 0)?;
        let first = reports.changes(9 * SECOND);
        assert_eq!(reports.at(9 * SECOND).count(), 2);
        assert_eq!(reports.at(11 * SECOND).map(|(_, it)| it.robot.as_str()).collect::<Vec<_>>(), ["r2"]);
        assert_ne!(reports.changes(11 * SECOND), first);
        take(&mut reports, "r2", &report(30.0, 2.0), 20 * SECOND)?;
        assert_eq!(reports.at(40 * SECOND).count(), 1, "said again");
        take(&mut reports, "r2", &BlockedReport::default(), 41 * SECOND)?;
        assert_eq!(reports.at(41 * SECOND).count(), 0, "taken back");
        assert!(take(&mut reports, "r1", &report(f64::NAN, 1.0), 0).is_err());
        Ok(())
    }

    #[test]
    fn a_robot_closes_little_and_not_for_long() -> Result<(), ReportRefused> {
        let limits = ReportLimits { max_things: 3, ..ReportLimits::default() };
        let mut reports = Reports::new(limits);
        take(&mut reports, "r", &report(86_400.0, 0.0), 0)?;
        assert_eq!(reports.at(599 * SECOND).count(), 1);
        assert_eq!(reports.at(601 * SECOND).count(), 0, "ten minutes are the most");
        let absent = Reporter::Robot { has_token: false };
        reports.take("r", absent, &report(86_400.0, 0.0), &[], 0)?;
        assert_eq!(reports.at(61 * SECOND).count(), 0, "a robot that is not there closes nothing for long");
        for x in 0..5 {
            take(&mut reports, "r", &report(60.0, f64::from(x)), 0)?;
        }
        let xs = |reports: &mut Reports| {
            reports.at(0).map(|(_, by)| by.places.first().map_or(-1.0, |place| place.x())).collect::<Vec<_>>()
        };
        assert_eq!(xs(&mut reports), [2.0, 3.0, 4.0], "the newest stay");
        take(&mut reports, "r", &report(60.0, 100.0), 0)?;
        assert_eq!(xs(&mut reports), [100.0], "and what lies near them");
        let wide = BlockedReport { for_s: 60.0, edges: Vec::new(), places: vec![[0.0, 0.0], [80.0, 0.0]] };
        assert!(matches!(take(&mut reports, "r", &wide, 0), Err(ReportRefused::TooWide { .. })));
        let many =
            BlockedReport { for_s: 60.0, edges: Vec::new(), places: (0..4).map(|x| [f64::from(x), 0.0]).collect() };
        assert!(matches!(take(&mut reports, "r", &many, 0), Err(ReportRefused::TooMany { .. })));
        assert_eq!(xs(&mut reports), [100.0], "what is refused changes nothing");
        Ok(())
    }

    #[test]
    fn a_robot_that_goes_takes_its_reports_along_and_an_operator_may_keep_them() -> Result<(), ReportRefused> {
        let mut reports = Reports::default();
        for robot in ["gone", "kept"] {
            take(&mut reports, robot, &report(600.0, 0.0), 0)?;
        }
        assert_eq!(reports.keep("kept", 3600.0, 0), 1);
        for robot in ["gone", "kept"] {
            reports.robot_has_gone(robot, 0);
        }
        let who =
            |reports: &mut Reports, at_s| reports.at(at_s * SECOND).map(|(_, by)| by.robot.clone()).collect::<Vec<_>>();
        assert_eq!(who(&mut reports, 61), ["kept"]);
        take(&mut reports, "kept", &BlockedReport::default(), 62 * SECOND)?;
        assert_eq!(who(&mut reports, 63), ["kept"], "it cannot take back what an operator keeps");
        assert_eq!(reports.clear(Some("kept"), 60.0, 64 * SECOND), 1);
        assert!(who(&mut reports, 65).is_empty());
        assert_eq!(reports.ignored(65 * SECOND).collect::<Vec<_>>(), [(124 * SECOND, "kept")]);
        let ignored = take(&mut reports, "kept", &report(60.0, 0.0), 66 * SECOND);
        assert!(matches!(ignored, Err(ReportRefused::Ignored { .. })), "{ignored:?}");
        take(&mut reports, "kept", &report(60.0, 0.0), 125 * SECOND)?;
        assert_eq!(reports.clear(None, 0.0, 126 * SECOND), 1);
        Ok(())
    }

    #[test]
    fn nobody_fills_the_memory() {
        let mut reports = Reports::default();
        for robot in 0..10_000 {
            let _ = take(&mut reports, &format!("r{robot}"), &report(60.0, 1.0), 0);
        }
        for x in 0..1000 {
            let _ = reports.take("desk", Reporter::Trusted, &report(60.0, f64::from(x)), &[], 0);
        }
        assert_eq!(reports.at(0).count(), ReportLimits::default().max_things_on_map + Reports::MAX_OF_ONE);
    }
}
