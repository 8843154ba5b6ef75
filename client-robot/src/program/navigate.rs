//! `client-robot serve --ros` in the place of Nav2: the action `navigate_to_pose` on the robot's
//! graph, and the topic `goal_pose`, where RViz puts what a person points at.
//!
//! The robot's loop waits for nobody: goals come to it in a queue, and tasks beside it tell who
//! sent them how each goes.

use super::graph_frames::GraphFrames;
use super::other_servers::other_server;
use crate::goals::GoalQueue;
use crate::mission::{MapSource, MissionObserver};
use crate::pilot::{Pilot, PilotStep};
use crate::serving::{GoalDesk, locate};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::Pose2;
use fht_proto::api::goal::{GoalOrder, GoalState, GoalStatus};
use fht_proto::api::reply::{ErrorCode, ErrorReply, PlaceRef};
use fht_ros::{ActionServer, ActiveGoal, Qos, RosError, RosNode, Subscription};
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::msg::{GoalUuid, PoseStamped, Time};
use fht_ros_messages::nav2::{NavigateToPose, NavigateToPoseFeedback, NavigateToPoseResult};
use fht_ros_robot::RosRobotConfig;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;

/// The action's name.
const ACTION: &str = "navigate_to_pose";
/// Where RViz puts goals.
const GOAL_TOPIC: &str = "goal_pose";
/// Between two words of how a goal goes.
const FEEDBACK_EVERY: Duration = Duration::from_millis(200);
/// Goals that wait to be taken in: the robot takes all once a frame.
const MAX_GOALS: usize = 16;
/// How long the end of a run waits until all senders are told.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// A robot that gets on more slowly than this has no time of arrival, metres per second.
const SLOWEST_MPS: f64 = 0.05;

/// What `NavigateToPose.Result` calls an error in Kilted; the first two are the planner's, which
/// Nav2 passes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
enum NavigatorError {
    GoalOutsideMap = 204,
    NoValidPath = 208,
    Unknown = 9000,
    Transform = 9002,
    Timeout = 9003,
}

impl From<Option<ErrorCode>> for NavigatorError {
    fn from(code: Option<ErrorCode>) -> Self {
        match code {
            Some(ErrorCode::OutOfMap) => Self::GoalOutsideMap,
            Some(ErrorCode::NoPath | ErrorCode::KeepOut | ErrorCode::Blocked) => Self::NoValidPath,
            Some(ErrorCode::Timeout | ErrorCode::Busy) => Self::Timeout,
            _ => Self::Unknown,
        }
    }
}

fn failed(error: NavigatorError, reason: &str) -> NavigateToPoseResult {
    NavigateToPoseResult { error_code: error as u16, error_msg: reason.to_owned() }
}

/// How a goal is, as of the last frame; nothing before it was taken in.
type GoalNews = Option<Result<GoalStatus, ErrorReply>>;

/// What the robot's loop is asked.
enum Asked {
    Goal(GoalOrder, watch::Sender<GoalNews>),
    Cancel(String),
}

/// What the loop and the tasks beside it share.
struct Counter {
    asked: Mutex<VecDeque<Asked>>,
    frames: Arc<GraphFrames>,
    /// When and where the robot was last, map frame.
    place: watch::Receiver<Option<(u64, Pose2)>>,
    /// Kept as long as somebody is to be told something.
    _telling: mpsc::Sender<()>,
}

/// The goals of the robot's own graph.
pub(super) struct NavigateDesk {
    counter: Arc<Counter>,
    under_way: Vec<(String, watch::Sender<GoalNews>)>,
    serving: JoinHandle<()>,
    /// Ends when everybody was told.
    told: mpsc::Receiver<()>,
}

/// Says where the robot is, for whoever is told how a goal goes.
pub(super) struct WhereNow(watch::Sender<Option<(u64, Pose2)>>);

impl MissionObserver for WhereNow {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        self.0.send_replace(step.localization.map_from_base().map(|at| (frame.time_us, at)));
        ControlFlow::Continue(())
    }
}

impl NavigateDesk {
    /// Serves the action and hears the topic; nothing, where somebody serves the action already.
    ///
    /// # Errors
    /// [`RosError`].
    pub(super) async fn open(node: &RosNode, ros: &RosRobotConfig) -> Result<Option<(Self, WhereNow)>, RosError> {
        if let Some(other) = other_server(node, ACTION).await? {
            let action = node.resolve(ACTION)?;
            tracing::warn!(
                "{other} serves {action} already (Nav2?): goals for it do not come here; say --drive nav2, or end it"
            );
            return Ok(None);
        }
        let server = node.action_server::<NavigateToPose>(ACTION).await?;
        let pointed = node.subscribe::<PoseStamped>(GOAL_TOPIC, Qos::default()).await?;
        let frames = GraphFrames::listen(node, &ros.tf, &ros.tf_static).await?;
        let (here, place) = watch::channel(None);
        let (telling, told) = mpsc::channel(1);
        let counter = Arc::new(Counter { asked: Mutex::default(), frames, place, _telling: telling });
        let serving = tokio::spawn(take_goals(server, pointed, Arc::clone(&counter)));
        Ok(Some((Self { counter, under_way: Vec::new(), serving, told }, WhereNow(here))))
    }

    /// Ends once all senders are told, or after a moment.
    pub(super) async fn close(self) {
        let Self { counter, under_way, serving, mut told } = self;
        serving.abort();
        drop((counter, under_way));
        // Who is not told by now hears that the server has gone.
        let _ = tokio::time::timeout(LAST_WORDS, told.recv()).await;
    }
}

impl GoalDesk for NavigateDesk {
    fn exchange(&mut self, goals: &mut GoalQueue, map: &dyn MapSource) {
        let asked = std::mem::take(&mut *self.counter.lock());
        for asked in asked {
            match asked {
                Asked::Goal(order, news) => self.offer(goals, order, news, map),
                Asked::Cancel(id) => {
                    if let Err(unknown) = goals.cancel(Some(&id)) {
                        tracing::debug!("{unknown}"); // it has ended meanwhile
                    }
                }
            }
        }
        self.under_way.retain(|(id, news)| {
            let status = goals.status(Some(id));
            let goes_on = status.as_ref().is_ok_and(|status| !status.state.is_final());
            news.send_replace(Some(status));
            goes_on
        });
    }
}

impl NavigateDesk {
    /// A goal takes the place of the one before, as Nav2 has it; behind those that the fleet sends
    /// it is the next.
    fn offer(&mut self, goals: &mut GoalQueue, order: GoalOrder, news: watch::Sender<GoalNews>, map: &dyn MapSource) {
        let id = order.id.clone();
        let taken = locate(&order, map).and_then(|goal| {
            for (before, _) in &self.under_way {
                if let Err(unknown) = goals.cancel(Some(before)) {
                    tracing::debug!("{unknown}");
                }
            }
            goals.offer(order, |_| Ok(goal))
        });
        match taken {
            Ok(_) => self.under_way.push((id, news)),
            Err(refusal) => {
                tracing::warn!("a goal of the robot's graph is refused: {refusal}");
                news.send_replace(Some(Err(refusal)));
            }
        }
    }
}

impl Counter {
    // A panic while it was held is a bug, and leaves every request whole.
    fn lock(&self) -> MutexGuard<'_, VecDeque<Asked>> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Asks the loop to take a goal: where its news come.
    fn ask(&self, order: GoalOrder) -> Result<watch::Receiver<GoalNews>, ErrorReply> {
        let mut asked = self.lock();
        if asked.len() >= MAX_GOALS {
            return Err(ErrorReply::new(ErrorCode::Busy, "the robot was told too much at a time; ask again"));
        }
        let (news, heard) = watch::channel(None);
        asked.push_back(Asked::Goal(order, news));
        Ok(heard)
    }

    /// The goal that a pose means.
    fn order(&self, id: String, wanted: &PoseStamped) -> Result<GoalOrder, NavigateToPoseResult> {
        let at = self.frames.in_map(wanted).map_err(|error| failed(NavigatorError::Transform, &error.to_string()))?;
        let (x, y) = (at.translation.x, at.translation.y);
        // Refuses what is too far away for a map.
        let to: PlaceRef =
            format!("{x},{y}").parse().map_err(|refusal: ErrorReply| refused(Some(refusal.code), &refusal.message))?;
        Ok(GoalOrder { id, to, yaw: Some(at.rotation.angle()), to_nearest: false })
    }

    /// A goal of the action, until it has ended.
    async fn follow(self: Arc<Self>, goal: ActiveGoal<NavigateToPose>, wanted: PoseStamped) {
        let (id, began) = (name_of(goal.id()), Instant::now());
        let asked = self
            .order(id.clone(), &wanted)
            .and_then(|order| self.ask(order).map_err(|refusal| refused(Some(refusal.code), &refusal.message)));
        let mut news = match asked {
            Ok(news) => news,
            Err(result) => return goal.abort(result),
        };
        let (mut is_canceling, mut first_m) = (false, None);
        let mut tick = tokio::time::interval(FEEDBACK_EVERY);
        loop {
            tokio::select! {
                () = goal.canceling(), if !is_canceling => {
                    is_canceling = true;
                    self.lock().push_back(Asked::Cancel(id.clone()));
                }
                changed = news.changed() => {
                    let heard = news.borrow_and_update().clone();
                    let status = match (changed, heard) {
                        (_, Some(Ok(status))) => status,
                        (_, Some(Err(refusal))) => return goal.abort(refused(Some(refusal.code), &refusal.message)),
                        (Ok(()), None) => continue,
                        (Err(_), None) => return goal.abort(refused(None, "the robot takes no more goals")),
                    };
                    let reason = status.reason.as_deref().unwrap_or_default();
                    match status.state {
                        GoalState::Arrived => return goal.succeed(NavigateToPoseResult::default()),
                        GoalState::Cancelled if is_canceling => return goal.canceled(refused(None, reason)),
                        state if state.is_final() => return goal.abort(refused(status.code, reason)),
                        _ if changed_for_good(&news) => return goal.abort(refused(None, "the robot has ended")),
                        _ => {}
                    }
                }
                _ = tick.tick() => {
                    let left_m = left_of(&news);
                    first_m = first_m.or(left_m);
                    if let Err(error) = goal.feedback(self.feedback(began.elapsed(), left_m, first_m)) {
                        tracing::debug!("{error}");
                    }
                }
            }
        }
    }

    /// How a goal goes that began `since` ago, of which `left_m` are left where there were
    /// `first_m`.
    fn feedback(&self, since: Duration, left_m: Option<f64>, first_m: Option<f64>) -> NavigateToPoseFeedback {
        let first_m = first_m.unwrap_or_default();
        let left_m = left_m.unwrap_or(first_m);
        let speed_mps = (first_m - left_m) / since.as_secs_f64().max(1e-3);
        let left_s = left_m / speed_mps.max(SLOWEST_MPS);
        let duration = |seconds: f64| Time::from_us((seconds.clamp(0.0, 1e6) * 1e6) as u64);
        let current_pose = self.place.borrow().map_or_else(PoseStamped::default, |(time_us, at)| PoseStamped {
            header: header_message(time_us, "map"),
            pose: pose_message(&at),
        });
        NavigateToPoseFeedback {
            current_pose,
            navigation_time: duration(since.as_secs_f64()),
            estimated_time_remaining: duration(left_s),
            number_of_recoveries: 0,
            distance_remaining: left_m as f32,
        }
    }
}

fn refused(code: Option<ErrorCode>, reason: &str) -> NavigateToPoseResult {
    failed(code.into(), reason)
}

/// Whether the loop says no more.
fn changed_for_good(news: &watch::Receiver<GoalNews>) -> bool {
    news.has_changed().is_err()
}

/// What is left of the path, metres, if there is one.
fn left_of(news: &watch::Receiver<GoalNews>) -> Option<f64> {
    news.borrow().as_ref()?.as_ref().ok()?.to_go_m
}

fn name_of(goal: GoalUuid) -> String {
    let digits: String = goal.uuid.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("ros-{digits}")
}

/// Accepts goals for as long as it runs.
async fn take_goals(server: ActionServer<NavigateToPose>, pointed: Subscription<PoseStamped>, counter: Arc<Counter>) {
    loop {
        tokio::select! {
            request = server.next() => {
                let wanted = request.goal.pose.clone();
                match request.accept() {
                    Ok(goal) => {
                        tokio::spawn(Arc::clone(&counter).follow(goal, wanted));
                    }
                    Err(error) => tracing::debug!("{error}"),
                }
            }
            wanted = pointed.next() => match wanted {
                Ok(wanted) => point(&counter, &wanted),
                Err(error) => tracing::warn!("{error}"),
            },
        }
    }
}

/// A goal of the topic: nobody is told of it but the log.
fn point(counter: &Counter, wanted: &PoseStamped) {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let asked = counter
        .order(format!("{GOAL_TOPIC}-{}", since.as_micros()), wanted)
        .and_then(|order| counter.ask(order).map_err(|refusal| refused(Some(refusal.code), &refusal.message)));
    if let Err(refusal) = asked {
        tracing::warn!("a goal of {GOAL_TOPIC} is refused: {}", refusal.error_msg);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_goals_are_ids_of_the_fleet() {
        let name = name_of(GoalUuid { uuid: [0xa5; 16] });
        assert_eq!((name.len(), &name[..6]), (36, "ros-a5"));
    }

    #[test]
    fn refusals_have_the_codes_that_nav2_passes_on() {
        let code = |code| refused(code, "so").error_code;
        assert_eq!(code(Some(ErrorCode::OutOfMap)), 204);
        assert_eq!((code(Some(ErrorCode::NoPath)), code(Some(ErrorCode::Timeout)), code(None)), (208, 9003, 9000));
    }
}
