//! Why a server cannot be reached. A Zenoh client that waits for its router does not say why; a
//! trial session that does not wait does.

use crate::attempt::attempt;
use std::borrow::Cow;
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;
use zenoh::Config;

/// How long an endpoint may take to say why.
pub(crate) const ANSWER: Duration = Duration::from_secs(3);
/// How long one that says nothing may take to be there at all.
const LISTENS: Duration = Duration::from_secs(1);

/// Why a session with `config` cannot be opened at each of `endpoints`, tried one after the other,
/// each for as long as `answer`.
pub async fn reasons(config: &Config, endpoints: &[String], answer: Duration) -> String {
    let mut reasons = Vec::new();
    for endpoint in endpoints {
        let reason = match tokio::time::timeout(answer, trial(config, endpoint)).await {
            Ok(Ok(())) => Some("there is one now".to_owned()),
            Ok(Err(error)) => Some(in_words(&error)),
            Err(_) => None,
        };
        let other = match &reason {
            Some(reason) => other_protocol(endpoint, reason),
            None => silent_to_tls(endpoint).await,
        };
        let reason = reason.unwrap_or_else(|| "no answer".to_owned());
        let hint = match other {
            Some(other) => Some(format!("it does not answer in Zenoh's protocol: perhaps it wants {other}")),
            None => hint(&reason).map(str::to_owned),
        };
        reasons.push(match hint {
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

/// The endpoint that was perhaps meant: `tls/…` where a TLS server was asked over TCP, and the
/// other way round. Each side takes what the other says for nonsense, and closes the connection.
fn other_protocol(endpoint: &str, reason: &str) -> Option<String> {
    let is = |texts: &[&str]| texts.iter().any(|text| reason.contains(text));
    if let Some(at) = endpoint.strip_prefix("tcp/") {
        return is(&["eof", "reset by peer"]).then(|| format!("tls/{at}"));
    }
    let at = endpoint.strip_prefix("tls/")?;
    is(&["eof", "reset by peer", "InvalidContentType", "corrupt message"]).then(|| format!("tcp/{at}"))
}

/// `tcp/…`, if a TLS endpoint is there but says nothing: a Zenoh router without TLS waits for
/// more of what it takes for a long message.
async fn silent_to_tls(endpoint: &str) -> Option<String> {
    let at = endpoint.strip_prefix("tls/")?.to_owned();
    let address = at.split(['?', '#']).next()?.to_owned();
    let listens = move || {
        let mut addresses = address.to_socket_addrs().ok()?;
        addresses.find_map(|address| TcpStream::connect_timeout(&address, LISTENS).ok())
    };
    tokio::task::spawn_blocking(listens).await.ok()??;
    Some(format!("tcp/{at}"))
}

/// What to look at. Zenoh's errors are texts, and the best of them are those of rustls.
fn hint(reason: &str) -> Option<&'static str> {
    let kinds: [(&[&str], &str); 6] = [
        (&["UnknownIssuer", "BadSignature"], "its certificate is not from our authority (root_ca_certificate)"),
        (&["NotValidForName", "not valid for name"], "its certificate does not name this host"),
        (
            &["Expired", "NotValidYet", "certificate expired", "not valid yet"],
            "a certificate has expired, or a clock is wrong",
        ),
        (&["fatal alert", "peer closed connection"], "it refuses our certificate, or the lack of one"),
        (&["failed to lookup"], "no computer has this name"),
        (&["Connection refused", "No route", "timed out"], "nobody listens there"),
    ];
    kinds.iter().find(|(texts, _)| texts.iter().any(|text| reason.contains(text))).map(|(_, hint)| *hint)
}

/// What Zenoh says went wrong, for people: without the places in its source, which its errors name.
#[must_use]
pub fn in_words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    let end = place(&text).map_or(text.len(), |(begin, _)| begin);
    closed(text.get(..end).unwrap_or(&text).trim_end_matches(['.', ' ']))
}

/// A text whose end was cut off, with the brackets that are open there closed.
fn closed(text: &str) -> String {
    let mut open = Vec::new();
    for letter in text.chars() {
        match letter {
            '[' => open.push(']'),
            '(' => open.push(')'),
            ']' | ')' if open.last() == Some(&letter) => drop(open.pop()),
            _ => {}
        }
    }
    text.chars().chain(open.into_iter().rev()).collect()
}

/// A text, such as a line of a log, without the places in Zenoh's source that stand in it.
#[must_use]
pub fn without_source_paths(text: &str) -> Cow<'_, str> {
    let (mut rest, mut cleaned) = (text, String::new());
    while let Some((begin, end)) = place(rest) {
        cleaned.push_str(rest.get(..begin).unwrap_or_default());
        rest = rest.get(end..).unwrap_or_default();
    }
    if rest.len() == text.len() { Cow::Borrowed(text) } else { Cow::Owned(cleaned + rest) }
}

/// Where the first ` at FILE.rs:LINE` begins and ends in a text, bytes.
fn place(text: &str) -> Option<(usize, usize)> {
    const AT: &str = " at ";
    text.match_indices(AT).find_map(|(begin, _)| {
        let rest = text.get(begin + AT.len()..)?;
        let word = rest.split([' ', '\n', ']', ')', ';', ',']).next()?;
        let line = word.split_once(".rs:").map(|(_, line)| line.chars().take_while(char::is_ascii_digit).count())?;
        let end = word.find(".rs:")? + ".rs:".len() + line;
        (line > 0).then_some((begin, begin + AT.len() + end))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_in_the_source_are_not_for_people() {
        let said = "No link at /home/ci/.cargo/registry/src/zenoh-1.10.2/src/link.rs:123. - Caused by refused \
                    at C:\\src\\a.rs:7.";
        assert_eq!(without_source_paths(said), "No link. - Caused by refused.");
        let error: zenoh::Error = said.into();
        assert_eq!(in_words(&error), "No link");
        let cut: zenoh::Error = "No link to tcp/hall:1: [hall: refused (os error 111) at /src/tcp.rs:7.]".into();
        assert_eq!(in_words(&cut), "No link to tcp/hall:1: [hall: refused (os error 111)]");
        for plain in ["nobody listens at tcp/hall:7447", "at home.rs: nothing", ""] {
            assert_eq!(without_source_paths(plain), plain);
        }
        let listed = "[refused at /src/a.rs:1., at rest] at src/b.rs:22.\n";
        assert_eq!(without_source_paths(listed), "[refused., at rest].\n");
    }
}
