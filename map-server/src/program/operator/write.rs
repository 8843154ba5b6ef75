//! Operators' increments: numbered and stamped like any other author's.

use crate::program::operator::asking::ANSWER_TIMEOUT;
use crate::program::operator::error::OperatorError;
use fht_client::author::{self, Authorship, NotWritten};
use fht_proto::api::reply::Head;
use fht_proto::{MapName, Op};
use zenoh::Session;

/// The same as the operator's increment of this number, for the operations undo those before it.
pub(super) async fn write_numbered(
    session: &Session,
    map: &MapName,
    operator: &str,
    number: u64,
    ops: Vec<Op>,
) -> Result<Head, OperatorError> {
    let by = Authorship { name: operator, may_begin: false, timeout: ANSWER_TIMEOUT };
    author::write_numbered(session, map, by, number, ops).await.map_err(|error| not_written(map, error))
}

/// Writes `ops` as one increment of the operator called `operator`; returns the head that contains
/// it.
pub(super) async fn write(
    session: &Session,
    map: &MapName,
    operator: &str,
    ops: Vec<Op>,
) -> Result<Head, OperatorError> {
    let by = Authorship { name: operator, may_begin: false, timeout: ANSWER_TIMEOUT };
    author::write(session, map, by, ops).await.map_err(|error| not_written(map, error))
}

fn not_written(map: &MapName, error: NotWritten) -> OperatorError {
    match error {
        NotWritten::Unanswered => OperatorError::Silent.of_order(&format!("journal {map}")),
        error => error.into(),
    }
}
