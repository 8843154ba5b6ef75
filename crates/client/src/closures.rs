//! What is closed for a robot now: what operators wrote, which is in the map, and what other robots
//! found blocked, which passes.

use fht_map::plan::blocked::{Reporter, Reports};
use fht_map::{Replica, Rules};
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::BlockedView;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use zenoh::sample::{Sample, SampleKind};

/// Longest report of what is blocked that is read, bytes.
const MAX_REPORT_BYTES: usize = 16 << 10;

/// The rules, and what they follow from.
#[derive(Debug)]
struct Cached {
    /// Of the map.
    version: u64,
    /// Of the reports.
    changes: u64,
    rules: Arc<Rules>,
}

/// What is closed, as it is heard of.
#[derive(Debug)]
pub struct Closures {
    /// The robot's own name: what it found blocked itself it knows better.
    robot: String,
    began: Instant,
    reports: Mutex<Reports>,
    cached: Mutex<Option<Cached>>,
}

impl Closures {
    /// Nothing is closed for the robot of this name yet.
    #[must_use]
    pub fn new(robot: &str) -> Self {
        Self { robot: robot.to_owned(), began: Instant::now(), reports: Mutex::default(), cached: Mutex::default() }
    }

    fn now_us(&self) -> u64 {
        u64::try_from(self.began.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    /// Takes another robot's report of what is blocked. Never waits for long.
    pub fn take(&self, sample: &Sample) {
        let Ok(Key::RobotTopic { robot, .. }) = sample.key_expr().as_str().parse() else { return };
        if robot == self.robot || sample.kind() != SampleKind::Put || sample.payload().len() > MAX_REPORT_BYTES {
            return;
        }
        match serde_json::from_slice(&sample.payload().to_bytes()) {
            // Whether it is there is for the server to know, which is asked when the link is new.
            Ok(report) => self.keep(&robot, Reporter::Robot { has_token: true }, &report),
            Err(error) => tracing::debug!(%robot, "a report of what is blocked is not taken: {error}"),
        }
    }

    /// Takes what the server has heard of instead of what was heard here: who comes late is told
    /// nothing again, and what operators have opened is not reported.
    pub fn take_known(&self, blocked: Vec<BlockedView>) {
        self.lock().clear(None, 0.0, self.now_us());
        let of_others = blocked.into_iter().filter(|view| view.robot != self.robot);
        for (robot, report) in of_others.filter_map(BlockedView::into_report) {
            self.keep(&robot, Reporter::Trusted, &report);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Reports> {
        self.reports.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn keep(&self, robot: &str, reporter: Reporter, report: &BlockedReport) {
        if let Err(reason) = self.lock().take(robot, reporter, report, &[], self.now_us()) {
            tracing::debug!(%robot, "a report of what is blocked is not taken: {reason}");
        }
    }

    /// What holds on a copy of the map now.
    #[must_use]
    pub fn rules(&self, copy: &Replica) -> Arc<Rules> {
        let now_us = self.now_us();
        let mut reports = self.lock();
        let (version, changes) = (copy.vector().version(), reports.changes(now_us));
        let mut cached = self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cached) = cached.as_ref().filter(|cached| (cached.version, cached.changes) == (version, changes)) {
            return Arc::clone(&cached.rules);
        }
        let blocked = reports.at(now_us).map(|(_, by)| by.clone()).collect();
        let rules = Arc::new(Rules::of(copy.state(), blocked));
        *cached = Some(Cached { version, changes, rules: Arc::clone(&rules) });
        rules
    }
}
