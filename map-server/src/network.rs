//! The service over Zenoh: what arrives, what is announced, what is answered.
//!
//! | module | idea |
//! | --- | --- |
//! | `session` | the server's session |
//! | `increments` | subscribes to increments and queues them for the writer |
//! | `robot_topics` | subscribes to what robots say about themselves |
//! | `announcements` | publishes heads, and refusals to their writers |
//! | `known_keys` | makes the keys that robots ask for known to all routers |
//! | `connected_sessions` | who is connected to the session |
//! | `other_servers` | notices another server that answers for the same maps |
//! | `queryable` | answers queries |
//! | `query_door` | keeps those waiting that come before the store is read |
//! | `query_rooms` | … and which of them wait for which |
//! | `query_counts` | how many there were, and how long they took |
//! | `query_trace` | what each goes through, for OpenTelemetry |
//! | `addressed` | what a key expression asks for |

mod addressed;
mod announcements;
#[cfg(feature = "web")]
mod connected_sessions;
mod increments;
mod known_keys;
mod other_servers;
mod query_counts;
mod query_door;
mod query_rooms;
mod query_trace;
mod queryable;
mod robot_topics;
mod session;

pub(crate) use announcements::{publish_head, publish_refusal};
#[cfg(feature = "web")]
pub(crate) use connected_sessions::ConnectedSessions;
pub(crate) use increments::subscribe_increments;
pub(crate) use known_keys::KnownKeys;
pub(crate) use other_servers::warn_of_other_servers;
#[cfg(feature = "web")]
pub(crate) use query_counts::CountedQueries;
pub(crate) use query_door::QueryDoor;
#[cfg(feature = "web")]
pub(crate) use query_rooms::CostClass;
pub(crate) use queryable::QueryService;
pub(crate) use robot_topics::{RobotTopicSubscriptions, learn_blockages, subscribe_robot_topics};
pub use session::ServerSessionError;
pub(crate) use session::{check_certificate, open, open_to_strangers, own_name, successor, to_zenoh};
