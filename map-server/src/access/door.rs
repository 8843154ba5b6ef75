//! Counts who does not get in, where this server is the router.
//!
//! Zenoh tells nobody of failed handshakes, of connections that it closes because too many are on
//! their way, and of sessions that it refuses. It does write lines of its log: this layer reads
//! those and tells the operator, at most once a second. A separate router (`zenohd`) prints the
//! same lines; `deploy/README.md` says which.

use crate::throttle::Throttle;
use std::collections::VecDeque;
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

/// Where Zenoh writes the lines.
const TLS: &str = "zenoh_link_tls::unicast";
const SESSIONS: &str = "zenoh_transport::unicast::manager";
/// The shortest time between two reports.
const PERIOD: Duration = Duration::from_secs(1);
/// So many connections are remembered with their certificates.
const REMEMBERED: usize = 1024;

/// Why somebody does not get in: part of Zenoh's line, and what it means.
const KINDS: [(&str, &str); 5] = [
    ("Hint: increase the system open file limit", "failed TLS handshake(s)"),
    ("Closing link for preventing potential DoS", "connection(s) closed because too many are on their way in"),
    ("Failed to accept link before deadline", "connection(s) that said nothing in time"),
    ("Max transports reached", "session(s) refused because there are too many"),
    ("already exist. Invalid config", "session(s) refused because their id is in use"),
];
/// A connection whose certificate is known from here on: `… on ADDRESS: ADDRESS. Common Name:
/// NAME.`
const ACCEPTED: &str = "Accepted TLS connection on";

#[derive(Debug)]
struct Counted {
    counts: [u64; KINDS.len()],
    throttle: Throttle,
    /// Addresses and the common names of the latest connections.
    certificates: VecDeque<(String, String)>,
}

/// Who has not got in since the start.
#[derive(Debug)]
struct Door {
    state: Mutex<Counted>,
    report: fn(&str),
}

/// The layer. It writes to standard error.
pub(crate) fn layer<S: Subscriber + for<'a> LookupSpan<'a>>() -> impl Layer<S> {
    // Not as a log line: a layer cannot write log lines.
    reporting(|text| fht_program::tell_line!("map-server: {text}"))
}

fn reporting<S: Subscriber + for<'a> LookupSpan<'a>>(report: fn(&str)) -> impl Layer<S> {
    let counted = Counted { counts: [0; KINDS.len()], throttle: Throttle::new(PERIOD), certificates: VecDeque::new() };
    let targets = Targets::new().with_target(TLS, LevelFilter::DEBUG).with_target(SESSIONS, LevelFilter::TRACE);
    Door { state: Mutex::new(counted), report }.with_filter(targets)
}

/// The text of an event.
#[derive(Default)]
struct Line(String);

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            let _ = write!(self.0, "{value:?}"); // to a text, which cannot fail
        }
    }
}

impl<S: Subscriber> Layer<S> for Door {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut line = Line::default();
        event.record(&mut line);
        self.take(&line.0);
    }
}

impl Door {
    fn take(&self, line: &str) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if line.starts_with(ACCEPTED) {
            state.remember(line);
        } else if let Some(kind) = KINDS.iter().position(|(part, _)| line.contains(part)) {
            state.counts[kind] += 1;
            if state.throttle.pass(Instant::now()).is_some() {
                (self.report)(&state.told(line));
            }
        }
    }
}

impl Counted {
    fn remember(&mut self, line: &str) {
        let Some((addresses, name)) = line.split_once(" Common Name: ") else { return };
        let Some(address) = addresses.trim_end_matches('.').rsplit(' ').next() else { return };
        if self.certificates.len() == REMEMBERED {
            self.certificates.pop_front();
        }
        let of_router = |c: char| c == '.' || c.is_control();
        self.certificates.push_back((address.to_owned(), name.trim_end_matches(of_router).chars().take(80).collect()));
    }

    /// The counts, and the last line with whose connection it was.
    fn told(&self, line: &str) -> String {
        let counts = self.counts.iter().zip(KINDS).filter(|(count, _)| **count > 0);
        let counts: Vec<String> = counts.map(|(count, (_, what))| format!("{count} {what}")).collect();
        let owner = self.certificates.iter().rev().find(|(address, _)| line.contains(address));
        let owner = owner.map(|(_, name)| format!(" (certificate: {name})")).unwrap_or_default();
        // What is in it comes from outside.
        let last: String =
            fht_session::without_source_paths(line).chars().filter(|c| !c.is_control()).take(300).collect();
        let last = last.trim_end_matches("Hint: increase the system open file limit.").trim_end_matches([' ', '.']);
        format!("not let in since the start: {}; the last: {last}{owner}", counts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing_subscriber::layer::SubscriberExt;

    #[test]
    fn who_does_not_get_in_is_counted_and_told_once_a_second_with_the_certificate() {
        static TOLD: Mutex<Vec<String>> = Mutex::new(Vec::new());
        let subscriber =
            tracing_subscriber::registry().with(reporting(|text| TOLD.lock().unwrap().push(text.to_owned())));
        tracing::subscriber::with_default(subscriber, || {
            tracing::debug!(target: "zenoh_link_tls::unicast",
                "Accepted TLS connection on 127.0.0.1:7447: 127.0.0.1:51000. Common Name: client:tug.");
            for _ in 0..2 {
                tracing::trace!(target: "zenoh_transport::unicast::manager",
                    "Closing link for preventing potential DoS: tls/127.0.0.1:7447 => tls/127.0.0.1:51000");
            }
            tracing::warn!(target: "zenoh_link_tls::unicast", "expired. Hint: increase the system open file limit.");
        });
        let told = TOLD.lock().unwrap();
        assert!(told.len() == 1 && told[0].contains("1 connection(s) closed because too many"), "{told:?}");
        assert!(told[0].ends_with("(certificate: client:tug)"), "{told:?}");
    }
}
