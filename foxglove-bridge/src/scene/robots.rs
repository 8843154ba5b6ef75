//! The robots as they were heard last. What they say comes from outside: names and numbers are
//! checked, and only so many are kept.

use fht_client::RobotEvent;
use fht_proto::FixedPoint;
use fht_proto::api::fleet::{LocalizationState, RobotPose};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// So many robots are shown.
const MAX_ROBOTS: usize = 1000;
/// So many places of one that does not know where it is, as the protocol has it.
const MAX_CANDIDATES: usize = 5;
/// Who says nothing for so long is shown no more.
const SILENT: Duration = Duration::from_secs(30);
/// The same for one whose token is there, as far as was heard: robots speak every second.
const SILENT_THERE: Duration = Duration::from_secs(300);

/// What a robot said last.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct KnownRobot {
    pub(crate) state: LocalizationState,
    /// 0 to 1.
    pub(crate) confidence: f64,
    /// Where it is, or was when it last knew: `[x, y, yaw]`.
    pub(crate) place: Option<[f64; 3]>,
    pub(crate) candidates: Vec<([f64; 3], f64)>,
    /// Which change of the robots was its last.
    pub(crate) change: u64,
}

impl KnownRobot {
    /// Where it is, if it knows.
    pub(crate) fn pose(&self) -> Option<[f64; 3]> {
        self.place.filter(|_| self.state == LocalizationState::Localized)
    }
}

/// The robots at a moment.
#[derive(Clone, Debug, Default)]
pub(crate) struct RobotsNow {
    /// Counts up whenever anything changes.
    pub(crate) change: u64,
    pub(crate) by_name: BTreeMap<String, KnownRobot>,
}

/// The robots as they are heard.
#[derive(Debug, Default)]
pub(crate) struct KnownRobots {
    now: Arc<RobotsNow>,
    heard: BTreeMap<String, Heard>,
}

#[derive(Debug)]
struct Heard {
    at: Instant,
    has_token: bool,
}

fn is_pose(pose: &[f64; 3]) -> bool {
    pose.iter().all(|value| value.is_finite()) && pose[..2].iter().all(|metres| metres.abs() <= FixedPoint::MAX_M)
}

impl KnownRobots {
    /// All of them now. Cheap; the same one until something changes.
    pub(crate) fn now(&self) -> Arc<RobotsNow> {
        Arc::clone(&self.now)
    }

    /// Takes what was heard.
    pub(crate) fn take(&mut self, event: RobotEvent, at: Instant) {
        match event {
            RobotEvent::Came(robot) => {
                if let Some(heard) = self.room_for(&robot, at) {
                    heard.has_token = true;
                }
            }
            RobotEvent::Left(robot) => self.forget(&robot),
            RobotEvent::Pose(pose) => self.take_pose(&pose, at),
            _ => {}
        }
    }

    fn room_for(&mut self, robot: &str, at: Instant) -> Option<&mut Heard> {
        if self.heard.len() >= MAX_ROBOTS && !self.heard.contains_key(robot) {
            return None;
        }
        Some(self.heard.entry(robot.to_owned()).or_insert(Heard { at, has_token: false }))
    }

    fn take_pose(&mut self, pose: &RobotPose, at: Instant) {
        let Some(heard) = self.room_for(&pose.robot, at) else { return };
        heard.at = at;
        let now = Arc::make_mut(&mut self.now);
        now.change += 1;
        let known = now.by_name.remove(&pose.robot);
        let knows = pose.state == LocalizationState::Localized;
        let place = pose.map_from_base.filter(|place| knows && is_pose(place));
        let robot = KnownRobot {
            // Who says that it knows, and not where, does not.
            state: if knows && place.is_none() { LocalizationState::NotLocalized } else { pose.state },
            confidence: if pose.confidence.is_finite() { pose.confidence.clamp(0.0, 1.0) } else { 0.0 },
            place: place.or_else(|| known.and_then(|known| known.place)),
            candidates: candidates(pose),
            change: now.change,
        };
        now.by_name.insert(pose.robot.clone(), robot);
    }

    fn forget(&mut self, robot: &str) {
        self.heard.remove(robot);
        if self.now.by_name.contains_key(robot) {
            let now = Arc::make_mut(&mut self.now);
            now.by_name.remove(robot);
            now.change += 1;
        }
    }

    /// Forgets who has been silent for too long.
    pub(crate) fn expire(&mut self, at: Instant) {
        let patience = |heard: &Heard| if heard.has_token { SILENT_THERE } else { SILENT };
        let is_gone = |heard: &Heard| at.saturating_duration_since(heard.at) > patience(heard);
        let gone: Vec<String> =
            self.heard.iter().filter(|(_, heard)| is_gone(heard)).map(|(robot, _)| robot.clone()).collect();
        gone.iter().for_each(|robot| self.forget(robot));
    }
}

/// The candidates with their probabilities. Who does not say how probable they are says it of the
/// first: the others share what that leaves.
fn candidates(pose: &RobotPose) -> Vec<([f64; 3], f64)> {
    let first = pose.confidence.clamp(0.0, 1.0);
    let others = (1.0 - first) / pose.candidates.len().saturating_sub(1).max(1) as f64;
    let of_rank = |rank: usize| if rank == 0 { first } else { others };
    let said = |rank: usize| pose.probabilities.get(rank).map(|share| share.clamp(0.0, 1.0));
    let shares = (0..).map(|rank| said(rank).unwrap_or_else(|| of_rank(rank)));
    let sound = pose.candidates.iter().copied().zip(shares).filter(|(at, share)| is_pose(at) && share.is_finite());
    sound.take(MAX_CANDIDATES).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(robot: &str, state: LocalizationState, map_from_base: Option<[f64; 3]>) -> RobotEvent {
        let localized = map_from_base.is_some();
        let candidates = vec![[f64::NAN, 0.0, 0.0], [1.0, 2.0, 0.0]];
        RobotEvent::Pose(RobotPose {
            robot: robot.to_owned(),
            localized,
            state,
            confidence: 7.0,
            candidates,
            probabilities: vec![0.5, 0.25],
            map_from_base,
            lost_because: None,
            stamp_us: None,
        })
    }

    #[test]
    fn robots_are_kept_while_they_are_there_and_no_more_than_can_be_shown() {
        let (mut robots, begin) = (KnownRobots::default(), Instant::now());
        robots.take(said("tug", LocalizationState::Localized, Some([1.0, 2.0, 0.5])), begin);
        robots.take(RobotEvent::Came("amr".to_owned()), begin);
        robots.take(said("amr", LocalizationState::Localized, Some([f64::INFINITY, 0.0, 0.0])), begin);
        let now = robots.now();
        assert_eq!(now.by_name["tug"].pose(), Some([1.0, 2.0, 0.5]));
        assert_eq!(now.by_name["amr"].pose(), None);
        assert_eq!(now.by_name["amr"].candidates, [([1.0, 2.0, 0.0], 0.25)]);
        robots.take(said("tug", LocalizationState::Lost, None), begin);
        let tug = robots.now().by_name["tug"].clone();
        assert_eq!((tug.pose(), tug.place, tug.confidence), (None, Some([1.0, 2.0, 0.5]), 1.0));

        robots.expire(begin + 2 * SILENT);
        assert_eq!(robots.now().by_name.keys().collect::<Vec<_>>(), ["amr"], "its token is there");
        robots.take(RobotEvent::Left("amr".to_owned()), begin);
        assert!(robots.now().by_name.is_empty());
        for number in 0..2 * MAX_ROBOTS {
            robots.take(said(&format!("r-{number}"), LocalizationState::Lost, None), begin);
        }
        assert_eq!(robots.now().by_name.len(), MAX_ROBOTS);
    }
}
