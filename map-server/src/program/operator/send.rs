//! Robots that take goals are sent somewhere.

use crate::program::operator::asking::head;
use crate::program::operator::error::OperatorError;
use crate::program::operator::rule::parse_pose;
use fht_client::{AskError, ask_json_async};
use fht_program::flags::with_flags;
use fht_proto::MapName;
use fht_proto::api::goal::{GoalState, GoalStatus};
use fht_proto::api::keys::{GoalTopic, Key, RobotTopic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, PlaceRef};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use zenoh::Session;
use zenoh::handlers::RingChannel;

/// How long a robot may take to say whether there is a path.
const ANSWER: Duration = Duration::from_secs(10);
/// Between two questions whether it has arrived.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// How long it may be silent meanwhile.
const PATIENCE: Duration = Duration::from_secs(30);

/// An id that nobody has used.
pub(super) fn new_id() -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("{:x}-{:x}", now.as_micros(), std::process::id())
}

/// The question that sends a robot somewhere.
pub(super) fn selector(
    (map, robot): (&MapName, &str),
    id: &str,
    to: &str,
    to_nearest: bool,
) -> Result<String, OperatorError> {
    let key = Key::robot(map, robot, RobotTopic::Goal);
    let place = match to.parse::<PlaceRef>() {
        Ok(_) => format!("to={}", to.trim()),
        Err(refusal) => {
            let has_yaw = to.matches(',').count() == 2;
            let pose = parse_pose(to).map_err(|reason| match has_yaw {
                true => OperatorError::Usage(reason),
                false => OperatorError::Usage(format!("{}, or x,y,yaw", refusal.message)),
            })?;
            let (at, yaw) = (pose.position, pose.yaw());
            format!("x={};y={};yaw={yaw}", at.x(), at.y())
        }
    };
    let nearest = if to_nearest { ";to_nearest=true" } else { "" };
    Ok(format!("{key}?id={id};{place}{nearest}"))
}

/// Sends it: the robot's word that it drives there, or will.
pub(super) async fn send(session: &Session, map: &MapName, selector: &str) -> Result<GoalStatus, OperatorError> {
    head(session, map).await?; // there is such a map
    ask(session, selector).await
}

async fn ask(session: &Session, selector: &str) -> Result<GoalStatus, OperatorError> {
    let robot = || selector.split('/').nth(3).unwrap_or_default().to_owned();
    let answer = ask_json_async::<GoalStatus>(session, selector, ANSWER).await.map_err(|error| match error {
        AskError::Silent => OperatorError::RobotSilent { robot: robot() },
        AskError::Refused(reply) => OperatorError::Refused(ErrorReply { message: with_flags(&reply.message), ..reply }),
        AskError::Unreadable(reason) => OperatorError::RobotAnswer { robot: robot(), reason },
        error => error.into(),
    })?;
    // Robots of others answer, too.
    let asked = selector.split_once("?id=").and_then(|(_, rest)| rest.split(';').next());
    let is_of_it = answer.robot == robot() && asked.is_none_or(|id| answer.id.as_deref() == Some(id));
    if !is_of_it {
        let reason = format!("it is of robot {} and goal {}", answer.robot, answer.id.as_deref().unwrap_or("none"));
        return Err(OperatorError::RobotAnswer { robot: robot(), reason });
    }
    Ok(answer)
}

/// Waits until nothing more becomes of a goal.
///
/// # Errors
/// [`OperatorError::NotArrived`], or that the robot does not answer.
pub(super) async fn arrived(session: &Session, map: &MapName, sent: GoalStatus) -> Result<GoalStatus, OperatorError> {
    let id = sent.id.clone().unwrap_or_default();
    let key = Key::goal(map, &sent.robot, GoalTopic::Status);
    let selector = format!("{key}?id={id}");
    // A robot that ends says so once, and cannot be asked afterwards.
    let told = session.declare_subscriber(key.to_string()).with(RingChannel::new(8)).await?;
    let (mut status, mut heard) = (sent, Instant::now());
    while !status.state.is_final() {
        tokio::time::sleep(ASK_AGAIN).await;
        let asked = ask(session, &selector).await;
        while let Ok(Some(sample)) = told.try_recv() {
            let news = serde_json::from_slice::<GoalStatus>(&sample.payload().to_bytes());
            if let Some(news) = news.ok().filter(|news| news.id == status.id) {
                (status, heard) = (news, Instant::now());
            }
        }
        match asked {
            _ if status.state.is_final() => {}
            Ok(news) => (status, heard) = (news, Instant::now()),
            // It took this goal, and remembers the last that ended.
            Err(OperatorError::Refused(ErrorReply { code: ErrorCode::UnknownGoal, .. })) => {
                let why =
                    ": that is the last that it said; it knows nothing of this goal any more: it was started anew";
                return Err(OperatorError::NotArrived {
                    robot: status.robot,
                    id,
                    state: status.state,
                    why: why.to_owned(),
                });
            }
            // The link may come back. Meanwhile the server answers in the robot's place.
            Err(error) if heard.elapsed() <= PATIENCE => tracing::debug!("asked in vain: {error}"),
            Err(_) => {
                let seconds = heard.elapsed().as_secs();
                let why = format!(": nothing was heard of the robot for {seconds} s; it may still be on its way");
                return Err(OperatorError::NotArrived { robot: status.robot, id, state: status.state, why });
            }
        }
    }
    if status.state == GoalState::Arrived {
        return Ok(status);
    }
    let why = status.reason.map(|reason| format!(": {}", in_plain_words(&reason))).unwrap_or_default();
    Err(OperatorError::NotArrived { robot: status.robot, id, state: status.state, why })
}

/// Takes a goal back, or all. The robot is asked first: it may drive on a map that is there no
/// more.
pub(super) async fn cancel(
    session: &Session,
    map: &MapName,
    robot: &str,
    id: Option<&str>,
) -> Result<GoalStatus, OperatorError> {
    let key = Key::goal(map, robot, GoalTopic::Cancel);
    let selector = id.map_or_else(|| key.to_string(), |id| format!("{key}?id={id}"));
    match ask(session, &selector).await {
        Err(error @ (OperatorError::RobotSilent { .. } | OperatorError::Refused(_))) => {
            head(session, map).await?; // there is such a map
            Err(match error {
                // Nothing that was given is wrong.
                OperatorError::Refused(reply) if id.is_none() && reply.code == ErrorCode::UnknownGoal => {
                    OperatorError::NothingToCancel { robot: robot.to_owned() }
                }
                error => error,
            })
        }
        answered => answered,
    }
}

/// What a robot says, with the flags that mean the same, and nothing that a terminal obeys.
fn in_plain_words(said: &str) -> String {
    with_flags(said).chars().filter(|letter| !letter.is_control()).collect()
}

/// A status as a line.
pub(super) fn in_words(status: &GoalStatus) -> String {
    let id = status.id.as_deref().map(|id| format!(" goal {id}")).unwrap_or_default();
    let moved = status.goal_moved_m.map(|metres| format!(", as near as it can: {metres:.2} m from the goal"));
    let far = status.to_go_m.map(|metres| format!(", {metres:.1} m to go")).unwrap_or_default();
    let why = status.reason.as_deref().map(|reason| format!(": {}", in_plain_words(reason))).unwrap_or_default();
    let next = status.waiting.as_deref().map(|next| format!("; goal {next} is next")).unwrap_or_default();
    format!("{}:{id} {}{far}{}{why}{next}", status.robot, status.state, moved.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::api::request::parse_goal;

    #[test]
    fn what_is_sent_is_what_robots_read() {
        let map: MapName = "museum".parse().expect("a name");
        let order = |to: &str| {
            let selector = selector((&map, "tug"), "7", to, true).map_err(|error| error.to_string())?;
            let (key, parameters) = selector.split_once('?').unwrap_or_default();
            assert_eq!(key, "fht/museum/robots/tug/goal");
            let pairs = parameters.split(';').filter_map(|pair| pair.split_once('='));
            parse_goal(pairs, None).map_err(|error| error.message)
        };
        assert!(order("Küche").is_ok_and(|order| order.to_nearest && order.yaw.is_none()));
        assert!(order("-1.5,3").is_ok_and(|order| order.yaw.is_none()));
        assert!(
            order("-1.5,3,90")
                .is_ok_and(|order| order.yaw.is_some_and(|yaw| (yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-4))
        );
        for wrong in ["1", "a b", "1,x", "1,2,3,4", "dock;id=8"] {
            assert!(order(wrong).is_err_and(|said| said.contains("x,y,yaw")), "{wrong}");
        }
    }
}
