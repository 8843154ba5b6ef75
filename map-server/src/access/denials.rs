//! Counts the messages that access control denies, where this server is the router.
//!
//! Zenoh drops a denied message without telling its sender, and without the feature `stats` it
//! counts nothing. It does write a trace line for each: this layer reads those lines and tells the
//! operator, at most once a second. A separate router (`zenohd`) prints the same lines with
//! `RUST_LOG=info,zenoh::net::routing::interceptor=trace`.

use crate::throttle::Throttle;
use std::cell::RefCell;
use std::fmt::{Debug, Write};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::Context;
use tracing_subscriber::registry::LookupSpan;

/// The target of Zenoh's lines.
const TARGET: &str = "zenoh::net::routing::interceptor";
/// The text for a message that is dropped, and for nothing else.
const DROPPED: &str = "Msg intercepted!";
/// Part of the text for what a session may not do; the same thread writes it just before.
const REASON: &str = " is unauthorized to ";
/// The direction in which the router itself would have sent: nobody's attempt.
const SENT_BY_ROUTER: &str = "(egress)";
/// The shortest time between two reports.
const PERIOD: Duration = Duration::from_secs(1);

thread_local! {
    static LAST_REASON: RefCell<String> = const { RefCell::new(String::new()) };
}

/// What has been denied since the start.
#[derive(Debug)]
struct Denials {
    state: Mutex<(u64, Throttle)>,
    report: fn(&str),
}

/// The layer. It listens to Zenoh's access control and to nothing else, and writes to standard
/// error.
pub(crate) fn layer<S: Subscriber + for<'a> LookupSpan<'a>>() -> impl Layer<S> {
    // Not as a log line: a layer cannot write log lines.
    reporting(|text| fht_program::tell_line!("map-server: {text}"))
}

fn reporting<S: Subscriber + for<'a> LookupSpan<'a>>(report: fn(&str)) -> impl Layer<S> {
    let denials = Denials { state: Mutex::new((0, Throttle::new(PERIOD))), report };
    denials.with_filter(Targets::new().with_target(TARGET, LevelFilter::TRACE))
}

/// The text of an event.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}"); // to a text, which cannot fail
        }
    }
}

impl<S: Subscriber> Layer<S> for Denials {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut message = Message::default();
        event.record(&mut message);
        if message.0.contains(REASON) {
            LAST_REASON.set(message.0);
        } else if message.0 == DROPPED {
            // No reason: the session's certificate is in nobody's list.
            let reason = LAST_REASON.take();
            if !reason.contains(SENT_BY_ROUTER) {
                self.count(&reason);
            }
        }
    }
}

impl Denials {
    fn count(&self, reason: &str) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.0 += 1;
        if state.1.pass(Instant::now()).is_some() {
            // Keys come from outside.
            let reason: String = reason.chars().filter(|c| !c.is_control()).take(300).collect();
            let last = if reason.is_empty() { "by a certificate that no role is given to" } else { &reason };
            (self.report)(&format!(
                "access control has denied {} message(s) since the start; the last: {last}",
                state.0
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing_subscriber::layer::SubscriberExt;

    #[test]
    fn what_is_dropped_is_counted_and_told_once_a_second() {
        static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let subscriber =
            tracing_subscriber::registry().with(reporting(|text| TOLD.lock().unwrap().push(text.to_owned())));
        tracing::subscriber::with_default(subscriber, || {
            let say =
                |text: &str| tracing::trace!(target: "zenoh::net::routing::interceptor::access_control", "{text}");
            let drop = || tracing::trace!(target: "zenoh::net::routing::interceptor", "Msg intercepted!");
            // What is looked up in advance is not dropped, and what the router does not send is
            // nobody's attempt.
            say("1f on lo+client:tug+tls is unauthorized to Put (ingress) on fht/m/inc/*");
            say("1f on lo+client:tug+tls is unauthorized to Put (egress) on fht/m/refused/1");
            drop();
            assert!(TOLD.lock().unwrap().is_empty());
            say("1f on lo+client:tug+tls is unauthorized to Put (ingress) on fht/m/inc/1/1");
            drop();
            drop();
        });
        let told = TOLD.lock().unwrap();
        assert!(told.len() == 1 && told[0].contains("denied 1 message(s)"), "{told:?}");
        assert!(told[0].contains("client:tug") && told[0].contains("fht/m/inc/1/1"), "{told:?}");
    }
}
