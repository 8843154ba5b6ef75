//! A session as a configuration says. A client tries all of its endpoints until one answers.

use crate::attempt::attempt;
use crate::configuration::set;
use crate::credentials::{self, CredentialError, TlsSide};
use crate::listen_trouble::{ListenTrouble, is_of_connecting, named};
use crate::{expiry, trouble};
use std::convert::Infallible;
use std::sync::Once;
use std::time::{Duration, Instant};
use zenoh::{Config, Session};

/// If opening takes longer than this, the reason is logged.
const REMARK_AFTER: Duration = Duration::from_secs(3);
/// … and again after each such time, until the session is open.
const REMARK_EVERY: Duration = Duration::from_secs(5);

/// How often a session that is open is looked at.
const LOOK: Duration = Duration::from_secs(1);
/// So long its last router may be lost before that is said: routers start again.
const LOST_FOR: Duration = Duration::from_secs(10);

/// So long before the patience is over the reasons are looked for, at most: one endpoint that says
/// nothing takes nearly all of it.
const REASONS_WITHIN: Duration = Duration::from_secs(4);
/// … and so long after it, so that there are reasons on a busy machine, too.
const GRACE: Duration = Duration::from_secs(1);

/// Between two attempts to open a session, at first and at most.
const FIRST_DELAY: Duration = Duration::from_millis(100);
const LONGEST_DELAY: Duration = Duration::from_secs(2);
/// `connect.timeout_ms` of a session that waits for its router.
pub(crate) const FOREVER: &str = "-1";

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// A certificate or key that the configuration names is of no use.
    #[error(transparent)]
    Credentials(#[from] CredentialError),
    /// Zenoh opens no session.
    #[error("no server or router at {}{}: {reason}", endpoints.join(", "), within(*patience))]
    Refused {
        /// Where to.
        endpoints: Vec<String>,
        /// For how long it was tried, if more than once.
        patience: Option<Duration>,
        /// What Zenoh says.
        reason: String,
    },
    /// It cannot listen where it should.
    #[error("cannot listen on {}: {trouble}", listen.join(", "))]
    Listen {
        /// Where.
        listen: Vec<String>,
        /// Why not.
        trouble: ListenTrouble,
    },
    /// A session that listens cannot be opened, for another reason.
    #[error("no session: {reason} (listening on [{}])", listen.join(", "))]
    Open {
        /// Where it listens.
        listen: Vec<String>,
        /// What Zenoh says.
        reason: String,
    },
}

fn within(patience: Option<Duration>) -> String {
    patience.map(|patience| format!(" within {:.0} s", patience.as_secs_f64().ceil())).unwrap_or_default()
}

/// Checks that the certificate which a map-server shows to routers over TLS is not a robot's or an
/// operator's.
///
/// # Errors
/// [`ConnectError::Credentials`].
pub fn check_server(config: &Config) -> Result<(), ConnectError> {
    Ok(credentials::check_server(config, &endpoints(config))?)
}

/// The name in the certificate that a map-server shows to routers over TLS: of the common name
/// `server:NAME`. None with another role, and without a certificate.
#[must_use]
pub fn server_name(config: &Config) -> Option<String> {
    credentials::server_name(config, &endpoints(config))
}

/// Opens a session.
///
/// A client that `config` lets wait (`connect.timeout_ms` of −1) tries all endpoints again and
/// again, and logs every five seconds why it still waits (`WARN`). With `patience`, any client does
/// so, and gives up after that time. A certificate that is refused is waited out as well, since the
/// router may be given another authority; one that cannot be read is an error.
///
/// # Errors
/// [`ConnectError`]. An attempt that hangs when the patience ends goes on in a thread of the
/// runtime.
pub async fn open_configured(mut config: Config, patience: Option<Duration>) -> Result<Session, ConnectError> {
    let endpoints = endpoints(&config);
    let listening = listening_at(&config);
    for (endpoints, side) in [(&endpoints, TlsSide::Connecting), (&listening, TlsSide::Listening)] {
        credentials::check(&config, endpoints, side)?;
        if let Some(sentence) = credentials::out_of_date(&config, endpoints, side) {
            tracing::warn!("{sentence}");
        }
        expiry::watch(&config, endpoints, side);
    }
    warn_of_threads(&endpoints);
    let waits =
        has(&config, "mode", "\"client\"") && (patience.is_some() || has(&config, "connect/timeout_ms", FOREVER));
    let refused = |reason: String| ConnectError::Refused { endpoints: endpoints.clone(), patience, reason };
    if !waits || endpoints.is_empty() {
        let error = match attempt(config.clone()).await {
            Ok(session) => return Ok(session),
            Err(error) => trouble::in_words(&error),
        };
        if listening.is_empty() {
            return Err(refused(error));
        }
        if is_of_connecting(&error) {
            let reasons = trouble::reasons(&config, &endpoints, trouble::ANSWER);
            // Many silent endpoints are not waited for.
            let found = tokio::time::timeout(REASONS_WITHIN, reasons).await;
            return Err(refused(found.unwrap_or_else(|_| "no answer".to_owned())));
        }
        return Err(match ListenTrouble::of(&error) {
            Some(trouble) => ConnectError::Listen { listen: named(listening, &error), trouble },
            None => ConnectError::Open { listen: listening, reason: error },
        });
    }
    // A client that Zenoh lets wait asks the first endpoint for ever and no other; one that does
    // not wait asks each once.
    config.insert_json5("connect/timeout_ms", "0").map_err(|error| refused(trouble::in_words(&error)))?;
    let begin = Instant::now();
    let trying = try_until_open(&config, &endpoints, Remarks { due: begin + REMARK_AFTER });
    let Some(patience) = patience else { return Ok(trying.await) };
    tokio::select! {
        session = trying => Ok(session),
        reasons = at_the_end(&config, &endpoints, patience) => Err(refused(reasons)),
    }
}

/// When the patience is over, why there is no session. That is looked for before its end, so that
/// nobody waits for much longer than was said.
async fn at_the_end(config: &Config, endpoints: &[String], patience: Duration) -> String {
    let end = Instant::now() + patience;
    let within = patience.min(REASONS_WITHIN);
    tokio::time::sleep(patience - within).await;
    let answer = ((within + GRACE) * 2 / 3).min(trouble::ANSWER);
    let reasons = trouble::reasons(config, endpoints, answer);
    let found = tokio::time::timeout_at((end + GRACE).into(), reasons).await;
    tokio::time::sleep_until(end.into()).await;
    // Many silent endpoints are not waited for.
    found.unwrap_or_else(|_| "no answer".to_owned())
}

/// Says once that TLS may crash on Zenoh's own threads (`docs/upstream.md`). The programs see to it
/// themselves (`fht_program::zenoh_threads`); who uses the library is told.
fn warn_of_threads(endpoints: &[String]) {
    static SAID: Once = Once::new();
    let speaks_tls = endpoints.iter().any(|endpoint| endpoint.starts_with("tls/"));
    if speaks_tls && std::env::var_os("ZENOH_RUNTIME").is_none() {
        SAID.call_once(|| {
            tracing::warn!(
                "Zenoh's TLS may crash when a connection fails: set ZENOH_RUNTIME to one thread (docs/upstream.md)"
            );
        });
    }
}

/// Whether `key` is set to `value`, both as JSON.
pub(crate) fn has(config: &Config, key: &str, value: &str) -> bool {
    config.get_json(key).is_ok_and(|set| set == value)
}

/// When it is said why there is no session yet.
struct Remarks {
    due: Instant,
}

impl Remarks {
    /// Whether it is to be said now.
    fn is_due(&mut self, now: Instant) -> bool {
        let is_due = now >= self.due;
        if is_due {
            // Not counted from now: what comes late once does not put off all that follow.
            self.due = (self.due + REMARK_EVERY).max(now);
        }
        is_due
    }

    /// How long to wait before the next attempt: `delay`, but not beyond the next remark.
    fn pause(&self, delay: Duration, now: Instant) -> Duration {
        delay.min(self.due.saturating_duration_since(now)).max(FIRST_DELAY)
    }
}

async fn try_until_open(config: &Config, endpoints: &[String], mut remarks: Remarks) -> Session {
    let mut delay = FIRST_DELAY;
    loop {
        let error = match attempt(config.clone()).await {
            Ok(session) => return session,
            Err(error) => error,
        };
        tracing::debug!("no session yet: {}", trouble::in_words(&error));
        if remarks.is_due(Instant::now()) {
            let reasons = trouble::reasons(config, endpoints, trouble::ANSWER).await;
            tracing::warn!("waiting for a server or router: {reasons}");
        }
        tokio::time::sleep(remarks.pause(delay, Instant::now())).await;
        delay = (2 * delay).min(LONGEST_DELAY);
    }
}

/// Logs every five seconds (`WARN`) why no router is linked, for as long as none is: at first soon,
/// later if the last one stays lost. It never ends. A router is open before it is linked to those
/// that it connects to; of other sessions nothing is said here.
pub async fn remark_while_alone(session: &Session, config: &Config) -> Infallible {
    let (mut config, endpoints) = (config.clone(), endpoints(config));
    // The session goes on trying under its own id.
    let is_ready = has(&config, "mode", "\"router\"") && set(&mut config, "id", "null").is_ok();
    if endpoints.is_empty() || !is_ready {
        std::future::pending::<()>().await;
    }
    let mut remarks = Remarks { due: Instant::now() + REMARK_AFTER };
    loop {
        tokio::time::sleep(LOOK).await;
        if is_linked(session).await {
            remarks = Remarks { due: Instant::now() + LOST_FOR };
        } else if remarks.is_due(Instant::now()) {
            let reasons = trouble::reasons(&config, &endpoints, trouble::ANSWER).await;
            // It takes a while.
            if !is_linked(session).await {
                tracing::warn!("waiting for a server or router: {reasons}");
            }
        }
    }
}

async fn is_linked(session: &Session) -> bool {
    session.info().routers_zid().await.next().is_some()
}

/// The endpoints that a configuration connects to, as texts.
#[must_use]
pub fn endpoints(config: &Config) -> Vec<String> {
    endpoints_at(config, "connect/endpoints")
}

/// The endpoints that a configuration listens on, as texts.
#[must_use]
pub fn listening_at(config: &Config) -> Vec<String> {
    endpoints_at(config, "listen/endpoints")
}

fn endpoints_at(config: &Config, key: &str) -> Vec<String> {
    let json = config.get_json(key).unwrap_or_default();
    let mut found = Vec::new();
    // A list, a list for each mode, or groups of links: whatever is a text with a slash is one.
    let mut waiting: Vec<serde_json::Value> = serde_json::from_str(&json).into_iter().collect();
    while let Some(value) = waiting.pop() {
        match value {
            serde_json::Value::String(text) if text.contains('/') => found.push(text),
            serde_json::Value::Array(values) => waiting.extend(values.into_iter().rev()),
            serde_json::Value::Object(fields) => waiting.extend(fields.into_iter().map(|(_, value)| value).rev()),
            _ => {}
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When remarks are made within a minute, seconds after the begin, if each attempt takes so
    /// long.
    fn remarks_s(attempt_s: f64) -> Vec<f64> {
        let begin = Instant::now();
        let mut remarks = Remarks { due: begin + REMARK_AFTER };
        let (mut now, mut delay, mut made) = (begin, FIRST_DELAY, Vec::new());
        while now < begin + Duration::from_secs(60) {
            now += Duration::from_secs_f64(attempt_s);
            if remarks.is_due(now) {
                made.push((now - begin).as_secs_f64());
            }
            now += remarks.pause(delay, now);
            delay = (2 * delay).min(LONGEST_DELAY);
        }
        made
    }

    #[test]
    fn a_remark_comes_every_five_seconds_however_long_attempts_take() {
        let at_once = remarks_s(0.001);
        assert!(
            at_once.len() == 12 && at_once.windows(2).all(|pair| (pair[1] - pair[0] - 5.0).abs() < 0.3),
            "{at_once:?}"
        );
        let slow = remarks_s(3.0);
        assert!(slow.len() >= 11, "{slow:?}");
    }
}
