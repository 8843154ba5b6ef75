use super::*;
use fht_localization::localizer::{Localizer, LocalizerConfig};
use fht_perception::frame::Twist;
use fht_perception::pose::{Point2, Pose2};
use proptest::prelude::*;

fn order(id: &str) -> GoalOrder {
    GoalOrder { id: id.to_owned(), to: "dock".parse().expect("a name"), yaw: None, to_nearest: false }
}

fn goal(x: f64) -> DriveGoal {
    Point2::new(x, 0.0).into()
}

/// A frame after which the robot knows its place.
fn step(outcome: Option<TaskOutcome>) -> PilotStep {
    let mut localization = Localizer::new(LocalizerConfig::default()).current();
    localization.map_from_odom = Some(Pose2::identity());
    PilotStep { command: Twist::default(), localization, candidates: Vec::new(), outcome }
}

/// A path that reaches the goal.
fn way(left_m: f64) -> Option<GoalPath> {
    Some(GoalPath { left_m, goal_moved_m: 0.0 })
}

/// A robot that stands and knows where it is.
fn ready() -> GoalQueue {
    let mut goals = GoalQueue::new("tug");
    goals.observe(&step(Some(TaskOutcome::Localized)), None);
    assert_eq!(goals.next_task(), Some(Task::Stay));
    goals
}

fn send(goals: &mut GoalQueue, id: &str) -> Result<GoalStatus, ErrorReply> {
    goals.offer(order(id), |_| Ok(goal(1.0)))
}

fn news(goals: &mut GoalQueue) -> Vec<(String, GoalState)> {
    goals.take_news().into_iter().map(|status| (status.id.unwrap_or_default(), status.state)).collect()
}

fn said(of: &[(&str, GoalState)]) -> Vec<(String, GoalState)> {
    of.iter().map(|(id, state)| ((*id).to_owned(), *state)).collect()
}

#[test]
fn a_robot_that_does_not_know_where_it_is_takes_no_goal() {
    let mut goals = GoalQueue::new("tug");
    assert_eq!(goals.status(None).map(|status| status.state), Ok(GoalState::Idle));
    assert!(send(&mut goals, "a").is_err_and(|error| error.code == ErrorCode::NotLocalized));
    assert_eq!((goals.next_task(), goals.is_driving()), (None, false));
}

#[test]
fn one_goal_is_driven_to_and_one_is_next() {
    let mut goals = ready();
    assert_eq!(send(&mut goals, "a").map(|status| status.state), Ok(GoalState::Driving));
    assert!(!goals.is_decided("a"), "there is no path yet");
    assert_eq!(goals.next_task(), Some(Task::GoTo(goal(1.0))));
    goals.observe(&step(None), way(5.0));
    assert!(goals.is_decided("a"));
    assert_eq!(send(&mut goals, "b").map(|status| status.state), Ok(GoalState::Waiting));
    assert_eq!(send(&mut goals, "c").map(|status| status.state), Ok(GoalState::Waiting));
    let status = goals.status(None).expect("it drives");
    assert_eq!((status.to_go_m, status.waiting.as_deref()), (Some(5.0), Some("c")));
    let driving =
        [("a", GoalState::Driving), ("b", GoalState::Waiting), ("b", GoalState::Cancelled), ("c", GoalState::Waiting)];
    assert_eq!(news(&mut goals), said(&driving));
    let replaced = goals.status(Some("b")).expect("it is remembered");
    assert_eq!(replaced.reason.as_deref(), Some("goal c was sent in its place"));

    goals.observe(&step(Some(TaskOutcome::Arrived)), way(0.0));
    assert_eq!(goals.next_task(), Some(Task::GoTo(goal(1.0))));
    let refused = ErrorReply::new(ErrorCode::NoPath, "nothing joins them");
    goals.observe(&step(Some(TaskOutcome::Failed(Failure::NoPath(refused)))), None);
    assert_eq!((goals.next_task(), goals.next_task()), (Some(Task::Stay), None));
    assert_eq!(news(&mut goals), said(&[("a", GoalState::Arrived), ("c", GoalState::Failed)]));
    let failed = goals.status(None).expect("the last one");
    assert_eq!((failed.code, failed.reason.as_deref()), (Some(ErrorCode::NoPath), Some("no path: nothing joins them")));
}

#[test]
fn the_same_goal_again_is_the_same_and_another_one_needs_another_id() {
    let mut goals = ready();
    send(&mut goals, "a").expect("taken");
    send(&mut goals, "b").expect("taken");
    assert_eq!(send(&mut goals, "a").map(|status| status.state), Ok(GoalState::Driving));
    assert_eq!(send(&mut goals, "b").map(|status| status.state), Ok(GoalState::Waiting));
    let other = GoalOrder { to_nearest: true, ..order("a") };
    assert!(goals.offer(other, |_| Ok(goal(2.0))).is_err_and(|error| error.message.contains("another one")));
    goals.next_task();
    goals.observe(&step(Some(TaskOutcome::Arrived)), way(0.0));
    assert_eq!(send(&mut goals, "a").map(|status| status.state), Ok(GoalState::Arrived), "it is not driven twice");
    let unknown = || Err(ErrorReply::new(ErrorCode::UnknownPlace, "there is no dock"));
    assert!(goals.offer(order("d"), |_| unknown()).is_err_and(|error| error.code == ErrorCode::UnknownPlace));
    assert!(goals.status(Some("d")).is_err(), "what was refused is nothing");
}

#[test]
fn a_goal_that_was_put_and_refused_stays_failed_until_it_is_sent_again() {
    let mut goals = ready();
    let refusal = ErrorReply::new(ErrorCode::UnknownPlace, "there is no dock");
    goals.refuse(order("a"), refusal.clone());
    assert_eq!(news(&mut goals), said(&[("a", GoalState::Failed)]));
    for id in [None, Some("a")] {
        let status = goals.status(id).expect("it is remembered");
        assert_eq!((status.state, status.code), (GoalState::Failed, Some(ErrorCode::UnknownPlace)));
        assert_eq!((status.id.as_deref(), status.reason.as_deref()), (Some("a"), Some("there is no dock")));
    }
    // Refused again, it is one; taken, it is what it is.
    goals.refuse(order("a"), refusal.clone());
    assert_eq!(send(&mut goals, "a").map(|status| status.state), Ok(GoalState::Driving));
    goals.next_task();
    goals.observe(&step(Some(TaskOutcome::Arrived)), way(0.0));
    assert_eq!(goals.status(Some("a")).map(|status| status.state), Ok(GoalState::Arrived));
    // Another goal under a known id takes nothing away from that one.
    goals.take_news();
    goals.refuse(GoalOrder { to_nearest: true, ..order("a") }, refusal);
    assert_eq!(news(&mut goals), said(&[("a", GoalState::Failed)]));
    assert_eq!(goals.status(Some("a")).map(|status| status.state), Ok(GoalState::Arrived));
    // A flood of them takes no other's place.
    for number in 0..100 {
        goals.refuse(order(&format!("f{number}")), ErrorReply::new(ErrorCode::UnknownPlace, "there is no dock"));
    }
    assert_eq!(goals.status(Some("a")).map(|status| status.state), Ok(GoalState::Arrived));
    assert!(goals.status(Some("f99")).is_ok() && goals.status(Some("f0")).is_err());
}

#[test]
fn a_goal_without_a_path_leaves_its_id_free() {
    let mut goals = ready();
    let no_path = ErrorReply::new(ErrorCode::KeepOut, "dock lies in the zone wet");
    send(&mut goals, "a").expect("taken");
    goals.next_task();
    goals.observe(&step(Some(TaskOutcome::Failed(Failure::NoPath(no_path)))), None);
    assert_eq!(news(&mut goals), said(&[("a", GoalState::Failed)]));
    assert_eq!(goals.status(Some("a")).map(|status| status.code), Ok(Some(ErrorCode::KeepOut)));
    // The zone is taken away, and the same goal is sent once more.
    assert_eq!(send(&mut goals, "a").map(|status| status.state), Ok(GoalState::Driving));
    goals.next_task();
    goals.observe(&step(None), way(2.0));
    goals.observe(&step(Some(TaskOutcome::Failed(Failure::Timeout { seconds: 1.0 }))), None);
    assert_eq!(send(&mut goals, "a").map(|status| status.state), Ok(GoalState::Failed), "it was driven to");
}

#[test]
fn a_goal_that_is_cancelled_lets_the_robot_stand_or_go_on_to_the_next() {
    let mut goals = ready();
    assert!(goals.cancel(None).is_err_and(|error| error.code == ErrorCode::UnknownGoal));
    for id in ["a", "b"] {
        send(&mut goals, id).expect("taken");
    }
    goals.next_task();
    assert!(goals.cancel(Some("x")).is_err_and(|error| error.code == ErrorCode::UnknownGoal));
    assert_eq!(goals.cancel(Some("b")).map(|status| status.state), Ok(GoalState::Cancelled));
    assert_eq!(goals.next_task(), None, "it drives on");
    assert_eq!(goals.cancel(Some("a")).map(|status| status.state), Ok(GoalState::Cancelled));
    assert_eq!(goals.cancel(Some("a")).map(|status| status.state), Ok(GoalState::Cancelled), "twice does no harm");
    assert_eq!(goals.next_task(), Some(Task::Stay));

    for id in ["c", "d"] {
        send(&mut goals, id).expect("taken");
    }
    goals.next_task();
    goals.cancel(Some("c")).expect("under way");
    assert!(matches!(goals.next_task(), Some(Task::GoTo(_))), "the next one");
    send(&mut goals, "e").expect("taken");
    let all = goals.cancel(None).expect("all");
    assert_eq!(all.id.as_deref(), Some("d"));
    assert_eq!(all.reason.as_deref(), Some("it was cancelled, and so was goal e, which was next"));
    assert_eq!((goals.next_task(), goals.is_driving()), (Some(Task::Stay), false));
    // Cancelled and sent anew between two frames.
    send(&mut goals, "f").expect("taken");
    goals.next_task();
    goals.cancel(Some("f")).expect("under way");
    send(&mut goals, "g").expect("taken");
    assert!(matches!(goals.next_task(), Some(Task::GoTo(_))));
}

#[test]
fn what_has_not_ended_is_cancelled_with_the_robots_end() {
    let mut goals = ready();
    for id in ["a", "b"] {
        send(&mut goals, id).expect("taken");
    }
    goals.take_news();
    goals.close("the robot has ended");
    assert_eq!(news(&mut goals), said(&[("b", GoalState::Cancelled), ("a", GoalState::Cancelled)]));
    assert_eq!(goals.status(None).ok().and_then(|status| status.reason).as_deref(), Some("the robot has ended"));
}

/// Something that happens to a robot.
#[derive(Clone, Debug)]
enum Event {
    Send(u8),
    Cancel(Option<u8>),
    Frame(Option<bool>),
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        any::<u8>().prop_map(Event::Send),
        prop::option::of(any::<u8>()).prop_map(Event::Cancel),
        prop::option::of(any::<bool>()).prop_map(Event::Frame),
    ]
}

proptest! {
    #[test]
    fn whatever_happens_every_goal_ends_once_and_the_pilot_follows(events in prop::collection::vec(event(), 0..200)) {
        let mut goals = ready();
        let mut task = Task::Stay;
        let mut ends: Vec<String> = Vec::new();
        for event in events {
            match event {
                Event::Send(id) => _ = send(&mut goals, &id.to_string()),
                Event::Cancel(id) => _ = goals.cancel(id.map(|id| id.to_string()).as_deref()),
                Event::Frame(outcome) => {
                    task = goals.next_task().unwrap_or(task);
                    prop_assert_eq!(matches!(task, Task::GoTo(_)), goals.is_driving());
                    let failed = TaskOutcome::Failed(Failure::Timeout { seconds: 1.0 });
                    let outcome = outcome.filter(|_| goals.is_driving());
                    let outcome = outcome.map(|arrives| if arrives { TaskOutcome::Arrived } else { failed });
                    goals.observe(&step(outcome), goals.is_driving().then_some(1.0).and_then(way));
                }
            }
            let ended = goals.take_news().into_iter().filter(|status| status.state.is_final());
            ends.extend(ended.filter_map(|status| status.id));
            prop_assert!(goals.ended.len() <= REMEMBERED);
        }
        let newest: Vec<&str> = goals.ended.iter().map(|ended| ended.order.id.as_str()).collect();
        let told: Vec<&str> = ends.iter().map(String::as_str).collect();
        prop_assert!(told.ends_with(&newest), "{:?} {:?}", told, newest);
    }
}

#[test]
fn who_asks_learns_that_the_robot_stopped_short_of_the_goal() {
    let mut goals = ready();
    send(&mut goals, "a").expect("taken");
    goals.next_task();
    goals.observe(&step(None), Some(GoalPath { left_m: 2.0, goal_moved_m: 30.5004 }));
    goals.observe(&step(Some(TaskOutcome::Arrived)), None);
    let status = goals.status(Some("a")).expect("it is remembered");
    assert_eq!((status.state, status.goal_moved_m, status.to_go_m), (GoalState::Arrived, Some(30.5), None));
}
