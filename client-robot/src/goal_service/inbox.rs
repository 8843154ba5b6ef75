//! What has come and was not taken in yet: read, checked, and bounded.

use fht_proto::api::goal::GoalOrder;
use fht_proto::api::keys::{GoalTopic, Key, RobotTopic};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::api::request::{bad_request, parse_goal, parse_goal_id, shown};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use zenoh::Wait;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::query::Query;

/// Goals that wait to be taken in: the robot takes all once a frame.
const MAX_GOALS: usize = 16;
/// All that waits: a flood of goals leaves room for a cancellation.
const MAX_REQUESTS: usize = 48;
/// Goals that were put when the robot had too much to do, of which it is told: nobody else hears of
/// their refusal.
const MAX_REFUSED: usize = 64;

/// What a robot is told or asked.
#[derive(Debug, PartialEq)]
pub(super) enum Ask {
    Send(GoalOrder),
    /// This goal, or all.
    Cancel(Option<String>),
    /// Of this goal, or of the newest.
    Status(Option<String>),
}

/// What has come, with who waits for a reply.
pub(super) struct Request {
    pub(super) ask: Ask,
    pub(super) query: Option<Query>,
}

/// Which of a robot's keys an expression means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Addressed {
    /// Where it is sent.
    Goal,
    /// What is asked about that.
    Topic(GoalTopic),
}

/// What an expression means; none: nothing that is for this robot alone.
fn addressed(expression: &str) -> Option<Result<Addressed, ErrorReply>> {
    match expression.parse() {
        Ok(Key::RobotTopic { topic: RobotTopic::Goal, .. }) => Some(Ok(Addressed::Goal)),
        Ok(Key::Goal { topic, .. }) => Some(Ok(Addressed::Topic(topic))),
        // Several robots may be asked at once, or told to stand, and not sent to one place.
        Err(_) if expression.contains('*') => {
            let ends_with = |topic: &GoalTopic| {
                let chunks = [topic.as_str(), RobotTopic::Goal.as_str()];
                expression.rsplit('/').take(2).eq(chunks)
            };
            GoalTopic::ALL.into_iter().find(ends_with).map(|topic| Ok(Addressed::Topic(topic)))
        }
        _ => {
            let topics = GoalTopic::ALL.map(|topic| format!("goal/{}", topic.as_str()));
            let text = format!("{} is no key of a robot: it has goal, {}", shown(expression), topics.join(", "));
            Some(Err(bad_request(text)))
        }
    }
}

/// Reads what is said under a key.
fn read<'a>(
    addressed: Addressed,
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&ZBytes>,
) -> Result<Ask, ErrorReply> {
    if let Some(length) = payload.map(ZBytes::len).filter(|length| *length > GoalOrder::MAX_BYTES) {
        let most = GoalOrder::MAX_BYTES;
        return Err(bad_request(format!("{length} bytes are too many for a goal: at most {most}")));
    }
    let payload = payload.map(ZBytes::to_bytes);
    let payload = payload.as_deref();
    match addressed {
        Addressed::Goal => parse_goal(parameters, payload).map(Ask::Send),
        Addressed::Topic(GoalTopic::Cancel) => parse_goal_id(parameters, payload).map(Ask::Cancel),
        Addressed::Topic(GoalTopic::Status) => parse_goal_id(parameters, payload).map(Ask::Status),
    }
}

/// What has come, in its order.
#[derive(Default)]
struct Waiting {
    requests: VecDeque<Request>,
    /// Put, and not taken.
    refused: Vec<GoalOrder>,
}

/// What has come and waits for the robot.
#[derive(Default)]
pub(super) struct Inbox(Mutex<Waiting>);

impl Inbox {
    /// All that has come since the last time.
    pub(super) fn take(&self) -> Vec<Request> {
        self.lock().requests.drain(..).collect()
    }

    /// The goals that were put since the last time when too much waited already.
    pub(super) fn take_refused(&self) -> Vec<GoalOrder> {
        std::mem::take(&mut self.lock().refused)
    }

    /// Takes what was put under one of the robot's keys.
    pub(super) fn take_put(&self, under: Addressed, payload: &ZBytes) {
        let outcome = read(under, std::iter::empty(), Some(payload)).and_then(|ask| self.push(ask, None));
        if let Err(refusal) = outcome {
            tracing::debug!(?under, "what was put is not taken: {refusal}");
        }
    }

    /// Takes a query; one that cannot be taken is answered at once.
    pub(super) fn take_query(&self, query: Query) {
        let Some(under) = addressed(query.key_expr().as_str()) else { return };
        let ask = under.and_then(|under| read(under, query.parameters().iter(), query.payload()));
        let outcome = ask.and_then(|ask| self.push(ask, Some(query.clone())));
        if let Err(sending) = outcome.or_else(|refusal| refuse(&query, &refusal)) {
            tracing::debug!("a refusal could not be sent: {sending}"); // the asker has gone
        }
    }

    fn push(&self, ask: Ask, query: Option<Query>) -> Result<(), ErrorReply> {
        let mut waiting = self.lock();
        let most = if matches!(ask, Ask::Send(_)) { MAX_GOALS } else { MAX_REQUESTS };
        if waiting.requests.len() >= most {
            if let (Ask::Send(order), None) = (ask, query)
                && waiting.refused.len() < MAX_REFUSED
            {
                waiting.refused.push(order);
            }
            return Err(busy());
        }
        waiting.requests.push_back(Request { ask, query });
        Ok(())
    }

    // A panic while it was held is a bug, and leaves every request whole.
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Sends an error reply.
pub(super) fn refuse(query: &Query, refusal: &ErrorReply) -> Result<(), zenoh::Error> {
    query.reply_err(serde_json::to_vec(refusal)?).encoding(Encoding::APPLICATION_JSON).wait()
}

/// The refusal of what comes too fast.
pub(super) fn busy() -> ErrorReply {
    ErrorReply::new(ErrorCode::Busy, "the robot was told too much at a time; ask again")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_goals_are_told_apart() {
        let (status, cancel) = (Addressed::Topic(GoalTopic::Status), Addressed::Topic(GoalTopic::Cancel));
        for key in ["fht/m/robots/r/goal/status", "fht/*/robots/*/goal/status", "fht/**/goal/status"] {
            assert_eq!(addressed(key), Some(Ok(status)), "{key}");
        }
        assert_eq!(addressed("fht/m/robots/*/goal/cancel"), Some(Ok(cancel)));
        assert_eq!(addressed("fht/m/robots/r/goal"), Some(Ok(Addressed::Goal)));
        for for_others in ["fht/**", "fht/*/robots/**", "fht/m/robots/*/goal", "fht/m/robots/r/goal/*"] {
            assert_eq!(addressed(for_others), None, "{for_others}");
        }
        let misspelt = addressed("fht/m/robots/r/goal/stat");
        let is_told = |text: &str| text.contains("goal/cancel, goal/status");
        assert!(matches!(&misspelt, Some(Err(error)) if is_told(&error.message)), "{misspelt:?}");
    }

    #[test]
    fn a_flood_is_bounded_and_leaves_room_for_a_cancellation() {
        let inbox = Inbox::default();
        let order = |id: usize| GoalOrder {
            id: id.to_string(),
            to: "dock".parse().expect("a name"),
            yaw: None,
            to_nearest: false,
        };
        let taken = (0..10_000).filter(|id| inbox.push(Ask::Send(order(*id)), None).is_ok()).count();
        assert_eq!(taken, MAX_GOALS);
        assert!(inbox.push(Ask::Send(order(0)), None).is_err_and(|refusal| refusal.code == ErrorCode::Busy));
        assert!(inbox.push(Ask::Cancel(None), None).is_ok());
        let requests = inbox.take();
        assert_eq!((requests.len(), &requests[MAX_GOALS].ask), (MAX_GOALS + 1, &Ask::Cancel(None)));
        assert!(inbox.take().is_empty());
        let refused: Vec<String> = inbox.take_refused().into_iter().map(|order| order.id).collect();
        let expected: Vec<String> = (MAX_GOALS..MAX_GOALS + MAX_REFUSED).map(|id| id.to_string()).collect();
        assert_eq!(refused, expected, "of so many the sender hears");
        assert!(inbox.take_refused().is_empty());
    }

    #[test]
    fn what_is_put_and_cannot_be_read_is_left_out() {
        let inbox = Inbox::default();
        for bad in [vec![0xff; 9], b"[]".to_vec(), vec![b'{'; 100_000], b"{\"id\":\"1\",\"x\":1e400,\"y\":0}".to_vec()]
        {
            inbox.take_put(Addressed::Goal, &ZBytes::from(bad));
        }
        assert!(inbox.take().is_empty());
        inbox.take_put(Addressed::Goal, &ZBytes::from(r#"{"id": "1", "to": "dock"}"#));
        inbox.take_put(Addressed::Topic(GoalTopic::Cancel), &ZBytes::from(""));
        let asks: Vec<Ask> = inbox.take().into_iter().map(|request| request.ask).collect();
        assert!(matches!(asks.as_slice(), [Ask::Send(order), Ask::Cancel(None)] if order.id == "1"), "{asks:?}");
    }
}
