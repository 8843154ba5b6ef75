//! Key expressions: the one place where they are built and parsed. `docs/protocol.md` says who puts
//! and who answers what.
//!
//! | key | what |
//! | --- | --- |
//! | `fht/maps` | the maps there are |
//! | `fht/{map}/{topic}` | queries about one map: [`Topic`] |
//! | `fht/{map}/inc/{author}/{number}` | one increment |
//! | `fht/{map}/kept/{author}/{number}` | an increment that was checked, in storages |
//! | `fht/{map}/refused/{author}` | why an increment was refused, at most once a second |
//! | `fht/{map}/admin/{action}` | orders of operators: [`AdminAction`] |
//! | `fht/{map}/robots/{robot}` | liveliness token: who is here |
//! | `fht/{map}/robots/{robot}/{topic}` | what robots say of themselves: [`RobotTopic`] |
//! | `fht/{map}/robots/{robot}/goal/{topic}` | what becomes of the goals that it was sent: [`GoalTopic`] |

use crate::model::ids::{AuthorId, MapName, is_name};
use std::fmt;
use std::str::FromStr;

/// First chunk of every key.
pub const PREFIX: &str = "fht";

/// Matches the increments of every map (a server subscribes to it).
pub const ALL_INCREMENTS: &str = "fht/*/inc/**";
/// Matches what servers have storages keep, of every map.
pub const ALL_KEPT: &str = "fht/*/kept/**";
/// Matches the first increment that storages keep of each author of every map.
pub const ALL_FIRST_KEPT: &str = "fht/*/kept/*/1";
/// Where servers see which storages are there. It is among the keys that storages keep, and is no
/// increment's.
pub const STORAGE_PRESENCE: &str = "fht/-/kept/presence";
/// Matches what robots say of themselves on every map, but not their tokens (a server subscribes to
/// it).
pub const ALL_ROBOT_TOPICS: &str = "fht/*/robots/*/*";
/// Matches the tokens of all robots on every map.
pub const ALL_ROBOTS: &str = "fht/*/robots/*";
/// Matches every query to every map.
pub const ALL_QUERIES: &str = "fht/**";

/// Matches every query to a server: all but those that robots answer.
pub const SERVERS_QUERIES: [&str; 7] =
    ["fht/*", "fht/*/*", "fht/*/admin/**", "fht/*/inc/**", "fht/*/kept/**", "fht/*/refused/**", "fht/*/robots/*"];

/// What can be asked of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// Version, vector, digest, counts.
    Head,
    /// The increments that a replica lacks.
    Since,
    /// The whole map at a version.
    Snapshot,
    /// A path between two places.
    Path,
    /// Nodes near a place.
    Nodes,
    /// Nodes that look like a descriptor.
    Match,
    /// The releases.
    Releases,
    /// What has changed between two states.
    Diff,
    /// Named places, zones, closed edges, what is blocked.
    Rules,
    /// The robots.
    Fleet,
    /// What operators have changed, and who.
    Journal,
}

impl Topic {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Head,
        Self::Since,
        Self::Snapshot,
        Self::Path,
        Self::Nodes,
        Self::Match,
        Self::Releases,
        Self::Diff,
        Self::Rules,
        Self::Fleet,
        Self::Journal,
    ];

    /// The chunk that names it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Since => "since",
            Self::Snapshot => "snapshot",
            Self::Path => "path",
            Self::Nodes => "nodes",
            Self::Match => "match",
            Self::Releases => "releases",
            Self::Diff => "diff",
            Self::Rules => "rules",
            Self::Fleet => "fleet",
            Self::Journal => "journal",
        }
    }
}

/// What a robot puts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RobotTopic {
    /// Where it is: [`crate::api::fleet::RobotPose`]. An explorer that begins a map holds a
    /// liveliness token under it.
    Pose,
    /// What it runs: [`crate::api::fleet::RobotStatus`].
    Status,
    /// What it could not pass: [`crate::api::fleet::BlockedReport`].
    Blocked,
    /// Where an explorer is going: [`crate::api::fleet::ExplorerGoal`]. Explorers also hold a
    /// liveliness token under it. Where a robot that serves is sent:
    /// [`crate::api::goal::GoalOrder`].
    Goal,
    /// What an explorer has seen: [`crate::SeenArea`].
    Seen,
}

impl RobotTopic {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Pose, Self::Status, Self::Blocked, Self::Goal, Self::Seen];

    /// The chunk that names it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Status => "status",
            Self::Blocked => "blocked",
            Self::Goal => "goal",
            Self::Seen => "seen",
        }
    }
}

/// What can be asked of a robot that takes goals, besides taking one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GoalTopic {
    /// Drop a goal.
    Cancel,
    /// What has become of it: [`crate::api::goal::GoalStatus`].
    Status,
}

impl GoalTopic {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Cancel, Self::Status];

    /// The chunk that names it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Cancel => "cancel",
            Self::Status => "status",
        }
    }
}

/// What an operator may have the server do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AdminAction {
    /// Fold old increments.
    Retain,
    /// Take in a series of increments from a file.
    Import,
    /// Delete the map after a grace period.
    Delete,
    /// Do not delete it after all.
    Undelete,
    /// Open what robots reported blocked.
    Unblock,
    /// Have what a robot reported blocked stay so.
    KeepBlocked,
    /// Say what writers take of the server's room, or change what one may take.
    Quota,
}

impl AdminAction {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Retain, Self::Import, Self::Delete, Self::Undelete, Self::Unblock, Self::KeepBlocked, Self::Quota];

    /// The chunk that names it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Retain => "retain",
            Self::Import => "import",
            Self::Delete => "delete",
            Self::Undelete => "undelete",
            Self::Unblock => "unblock",
            Self::KeepBlocked => "keep-blocked",
            Self::Quota => "quota",
        }
    }
}

/// A concrete key of the service.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Key {
    /// `fht/maps`
    Maps,
    /// `fht/{map}/inc/{author}/{number}`
    Increment {
        /// The map written to.
        map: MapName,
        /// The writer.
        author: AuthorId,
        /// The writer's running number.
        number: u64,
    },
    /// `fht/{map}/kept/{author}/{number}`
    Kept {
        /// The map written to.
        map: MapName,
        /// The writer.
        author: AuthorId,
        /// The writer's running number.
        number: u64,
    },
    /// `fht/{map}/{topic}`
    Topic {
        /// The map asked.
        map: MapName,
        /// What is asked.
        topic: Topic,
    },
    /// `fht/{map}/refused/{author}`
    Refused {
        /// The map written to.
        map: MapName,
        /// The writer.
        author: AuthorId,
    },
    /// `fht/{map}/robots/{robot}`
    Robot {
        /// The map that the robot uses.
        map: MapName,
        /// The robot's name.
        robot: String,
    },
    /// `fht/{map}/robots/{robot}/{topic}`
    RobotTopic {
        /// The map that the robot uses.
        map: MapName,
        /// The robot's name.
        robot: String,
        /// What it says.
        topic: RobotTopic,
    },
    /// `fht/{map}/robots/{robot}/goal/{topic}`
    Goal {
        /// The map that the robot uses.
        map: MapName,
        /// The robot's name.
        robot: String,
        /// What is asked of it.
        topic: GoalTopic,
    },
    /// `fht/{map}/admin/{action}`
    Admin {
        /// The map.
        map: MapName,
        /// What is to be done.
        action: AdminAction,
    },
}

impl Key {
    /// The key of one increment.
    #[must_use]
    pub fn increment(map: &MapName, author: AuthorId, number: u64) -> Self {
        Self::Increment { map: map.clone(), author, number }
    }

    /// The key under which storages keep one increment.
    #[must_use]
    pub fn kept(map: &MapName, author: AuthorId, number: u64) -> Self {
        Self::Kept { map: map.clone(), author, number }
    }

    /// The key under which the server says why it refused an increment of `author`.
    #[must_use]
    pub fn refused(map: &MapName, author: AuthorId) -> Self {
        Self::Refused { map: map.clone(), author }
    }

    /// The key under which a robot says something.
    #[must_use]
    pub fn robot(map: &MapName, robot: &str, topic: RobotTopic) -> Self {
        Self::RobotTopic { map: map.clone(), robot: robot.to_owned(), topic }
    }

    /// The key under which a robot is asked about its goals.
    #[must_use]
    pub fn goal(map: &MapName, robot: &str, topic: GoalTopic) -> Self {
        Self::Goal { map: map.clone(), robot: robot.to_owned(), topic }
    }

    /// The key of a topic of a map.
    #[must_use]
    pub fn topic(map: &MapName, topic: Topic) -> Self {
        Self::Topic { map: map.clone(), topic }
    }
}

/// The expression that matches all increments of one map.
#[must_use]
pub fn increments_of(map: &MapName) -> String {
    format!("{PREFIX}/{map}/inc/**")
}

/// The expression that matches everything that storages keep of one author.
#[must_use]
pub fn kept_of(map: &MapName, author: AuthorId) -> String {
    format!("{PREFIX}/{map}/kept/{author}/*")
}

/// The expression that matches what all robots of a map say of one topic.
#[must_use]
pub fn robots_of(map: &MapName, topic: RobotTopic) -> String {
    format!("{PREFIX}/{map}/robots/*/{}", topic.as_str())
}

/// The expression that matches all keys under which a robot is sent and asked about its goals.
#[must_use]
pub fn goals_of(map: &MapName, robot: &str) -> String {
    format!("{PREFIX}/{map}/robots/{robot}/{}/**", RobotTopic::Goal.as_str())
}

/// The expression that matches the tokens of all robots of a map.
#[must_use]
pub fn presence_of(map: &MapName) -> String {
    format!("{PREFIX}/{map}/robots/*")
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Maps => write!(f, "{PREFIX}/maps"),
            Self::Increment { map, author, number } => write!(f, "{PREFIX}/{map}/inc/{author}/{number}"),
            Self::Kept { map, author, number } => write!(f, "{PREFIX}/{map}/kept/{author}/{number}"),
            Self::Topic { map, topic } => write!(f, "{PREFIX}/{map}/{}", topic.as_str()),
            Self::Refused { map, author } => write!(f, "{PREFIX}/{map}/refused/{author}"),
            Self::Robot { map, robot } => write!(f, "{PREFIX}/{map}/robots/{robot}"),
            Self::RobotTopic { map, robot, topic } => write!(f, "{PREFIX}/{map}/robots/{robot}/{}", topic.as_str()),
            Self::Goal { map, robot, topic } => {
                write!(f, "{PREFIX}/{map}/robots/{robot}/{}/{}", RobotTopic::Goal.as_str(), topic.as_str())
            }
            Self::Admin { map, action } => write!(f, "{PREFIX}/{map}/admin/{}", action.as_str()),
        }
    }
}

/// A text that is not a key of the service.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0} is not a key of the map service")]
pub struct ParseKeyError(String);

/// The map and the author that the key of an increment names, even if its number is none.
#[must_use]
pub fn writer_of(key: &str) -> Option<(MapName, AuthorId)> {
    let mut chunks = key.split('/');
    let (Some(PREFIX), Some(map), Some("inc"), Some(author)) =
        (chunks.next(), chunks.next(), chunks.next(), chunks.next())
    else {
        return None;
    };
    Some((map.parse().ok()?, author.parse().ok()?))
}

impl FromStr for Key {
    type Err = ParseKeyError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || ParseKeyError(text.chars().take(120).collect());
        let map = |name: &str| name.parse::<MapName>().map_err(|_| error());
        let robot = |name: &str| if is_name(name) { Ok(name.to_owned()) } else { Err(error()) };
        let chunks: Vec<&str> = text.split('/').collect();
        match chunks.as_slice() {
            [PREFIX, "maps"] => Ok(Self::Maps),
            [PREFIX, name, kind @ ("inc" | "kept"), author, number] => {
                let canonical = !number.starts_with('0') && number.bytes().all(|b| b.is_ascii_digit());
                if !canonical {
                    return Err(error());
                }
                let (map, author) = (map(name)?, author.parse().map_err(|_| error())?);
                let number = number.parse().map_err(|_| error())?;
                Ok(match *kind {
                    "inc" => Self::Increment { map, author, number },
                    _ => Self::Kept { map, author, number },
                })
            }
            [PREFIX, name, "refused", author] => {
                Ok(Self::Refused { map: map(name)?, author: author.parse().map_err(|_| error())? })
            }
            [PREFIX, name, "robots", who] => Ok(Self::Robot { map: map(name)?, robot: robot(who)? }),
            [PREFIX, name, "robots", who, topic] => {
                let topic = RobotTopic::ALL.into_iter().find(|t| t.as_str() == *topic).ok_or_else(error)?;
                Ok(Self::RobotTopic { map: map(name)?, robot: robot(who)?, topic })
            }
            [PREFIX, name, "robots", who, "goal", topic] => {
                let topic = GoalTopic::ALL.into_iter().find(|t| t.as_str() == *topic).ok_or_else(error)?;
                Ok(Self::Goal { map: map(name)?, robot: robot(who)?, topic })
            }
            [PREFIX, name, "admin", action] => {
                let action = AdminAction::ALL.into_iter().find(|a| a.as_str() == *action).ok_or_else(error)?;
                Ok(Self::Admin { map: map(name)?, action })
            }
            [PREFIX, name, topic] => {
                let topic = Topic::ALL.into_iter().find(|t| t.as_str() == *topic).ok_or_else(error)?;
                Ok(Self::Topic { map: map(name)?, topic })
            }
            _ => Err(error()),
        }
    }
}
