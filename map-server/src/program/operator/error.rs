//! Why an operator's command failed.

use crate::network::ServerSessionError;
use crate::rescue::RestoreError;
use fht_client::AskError;
use fht_client::author::NotWritten;
use fht_map::crdt::inverse::InverseError;
use fht_proto::MapName;
use fht_proto::api::goal::GoalState;
use fht_proto::api::reply::ErrorReply;
use std::io::ErrorKind;
use std::path::PathBuf;

/// Why an operator's command failed.
#[derive(Debug, thiserror::Error)]
pub enum OperatorError {
    /// No session.
    #[error(transparent)]
    Session(#[from] ServerSessionError),
    /// The configuration makes the command listen where somebody else does.
    #[error(
        "cannot listen on {}: the address is in use. This --zenoh-config makes a server or router that listens; an \
         operator's command takes one that only connects (mode client, connect.endpoints), or --connect",
        listen.join(", ")
    )]
    Listens {
        /// The endpoints to listen on.
        listen: Vec<String>,
    },
    /// Zenoh refused.
    #[error("Zenoh refuses: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// Nobody answered in time.
    #[error(
        "no map-server answered: is one up, and in the list of roles, and may this operator ask it? (access control \
         drops silently)"
    )]
    Silent,
    /// An order was sent, and nobody has said what became of it.
    #[error("{}; it may have been carried out: see `map-server {see}`", Self::Silent)]
    OrderUnanswered {
        /// The command that shows it.
        see: String,
    },
    /// The server refused, with its reason.
    #[error("{0}")]
    Refused(ErrorReply),
    /// A map that is to be deleted takes nothing new; when and why that is was said before.
    #[error("nothing is written: a map that will be deleted takes nothing new; `map-server undelete {map}` keeps it")]
    ToBeDeleted {
        /// The map.
        map: MapName,
    },
    /// The answer cannot be read.
    #[error("the server's answer cannot be read: {0}")]
    Answer(String),
    /// A robot did not get where it was sent.
    #[error("{robot} did not arrive: goal {id} is {state}{why}")]
    NotArrived {
        /// The robot.
        robot: String,
        /// The goal.
        id: String,
        /// What became of it.
        state: GoalState,
        /// `: ` and the reason, if there is one.
        why: String,
    },
    /// A robot that is to drop its goals has none.
    #[error("the robot {robot} has no goal")]
    NothingToCancel {
        /// The robot.
        robot: String,
    },
    /// A robot that takes goals does not answer.
    #[error("the robot {robot} does not answer: does client-robot serve run, and may this operator send it?")]
    RobotSilent {
        /// The robot.
        robot: String,
    },
    /// A robot answers what makes no sense.
    #[error("what the robot {robot} answers cannot be used: {reason}")]
    RobotAnswer {
        /// The robot.
        robot: String,
        /// Why.
        reason: String,
    },
    /// What was put was not stored in time.
    #[error(
        "the server has not stored it within {seconds} s: may this operator write (access control drops silently), \
         and do enough storages answer? It may still be carried out: see journal before you give it again"
    )]
    NotStored {
        /// How long was waited, seconds.
        seconds: u64,
    },
    /// The command makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file that is there is not written over.
    #[error("{} is there, and is no exported map: it is not written over; give another name", .0.display())]
    NoArchive(PathBuf),
    /// A file is not a map.
    #[error("{}: {source}", path.display())]
    Archive {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: fht_proto::codec::archive::ArchiveError,
    },
    /// A map in a file is not what the file says, or could not be taken in by any server.
    #[error(transparent)]
    Unsound(#[from] RestoreError),
    /// Nothing is taken back.
    #[error("map {map}: {}{}", source.with_names(names.iter().map(String::as_str)), rest(source, *folded))]
    Undo {
        /// The map.
        map: MapName,
        /// Who may be meant: authors are ids.
        names: Vec<String>,
        /// Why.
        source: InverseError,
        /// The number of the author's last increment that is folded; none: 0.
        folded: u64,
    },
    /// An import has ended before the end of the file.
    #[error(
        "{reason}; part of map {map} is there (version {version} of {of}): when the reason is gone, the import goes on \
         from there, or `map-server delete {map}` takes it away"
    )]
    PartlyImported {
        /// The map.
        map: MapName,
        /// So many increments of it are there.
        version: u64,
        /// So many there are in the file.
        of: u64,
        /// Why.
        reason: Box<OperatorError>,
    },
    /// A merge into a new map has ended before its end.
    #[error(
        "{reason}; part of map {map} {} there: `map-server delete {map}` takes it away, and both maps are as they were",
        if *is_sure { "is" } else { "may be" }
    )]
    PartlyMerged {
        /// The new map.
        map: MapName,
        /// Whether something of it is known to be there.
        is_sure: bool,
        /// Why.
        reason: Box<OperatorError>,
    },
    /// A map is not renamed, and nothing of it has changed.
    #[error("{reason}; {old} is not renamed, and is kept as it was")]
    NotRenamed {
        /// The map.
        old: MapName,
        /// Why.
        reason: Box<OperatorError>,
    },
    /// Somebody else writes under the operator's name.
    #[error("somebody else writes as {author} at this moment: give the command again, or another --operator")]
    Contended {
        /// The operator's name.
        author: String,
    },
    /// Two maps are not merged.
    #[error("not merged: {0}")]
    Merge(#[from] fht_merge::MergeRefusal),
    /// The merge ended without giving a reason: a defect.
    #[error("the merge failed: {0}")]
    Lost(#[from] tokio::task::JoinError),
    /// The system gives no threads.
    #[error("no threads: {0}")]
    Runtime(std::io::Error),
}

/// What else there is of the author where nothing was found to take back.
fn rest(source: &InverseError, folded: u64) -> String {
    match source {
        InverseError::Unchanged { .. } if folded > 0 => format!("; increments 1 to {folded} are folded, and stay"),
        _ => String::new(),
    }
}

impl OperatorError {
    /// Whether what was given is wrong, or not there.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Session(error) => error.is_input(),
            Self::Refused(reply) => reply.code.is_input(),
            Self::Usage(_) | Self::NoArchive(_) | Self::Archive { .. } | Self::Unsound(_) | Self::Listens { .. } => {
                true
            }
            Self::File { source, .. } => is_of_name(source.kind()),
            Self::NotRenamed { reason, .. }
            | Self::PartlyImported { reason, .. }
            | Self::PartlyMerged { reason, .. } => reason.is_input(),
            // There are no such changes, or not so many.
            Self::Undo { source, .. } => {
                use InverseError::{NoneSuch, TooFew, Unchanged};
                matches!(source, TooFew { .. } | NoneSuch { .. } | Unchanged { .. })
            }
            _ => false,
        }
    }

    /// The same of an order that was sent; `see`: the command that shows whether it was done.
    pub(super) fn of_order(self, see: &str) -> Self {
        match self {
            Self::Silent => Self::OrderUnanswered { see: see.to_owned() },
            error => error,
        }
    }

    pub(super) fn json(error: &serde_json::Error) -> Self {
        Self::Answer(error.to_string())
    }
}

/// Whether a file cannot be read or written because of what it is called, and where it lies. A full
/// or broken disk is no wrong input.
fn is_of_name(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::NotFound
            | ErrorKind::PermissionDenied
            | ErrorKind::ReadOnlyFilesystem
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::InvalidFilename
            | ErrorKind::InvalidInput
    )
}

impl From<AskError> for OperatorError {
    fn from(error: AskError) -> Self {
        match error {
            AskError::Zenoh(error) => Self::Zenoh(error),
            AskError::Silent => Self::Silent,
            AskError::Refused(reply) => Self::Refused(reply),
            AskError::Unreadable(reason) => Self::Answer(reason),
        }
    }
}

impl From<NotWritten> for OperatorError {
    fn from(error: NotWritten) -> Self {
        match error {
            NotWritten::Zenoh(error) => Self::Zenoh(error),
            NotWritten::Ask(error) => error.into(),
            NotWritten::Name(error) => Self::Usage(error.to_string()),
            NotWritten::Refused(reply) => Self::Refused(reply),
            NotWritten::Unanswered => Self::Silent.of_order("maps"),
            NotWritten::NotStored { seconds } => Self::NotStored { seconds },
            NotWritten::Contended { author } => Self::Contended { author },
            error => Self::Usage(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_be_there_is_not_said_to_be_there() {
        let part = |is_sure| {
            let map = "hall".parse().unwrap_or_else(|error| panic!("{error}"));
            OperatorError::PartlyMerged { map, is_sure, reason: Box::new(OperatorError::Silent.of_order("maps")) }
        };
        assert!(part(true).to_string().contains("; part of map hall is there: "));
        let unsure = part(false).to_string();
        assert!(unsure.contains("; part of map hall may be there: `map-server delete hall` takes it away"), "{unsure}");
        let refused = OperatorError::Usage("no".to_owned()).of_order("maps");
        assert_eq!(refused.to_string(), "no", "that was an answer");
    }

    #[test]
    fn a_missing_folder_is_wrong_input_and_a_full_disk_is_not() {
        let is_input = |kind: ErrorKind| OperatorError::File { path: "y.fht".into(), source: kind.into() }.is_input();
        assert!(is_input(ErrorKind::NotFound) && is_input(ErrorKind::IsADirectory));
        assert!(!is_input(ErrorKind::StorageFull) && !is_input(ErrorKind::QuotaExceeded));
    }
}
