//! What is closed on the maps now: by operators, whose rules are in the maps, and by robots that
//! found something blocked, which expires.

use crate::catalog::{MapView, PlanningState};
use fht_map::Rules;
use fht_map::plan::blocked::Reports;
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::reply::BlockedView;
use fht_proto::{Digest, EdgeKey, Invalid, MapName, ReleaseId};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What is closed on one map.
#[derive(Debug, Default)]
struct MapRules {
    reports: Reports,
    /// The rules, with the version and the state of the reports that they were derived from.
    rules: Option<(u64, u64, Arc<Rules>)>,
}

/// A state that robots do not run: a release, or the newest. Two releases may have the same state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherState {
    /// The map.
    pub map: MapName,
    /// The release; none for the newest state.
    pub release: Option<ReleaseId>,
    /// Its digest.
    pub digest: Digest,
}

/// What is closed on all maps.
#[derive(Debug, Default)]
pub struct ActiveRules {
    maps: Mutex<BTreeMap<MapName, MapRules>>,
    /// States that robots do not run and that somebody asked for paths on, the latest question
    /// last.
    others: Mutex<VecDeque<(OtherState, Arc<PlanningState>)>>,
}

/// How many such states are kept.
const MAX_OTHERS: usize = 4;

impl ActiveRules {
    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<MapName, MapRules>> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a robot's report that arrived at `now_us`. Callers drop reports on unknown maps.
    ///
    /// # Errors
    /// What is wrong with the report.
    pub fn take_report(&self, map: &MapName, robot: &str, report: &BlockedReport, now_us: u64) -> Result<(), Invalid> {
        self.lock().entry(map.clone()).or_default().reports.take(robot, report, now_us)
    }

    /// The rules of a map at `now_us`.
    #[must_use]
    pub fn rules(&self, view: &MapView, now_us: u64) -> Arc<Rules> {
        if let Some(rules) = self.rules_at_hand(view, now_us) {
            return rules;
        }
        let (changes, blocked) = {
            let mut maps = self.lock();
            let reports = &mut maps.entry(view.head.map.clone()).or_default().reports;
            (reports.changes(now_us), reports.at(now_us).map(|(_, blocked)| blocked.clone()).collect())
        };
        // A large map takes a while; nobody waits for the lock meanwhile.
        let rules = Arc::new(Rules::of(&view.state, blocked));
        if let Some(of_map) = self.lock().get_mut(&view.head.map) {
            of_map.rules = Some((view.head.version, changes, Arc::clone(&rules)));
        }
        rules
    }

    /// The same, if they are already derived. Never blocks for long.
    #[must_use]
    pub fn rules_at_hand(&self, view: &MapView, now_us: u64) -> Option<Arc<Rules>> {
        let mut maps = self.lock();
        let of_map = maps.get_mut(&view.head.map)?;
        let now = (view.head.version, of_map.reports.changes(now_us));
        of_map.rules.as_ref().filter(|(at, of, _)| (*at, *of) == now).map(|(_, _, rules)| Arc::clone(rules))
    }

    /// What robots found blocked on a map, and for how much longer.
    #[must_use]
    pub fn blocked(&self, map: &MapName, now_us: u64) -> Vec<BlockedView> {
        let mut maps = self.lock();
        let Some(of_map) = maps.get_mut(map) else { return Vec::new() };
        let view = |(until_us, by): (u64, &fht_map::plan::blocked::BlockedBy)| BlockedView {
            robot: by.robot.clone(),
            for_s: (until_us.saturating_sub(now_us) as f64 * 1e-5).round() / 10.0,
            edges: by.edges.iter().map(EdgeKey::to_texts).collect(),
            places: by.places.iter().map(|place| [place.x(), place.y()]).collect(),
        };
        of_map.reports.at(now_us).map(view).collect()
    }

    /// A state that robots do not run: the one kept since an earlier question, or the one that
    /// `make` returns.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn other<E>(
        &self,
        of: OtherState,
        make: impl FnOnce() -> Result<PlanningState, E>,
    ) -> Result<Arc<PlanningState>, E> {
        let lock = || self.others.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, planning)) = lock().iter().find(|(known, _)| *known == of) {
            return Ok(Arc::clone(planning));
        }
        let planning = Arc::new(make()?);
        let mut others = lock();
        others.push_back((of, Arc::clone(&planning)));
        let surplus = others.len().saturating_sub(MAX_OTHERS);
        others.drain(..surplus);
        Ok(planning)
    }
}
