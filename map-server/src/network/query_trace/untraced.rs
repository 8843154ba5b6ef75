//! Nothing is kept.

use crate::network::query_trace::Step;
use fht_proto::api::reply::ErrorReply;

/// A query of which nothing is kept.
#[derive(Clone, Debug)]
pub(in crate::network) struct QueryTrace;

/// A step of it.
#[derive(Debug)]
pub(in crate::network) struct TraceStep;

impl QueryTrace {
    pub(in crate::network) fn begin(_over: &'static str, _key: &str, _asked: impl FnOnce() -> String) -> Self {
        Self
    }

    pub(in crate::network) fn step(&self, _: Step) -> TraceStep {
        TraceStep
    }

    pub(in crate::network) fn outcome(&self, _refusal: Option<&ErrorReply>) {}

    pub(in crate::network) fn is_left(&self) {}
}

impl TraceStep {
    pub(in crate::network) fn end(self) {}

    pub(in crate::network) fn forget(self) {}
}
