//! What holds on the maps now: the rules of operators, which are in the maps, and what robots found blocked, which passes.

use crate::basis::Basis;
use crate::catalog::MapView;
use fht_map::Rules;
use fht_map::blocked::Reports;
use fht_proto::fleet::BlockedReport;
use fht_proto::query::BlockedView;
use fht_proto::{Digest, EdgeKey, Invalid, MapName, ReleaseId};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What holds on one map.
#[derive(Debug, Default)]
struct Live {
    reports: Reports,
    /// The rules, and the version and the state of the reports that they follow from.
    rules: Option<(u64, u64, Arc<Rules>)>,
}

/// A state that robots do not run: a release, or the newest. Two releases may be of one state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherState {
    /// The map.
    pub map: MapName,
    /// The release; none for the newest state.
    pub release: Option<ReleaseId>,
    /// Its digest.
    pub digest: Digest,
}

/// What holds on all maps.
#[derive(Debug, Default)]
pub struct LiveRules {
    maps: Mutex<BTreeMap<MapName, Live>>,
    /// States that somebody asked for paths on and that robots do not run, the newest question last.
    others: Mutex<VecDeque<(OtherState, Arc<Basis>)>>,
}

/// States besides those that robots run of which the free space is kept.
const MAX_OTHERS: usize = 4;

impl LiveRules {
    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<MapName, Live>> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a robot's report that arrived at `now_us`. Reports on maps that there are not are for the caller to drop.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn take(&self, map: &MapName, robot: &str, report: &BlockedReport, now_us: u64) -> Result<(), Invalid> {
        self.lock().entry(map.clone()).or_default().reports.take(robot, report, now_us)
    }

    /// The rules that hold on a map at `now_us`.
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
        // A large map takes its time; nobody waits for the lock meanwhile.
        let rules = Arc::new(Rules::of(&view.state, blocked));
        if let Some(live) = self.lock().get_mut(&view.head.map) {
            live.rules = Some((view.head.version, changes, Arc::clone(&rules)));
        }
        rules
    }

    /// The same, if they are at hand. Never waits for long.
    #[must_use]
    pub fn rules_at_hand(&self, view: &MapView, now_us: u64) -> Option<Arc<Rules>> {
        let mut maps = self.lock();
        let live = maps.get_mut(&view.head.map)?;
        let now = (view.head.version, live.reports.changes(now_us));
        live.rules.as_ref().filter(|(at, of, _)| (*at, *of) == now).map(|(_, _, rules)| Arc::clone(rules))
    }

    /// What robots found blocked on a map, and for how long yet.
    #[must_use]
    pub fn blocked(&self, map: &MapName, now_us: u64) -> Vec<BlockedView> {
        let mut maps = self.lock();
        let Some(live) = maps.get_mut(map) else { return Vec::new() };
        let view = |(until_us, by): (u64, &fht_map::blocked::BlockedBy)| BlockedView {
            robot: by.robot.clone(),
            for_s: (until_us.saturating_sub(now_us) as f64 * 1e-5).round() * 0.1,
            edges: by.edges.iter().map(EdgeKey::to_texts).collect(),
            places: by.places.iter().map(|place| [place.x(), place.y()]).collect(),
        };
        live.reports.at(now_us).map(view).collect()
    }

    /// A state that robots do not run, as it was kept since somebody asked for it, or as `make` makes it.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn other<E>(&self, of: OtherState, make: impl FnOnce() -> Result<Basis, E>) -> Result<Arc<Basis>, E> {
        let lock = || self.others.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, basis)) = lock().iter().find(|(known, _)| *known == of) {
            return Ok(Arc::clone(basis));
        }
        let basis = Arc::new(make()?);
        let mut others = lock();
        others.push_back((of, Arc::clone(&basis)));
        let surplus = others.len().saturating_sub(MAX_OTHERS);
        others.drain(..surplus);
        Ok(basis)
    }
}
