//! Missions of simulated robots that drive by themselves, on an explored map.

use client_robot::mission::{self, MissionConfig, MissionGoal, Services};
use client_robot::pilot::PilotConfig;
use client_robot::program::{MissionReport, MissionScore};
use fht_client::{FreeSpaceCache, PathSource, PlannedPath, rules_of_own};
use fht_descriptor::DescriptorNet;
use fht_eval::Survey;
use fht_map::MapState;
use fht_perception::frame::Panorama;
use fht_perception::pose::Point2;
use fht_proto::api::reply::ErrorReply;
use fht_proto::{Descriptor, FixedPoint};
use fht_sim::{PeopleConfig, SimConfig, Simulator};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A robot of another day than the explorer's.
const OTHER_DAY: u64 = 1000;
/// Room around a start, metres.
const CLEARANCE_M: f64 = 0.25;

/// Whether the first place that was declared is right, within 1 m and 5° (paper).
pub fn is_right(report: &MissionReport) -> bool {
    report.relocalization_error_m.is_some_and(|metres| metres < 1.0)
        && report.relocalization_error_deg.is_some_and(|degrees| degrees < 5.0)
}

/// Missions in one building, from starts that are drawn by their numbers.
pub struct Missions<'a> {
    survey: &'a Survey,
    people: u16,
    paths: OwnPaths<'a>,
}

impl<'a> Missions<'a> {
    /// On the map of `survey`, among so many people.
    pub fn new(survey: &'a Survey, people: u16) -> Self {
        Self { survey, people, paths: OwnPaths { map: &survey.map, space: FreeSpaceCache::default() } }
    }

    /// The mission from the start of a number; without `net` by the scanner alone.
    pub fn run(
        &mut self,
        start: u64,
        goal: &MissionGoal,
        pilot: PilotConfig,
        mut net: Option<&mut DescriptorNet>,
    ) -> Result<MissionReport, String> {
        let survey = self.survey;
        let day = OTHER_DAY + start;
        let camera_every = if net.is_some() { SimConfig::default().camera_every } else { 0 };
        let config = SimConfig { light_seed: day, camera_every, ..SimConfig::default() };
        let pose = survey.world.random_free_pose(start, CLEARANCE_M);
        let simulator = Simulator::new(Arc::clone(&survey.world), config, pose, day);
        let simulator = simulator.among(PeopleConfig::of(self.people.into(), day));
        let mut describe = |panorama: &Panorama| -> Option<Descriptor> { net.as_mut()?.descriptor(panorama).ok() };
        let mut services = Services { map: &survey.map, paths: &mut self.paths, describe: &mut describe };
        let mut score = MissionScore::new(&simulator, &survey.world_from_map);
        let mission = MissionConfig { pilot: PilotConfig { seed: day, ..pilot }, ..MissionConfig::default() };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| format!("the async runtime cannot be started: {error}"))?;
        let outcome = runtime.block_on(mission::run(simulator, mission, goal, &mut services, &mut score));
        Ok(score.finish(&outcome.map_err(|error| error.to_string())?))
    }
}

/// Paths on the map at hand.
struct OwnPaths<'a> {
    map: &'a MapState,
    space: FreeSpaceCache,
}

impl PathSource for OwnPaths<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.space.plan(self.map, 0, from, to, &rules_of_own(blocked))
    }
}
