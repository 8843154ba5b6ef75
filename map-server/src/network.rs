//! The service over Zenoh: what arrives, what is announced, what is answered.
//!
//! | module | idea |
//! | --- | --- |
//! | `session` | the server's session |
//! | `increments` | subscribes to increments and queues them for the writer |
//! | `robot_topics` | subscribes to what robots say about themselves |
//! | `announcements` | publishes heads, and refusals to their writers |
//! | `queryable` | answers queries |

mod announcements;
mod increments;
mod queryable;
mod robot_topics;
mod session;

pub(crate) use announcements::{publish_head, publish_refusal};
pub(crate) use increments::subscribe_increments;
pub(crate) use queryable::QueryService;
pub(crate) use robot_topics::{RobotTopicSubscriptions, learn_blockages, subscribe_robot_topics};
pub use session::ServerSessionError;
pub(crate) use session::{open, open_to_strangers};
