//! A live copy of a map over Zenoh, and what a robot tells and asks beside it.
//!
//! ```text
//!            increments, heads                      paths?
//!  server ───────────────────→ LiveReplica ──┐   ┌─────────→ server
//!            what is lacking?   (sync,       ├─ ServerPaths ──→ PlannedPath ──→ the robot
//!         ←──────────────────    staleness)  │   (own_paths at once, the server's when it comes)
//!  robots ── what is blocked ─→ Closures ────┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `queries` | questions to the server, each with one answer or the reason why there is none |
//! | `replica` | a live copy over a session, in a thread of its own ([`LiveReplica`]) |
//! | `sync`, `staleness` | what to ask for, and when not to trust a copy: no network, no clock |
//! | `closures` | what operators and other robots have closed, now |
//! | `planned_path`, `own_paths`, `navmesh` | paths that a robot plans on its own copy |
//! | `paths`, `path_reply` | paths from the server, checked, with the robot's own until they come |
//! | `presence` | that a robot is here, where, and what it runs |
//! | `robot_events` | the same of all robots, as it happens |
//! | [`author`] | writing single increments, for operators and tools |
//!
//! The decisions need no network. A copy that has just begun asks for the head, then for
//! everything:
//!
//! ```
//! use fht_client::{Sync, SyncConfig, SyncQuestion};
//! use fht_map::Replica;
//! use fht_proto::VersionVector;
//! use std::time::Instant;
//!
//! let (copy, mut sync) = (Replica::default(), Sync::new(SyncConfig::default()));
//! assert_eq!(sync.poll(&copy, Instant::now()), Some(SyncQuestion::Head));
//! let everything = SyncQuestion::Since(VersionVector::default());
//! assert_eq!(sync.poll(&copy, Instant::now()), Some(everything));
//! ```

pub mod author;
mod closures;
mod navmesh;
mod own_paths;
mod path_reply;
mod paths;
mod planned_path;
mod presence;
mod queries;
mod replica;
mod robot_events;
mod staleness;
mod sync;

pub use closures::Closures;
pub use navmesh::FreeSpaceCache;
pub use own_paths::{entry_node, rules_of_own, with_entry};
pub use path_reply::{UnusablePath, check_kept, planned, planned_between};
pub use paths::{PathQuestion, ServerPaths, ServerPathsConfig, ask_path};
pub use planned_path::{PathPoint, PathSource, PlannedPath, Planner};
pub use presence::{PoseReport, Presence};
pub use queries::{
    AskError, ask, ask_all_async, ask_async, ask_fleet_async, ask_head, ask_head_async, ask_json_async,
    ask_until_answered, read_head,
};
pub use replica::{LiveReplica, ReplicaConfig, ReplicaError};
pub use robot_events::{RobotEvent, RobotEvents, WatchError};
pub use staleness::{Staleness, StalenessConfig, StalenessStep};
pub use sync::{Running, Sync, SyncConfig, SyncQuestion};
