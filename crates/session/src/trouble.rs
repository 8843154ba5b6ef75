//! Why a server cannot be reached. A Zenoh client that waits for its router does not say why; a
//! trial session that does not wait does.

use crate::attempt::attempt;
use zenoh::Config;

/// Why a session with `config` cannot be opened at each of `endpoints`, tried one after the other.
pub async fn reasons(config: &Config, endpoints: &[String]) -> String {
    let mut reasons = Vec::new();
    for endpoint in endpoints {
        let reason = match trial(config, endpoint).await {
            Ok(()) => "there is one now".to_owned(),
            Err(error) => without_source_paths(&error.to_string()),
        };
        reasons.push(match hint(&reason) {
            Some(hint) => format!("{endpoint}: {hint} ({reason})"),
            None => format!("{endpoint}: {reason}"),
        });
    }
    reasons.join("; ")
}

/// Tries one endpoint once, as a peer: only a session that may have several connections reports why
/// one of them failed.
async fn trial(config: &Config, endpoint: &str) -> Result<(), zenoh::Error> {
    let mut config = config.clone();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("connect/endpoints", &serde_json::to_string(&[endpoint])?),
        ("connect/timeout_ms", "0"),
        ("connect/exit_on_failure", "true"),
        ("listen/endpoints", "[]"),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
    ] {
        config.insert_json5(key, value)?;
    }
    attempt(config).await?.close().await
}

/// What to look at. Zenoh's errors are texts, and the best of them are those of rustls.
fn hint(reason: &str) -> Option<&'static str> {
    let kinds: [(&[&str], &str); 5] = [
        (&["UnknownIssuer", "BadSignature"], "its certificate is not from our authority (root_ca_certificate)"),
        (&["NotValidForName", "not valid for name"], "its certificate does not name this host"),
        (&["Expired", "NotValidYet"], "a certificate has expired, or a clock is wrong"),
        (&["fatal alert", "peer closed connection"], "it refuses our certificate, or the lack of one"),
        (&["Connection refused", "No route", "timed out", "failed to lookup"], "nobody listens there"),
    ];
    kinds.iter().find(|(texts, _)| texts.iter().any(|text| reason.contains(text))).map(|(_, hint)| *hint)
}

/// `text` without the source location that Zenoh's errors end in.
#[must_use]
pub fn without_source_paths(text: &str) -> String {
    text.split(" at /").next().unwrap_or(text).trim_end_matches(['.', ' ']).to_owned()
}
