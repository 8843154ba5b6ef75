//! Who begins a map: of several explorers that find none, one does.

use fht_client::LiveReplica;
use fht_proto::MapName;
use fht_proto::api::keys::{Key, RobotTopic, robots_of};
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};
use zenoh::liveliness::LivelinessToken;
use zenoh::{Session, Wait};

/// How long to wait for the names of explorers that are there already.
pub(crate) const ROLL_CALL: Duration = Duration::from_secs(1);
/// Within this a claim to begin a map has reached the others.
pub(crate) const CLAIM_TIME: Duration = Duration::from_millis(500);
/// An explorer whose turn it is and that claims nothing for so long is passed over: it hangs, or it
/// only says that it explores.
const PASSED_OVER_AFTER: Duration = Duration::from_secs(10);

/// An explorer that finds no map.
pub(super) struct Founding<'a> {
    session: &'a Session,
    map: &'a MapName,
    robot: &'a str,
    replica: &'a LiveReplica,
}

/// Since when others' names are known.
#[derive(Default)]
struct Others(BTreeMap<String, Instant>);

impl Others {
    /// Whether `robot` is the first by name of those that are there now and are not passed over.
    fn leave_the_turn_to(&mut self, robot: &str, names: &BTreeSet<String>, now: Instant) -> bool {
        self.0.retain(|name, _| names.contains(name));
        for name in names {
            self.0.entry(name.clone()).or_insert(now);
        }
        let is_waited_for = |since: &Instant| now.duration_since(*since) < PASSED_OVER_AFTER;
        !self.0.iter().any(|(name, since)| name.as_str() < robot && is_waited_for(since))
    }
}

impl<'a> Founding<'a> {
    pub(super) fn new(session: &'a Session, map: &'a MapName, robot: &'a str, replica: &'a LiveReplica) -> Self {
        Self { session, map, robot, replica }
    }

    /// Of the explorers that are there, the one whose name comes first claims the map; whoever sees
    /// a claim joins. Two that did not see each other in time have both claimed it: the one whose
    /// name comes later withdraws. The claim, if this explorer begins the map: it holds for as long
    /// as it is kept.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub(super) fn claim(&self, patience: Duration) -> Result<Option<LivelinessToken>, zenoh::Error> {
        let deadline = Instant::now() + patience;
        let mut others = Others::default();
        while Instant::now() < deadline && self.is_bare() {
            if !self.names(RobotTopic::Pose)?.is_empty() {
                return Ok(None);
            }
            if others.leave_the_turn_to(self.robot, &self.names(RobotTopic::Goal)?, Instant::now()) {
                let key = Key::robot(self.map, self.robot, RobotTopic::Pose).to_string();
                let claim = self.session.liveliness().declare_token(key).wait()?;
                std::thread::sleep(CLAIM_TIME);
                let comes_first =
                    self.names(RobotTopic::Pose)?.first().is_none_or(|first| first.as_str() >= self.robot);
                // An explorer that holds no token yet may be delivering what its last run has left.
                return Ok(Some(claim).filter(|_| self.is_bare() && comes_first));
            }
            std::thread::sleep(CLAIM_TIME);
        }
        Ok(None)
    }

    fn is_bare(&self) -> bool {
        self.replica.read().state().counts().main_nodes == 0
    }

    /// The names of the other robots that hold a token under a topic.
    fn names(&self, topic: RobotTopic) -> Result<BTreeSet<String>, zenoh::Error> {
        let answers = self.session.liveliness().get(robots_of(self.map, topic)).timeout(ROLL_CALL).wait()?;
        let mut names = BTreeSet::new();
        while let Ok(answer) = answers.recv() {
            if let Ok(sample) = answer.result()
                && let Ok(Key::RobotTopic { robot, .. }) = sample.key_expr().as_str().parse()
                && robot != self.robot
            {
                names.insert(robot);
            }
        }
        Ok(names)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_claims_nothing_is_passed_over() {
        let (begin, mut others) = (Instant::now(), Others::default());
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
        let after = |seconds| begin + Duration::from_secs(seconds);
        assert!(others.leave_the_turn_to("b", &names(&["c"]), begin), "it is the first by name");
        assert!(!others.leave_the_turn_to("b", &names(&["a", "c"]), after(1)));
        assert!(!others.leave_the_turn_to("b", &names(&["a"]), after(10)));
        assert!(others.leave_the_turn_to("b", &names(&["a"]), after(11)), "it has done nothing for ten seconds");
        assert!(others.leave_the_turn_to("b", &names(&[]), after(12)));
        assert!(!others.leave_the_turn_to("b", &names(&["a"]), after(13)), "it has come anew");
    }
}
