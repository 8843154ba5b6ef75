//! Sending goals to an action server.

use crate::attachment::Gid;
use crate::error::RosError;
use crate::node::{RosNode, now_ns};
use crate::qos::Qos;
use crate::service::RawClient;
use crate::subscription::RawSubscription;
use fht_ros_messages::msg::{CancelGoal, CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalUuid};
use fht_ros_messages::{
    FeedbackMessage, GetResultRequest, GetResultResponse, RosAction, RosService, SendGoalRequest, SendGoalResponse, cdr,
};
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

/// How long a server may think about a goal.
const PATIENCE: Duration = Duration::from_secs(10);
/// A goal may take as long as it takes: Zenoh has no "for ever".
const AGES: Duration = Duration::from_secs(10 * 365 * 24 * 3600);

/// Sends goals.
pub struct ActionClient<A> {
    clients: Arc<Clients>,
    action: PhantomData<fn() -> A>,
}

struct Clients {
    name: String,
    goals: RawClient,
    cancels: RawClient,
    results: RawClient,
    node: RosNode,
}

/// A goal that the server has taken.
pub struct SentGoal<A> {
    goal_id: GoalUuid,
    clients: Arc<Clients>,
    feedback: RawSubscription,
    action: PhantomData<fn() -> A>,
}

impl RosNode {
    /// A client of the action `name`.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn action_client<A: RosAction>(&self, name: &str) -> Result<ActionClient<A>, RosError> {
        let (kind, within) = (A::TYPE, |part: &str| format!("{name}/_action/{part}"));
        let clients = Clients {
            name: self.resolve(name)?,
            goals: RawClient::new(self, &within("send_goal"), &format!("{kind}_SendGoal")).await?,
            cancels: RawClient::new(self, &within("cancel_goal"), CancelGoal::TYPE).await?,
            results: RawClient::new(self, &within("get_result"), &format!("{kind}_GetResult")).await?,
            node: self.clone(),
        };
        Ok(ActionClient { clients: Arc::new(clients), action: PhantomData })
    }
}

impl<A: RosAction> ActionClient<A> {
    /// Sends a goal, and waits until the server takes it.
    ///
    /// # Errors
    /// [`RosError::NoServer`] when there is none, [`RosError::Refused`] when it rejects the goal.
    pub async fn send(&self, goal: A::Goal) -> Result<SentGoal<A>, RosError> {
        let Clients { name, goals, node, .. } = &*self.clients;
        let feedback_type = format!("{}_FeedbackMessage", A::TYPE);
        let topic = format!("{name}/_action/feedback");
        // Subscribed before, so that no feedback is missed.
        let feedback = RawSubscription::new(node, &topic, &feedback_type, Qos::default()).await?;
        let goal_id = GoalUuid { uuid: Gid::of_token(&format!("{} {}", feedback.declared.token, now_ns())).0 };
        let taken: SendGoalResponse = goals.call(&SendGoalRequest { goal_id, goal }, PATIENCE).await?;
        if !taken.accepted {
            return Err(RosError::Refused { name: name.clone(), reason: "the goal is rejected".to_owned() });
        }
        Ok(SentGoal { goal_id, clients: Arc::clone(&self.clients), feedback, action: PhantomData })
    }
}

impl<A: RosAction> SentGoal<A> {
    /// Waits for the next word of how it goes. Cancel safe.
    ///
    /// # Errors
    /// [`RosError::Message`] when it is none.
    pub async fn feedback(&self) -> Result<A::Feedback, RosError> {
        loop {
            let received = self.feedback.inbox.next().await;
            let name = &self.feedback.declared.name;
            let message: FeedbackMessage<A::Feedback> =
                cdr::decode_owned(&received.bytes).map_err(RosError::message(name))?;
            if message.goal_id == self.goal_id {
                return Ok(message.feedback);
            }
        }
    }

    /// Asks the server to end it early; `true` if it will.
    ///
    /// # Errors
    /// [`RosError`].
    pub async fn cancel(&self) -> Result<bool, RosError> {
        let goal_info = GoalInfo { goal_id: self.goal_id, ..GoalInfo::default() };
        let response: CancelGoalResponse =
            self.clients.cancels.call(&CancelGoalRequest { goal_info }, PATIENCE).await?;
        Ok(response.goals_canceling.iter().any(|goal| goal.goal_id == self.goal_id))
    }

    /// Waits until the goal has ended: how (a constant of
    /// [`GoalStatusMsg`](fht_ros_messages::msg::GoalStatusMsg)), and what came of it.
    ///
    /// # Errors
    /// [`RosError`]; [`RosError::NoServer`] when the server is gone.
    pub async fn result(&self) -> Result<GetResultResponse<A::Result>, RosError> {
        self.clients.results.call(&GetResultRequest { goal_id: self.goal_id }, AGES).await
    }
}
