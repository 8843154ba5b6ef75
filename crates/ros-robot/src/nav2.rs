//! Nav2 drives: it is told where to by its action `navigate_to_pose`, and says what comes of it.
//!
//! A robot's loop says with each frame what it wants ([`Nav2Driver::want`]); a task beside it sends
//! goals, hears how they go, and takes them back. While Nav2 drives, [`DrivenByNav2`] keeps the
//! loop's own commands to itself.

use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::Pose2;
use fht_perception::robot::{Robot, RobotError, Sensors};
use fht_ros::{ActionClient, RosError, RosNode, SentGoal};
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::GetResultResponse;
use fht_ros_messages::msg::{GoalStatusMsg, PoseStamped};
use fht_ros_messages::nav2::{NavigateToPose, NavigateToPoseGoal, NavigateToPoseResult};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// The action's name.
const ACTION: &str = "navigate_to_pose";
/// Nav2 says how its goal goes ten times a second or so.
const FEEDBACK_PATIENCE: Duration = Duration::from_secs(10);
/// How long a robot that is told to stand waits until Nav2 has taken that in.
const STOP_PATIENCE: Duration = Duration::from_millis(250);

/// How Nav2 is with what was wanted of it last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Nav2State {
    /// Nothing is wanted of it.
    Idle,
    /// It drives, or is asked to.
    Driving,
    /// It says that it is there.
    Arrived,
    /// It does not get there, or does not answer: a sentence that says what to do.
    GaveUp(String),
}

/// What was wanted, and how it is.
type Told = (Option<Pose2>, Nav2State);

/// Tells Nav2 where to drive.
pub struct Nav2Driver {
    wanted: watch::Sender<Option<Pose2>>,
    told: watch::Receiver<Told>,
    /// Whether something was said since the robot was driven last.
    is_fresh: AtomicBool,
    task: JoinHandle<()>,
}

impl Nav2Driver {
    /// Drives by the action `navigate_to_pose` of the node's namespace, from a task of the Tokio
    /// runtime that calls this. Nav2 may come later.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn start(node: &RosNode) -> Result<Arc<Self>, RosError> {
        let client = node.action_client(ACTION).await?;
        let action = node.resolve(ACTION)?;
        let (wanted, wishes) = watch::channel(None);
        let (telling, told) = watch::channel((None, Nav2State::Idle));
        let task = tokio::spawn(carry_out(Dispatcher { client, action, telling }, wishes));
        Ok(Arc::new(Self { wanted, told, is_fresh: AtomicBool::new(false), task }))
    }

    /// Where the robot is to be, map frame; none: nowhere, and Nav2 is to let it stand. Said with
    /// each frame: a robot that is told to stand without a word since is stopped.
    pub fn want(&self, map_from_goal: Option<Pose2>) {
        self.is_fresh.store(true, Ordering::Relaxed);
        self.wish(map_from_goal);
    }

    fn wish(&self, map_from_goal: Option<Pose2>) {
        self.wanted.send_if_modified(|now| {
            let is_new = *now != map_from_goal;
            *now = map_from_goal;
            is_new
        });
    }

    /// How Nav2 is with what is wanted now.
    #[must_use]
    pub fn state(&self) -> Nav2State {
        let wanted = *self.wanted.borrow();
        let (goal, state) = self.told.borrow().clone();
        match wanted {
            None => Nav2State::Idle,
            Some(_) if goal == wanted => state,
            Some(_) => Nav2State::Driving,
        }
    }

    /// Takes back what is wanted, and waits a moment until Nav2 has heard it.
    pub async fn stop(&self) {
        self.wish(None);
        let mut told = self.told.clone();
        // Late is as well: it is asked to, and the robot's own command to stand follows.
        let _ = timeout(STOP_PATIENCE, told.wait_for(|(goal, _)| goal.is_none())).await;
    }
}

impl Drop for Nav2Driver {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// Sends goals, and tells how they are.
struct Dispatcher {
    client: ActionClient<NavigateToPose>,
    action: String,
    telling: watch::Sender<Told>,
}

/// Has Nav2 do what is wanted. A goal takes the place of the one before without a stop.
async fn carry_out(dispatcher: Dispatcher, mut wishes: watch::Receiver<Option<Pose2>>) {
    let mut under_way: Option<SentGoal<NavigateToPose>> = None;
    loop {
        let wanted = *wishes.borrow_and_update();
        let Some(goal) = wanted else {
            if let Some(sent) = under_way.take() {
                take_back(&sent).await;
            }
            dispatcher.tell(None, Nav2State::Idle);
            if wishes.changed().await.is_err() {
                return;
            }
            continue;
        };
        dispatcher.tell(wanted, Nav2State::Driving);
        let sent = match dispatcher.client.send(goal_message(&goal)).await {
            Ok(sent) => sent,
            Err(error) => {
                // What it drove to before is out of date, too.
                if let Some(sent) = under_way.take() {
                    take_back(&sent).await;
                }
                dispatcher.tell(wanted, Nav2State::GaveUp(dispatcher.sentence(&error)));
                if wishes.changed().await.is_err() {
                    return;
                }
                continue;
            }
        };
        let ended = tokio::select! {
            ended = dispatcher.attend(&sent, &goal) => Some(ended),
            _ = wishes.changed() => None,
        };
        under_way = match ended {
            None => Some(sent),
            Some(state) => {
                if matches!(state, Nav2State::GaveUp(_)) {
                    take_back(&sent).await;
                }
                dispatcher.tell(wanted, state);
                if wishes.changed().await.is_err() {
                    return;
                }
                None
            }
        };
    }
}

async fn take_back(sent: &SentGoal<NavigateToPose>) {
    if let Err(error) = sent.cancel().await {
        tracing::debug!("{error}"); // it is gone, and drives nothing
    }
}

impl Dispatcher {
    fn tell(&self, goal: Option<Pose2>, state: Nav2State) {
        if let Nav2State::GaveUp(reason) = &state {
            tracing::warn!("{reason}");
        }
        self.telling.send_replace((goal, state));
    }

    /// Waits until a goal has ended: how.
    async fn attend(&self, sent: &SentGoal<NavigateToPose>, goal: &Pose2) -> Nav2State {
        let result = sent.result();
        tokio::pin!(result);
        loop {
            tokio::select! {
                ended = &mut result => return self.ended(ended, goal),
                heard = timeout(FEEDBACK_PATIENCE, sent.feedback()) => match heard {
                    Ok(Ok(feedback)) => tracing::trace!(left_m = feedback.distance_remaining, "Nav2 drives"),
                    Ok(Err(error)) => tracing::debug!("{error}"),
                    Err(_) => {
                        let (action, seconds) = (&self.action, FEEDBACK_PATIENCE.as_secs());
                        return Nav2State::GaveUp(format!(
                            "{action} has said nothing of its goal for {seconds} s: is Nav2 well? (see its log)"
                        ));
                    }
                },
            }
        }
    }

    fn ended(&self, ended: Result<GetResultResponse<NavigateToPoseResult>, RosError>, goal: &Pose2) -> Nav2State {
        let GetResultResponse { status, result } = match ended {
            Ok(response) => response,
            Err(error) => return Nav2State::GaveUp(self.sentence(&error)),
        };
        if status == GoalStatusMsg::SUCCEEDED {
            return Nav2State::Arrived;
        }
        let how = match status {
            GoalStatusMsg::CANCELED => "was told by somebody else to give up",
            GoalStatusMsg::UNKNOWN => "does not know any more",
            _ => "gave up",
        };
        let NavigateToPoseResult { error_code, error_msg } = result;
        let why = match error_msg.trim() {
            "" => format!("its error code is {error_code}"),
            reason => reason.to_owned(),
        };
        let (action, x, y) = (&self.action, goal.translation.x, goal.translation.y);
        Nav2State::GaveUp(format!("{action} {how} the goal at ({x:.2}, {y:.2}): {why}"))
    }

    fn sentence(&self, error: &RosError) -> String {
        let action = &self.action;
        match error {
            RosError::NoServer(_) => format!(
                "nobody serves {action}: start Nav2 and make it active (ros2 action list), or leave out --drive nav2"
            ),
            RosError::Refused { reason, .. } => {
                format!("{action} does not take the goal ({reason}): is Nav2 active? (ros2 lifecycle get bt_navigator)")
            }
            error => error.to_string(),
        }
    }
}

fn goal_message(map_from_goal: &Pose2) -> NavigateToPoseGoal {
    // Without a stamp it holds whenever it comes, whatever clock the robot has.
    let pose = PoseStamped { header: header_message(0, "map"), pose: pose_message(map_from_goal) };
    NavigateToPoseGoal { pose, behavior_tree: String::new() }
}

/// A robot that Nav2 drives while something is wanted of it, and that takes commands else: while it
/// looks for its place, and on the last bit of the way that Nav2 leaves. It is stopped both ways.
/// Without a driver it takes all commands.
pub struct DrivenByNav2<R> {
    robot: R,
    driver: Option<Arc<Nav2Driver>>,
}

impl<R> DrivenByNav2<R> {
    /// Nav2 drives `robot`.
    pub fn new(robot: R, driver: Option<Arc<Nav2Driver>>) -> Self {
        Self { robot, driver }
    }

    /// The robot.
    pub fn robot(&self) -> &R {
        &self.robot
    }

    /// The robot, which Nav2 drives no more.
    pub fn into_inner(self) -> R {
        self.robot
    }
}

impl<R: Robot + Send> Sensors for DrivenByNav2<R> {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        self.robot.sense().await
    }
}

impl<R: Robot + Send> Robot for DrivenByNav2<R> {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        let Some(driver) = &self.driver else { return self.robot.drive(command).await };
        let is_fresh = driver.is_fresh.swap(false, Ordering::Relaxed);
        if !is_fresh && command == Twist::default() {
            // The sensors are silent, or the run ends.
            driver.stop().await;
            return self.robot.drive(command).await;
        }
        match driver.state() {
            Nav2State::Driving => Ok(()),
            // Where Nav2 does not get on, nobody tries.
            Nav2State::GaveUp(_) => self.robot.drive(Twist::default()).await,
            Nav2State::Idle | Nav2State::Arrived => self.robot.drive(command).await,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use fht_ros::NodeConfig;

    async fn node() -> RosNode {
        let mut config = zenoh::Config::default();
        config.insert_json5("scouting/multicast/enabled", "false").expect("a key of Zenoh");
        config.insert_json5("listen/endpoints", "[]").expect("a key of Zenoh");
        let session = zenoh::open(config).await.expect("a session");
        RosNode::join(session, NodeConfig::new("client")).await.expect("a node")
    }

    /// How Nav2 is, once it has decided.
    async fn decided(driver: &Nav2Driver) -> Nav2State {
        let mut told = driver.told.clone();
        let wanted = *driver.wanted.borrow();
        let is_decided = |(goal, state): &Told| *goal == wanted && *state != Nav2State::Driving;
        timeout(Duration::from_secs(20), told.wait_for(is_decided)).await.expect("in time").expect("it runs").1.clone()
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn goals_replace_each_other_end_and_are_taken_back() {
        let node = node().await;
        let server = node.action_server::<NavigateToPose>(ACTION).await.expect("a server");
        let driver = Nav2Driver::start(&node).await.expect("a client");
        assert_eq!(driver.state(), Nav2State::Idle);
        driver.want(Some(pose(1.0, 0.0, 0.0)));
        let first = server.next().await;
        assert_eq!((first.goal.pose.header.frame_id.as_str(), first.goal.pose.pose.position.x), ("map", 1.0));
        let first = first.accept().expect("the client is there");
        assert_eq!(driver.state(), Nav2State::Driving);
        driver.want(Some(pose(2.0, 0.0, 0.0)));
        let second = server.next().await.accept().expect("the client is there");
        assert!(!first.is_canceling(), "Nav2 goes over to the next goal by itself");
        first.abort(NavigateToPoseResult::default());
        second.succeed(NavigateToPoseResult::default());
        assert_eq!(decided(&driver).await, Nav2State::Arrived);

        driver.want(Some(pose(3.0, 0.0, 0.0)));
        let third = server.next().await.accept().expect("the client is there");
        third.abort(NavigateToPoseResult { error_code: 208, error_msg: "a wall is in the way".to_owned() });
        let gave_up = decided(&driver).await;
        assert!(
            matches!(&gave_up, Nav2State::GaveUp(why) if why.contains("(3.00, 0.00): a wall is in the way")),
            "{gave_up:?}"
        );

        driver.want(Some(pose(4.0, 0.0, 0.0)));
        let fourth = server.next().await.accept().expect("the client is there");
        let standing = tokio::spawn(async move {
            fourth.canceling().await;
            fourth.canceled(NavigateToPoseResult::default());
        });
        driver.stop().await;
        standing.await.expect("it is taken back");
        assert_eq!(driver.state(), Nav2State::Idle);

        driver.want(Some(pose(5.0, 0.0, 0.0)));
        server.next().await.reject();
        let rejected = decided(&driver).await;
        assert!(matches!(&rejected, Nav2State::GaveUp(why) if why.contains("is Nav2 active?")), "{rejected:?}");
        drop(server);
        driver.want(Some(pose(6.0, 0.0, 0.0)));
        let nobody = decided(&driver).await;
        assert!(
            matches!(&nobody, Nav2State::GaveUp(why) if why.contains("nobody serves /navigate_to_pose")),
            "{nobody:?}"
        );
    }
}
