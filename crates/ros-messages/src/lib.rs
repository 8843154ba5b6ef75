//! ROS 2's interfaces without ROS: what a robot that maps and drives says and hears. No I/O.
//!
//! | module | idea |
//! | --- | --- |
//! | [`msg`] | the messages, field for field, and services |
//! | [`nav2`] | the actions of Nav2 |
//! | `interface` | what a message, a service and an action are |
//! | `action` | what ROS makes of an action: three services and two topics |
//! | [`cdr`] | their serialization |
//! | `definitions` | their definitions as text, which MCAP files carry |
//! | `hash` | the type hashes (RIHS01) that ROS 2 puts into names, by distribution |
//!
//! ```
//! use fht_ros_messages::msg::{StringMsg, TwistMsg};
//! use fht_ros_messages::{Distribution, RosMessage, cdr, definition, type_hash};
//!
//! let bytes = cdr::encode(&StringMsg { data: "hi".to_owned() })?;
//! assert_eq!(bytes, [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0]);
//! assert_eq!(cdr::decode::<StringMsg>(&bytes)?.data, "hi");
//!
//! let hash = type_hash(StringMsg::TYPE, Distribution::Jazzy).expect("a defined type");
//! assert!(hash.starts_with("RIHS01_df668c740482bbd4"));
//! let placeholder = type_hash(StringMsg::TYPE, Distribution::Humble);
//! assert_eq!(placeholder.as_deref(), Some("TypeHashNotSupported"));
//! let text = definition(TwistMsg::TYPE).expect("a defined type");
//! assert!(text.starts_with("geometry_msgs/Vector3 linear\n"));
//! # Ok::<(), fht_ros_messages::cdr::CdrError>(())
//! ```

mod action;
pub mod cdr;
mod definitions;
mod hash;
mod interface;
pub mod msg;
pub mod nav2;

pub use action::{FeedbackMessage, GetResultRequest, GetResultResponse, SendGoalRequest, SendGoalResponse};
pub use definitions::definition;
pub use hash::{Distribution, UnknownDistribution, definition_hash, type_hash};
pub use interface::{RosAction, RosMessage, RosService};
