//! Velocity commands, with or without a stamp: which of the two is ROS's choice of the year, so it
//! is looked what the robot's driver takes.

use fht_ros::{EndpointKind, Publisher, Qos, QosDurability, QosReliability, RosError, RosNode};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{HeaderMsg, TwistMsg, TwistStamped};
use std::time::{Duration, Instant};
use tokio::task::JoinHandle;

/// How long routers may take to tell who is on the graph.
pub(crate) const ROLL_CALL: Duration = Duration::from_secs(2);
/// Only the newest command counts.
const COMMAND_QOS: Qos = Qos { reliability: QosReliability::Reliable, durability: QosDurability::Volatile, depth: 1 };
/// Between two looks for who takes commands.
const LOOK_AGAIN: Duration = Duration::from_millis(250);
/// How long who takes commands is waited for.
const DRIVER_COMES: Duration = Duration::from_secs(10);

/// Where commands go.
pub(crate) enum Commands {
    Plain(Publisher<TwistMsg>),
    Stamped(Publisher<TwistStamped>),
    /// Nobody takes commands yet: it is looked again beside the loop.
    Nobody(JoinHandle<Result<Self, RosError>>),
}

impl Commands {
    /// With a stamp if who takes commands wants one.
    pub(crate) async fn find(node: &RosNode, topic: &str) -> Result<Self, RosError> {
        if let Some(found) = Self::for_takers(node, topic).await? {
            return Ok(found);
        }
        let (node, topic) = (node.clone(), topic.to_owned());
        Ok(Self::Nobody(tokio::spawn(async move { Self::wait_for_takers(&node, &topic).await })))
    }

    /// The driver may still come. After [`DRIVER_COMES`] commands are given without a stamp, in
    /// case it cannot be seen.
    async fn wait_for_takers(node: &RosNode, topic: &str) -> Result<Self, RosError> {
        let began = Instant::now();
        while began.elapsed() < DRIVER_COMES {
            tokio::time::sleep(LOOK_AGAIN).await;
            if let Some(found) = Self::for_takers(node, topic).await? {
                return Ok(found);
            }
        }
        Ok(Self::Plain(node.publisher(topic, COMMAND_QOS).await?))
    }

    async fn for_takers(node: &RosNode, topic: &str) -> Result<Option<Self>, RosError> {
        let there = node.endpoints(ROLL_CALL).await?;
        let takers = there.iter().filter(|end| end.kind == EndpointKind::Subscription && end.name == topic);
        let types: Vec<&str> = takers.map(|end| end.ros_type.as_str()).collect();
        Ok(match types.contains(&TwistStamped::TYPE) {
            true => Some(Self::Stamped(node.publisher(topic, COMMAND_QOS).await?)),
            false if types.is_empty() => None,
            false => Some(Self::Plain(node.publisher(topic, COMMAND_QOS).await?)),
        })
    }

    /// What has been found by now.
    async fn settle(&mut self) -> Result<(), RosError> {
        while let Self::Nobody(looking) = self
            && looking.is_finished()
        {
            // The task is neither aborted nor does it panic; else nobody is looked for any more.
            let Ok(found) = looking.await else { break };
            *self = found?;
        }
        Ok(())
    }

    /// Gives a command to who takes commands, if it is there by now; `header` is that of one with a
    /// stamp.
    pub(crate) async fn give(&mut self, twist: TwistMsg, header: HeaderMsg) -> Result<(), RosError> {
        self.settle().await?;
        match self {
            Self::Nobody(_) => Ok(()),
            Self::Plain(publisher) => publisher.publish(&twist),
            Self::Stamped(publisher) => publisher.publish(&TwistStamped { header, twist }),
        }
    }
}
