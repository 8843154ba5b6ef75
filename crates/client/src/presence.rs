//! What a robot tells the others: that it is here, where it is, what it runs, what it could not
//! pass.

use fht_perception::candidate::PossiblePlace;
use fht_perception::pose::{Pose2, to_fixed};
use fht_proto::api::fleet::{BlockedReport, LocalizationState, RobotPose, RobotRole, RobotStatus};
use fht_proto::api::keys::{Key, RobotTopic};
use fht_proto::model::version::VersionVector;
use fht_proto::{MapName, ParseIdError, RobotName};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait};

fn token_key(map: &MapName, robot: &str) -> String {
    Key::Robot { map: map.clone(), robot: robot.to_owned() }.to_string()
}

/// Where a robot is, as far as it knows.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseReport {
    /// Whether it knows.
    pub state: LocalizationState,
    /// Probability that the pose, or the likeliest candidate, is right: 0 to 1.
    pub confidence: f64,
    /// Where it may be while it does not know, likeliest first.
    pub candidates: Vec<PossiblePlace>,
    /// Its pose in the map frame, if it knows.
    pub map_from_base: Option<Pose2>,
    /// Why it gave up the last place that it knew, in words; none once it knows again.
    pub lost_because: Option<String>,
}

impl Default for PoseReport {
    /// A robot that knows nothing yet.
    fn default() -> Self {
        Self {
            state: LocalizationState::NotLocalized,
            confidence: 0.0,
            candidates: Vec::new(),
            map_from_base: None,
            lost_because: None,
        }
    }
}

/// To the millimetre and to 1e-4 rad, like everything on the wire.
fn x_y_yaw(at: &Pose2) -> [f64; 3] {
    let fixed = to_fixed(at);
    [fixed.position.x(), fixed.position.y(), fixed.yaw()]
}

/// The voice of one robot on one map. Lost messages do no harm: the next one comes soon.
#[derive(Clone, Debug)]
pub struct Presence {
    session: Session,
    map: MapName,
    robot: String,
    role: RobotRole,
}

impl Presence {
    /// Checks the name; says nothing yet.
    ///
    /// # Errors
    /// When it is no [`RobotName`].
    pub fn new(session: &Session, map: &MapName, robot: &str, role: RobotRole) -> Result<Self, ParseIdError> {
        let name: RobotName = robot.parse()?;
        Ok(Self { session: session.clone(), map: map.clone(), robot: name.into(), role })
    }

    /// The robot's name.
    #[must_use]
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// Declares that the robot is here, for as long as the token lives.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn declare(&self) -> Result<LivelinessToken, zenoh::Error> {
        self.session.liveliness().declare_token(token_key(&self.map, &self.robot)).wait()
    }

    /// Whether a robot of this name is there already, as far as is known within `timeout`.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub fn is_taken(&self, timeout: Duration) -> Result<bool, zenoh::Error> {
        let there = self.session.liveliness().get(token_key(&self.map, &self.robot)).timeout(timeout).wait()?;
        Ok(there.into_iter().any(|token| token.result().is_ok()))
    }

    /// Publishes where the robot is, and what it runs: the increments in `vector`, and the release
    /// if it runs one.
    pub fn publish(&self, pose: &PoseReport, vector: VersionVector, release: Option<String>) {
        self.publish_by(pose, vector, release, CongestionControl::Drop);
    }

    /// The same for the last time: no later message makes up for this one, so it waits for its turn
    /// on a slow link.
    pub fn publish_last(&self, pose: &PoseReport, vector: VersionVector, release: Option<String>) {
        self.publish_by(pose, vector, release, CongestionControl::Block);
    }

    fn publish_by(
        &self,
        pose: &PoseReport,
        vector: VersionVector,
        release: Option<String>,
        congestion: CongestionControl,
    ) {
        let map_from_base = pose.map_from_base.as_ref().map(x_y_yaw);
        let now = SystemTime::now().duration_since(UNIX_EPOCH).ok();
        let stamp_us = now.and_then(|now| u64::try_from(now.as_micros()).ok());
        let pose_message = RobotPose {
            robot: self.robot.clone(),
            localized: map_from_base.is_some(),
            state: pose.state,
            confidence: pose.confidence,
            candidates: pose.candidates.iter().map(|place| x_y_yaw(&place.map_from_base)).collect(),
            probabilities: pose.candidates.iter().map(|place| place.probability).collect(),
            map_from_base,
            lost_because: pose.lost_because.clone(),
            stamp_us,
        };
        let status = RobotStatus {
            robot: self.robot.clone(),
            role: self.role,
            map: self.map.clone(),
            version: vector.version(),
            vector,
            release,
            state: pose.state,
            map_from_base,
            stamp_us,
        };
        self.put_json_by(RobotTopic::Pose, &pose_message, congestion);
        self.put_json_by(RobotTopic::Status, &status, congestion);
    }

    /// Reports what the robot could not pass. A report without edges and places takes the earlier
    /// ones back.
    pub fn report_blocked(&self, report: &BlockedReport) {
        self.put_json(RobotTopic::Blocked, report);
    }

    /// Publishes a message of one topic as JSON.
    pub fn put_json<T: serde::Serialize>(&self, topic: RobotTopic, message: &T) {
        self.put_json_by(topic, message, CongestionControl::Drop);
    }

    /// Publishes a message of one topic.
    pub fn put(&self, topic: RobotTopic, bytes: Vec<u8>, encoding: Encoding) {
        self.put_by(topic, bytes, encoding, CongestionControl::Drop);
    }

    fn put_json_by<T: serde::Serialize>(&self, topic: RobotTopic, message: &T, congestion: CongestionControl) {
        if let Ok(json) = serde_json::to_vec(message) {
            self.put_by(topic, json, Encoding::APPLICATION_JSON, congestion);
        }
    }

    fn put_by(&self, topic: RobotTopic, bytes: Vec<u8>, encoding: Encoding, congestion: CongestionControl) {
        let key = Key::robot(&self.map, &self.robot, topic).to_string();
        let put = self.session.put(&key, bytes).encoding(encoding).congestion_control(congestion);
        if let Err(error) = put.wait() {
            tracing::debug!(%error, key, "not published");
        }
    }
}
