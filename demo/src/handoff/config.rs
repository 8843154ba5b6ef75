//! What the demo shows, and why it may end early.

use crate::process::ProcessError;
use fht_client::ReplicaError;
use fht_proto::{ParseIdError, SharedWorldName};
use fht_session::SessionError;
use fht_shared_world::JoinError;
use fht_sim::WorldError;
use std::path::{Path, PathBuf};

/// Who explores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Crew {
    /// One robot.
    One,
    /// This many at once, all starting in one room.
    Team(usize),
    /// One that dies after it has seen half of the building, and another that finishes the job.
    Succession,
}

/// What to show.
#[derive(Clone, Debug)]
pub struct HandoffConfig {
    /// The executable with the roles.
    pub executable: PathBuf,
    /// `museum`, `office` or the path of a Nav2 `map.yaml` or a Gazebo `.world`.
    pub world: String,
    /// Pictures for the walls of a Nav2 map.
    pub textures: Option<PathBuf>,
    /// Seed of everything: drawing, noise, light, start and goal.
    pub seed: u64,
    /// So many people walk about. All robots meet the same ones.
    pub people: u16,
    /// Who explores.
    pub crew: Crew,
    /// Whether the robots are simulated ones that speak ROS 2, at routers of their own. One
    /// explorer.
    pub ros: bool,
    /// Where the server listens.
    pub endpoint: String,
    /// Folder for the server's data and the reports of the programs.
    pub folder: PathBuf,
    /// Where the picture goes.
    pub picture: PathBuf,
    /// Whether a missing ONNX Runtime library may be fetched.
    pub fetch: bool,
    /// Whether progress is shown.
    pub progress: bool,
}

impl HandoffConfig {
    /// The world that all robots share, if there are people or several robots at once in it. Its
    /// name is that of this process and of the folder.
    ///
    /// # Errors
    /// Never: every such name is one.
    pub fn shared_world(&self) -> Result<Option<SharedWorldName>, ParseIdError> {
        let is_shared = self.people > 0 || matches!(self.crew, Crew::Team(_));
        is_shared.then(|| shared_world(&self.folder)).transpose()
    }
}

/// The name of the world that the robots of a demo share which keeps its data in `folder`.
///
/// # Errors
/// Never: every such name is one.
pub fn shared_world(folder: &Path) -> Result<SharedWorldName, ParseIdError> {
    let folder = folder.file_name().unwrap_or_default().to_string_lossy();
    let letters: String = folder.chars().filter(char::is_ascii_alphanumeric).take(40).collect();
    format!("handoff-{}-{letters}", std::process::id()).parse()
}

/// Why the demo ended early.
#[derive(Debug, thiserror::Error)]
pub enum HandoffError {
    /// A program failed.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A file of a program cannot be read.
    #[error("{path}: {reason}", path = path.display())]
    Report {
        /// Which file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The session cannot be opened.
    #[error(transparent)]
    Link(#[from] SessionError),
    /// The map cannot be fetched.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The server does not answer.
    #[error("the server does not tell its head: {0}")]
    Head(#[from] fht_client::AskError),
    /// The server's map did not arrive.
    #[error("the map did not arrive within {0} s")]
    Incomplete(u64),
    /// The world cannot be loaded.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The robots' world cannot be shared.
    #[error(transparent)]
    SharedWorld(#[from] JoinError),
    /// Zenoh failed.
    #[error("zenoh: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// A robot's graph cannot be listened to.
    #[error(transparent)]
    Ros(#[from] fht_ros::RosError),
    /// A thread that followed an explorer failed: a defect.
    #[error("an explorer was not followed to its end")]
    Thread,
    /// No runtime.
    #[error("no runtime: {0}")]
    Runtime(#[from] std::io::Error),
    /// The world's name is not a valid map name.
    #[error(transparent)]
    MapName(#[from] ParseIdError),
}

impl HandoffError {
    /// Whether what was given is wrong: a program says so by its exit code, 2.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Process(ProcessError::Failed { status, .. }) => status.code() == Some(2),
            Self::World(_) | Self::MapName(_) => true,
            _ => false,
        }
    }
}
