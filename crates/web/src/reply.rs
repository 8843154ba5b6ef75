//! Answers and refusals as HTTP.

use crate::port::WebAnswer;
use axum::body::Body;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, RETRY_AFTER};
use axum::http::{HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::api::request::Format;

/// What is told instead of an answer.
#[derive(Debug)]
pub(crate) struct WebRefusal {
    pub(crate) status: StatusCode,
    pub(crate) reply: ErrorReply,
}

impl WebRefusal {
    pub(crate) fn new(status: StatusCode, code: ErrorCode, message: &str) -> Self {
        Self { status, reply: ErrorReply::new(code, message) }
    }
}

/// The status that goes with a code.
fn status_of(code: ErrorCode) -> StatusCode {
    match code {
        ErrorCode::BadRequest | ErrorCode::IncompatibleModel | ErrorCode::NotCanonical | ErrorCode::Future => {
            StatusCode::BAD_REQUEST
        }
        ErrorCode::UnknownMap
        | ErrorCode::UnknownVersion
        | ErrorCode::UnknownNode
        | ErrorCode::UnknownPlace
        | ErrorCode::UnknownGoal
        | ErrorCode::UnknownRobot => StatusCode::NOT_FOUND,
        // The question is understood, and this is what is known about it.
        ErrorCode::NoPath
        | ErrorCode::OutOfMap
        | ErrorCode::KeepOut
        | ErrorCode::Blocked
        | ErrorCode::NotLocalized
        | ErrorCode::Full => StatusCode::UNPROCESSABLE_ENTITY,
        ErrorCode::NotPermitted => StatusCode::FORBIDDEN,
        ErrorCode::Conflict => StatusCode::CONFLICT,
        ErrorCode::Deleted => StatusCode::GONE,
        ErrorCode::TooLong => StatusCode::PAYLOAD_TOO_LARGE,
        ErrorCode::Busy | ErrorCode::ReadOnly | ErrorCode::Damaged | ErrorCode::Timeout => {
            StatusCode::SERVICE_UNAVAILABLE
        }
        ErrorCode::Internal | ErrorCode::Unknown => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

impl From<ErrorReply> for WebRefusal {
    fn from(reply: ErrorReply) -> Self {
        Self { status: status_of(reply.code), reply }
    }
}

impl IntoResponse for WebRefusal {
    fn into_response(self) -> Response {
        let retry_after_s = self.reply.retry_after_s;
        let mut response = with_type("application/json", serde_json::to_vec(&self.reply).unwrap_or_default());
        *response.status_mut() = self.status;
        if let Some(seconds) = retry_after_s {
            response.headers_mut().insert(RETRY_AFTER, HeaderValue::from(seconds));
        }
        response
    }
}

impl IntoResponse for WebAnswer {
    fn into_response(self) -> Response {
        let kind = match self.format {
            Format::Json => "application/json",
            Format::Postcard => "application/octet-stream",
        };
        with_type(kind, self.bytes)
    }
}

/// Bytes of a type that nobody keeps.
pub(crate) fn with_type(kind: &'static str, bytes: impl Into<Body>) -> Response {
    let mut response = Response::new(bytes.into());
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}
