//! An operator's last changes, taken back; or those of a robot that its role does not allow.

use super::journal;
use crate::access::read_roles;
use crate::program::operator::asking::state_of;
use crate::program::operator::error::OperatorError;
use crate::program::operator::transfer::fetch_state;
use crate::program::operator::write::write_numbered;
use fht_map::crdt::inverse::{Inverse, folded_upto, inverse, inverse_of, inverse_of_all};
use fht_map::{WriterRole, WriterRoles, may_write};
use fht_proto::{AuthorId, Increment, MapName, Op, Release, RobotName};
use serde::Serialize;
use std::path::Path;
use zenoh::Session;

/// About how long an increment may be, in memory.
const MAX_BYTES: usize = 512 << 10;

/// What is to be taken back.
pub(super) enum Undone {
    /// So many of the operator's newest increments.
    Newest(u64),
    /// All that a robot wrote.
    All(RobotName),
    /// What a robot wrote that its role does not allow.
    AgainstRoles {
        /// Who wrote it.
        author: RobotName,
        /// The roles.
        writers: WriterRoles,
    },
}

impl Undone {
    /// The operator's newest changes; of a robot all that it wrote, or what it wrote against the
    /// list of roles in a file.
    pub(super) fn asked(last: u64, author: Option<RobotName>, roles: Option<&Path>) -> Result<Self, OperatorError> {
        Ok(match (author, roles) {
            (None, _) => Self::Newest(last),
            (Some(author), None) => Self::All(author),
            (Some(author), Some(file)) => {
                let roles = read_roles(file).map_err(|error| OperatorError::Usage(error.to_string()))?;
                Self::AgainstRoles { author, writers: roles.writers }
            }
        })
    }

    /// The robot whose increments are meant; none: the operator's own.
    fn robot(&self) -> Option<&RobotName> {
        match self {
            Self::Newest(_) => None,
            Self::All(robot) | Self::AgainstRoles { author: robot, .. } => Some(robot),
        }
    }
}

/// What was taken back.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TakenBack {
    /// The map.
    map: MapName,
    /// Its version now.
    version: u64,
    /// Numbers of the increments that were taken back: the first and the last.
    undone: [u64; 2],
    /// In how many increments.
    increments: usize,
    /// What that did, a sentence each.
    words: Vec<String>,
}

/// Changes of operators whose names are looked up for a refusal.
const NAMED: u64 = 200;

/// Takes increments back.
pub(super) async fn undo(
    session: &Session,
    map: &MapName,
    operator: &str,
    undone: Undone,
    quiet: bool,
) -> Result<TakenBack, OperatorError> {
    let (series, _, _) = fetch_state(session, map, quiet).await?;
    let author = AuthorId::of_robot(operator);
    // What somebody else writes under this name meanwhile would be undone once more, or not at all.
    let folded_numbers = series.folds.iter().filter(|fold| fold.author == author).map(|fold| fold.last);
    let own = series.increments.iter().filter(|increment| increment.author == author);
    let mut number = own.map(|increment| increment.number).chain(folded_numbers).max().unwrap_or(0);
    let robot = undone.robot().cloned();
    let folded = robot.as_ref().map_or(0, |robot| folded_upto(&series, AuthorId::of_robot(robot.as_str())));
    let mut names: Vec<String> =
        undone.robot().map(ToString::to_string).into_iter().chain([operator.to_owned()]).collect();
    let computed = tokio::task::spawn_blocking(move || match undone {
        Undone::Newest(count) => inverse(&series, author, count),
        Undone::All(of) => inverse_of_all(&series, AuthorId::of_robot(of.as_str()), author),
        Undone::AgainstRoles { author: of, writers } => {
            let of = AuthorId::of_robot(of.as_str());
            let role = writers.role(of).unwrap_or(WriterRole::Explorer);
            let is_against = |op: &Op| may_write(role, of, op).is_err();
            inverse_of(&series, of, author, |increment| increment.ops.iter().any(is_against))
        }
    })
    .await?;
    let Inverse { first, last, ops, mut words } = match computed {
        Ok(inverse) => inverse,
        Err(source) => {
            // Who was in the way: without the names there are still the ids.
            let others = journal::ask(session, map, operator, NAMED).await.map(|journal| journal.entries);
            names.extend(others.unwrap_or_default().into_iter().filter_map(|entry| entry.name));
            return Err(OperatorError::Undo { map: map.clone(), names, source, folded });
        }
    };
    for op in &ops {
        if let Op::PutRelease { release, .. } = op {
            check_kept(session, map, release).await?;
        }
    }
    if let Some(robot) = robot.filter(|_| folded > 0) {
        words.push(format!("increments 1 to {folded} of {robot} are folded, and stay"));
    }
    let batches = batches(ops);
    let (increments, mut version) = (batches.len(), 0);
    for ops in batches {
        number += 1;
        version = write_numbered(session, map, operator, number, ops).await?.version;
    }
    Ok(TakenBack { map: map.clone(), version, undone: [first, last], increments, words })
}

/// Whether the server still has the state of a release that was deleted.
async fn check_kept(session: &Session, map: &MapName, release: &Release) -> Result<(), OperatorError> {
    match state_of(session, map, Some(&release.vector.to_string())).await {
        Ok(state) if state.digest == release.digest => Ok(()),
        Ok(_) | Err(OperatorError::Refused(_)) => {
            let text = format!("the state of the deleted release was folded away: map {map} stays as it is");
            Err(OperatorError::Usage(text))
        }
        Err(error) => Err(error),
    }
}

/// The operations in increments that a server takes.
fn batches(ops: Vec<Op>) -> Vec<Vec<Op>> {
    let (mut batches, mut batch, mut length) = (Vec::new(), Vec::new(), 0);
    for op in ops {
        let bytes = op.memory_bytes();
        if batch.len() == Increment::MAX_OPS || (length + bytes > MAX_BYTES && !batch.is_empty()) {
            batches.push(std::mem::take(&mut batch));
            length = 0;
        }
        length += bytes;
        batch.push(op);
    }
    batches.push(batch);
    batches
}

pub(super) fn in_words(done: &TakenBack) -> String {
    let TakenBack { map, version, increments, words, .. } = done;
    let again = if *increments > 1 { format!("; undo --last {increments} takes this back") } else { String::new() };
    format!("{}\nwritten; map {map} is at version {version}{again}", words.join("\n"))
}
