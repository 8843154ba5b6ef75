//! The robots on a map, as they come, go and say where they are.

use fht_proto::MapName;
use fht_proto::api::fleet::{BlockedReport, RobotPose};
use fht_proto::api::keys::{Key, RobotTopic, presence_of, robots_of};
use fht_proto::model::validate::Validate;
use tokio::sync::mpsc;
use zenoh::Session;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};

/// Events that may wait to be read; while there are so many, newer ones are dropped.
const QUEUE: usize = 1024;
/// Longest message that is read, bytes.
const MAX_BYTES: usize = 16 << 10;

/// An event for whoever reads; it is dropped if too many wait.
fn pass_on(event: Option<RobotEvent>, sender: &mpsc::Sender<RobotEvent>) {
    if let Some(event) = event {
        let _ = sender.try_send(event);
    }
}

/// The robots cannot be watched.
#[derive(Debug, thiserror::Error)]
#[error("the robots cannot be watched: {}", fht_session::in_words(.0))]
pub struct WatchError(#[from] zenoh::Error);

/// What happened to a robot, or what it said.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RobotEvent {
    /// The robot of this name is there.
    Came(String),
    /// It has left, or its session was lost.
    Left(String),
    /// Where a robot is, as far as it knows.
    Pose(RobotPose),
    /// What a robot could not pass; a report replaces its earlier one.
    Blocked {
        /// The robot.
        robot: String,
        /// What, and for how long.
        report: BlockedReport,
    },
}

/// What robots say of themselves, from robot to robot, without the server. Ends when dropped.
pub struct RobotEvents {
    events: mpsc::Receiver<RobotEvent>,
    _subscribers: [Subscriber<()>; 3],
}

impl RobotEvents {
    /// What robots on a map say from now on. Those that are there already come first.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub async fn watch(session: &Session, map: &MapName) -> Result<Self, WatchError> {
        let (sender, events) = mpsc::channel(QUEUE);
        let said = |topic: RobotTopic| {
            let sender = sender.clone();
            let take = move |sample: Sample| pass_on(message(&sample), &sender);
            session.declare_subscriber(robots_of(map, topic)).callback(take)
        };
        let (poses, blocked) = (said(RobotTopic::Pose).await?, said(RobotTopic::Blocked).await?);
        let token = move |sample: Sample| pass_on(presence(&sample), &sender);
        let tokens = session.liveliness().declare_subscriber(presence_of(map)).history(true).callback(token).await?;
        Ok(Self { events, _subscribers: [poses, blocked, tokens] })
    }

    /// Waits for the next event. `None` when the session was closed.
    pub async fn next(&mut self) -> Option<RobotEvent> {
        self.events.recv().await
    }
}

fn presence(sample: &Sample) -> Option<RobotEvent> {
    let Ok(Key::Robot { robot, .. }) = sample.key_expr().as_str().parse() else { return None };
    Some(if sample.kind() == SampleKind::Put { RobotEvent::Came(robot) } else { RobotEvent::Left(robot) })
}

/// What a robot said under its own name; nothing else.
fn message(sample: &Sample) -> Option<RobotEvent> {
    let Ok(Key::RobotTopic { robot, topic, .. }) = sample.key_expr().as_str().parse() else { return None };
    if sample.kind() != SampleKind::Put || sample.payload().len() > MAX_BYTES {
        return None;
    }
    let json = sample.payload().to_bytes();
    match topic {
        RobotTopic::Pose => {
            let pose: RobotPose = serde_json::from_slice(&json).ok()?;
            (pose.robot == robot).then_some(RobotEvent::Pose(pose))
        }
        RobotTopic::Blocked => {
            let report: BlockedReport = serde_json::from_slice(&json).ok()?;
            report.validate().ok()?;
            Some(RobotEvent::Blocked { robot, report })
        }
        _ => None,
    }
}
