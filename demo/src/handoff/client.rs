//! The client of the demo: a robot dropped somewhere, which finds its place and drives to a goal.

use super::config::{HandoffConfig, HandoffError};
use super::explorers::Explored;
use super::programs::{Bars, read_report, world_args};
use crate::process::{Process, ProcessError, Role};
use fht_proto::{MapName, SharedWorldName};
use fht_sim::{Contacts, RobotContacts};
use serde::Deserialize;
use std::ffi::OsString;
use std::path::Path;

/// The part of the client's report that the demo shows.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct ClientReport {
    pub(super) start: [f64; 3],
    pub(super) goal: Option<[f64; 2]>,
    pub(super) localized: bool,
    pub(super) relocalization_distance_m: Option<f64>,
    pub(super) relocalization_error_m: Option<f64>,
    pub(super) relocalization_error_deg: Option<f64>,
    pub(super) final_error_m: Option<f64>,
    pub(super) arrived: bool,
    pub(super) goal_distance_m: Option<f64>,
    pub(super) failure: Option<String>,
    pub(super) path_length_m: Option<f64>,
    pub(super) shortest_length_m: Option<f64>,
    pub(super) collisions: u64,
    pub(super) contacts: Contacts,
    pub(super) robot_contacts: RobotContacts,
    pub(super) sim_s: f64,
    pub(super) trajectory: Vec<[f64; 2]>,
    pub(super) true_trajectory: Vec<[f64; 2]>,
}

/// Carries out the client's mission.
pub(super) fn client(
    config: &HandoffConfig,
    map: &MapName,
    explored: &Explored,
    bars: &Bars,
    shared: Option<&SharedWorldName>,
) -> Result<ClientReport, HandoffError> {
    let report = config.folder.join("client.json");
    let mut args = vec!["go".into()];
    args.extend(world_args(config, map, &report, shared));
    let [x, y, yaw] = explored.world_from_map;
    // Another day: other noise, other wheels, other light.
    let (seed, light) = ((1000 + config.seed).to_string(), (1 + config.seed).to_string());
    let origin = format!("{x},{y},{yaw}rad");
    args.extend(["--seed", &seed, "--light-seed", &light, "--map-origin", &origin].map(Into::into));
    args.extend(["--to", "random", "--quiet"].map(Into::into));
    drive(config, bars, args, &report)
}

/// Runs the client's program, and reads the report that it writes.
pub(super) fn drive<T: for<'de> Deserialize<'de>>(
    config: &HandoffConfig,
    bars: &Bars,
    args: Vec<OsString>,
    report: &Path,
) -> Result<T, HandoffError> {
    let bar = bars.add("client".to_owned());
    bar.set_message("dropped somewhere; finding out where, then driving to its goal");
    let ended = Process::start(&config.executable, Role::ClientRobot, args)?.follow(|_| ());
    // A client that did not arrive says so in its report and by its exit code.
    match ended {
        Err(ProcessError::Failed { .. }) if report.exists() => bar.finish_with_message("failed"),
        other => {
            other?;
            bar.finish_with_message("done");
        }
    }
    read_report(report)
}
