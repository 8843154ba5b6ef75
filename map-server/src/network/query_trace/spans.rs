//! Spans of OpenTelemetry, by whatever provider the program has set up. What others ask for is cut
//! where it is long; payloads are not in it.

use crate::network::query_trace::Step;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use opentelemetry::trace::{Span, SpanBuilder, SpanKind, Status, TraceContextExt, Tracer};
use opentelemetry::{Context, KeyValue, global};
use std::time::SystemTime;

/// Who makes the spans.
const SCOPE: &str = "map-server";

/// A query's span, if somebody collects it. It ends with the last copy.
#[derive(Clone, Debug)]
pub(in crate::network) struct QueryTrace(Option<Context>);

/// A step of it: it ends when it is dropped.
#[derive(Debug)]
#[must_use = "it ends when it is dropped"]
pub(in crate::network) struct TraceStep {
    of: Option<(Context, SystemTime)>,
    what: Step,
}

/// What a key asks for, of a fixed list, and the map that is meant.
fn kind_of(key: &str) -> (String, Option<String>) {
    match key.parse() {
        Ok(Key::Maps) => ("maps".to_owned(), None),
        Ok(Key::Topic { map, topic }) => (topic.as_str().to_owned(), Some(map.to_string())),
        Ok(Key::Admin { map, action }) => (format!("admin/{}", action.as_str()), Some(map.to_string())),
        _ => ("other".to_owned(), None),
    }
}

impl QueryTrace {
    /// A query for `key` has come over something; `asked` tells all of it.
    pub(in crate::network) fn begin(over: &'static str, key: &str, asked: impl FnOnce() -> String) -> Self {
        let tracer = global::tracer(SCOPE);
        let (topic, map) = kind_of(key);
        let mut span = tracer.build(SpanBuilder::from_name(topic.clone()).with_kind(SpanKind::Server));
        if !span.is_recording() {
            return Self(None);
        }
        span.set_attribute(KeyValue::new("fht.topic", topic));
        span.set_attribute(KeyValue::new("fht.over", over));
        span.set_attribute(KeyValue::new("fht.asked", asked()));
        if let Some(map) = map {
            span.set_attribute(KeyValue::new("fht.map", map));
        }
        Self(Some(Context::new().with_span(span)))
    }

    /// A step begins.
    pub(in crate::network) fn step(&self, what: Step) -> TraceStep {
        TraceStep { of: self.0.clone().map(|context| (context, SystemTime::now())), what }
    }

    /// It is answered, or refused.
    pub(in crate::network) fn outcome(&self, refusal: Option<&ErrorReply>) {
        let Some(context) = &self.0 else { return };
        let span = context.span();
        let outcome = match refusal.map(|refusal| refusal.code) {
            None => "answered",
            Some(ErrorCode::Busy) => "busy",
            Some(_) => "refused",
        };
        span.set_attribute(KeyValue::new("fht.outcome", outcome));
        let Some(refusal) = refusal else { return };
        let code = serde_json::to_value(refusal.code).ok().and_then(|code| code.as_str().map(str::to_owned));
        span.set_attribute(KeyValue::new("error.type", code.unwrap_or_default()));
        // What the asker did wrong is no failure of the server.
        if matches!(refusal.code, ErrorCode::Internal | ErrorCode::Damaged | ErrorCode::Busy) {
            span.set_status(Status::error(refusal.message.clone()));
        }
    }

    /// Somebody else answers.
    pub(in crate::network) fn is_left(&self) {
        if let Some(context) = &self.0 {
            context.span().set_attribute(KeyValue::new("fht.outcome", "left"));
        }
    }
}

impl TraceStep {
    /// It ends.
    pub(in crate::network) fn end(self) {}

    /// It was none.
    pub(in crate::network) fn forget(mut self) {
        self.of = None;
    }
}

impl Drop for TraceStep {
    fn drop(&mut self) {
        let Some((context, begun)) = self.of.take() else { return };
        let name = match self.what {
            Step::Wait => "wait",
            Step::Compute => "compute",
            Step::Reply => "reply",
        };
        let builder = SpanBuilder::from_name(name).with_kind(SpanKind::Internal).with_start_time(begun);
        global::tracer(SCOPE).build_with_context(builder, &context).end();
    }
}
