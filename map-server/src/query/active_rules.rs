//! What is closed on the maps now: by operators, whose rules are in the maps, and by robots that
//! found something blocked, which expires.

use crate::catalog::{MapView, PlanningState};
use fht_map::Rules;
use fht_map::plan::blocked::{BlockedBy, ReportLimits, ReportRefused, Reporter, Reports, middles};
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::reply::{BlockedView, IgnoredView};
use fht_proto::{Digest, EdgeKey, MapName, ReleaseId};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What is closed on one map.
#[derive(Debug)]
struct MapRules {
    reports: Reports,
    derived: Option<DerivedRules>,
}

/// Rules, and what they were derived from.
#[derive(Debug)]
struct DerivedRules {
    /// Version of the map.
    version: u64,
    /// State of the reports.
    changes: u64,
    at_us: u64,
    rules: Arc<Rules>,
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
    limits: ReportLimits,
    maps: Mutex<BTreeMap<MapName, MapRules>>,
    /// States that robots do not run and that somebody asked for paths on, the latest question
    /// last.
    others: Mutex<VecDeque<(OtherState, Arc<PlanningState>)>>,
}

/// How many such states are kept.
const MAX_OTHERS: usize = 4;

/// From now until then, seconds, to a tenth.
fn left_s(until_us: u64, now_us: u64) -> f64 {
    (until_us.saturating_sub(now_us) as f64 * 1e-5).round() / 10.0
}

impl ActiveRules {
    /// Nothing is reported yet.
    #[must_use]
    pub fn new(limits: ReportLimits) -> Self {
        Self { limits, ..Self::default() }
    }

    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<MapName, MapRules>> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with the reports of a map that there is.
    fn with_reports<T>(&self, map: &MapName, act: impl FnOnce(&mut Reports) -> T) -> T {
        let mut maps = self.lock();
        let new = || MapRules { reports: Reports::new(self.limits.clone()), derived: None };
        act(&mut maps.entry(map.clone()).or_insert_with(new).reports)
    }

    /// Takes a robot's report on the map of `view` that arrived at `now_us`.
    ///
    /// # Errors
    /// [`ReportRefused`].
    pub fn take_report(
        &self,
        view: &MapView,
        (robot, reporter): (&str, Reporter),
        report: &BlockedReport,
        now_us: u64,
    ) -> Result<(), ReportRefused> {
        let middles = middles(&report.edge_keys()?, [&view.state, view.running.state()]);
        self.with_reports(&view.head.map, |reports| reports.take(robot, reporter, report, &middles, now_us))
    }

    /// A robot's liveliness token has gone, and soon its reports go.
    pub fn robot_has_gone(&self, map: &MapName, robot: &str, now_us: u64) {
        if let Some(of_map) = self.lock().get_mut(map) {
            of_map.reports.robot_has_gone(robot, now_us);
        }
    }

    /// Operators open what `robot`, or everybody, has reported blocked; the robot's reports do not
    /// count for `ignore_s` seconds. How many reports there were.
    pub fn clear_reports(&self, map: &MapName, robot: Option<&str>, ignore_s: f64, now_us: u64) -> usize {
        let cleared = self.with_reports(map, |reports| reports.clear(robot, ignore_s, now_us));
        self.apply_at_once(map);
        cleared
    }

    /// Operators have what `robot` has reported stay so for `for_s` seconds. How many reports there
    /// are.
    pub fn keep_reports(&self, map: &MapName, robot: &str, for_s: f64, now_us: u64) -> usize {
        self.with_reports(map, |reports| reports.keep(robot, for_s, now_us))
    }

    /// What operators say does not wait.
    fn apply_at_once(&self, map: &MapName) {
        if let Some(of_map) = self.lock().get_mut(map) {
            of_map.derived = None;
        }
    }

    /// The rules of a map at `now_us`. What robots reported takes effect at most every
    /// [`ReportLimits::apply_every_s`], because the map's free space has to be made anew for it.
    #[must_use]
    pub fn rules(&self, view: &MapView, now_us: u64) -> Arc<Rules> {
        if let Some(rules) = self.rules_at_hand(view, now_us) {
            return rules;
        }
        let (changes, blocked): (u64, Vec<BlockedBy>) = self.with_reports(&view.head.map, |reports| {
            (reports.changes(now_us), reports.at(now_us).map(|(_, blocked)| blocked.clone()).collect())
        });
        // A large map takes a while; nobody waits for the lock meanwhile.
        let rules = Arc::new(Rules::of(&view.state, blocked));
        if let Some(of_map) = self.lock().get_mut(&view.head.map) {
            let rules = Arc::clone(&rules);
            of_map.derived = Some(DerivedRules { version: view.head.version, changes, at_us: now_us, rules });
        }
        rules
    }

    /// The same, if they are already derived. Never blocks for long.
    #[must_use]
    pub fn rules_at_hand(&self, view: &MapView, now_us: u64) -> Option<Arc<Rules>> {
        let apply_every_us = (self.limits.apply_every_s.max(0.0) * 1e6) as u64; // saturates
        let mut maps = self.lock();
        let of_map = maps.get_mut(&view.head.map)?;
        let changes = of_map.reports.changes(now_us);
        let holds = |derived: &&DerivedRules| {
            let is_recent = now_us < derived.at_us.saturating_add(apply_every_us);
            derived.version == view.head.version && (derived.changes == changes || is_recent)
        };
        of_map.derived.as_ref().filter(holds).map(|derived| Arc::clone(&derived.rules))
    }

    /// What robots found blocked on a map, and for how much longer.
    #[must_use]
    pub fn blocked(&self, map: &MapName, now_us: u64) -> Vec<BlockedView> {
        let mut maps = self.lock();
        let Some(of_map) = maps.get_mut(map) else { return Vec::new() };
        let view = |(until_us, by): (u64, &BlockedBy)| BlockedView {
            robot: by.robot.clone(),
            for_s: left_s(until_us, now_us),
            edges: by.edges.iter().map(EdgeKey::to_texts).collect(),
            places: by.places.iter().map(|place| [place.x(), place.y()]).collect(),
        };
        of_map.reports.at(now_us).map(view).collect()
    }

    /// Whose reports do not count on a map, and for how much longer.
    #[must_use]
    pub fn ignored(&self, map: &MapName, now_us: u64) -> Vec<IgnoredView> {
        let mut maps = self.lock();
        let Some(of_map) = maps.get_mut(map) else { return Vec::new() };
        let view =
            |(until_us, robot): (u64, &str)| IgnoredView { robot: robot.to_owned(), for_s: left_s(until_us, now_us) };
        of_map.reports.ignored(now_us).map(view).collect()
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
