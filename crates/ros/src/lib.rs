//! A node on a ROS 2 graph over Zenoh, without ROS.
//!
//! Robots with `rmw_zenoh` speak Zenoh themselves; others stand behind `zenoh-bridge-ros2dds`. This
//! library speaks as both do ([`KeyForm`]): keys, liveliness tokens, attachments and type hashes
//! are theirs, so that ROS's own tools see its nodes as their own.
//!
//! | module | idea |
//! | --- | --- |
//! | `names` | names of topics and types: resolved, checked, mangled |
//! | `keys` | keys of messages, tokens of nodes and endpoints |
//! | `qos` | quality of service, and how tokens say it |
//! | `attachment` | what each message says of its sender |
//! | `goals` | the goals of an action server, as plain data |
//! | `inbox` | a queue of bounded length: the oldest goes first |
//! | `node` | who one is, and who else is there ([`RosNode`]) |
//! | `publisher`, `subscription` | topics, also those that keep their last messages |
//! | `service` | asking and answering |
//! | `action_server`, `action_client` | goals, feedback, results |
//!
//! Needs a Tokio runtime with more than one thread, as Zenoh does. Here two nodes share a session:
//!
//! ```
//! use fht_ros::{RosNode, NodeConfig, Qos};
//! use fht_ros_messages::msg::StringMsg;
//!
//! # let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
//! # runtime.block_on(async {
//! # let mut config = zenoh::Config::default();
//! # config.insert_json5("scouting/multicast/enabled", "false")?;
//! # config.insert_json5("listen/endpoints", "[]")?;
//! let session = zenoh::open(config).await?; // on a robot: fht_session::open, at its router
//! let talker = RosNode::join(session.clone(), NodeConfig::new("talker")).await?;
//! let listener = RosNode::join(session, NodeConfig::new("listener")).await?;
//! let heard = listener.subscribe::<StringMsg>("chatter", Qos::default()).await?;
//! let chatter = talker.publisher("chatter", Qos::default()).await?;
//! chatter.publish(&StringMsg { data: "hello".to_owned() })?;
//! assert_eq!(heard.next().await?.data, "hello");
//! # Ok::<(), Box<dyn std::error::Error + Send + Sync>>(())
//! # }).map_err(|error| error.to_string())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod action_client;
mod action_server;
mod attachment;
mod error;
mod goals;
mod inbox;
mod keys;
mod missed;
mod names;
mod node;
mod publisher;
mod qos;
mod service;
mod subscription;

pub use action_client::{ActionClient, SentGoal};
pub use action_server::{ActionServer, ActiveGoal, GoalRequest};
pub use attachment::{Attachment, AttachmentError, Gid};
pub use error::RosError;
pub use keys::{
    Endpoint, EndpointKind, KeyForm, NodeIdentity, UnknownKeyForm, data_key, endpoint_token, endpoint_tokens,
    node_token, parse_token,
};
pub use names::{NameError, dds_type, namespace, resolve, ros_type};
pub use node::{NodeConfig, RosNode};
pub use publisher::Publisher;
pub use qos::{Qos, QosDurability, QosReliability};
pub use service::{Call, ServiceClient, ServiceServer};
pub use subscription::{Received, Subscription};
