//! Replies as they are sent.

use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::api::request::Format;
use fht_proto::codec::envelope::Message;
use fht_proto::encode;
use serde::Serialize;

/// One reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// How it is written.
    pub format: Format,
    /// The payload.
    pub bytes: Vec<u8>,
}

pub(super) fn error(code: ErrorCode, message: impl AsRef<str>) -> ErrorReply {
    ErrorReply::new(code, message.as_ref())
}

/// What a client is told about a failure of the server, whose `cause` goes to the log.
pub(crate) fn internal(cause: impl std::fmt::Display) -> ErrorReply {
    tracing::error!("a query failed: {cause}");
    error(ErrorCode::Internal, "the server failed; its log says why")
}

/// A reply as JSON.
pub(crate) fn json<T: Serialize>(value: &T) -> Result<Answer, ErrorReply> {
    let bytes = serde_json::to_vec(value).map_err(internal)?;
    Ok(Answer { format: Format::Json, bytes })
}

/// A reply in its binary envelope.
pub(super) fn postcard<M: Message>(message: &M) -> Result<Answer, ErrorReply> {
    let bytes = encode(message).map_err(internal)?;
    Ok(Answer { format: Format::Postcard, bytes })
}
