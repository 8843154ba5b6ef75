//! A certificate that expires while a session is open. Routers then end the session and take no
//! other one, and say so to nobody but their own logs.

use crate::credentials::{TlsSide, Validity, out_of_date, valid_for};
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::Config;

/// A clock is set and a file renewed at any time: so often it is looked.
const LOOK: Duration = Duration::from_secs(30);
/// So often it is said again that a certificate has expired.
const SAY_AGAIN: Duration = Duration::from_secs(60);
/// So long before a certificate expires it is said that it will, at most: of short-lived ones, that
/// a timer renews, in the last tenth of their life.
const AHEAD: Duration = Duration::from_secs(14 * 86_400);
/// So often that is said again.
const SAY_AHEAD: Duration = Duration::from_secs(86_400);
/// A certificate is valid to the end of its last second.
const BEYOND: Duration = Duration::from_secs(1);

/// What is watched already: several sessions may have one certificate.
static WATCHED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Whether a certificate is watched from now on, and was not before.
fn is_new(tls: &str, side: TlsSide) -> bool {
    WATCHED.lock().unwrap_or_else(PoisonError::into_inner).insert(format!("{side:?} {tls}"))
}

/// Says that the certificate which `config` shows on this side will expire soon, and from when it
/// does that it has expired. In a thread of its own, as long as the program runs: sessions outlive
/// the runtime that they were opened in. One that has expired already, and was let in, is not
/// spoken of.
pub(crate) fn watch(config: &Config, endpoints: &[String], side: TlsSide) {
    if valid_for(config, endpoints, side).is_none() {
        return; // there is none, or it was out of date before
    }
    let tls = config.get_json("transport/link/tls").unwrap_or_default();
    if !is_new(&tls, side) {
        return;
    }
    let (config, endpoints) = (config.clone(), endpoints.to_vec());
    let look = move || {
        let mut said_ahead: Option<Instant> = None;
        loop {
            let sentence = out_of_date(&config, &endpoints, side);
            if let Some(sentence) = &sentence {
                tracing::warn!("{sentence}. {}", remedy(side));
            }
            let validity = valid_for(&config, &endpoints, side);
            let is_new = said_ahead.is_none_or(|said| said.elapsed() >= SAY_AHEAD);
            if let Some(validity) = validity.as_ref().filter(|validity| is_new && is_near(validity)) {
                tracing::warn!("{}. {}", validity.said, remedy(side));
                said_ahead = Some(Instant::now());
            }
            std::thread::sleep(pause(sentence.is_some(), validity.map(|validity| validity.left)));
        }
    };
    if let Err(error) = std::thread::Builder::new().name("expiry".to_owned()).spawn(look) {
        tracing::warn!("nobody looks at when the certificate expires: {error}");
    }
}

fn remedy(side: TlsSide) -> &'static str {
    match side {
        TlsSide::Connecting => "A renewed one in its place is read with the next attempt to connect",
        TlsSide::Listening => "A renewed one in its place is read at the next start",
    }
}

/// Whether it is time to renew a certificate.
fn is_near(validity: &Validity) -> bool {
    validity.left <= AHEAD.min(validity.of / 10)
}

/// How long nothing needs to be looked at.
fn pause(has_expired: bool, valid_for: Option<Duration>) -> Duration {
    if has_expired { SAY_AGAIN } else { valid_for.map_or(LOOK, |left| (left + BEYOND).min(LOOK)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_is_met_and_then_told_now_and_again() {
        assert_eq!(pause(false, Some(Duration::from_secs(86_400))), LOOK);
        assert_eq!(pause(false, Some(Duration::from_secs(3))), Duration::from_secs(4));
        assert_eq!(pause(true, None), SAY_AGAIN);
        // A file that cannot be read at the moment.
        assert_eq!(pause(false, None), LOOK);
    }

    #[test]
    fn who_may_renew_is_told_in_time() {
        let day = 86_400;
        for (of, left, expected) in
            [(365, 15, false), (365, 14, true), (365, 1, true), (7, 6, false), (10, 2, false), (10, 1, true)]
        {
            let [of, left] = [of, left].map(|days| Duration::from_secs(days * day));
            let validity = Validity { said: String::new(), of, left };
            assert_eq!(is_near(&validity), expected, "{validity:?}");
        }
    }

    #[test]
    fn a_certificate_is_watched_once() {
        assert!(is_new("{a: 1}", TlsSide::Connecting) && !is_new("{a: 1}", TlsSide::Connecting));
        assert!(is_new("{a: 1}", TlsSide::Listening), "another certificate");
    }
}
