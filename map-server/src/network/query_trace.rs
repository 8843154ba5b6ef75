//! What a query goes through, as one trace: it waits in its room, an answer is computed, and it is
//! sent. Without the feature `otel`, or where nobody collects traces, nothing is kept.

#[cfg(feature = "otel")]
mod spans;
#[cfg(not(feature = "otel"))]
mod untraced;

#[cfg(feature = "otel")]
pub(super) use spans::QueryTrace;
#[cfg(not(feature = "otel"))]
pub(super) use untraced::QueryTrace;

/// A part of what is done about a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// It waits in its room, and for a thread.
    Wait,
    /// An answer is computed, or an order carried out.
    Compute,
    /// The answer is sent.
    Reply,
}
