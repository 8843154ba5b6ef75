//! What robots found blocked, for as long as their reports hold. Servers and robots alike keep it.

use crate::crdt::state::MapState;
use fht_proto::api::fleet::BlockedReport;
use fht_proto::{EdgeKey, FixedPoint, Invalid, NodeId};
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

/// The reports that hold. Times are the keeper's own, microseconds; they must not go back.
#[derive(Clone, Debug, Default)]
pub struct Reports {
    by_robot: BTreeMap<String, Vec<(u64, BlockedBy)>>,
    changes: u64,
}

impl Reports {
    /// Robots whose reports are kept. Names are free to invent.
    const MAX_ROBOTS: usize = 1024;
    /// Reports of one robot that are kept; the newest stay.
    const MAX_OF_ONE: usize = 64;

    /// Takes a report of `robot` that arrived at `now_us`.
    ///
    /// # Errors
    /// What is wrong with the report.
    pub fn take(&mut self, robot: &str, report: &BlockedReport, now_us: u64) -> Result<(), Invalid> {
        use fht_proto::model::validate::Validate;
        report.validate()?;
        self.expire(now_us);
        if report.edges.is_empty() && report.places.is_empty() {
            self.changes += u64::from(self.by_robot.remove(robot).is_some());
            return Ok(());
        }
        let edges = report.edge_keys()?.into_iter().collect();
        let places = report.places.iter().map(|&[x, y]| FixedPoint::from_metres(x, y)).collect();
        if self.by_robot.len() >= Self::MAX_ROBOTS && !self.by_robot.contains_key(robot) {
            return Ok(());
        }
        let until_us = now_us.saturating_add((report.for_s * 1e6) as u64); // saturates
        let of_robot = self.by_robot.entry(robot.to_owned()).or_default();
        // What it says again, it says anew.
        of_robot.retain(|(_, earlier)| earlier.edges != edges || earlier.places != places);
        of_robot.push((until_us, BlockedBy { robot: robot.to_owned(), edges, places }));
        let surplus = of_robot.len().saturating_sub(Self::MAX_OF_ONE);
        of_robot.drain(..surplus);
        self.changes += 1;
        Ok(())
    }

    fn expire(&mut self, now_us: u64) {
        let count = |of: &BTreeMap<String, Vec<(u64, BlockedBy)>>| of.values().map(Vec::len).sum::<usize>();
        let before = count(&self.by_robot);
        self.by_robot.values_mut().for_each(|of_robot| of_robot.retain(|(until_us, _)| *until_us > now_us));
        self.by_robot.retain(|_, of_robot| !of_robot.is_empty());
        self.changes += u64::from(count(&self.by_robot) != before);
    }

    /// What counts as blocked at `now_us`, by robot, with the time until when.
    pub fn at(&mut self, now_us: u64) -> impl Iterator<Item = (u64, &BlockedBy)> {
        self.expire(now_us);
        self.by_robot.values().flatten().map(|(until_us, blocked)| (*until_us, blocked))
    }

    /// A number that changes whenever what is blocked at `now_us` does.
    pub fn changes(&mut self, now_us: u64) -> u64 {
        self.expire(now_us);
        self.changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    const SECOND: u64 = 1_000_000;

    fn report(for_s: f64, x: f64) -> BlockedReport {
        BlockedReport { for_s, edges: Vec::new(), places: vec![[x, 0.0]] }
    }

    #[test]
    fn a_report_holds_for_as_long_as_it_says() -> Result<(), Invalid> {
        let mut reports = Reports::default();
        reports.take("r1", &report(10.0, 1.0), 0)?;
        reports.take("r2", &report(30.0, 2.0), 0)?;
        let first = reports.changes(9 * SECOND);
        assert_eq!(reports.at(9 * SECOND).count(), 2);
        assert_eq!(reports.at(11 * SECOND).map(|(_, it)| it.robot.as_str()).collect::<Vec<_>>(), ["r2"]);
        assert_ne!(reports.changes(11 * SECOND), first);
        reports.take("r2", &report(30.0, 2.0), 20 * SECOND)?;
        assert_eq!(reports.at(40 * SECOND).count(), 1, "said again");
        reports.take("r2", &BlockedReport::default(), 41 * SECOND)?;
        assert_eq!(reports.at(41 * SECOND).count(), 0, "taken back");
        assert!(reports.take("r1", &report(f64::NAN, 1.0), 0).is_err());
        Ok(())
    }

    #[test]
    fn nobody_fills_the_memory() -> Result<(), Invalid> {
        let mut reports = Reports::default();
        for robot in 0..2 * Reports::MAX_ROBOTS {
            reports.take(&format!("r{robot}"), &report(60.0, 1.0), 0)?;
        }
        for x in 0..1000 {
            reports.take("r1", &report(60.0, f64::from(x)), 0)?;
        }
        assert_eq!(reports.at(0).count(), Reports::MAX_ROBOTS + Reports::MAX_OF_ONE - 1);
        Ok(())
    }
}
