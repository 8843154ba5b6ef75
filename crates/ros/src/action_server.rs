//! Serving an action: goals are accepted or rejected, told of while they go on, and ended.

use crate::error::RosError;
use crate::goals::{GoalBook, ResultAnswer};
use crate::node::{RosNode, now_ns};
use crate::publisher::RawPublisher;
use crate::qos::Qos;
use crate::service::{RawCall, RawServer};
use fht_ros_messages::msg::{CancelGoal, CancelGoalRequest, GoalStatusArray, GoalStatusMsg, GoalUuid, Time};
use fht_ros_messages::{
    FeedbackMessage, GetResultRequest, GetResultResponse, RosAction, RosMessage, RosService, SendGoalRequest,
    SendGoalResponse, cdr,
};
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// Serves an action: take its goals with [`ActionServer::next`].
pub struct ActionServer<A> {
    goals: RawServer,
    shared: Arc<Shared>,
    answering: JoinHandle<()>,
    action: PhantomData<fn() -> A>,
}

impl<A> Drop for ActionServer<A> {
    fn drop(&mut self) {
        self.answering.abort();
    }
}

/// A goal that a client sends.
pub struct GoalRequest<A: RosAction> {
    /// What is to be reached.
    pub goal: A::Goal,
    goal_id: GoalUuid,
    call: RawCall,
    shared: Arc<Shared>,
}

/// A goal that was accepted. Dropped before it has ended, it is aborted.
pub struct ActiveGoal<A: RosAction> {
    goal_id: GoalUuid,
    shared: Arc<Shared>,
    has_ended: bool,
    action: PhantomData<fn() -> A>,
}

/// What the server's parts share.
struct Shared {
    book: Mutex<GoalBook<RawCall>>,
    status: RawPublisher,
    feedback: RawPublisher,
    /// Counts requests to cancel.
    cancelled: watch::Sender<u64>,
}

impl Shared {
    fn book(&self) -> MutexGuard<'_, GoalBook<RawCall>> {
        self.book.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell_status(&self) {
        let statuses = self.book().statuses();
        if let Err(error) = self.status.publish::<GoalStatusArray>(&statuses) {
            tracing::debug!("the states of goals cannot be told: {error}");
        }
    }

    /// Ends a goal, and answers who waits for its result.
    fn finish(&self, goal_id: GoalUuid, status: i8, result: Vec<u8>) {
        let waiting = self.book().finish(goal_id, status, result.clone());
        for call in waiting {
            answer(&call, result.clone());
        }
        self.tell_status();
    }

    fn cancel(&self, call: &RawCall) {
        match call.request::<CancelGoalRequest>() {
            Ok(request) => {
                let response = self.book().cancel(&request);
                if let Err(error) = call.respond(&response) {
                    tracing::debug!("a client that cancels cannot be answered: {error}");
                }
                self.cancelled.send_modify(|count| *count += 1);
                self.tell_status();
            }
            Err(error) => call.refuse(&error.to_string()),
        }
    }
}

fn answer(call: &RawCall, response: Vec<u8>) {
    if let Err(error) = call.respond_bytes(response) {
        tracing::debug!("a client that waits for a result cannot be answered: {error}");
    }
}

/// A result as it is told.
fn told<A: RosAction>(status: i8, result: A::Result) -> Vec<u8> {
    cdr::encode(&GetResultResponse { status, result }).unwrap_or_default()
}

impl RosNode {
    /// Serves the action `name`, in a task of the Tokio runtime that calls this.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn action_server<A: RosAction + 'static>(&self, name: &str) -> Result<ActionServer<A>, RosError> {
        let (kind, within) = (A::TYPE, |part: &str| format!("{name}/_action/{part}"));
        let status = RawPublisher::new(self, &within("status"), GoalStatusArray::TYPE, Qos::latched(1)).await?;
        let feedback_type = format!("{kind}_FeedbackMessage");
        let feedback = RawPublisher::new(self, &within("feedback"), &feedback_type, Qos::default()).await?;
        let goals = RawServer::new(self, &within("send_goal"), &format!("{kind}_SendGoal")).await?;
        let cancels = RawServer::new(self, &within("cancel_goal"), CancelGoal::TYPE).await?;
        let results = RawServer::new(self, &within("get_result"), &format!("{kind}_GetResult")).await?;
        let (cancelled, _) = watch::channel(0);
        let shared = Arc::new(Shared { book: Mutex::default(), status, feedback, cancelled });
        let answering = tokio::spawn(answer_all::<A>(Arc::clone(&shared), cancels, results));
        Ok(ActionServer { goals, shared, answering, action: PhantomData })
    }
}

/// Answers who cancels goals and who asks for results.
async fn answer_all<A: RosAction>(shared: Arc<Shared>, cancels: RawServer, results: RawServer) {
    loop {
        tokio::select! {
            call = cancels.inbox.next() => shared.cancel(&call),
            call = results.inbox.next() => match call.request::<GetResultRequest>() {
                Ok(GetResultRequest { goal_id }) => {
                    let said = shared.book().ask(goal_id, call);
                    match said {
                        ResultAnswer::Later => {}
                        ResultAnswer::Now(call, result) => answer(&call, result),
                        ResultAnswer::Unknown(call) => {
                            answer(&call, told::<A>(GoalStatusMsg::UNKNOWN, A::Result::default()));
                        }
                    }
                }
                Err(error) => call.refuse(&error.to_string()),
            },
        }
    }
}

impl<A: RosAction> ActionServer<A> {
    /// Waits for the next goal. Cancel safe.
    pub async fn next(&self) -> GoalRequest<A> {
        loop {
            let call = self.goals.inbox.next().await;
            match call.request::<SendGoalRequest<A::Goal>>() {
                Ok(SendGoalRequest { goal_id, .. }) if self.shared.book().knows(goal_id) => reject(&call),
                Ok(SendGoalRequest { goal_id, goal }) => {
                    return GoalRequest { goal, goal_id, call, shared: Arc::clone(&self.shared) };
                }
                Err(error) => call.refuse(&error.to_string()),
            }
        }
    }
}

fn reject(call: &RawCall) {
    if let Err(error) = call.respond(&SendGoalResponse::default()) {
        tracing::debug!("a client whose goal is rejected cannot be told: {error}");
    }
}

impl<A: RosAction> GoalRequest<A> {
    /// Takes the goal.
    ///
    /// # Errors
    /// [`RosError`] when the client cannot be told.
    pub fn accept(self) -> Result<ActiveGoal<A>, RosError> {
        let stamp = Time::from_us(u64::try_from(now_ns() / 1000).unwrap_or_default());
        self.shared.book().accept(self.goal_id, stamp);
        let goal = ActiveGoal {
            goal_id: self.goal_id,
            shared: Arc::clone(&self.shared),
            has_ended: false,
            action: PhantomData,
        };
        self.call.respond(&SendGoalResponse { accepted: true, stamp })?;
        self.shared.tell_status();
        Ok(goal)
    }

    /// Does not take it.
    pub fn reject(self) {
        reject(&self.call);
    }
}

impl<A: RosAction> ActiveGoal<A> {
    /// Its name, as the client gave it.
    #[must_use]
    pub fn id(&self) -> GoalUuid {
        self.goal_id
    }

    /// Tells how it goes.
    ///
    /// # Errors
    /// [`RosError`].
    pub fn feedback(&self, feedback: A::Feedback) -> Result<(), RosError> {
        self.shared.feedback.publish(&FeedbackMessage { goal_id: self.goal_id, feedback })
    }

    /// Whether somebody wants it to end early.
    #[must_use]
    pub fn is_canceling(&self) -> bool {
        self.shared.book().status(self.goal_id) == GoalStatusMsg::CANCELING
    }

    /// Waits until somebody wants it to end early. Cancel safe.
    pub async fn canceling(&self) {
        let mut cancelled = self.shared.cancelled.subscribe();
        while !self.is_canceling() {
            if cancelled.changed().await.is_err() {
                std::future::pending::<()>().await;
            }
        }
    }

    /// It is reached.
    pub fn succeed(self, result: A::Result) {
        self.end(GoalStatusMsg::SUCCEEDED, result);
    }

    /// It cannot be reached.
    pub fn abort(self, result: A::Result) {
        self.end(GoalStatusMsg::ABORTED, result);
    }

    /// It ends early, as was wanted.
    pub fn canceled(self, result: A::Result) {
        self.end(GoalStatusMsg::CANCELED, result);
    }

    fn end(mut self, status: i8, result: A::Result) {
        self.has_ended = true;
        self.shared.finish(self.goal_id, status, told::<A>(status, result));
    }
}

impl<A: RosAction> Drop for ActiveGoal<A> {
    fn drop(&mut self) {
        if !self.has_ended {
            let result = told::<A>(GoalStatusMsg::ABORTED, A::Result::default());
            self.shared.finish(self.goal_id, GoalStatusMsg::ABORTED, result);
        }
    }
}
