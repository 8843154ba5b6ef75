//! Why the program ends early.

use fht_client::{AskError, ReplicaError, UnusablePath};
use fht_perception::robot::RobotError;
use fht_program::flags::with_flags;
use fht_proto::{MapName, ParseIdError};
use fht_ros::RosError;
use fht_session::{SessionError, in_words};
use fht_shared_world::JoinError;
use fht_sim::{StartError, WorldError};

/// Why a command could not be carried out.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CliError {
    #[error(transparent)]
    Link(#[from] SessionError),
    #[error("the robot's router: {0}")]
    RobotRouter(#[source] SessionError),
    #[error(transparent)]
    Graph(#[from] RosError),
    #[error("{error}{}", trouble.as_ref().map(|trouble| format!(": {trouble}")).unwrap_or_default())]
    Robot { error: RobotError, trouble: Option<String> },
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    #[error("{}", with_flags(&.0.to_string()))]
    Ask(#[from] AskError),
    #[error("{}", with_flags(&.0.to_string()))]
    Refused(#[from] fht_proto::api::reply::ErrorReply),
    #[error(transparent)]
    World(#[from] WorldError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    SharedWorld(#[from] JoinError),
    #[error("the descriptor network cannot be loaded: {0}")]
    Descriptor(#[from] fht_descriptor::DescriptorError),
    #[error("the server's answer cannot be used: {0}")]
    Path(#[from] UnusablePath),
    #[error(transparent)]
    RobotName(#[from] ParseIdError),
    #[error("the map '{0}' has no main nodes yet; nothing to relocalize at")]
    EmptyMap(MapName),
    #[error("map {map} has no {what} ({known})")]
    UnknownGoal { map: MapName, what: String, known: String },
    #[error("a robot called {0} is there already; give this one another --robot")]
    NameTaken(String),
    #[error("{0}")]
    Report(String),
    #[error("a thread cannot be started: {0}")]
    Thread(#[source] std::io::Error),
    #[error("no runtime: {0}")]
    Runtime(#[source] std::io::Error),
    #[error("Zenoh refuses: {}", in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    #[error("the recording failed: {0}")]
    Record(#[from] fht_bag::WriteError),
    #[error(transparent)]
    Files(#[from] fht_program::flags::FileClash),
    #[error(transparent)]
    OnlyWithRos(#[from] fht_ros_robot::OnlyWithRos),
    #[error(transparent)]
    Mission(#[from] crate::mission::MissionError),
    #[error("the report cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
}

impl CliError {
    /// Whether what was given is wrong, or not there, and not the run.
    pub(crate) fn is_input(&self) -> bool {
        match self {
            Self::Link(error) | Self::RobotRouter(error) => error.is_input(),
            Self::SharedWorld(error) => error.is_input(),
            Self::Refused(reply) | Self::Ask(AskError::Refused(reply)) => reply.code.is_input(),
            Self::World(_)
            | Self::Record(fht_bag::WriteError::Exists { .. })
            | Self::Files(_)
            | Self::OnlyWithRos(_)
            | Self::Graph(RosError::Name(_))
            | Self::Start(_)
            | Self::Descriptor(_)
            | Self::RobotName(_)
            | Self::UnknownGoal { .. }
            | Self::NameTaken(_) => true,
            Self::Replica(_)
            | Self::Graph(_)
            | Self::Robot { .. }
            | Self::Ask(_)
            | Self::Path(_)
            | Self::EmptyMap(_)
            | Self::Report(_)
            | Self::Thread(_)
            | Self::Runtime(_)
            | Self::Zenoh(_)
            | Self::Record(_)
            | Self::Mission(_)
            | Self::Json(_) => false,
        }
    }
}
