//! Operators' increments: numbered and stamped like any other author's.

use crate::program::operator::asking::ANSWER_TIMEOUT;
use crate::program::operator::error::OperatorError;
use fht_client::author::{self, Authorship};
use fht_proto::api::reply::Head;
use fht_proto::{MapName, Op};
use zenoh::Session;

/// Writes `ops` as one increment of the operator called `operator`; returns the head that contains
/// it.
pub(super) async fn write(
    session: &Session,
    map: &MapName,
    operator: &str,
    ops: Vec<Op>,
) -> Result<Head, OperatorError> {
    let by = Authorship { name: operator, may_begin: false, timeout: ANSWER_TIMEOUT };
    Ok(author::write(session, map, by, ops).await?)
}
