//! From a connection to a WebSocket, for those who may have one. A browser connects wherever a page
//! tells it to, with its user's certificate, so it matters which page that is.

use crate::link::protocol::SUBPROTOCOLS;
use fht_door::{Caller, DoorStream, Hosts};
use std::sync::Arc;
use std::time::Duration;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tokio_tungstenite::tungstenite::http::header::{HOST, ORIGIN, SEC_WEBSOCKET_PROTOCOL};
use tokio_tungstenite::tungstenite::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::{WebSocketStream, accept_hdr_async_with_config};

/// How long a handshake may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest message of a viewer, bytes.
const MAX_MESSAGE_BYTES: usize = 64 << 10;
/// A viewer says little: so much is kept for it.
const READ_BUFFER_BYTES: usize = 4 << 10;
/// Where Foxglove's own pages come from: the application in the browser, and on the desktop.
const FOXGLOVE: [&str; 2] = ["https://app.foxglove.dev", "file://"];

/// A connection to a viewer.
pub(crate) type ViewerSocket = WebSocketStream<DoorStream>;

/// The pages that may connect: Foxglove's, those of this machine's own names, and those that were
/// named. Programs that are no browsers do not say where they come from, and may.
#[derive(Debug)]
pub(crate) struct Origins {
    hosts: Arc<Hosts>,
    named: Vec<String>,
}

impl Origins {
    pub(crate) fn new(hosts: Arc<Hosts>, named: Vec<String>) -> Self {
        Self { hosts, named }
    }

    fn has(&self, origin: &str) -> bool {
        let authority = || origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
        FOXGLOVE.contains(&origin)
            || self.named.iter().any(|named| named == origin)
            || authority().is_some_and(|authority| self.hosts.has(authority))
    }

    /// The protocol to speak.
    ///
    /// # Errors
    /// Why nothing is spoken, and the status that says so.
    fn judge(&self, caller: &Caller, fields: &HeaderMap) -> Result<&'static str, (StatusCode, String)> {
        if *caller == Caller::Stranger {
            let text = "show a certificate of this site whose common name is ROLE:NAME";
            return Err((StatusCode::UNAUTHORIZED, text.to_owned()));
        }
        if !field(fields, &HOST)?.is_some_and(|host| self.hosts.has(host)) {
            let text = "this bridge does not go by the name in the field Host: --name makes one known";
            return Err((StatusCode::MISDIRECTED_REQUEST, text.to_owned()));
        }
        if let Some(origin) = field(fields, &ORIGIN)?.filter(|origin| !self.has(origin)) {
            let shown: String = origin.chars().take(100).collect();
            return Err((StatusCode::FORBIDDEN, format!("the page {shown} may not connect: --origin {shown} lets it")));
        }
        let offered = fields.get_all(SEC_WEBSOCKET_PROTOCOL).iter().filter_map(|value| value.to_str().ok());
        let offered: Vec<&str> = offered.flat_map(|values| values.split(',')).map(str::trim).collect();
        let spoken = SUBPROTOCOLS.into_iter().find(|protocol| offered.contains(protocol));
        let text = || format!("offer one of the WebSocket protocols {}", SUBPROTOCOLS.join(", "));
        spoken.ok_or_else(|| (StatusCode::BAD_REQUEST, text()))
    }
}

/// A field that is there once at most, as text.
fn field<'a>(fields: &'a HeaderMap, name: &HeaderName) -> Result<Option<&'a str>, (StatusCode, String)> {
    let mut values = fields.get_all(name).iter();
    match (values.next().map(HeaderValue::to_str), values.next()) {
        (None, _) => Ok(None),
        (Some(Ok(text)), None) => Ok(Some(text)),
        _ => Err((StatusCode::BAD_REQUEST, format!("the field {name} cannot be read"))),
    }
}

/// A WebSocket, if `caller` may have one and asks in time.
pub(crate) async fn shake_hands(stream: DoorStream, caller: &Caller, origins: &Origins) -> Option<ViewerSocket> {
    #[allow(clippy::result_large_err)] // the library's own type
    let judge = |request: &Request, mut response: Response| -> Result<Response, ErrorResponse> {
        match origins.judge(caller, request.headers()) {
            Ok(spoken) => {
                response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(spoken));
                Ok(response)
            }
            Err((status, text)) => {
                tracing::warn!(status = status.as_u16(), "a viewer is refused: {text}");
                let mut refusal = ErrorResponse::new(Some(text + "\n"));
                *refusal.status_mut() = status;
                Err(refusal)
            }
        }
    };
    let config = WebSocketConfig::default()
        .max_message_size(Some(MAX_MESSAGE_BYTES))
        .max_frame_size(Some(MAX_MESSAGE_BYTES))
        .read_buffer_size(READ_BUFFER_BYTES);
    match timeout(PATIENCE, accept_hdr_async_with_config(stream, judge, Some(config))).await {
        Ok(Ok(socket)) => Some(socket),
        Ok(Err(error)) => {
            tracing::debug!("no handshake: {error}");
            None
        }
        Err(_) => {
            tracing::debug!("no handshake in time");
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_door::MemberRole;
    use std::net::IpAddr;

    fn judged(caller: &Caller, fields: &[(&'static str, &str)]) -> Result<&'static str, u16> {
        let hosts = Hosts::new(IpAddr::from([10, 0, 0, 5]), ["maps.example".to_owned()].into_iter(), true);
        let origins = Origins::new(Arc::new(hosts), vec!["https://viewer.example".to_owned()]);
        let mut headers = HeaderMap::new();
        for (name, value) in fields {
            let value = HeaderValue::from_str(value).unwrap_or_else(|error| panic!("{error}"));
            headers.append(HeaderName::from_static(name), value);
        }
        origins.judge(caller, &headers).map_err(|(status, _)| status.as_u16())
    }

    #[test]
    fn only_known_pages_and_programs_connect() {
        let (host, offer) = (("host", "maps.example:8765"), ("sec-websocket-protocol", "foxglove.sdk.v1"));
        let from = |origin: &str| judged(&Caller::Local, &[host, offer, ("origin", origin)]);
        assert_eq!(judged(&Caller::Local, &[host, offer]), Ok("foxglove.sdk.v1"), "no browser");
        for origin in [
            "https://app.foxglove.dev",
            "file://",
            "http://localhost:8080",
            "https://maps.example",
            "https://viewer.example",
        ] {
            assert!(from(origin).is_ok(), "{origin}");
        }
        for origin in [
            "https://evil.example",
            "null",
            "",
            "https://app.foxglove.dev.evil.example",
            "http://app.foxglove.dev",
            "https://localhost.evil.example",
            "ftp://localhost",
        ] {
            assert_eq!(from(origin), Err(403), "{origin}");
        }
        let twice = [host, offer, ("origin", "file://"), ("origin", "https://evil.example")];
        assert_eq!(judged(&Caller::Local, &twice), Err(400));
    }

    #[test]
    fn strangers_other_names_and_other_protocols_are_refused() {
        let (host, offer) = (("host", "10.0.0.5:8765"), ("sec-websocket-protocol", "foxglove.sdk.v1"));
        assert_eq!(judged(&Caller::Stranger, &[host, offer]), Err(401));
        let member = Caller::Member(MemberRole::Client, "tug".parse().unwrap_or_else(|error| panic!("{error}")));
        assert!(judged(&member, &[host, offer]).is_ok());
        assert_eq!(judged(&member, &[("host", "evil.example"), offer]), Err(421));
        assert_eq!(judged(&member, &[offer]), Err(421));
        assert_eq!(judged(&member, &[host]), Err(400));
        let speaks = |protocols: &str| judged(&member, &[host, ("sec-websocket-protocol", protocols)]);
        assert_eq!(speaks("foxglove.websocket.v1, foxglove.sdk.v1"), Ok("foxglove.sdk.v1"));
        assert_eq!(speaks("foxglove.websocket.v1"), Ok("foxglove.websocket.v1"));
        assert_eq!(speaks("foxglove.sdk.v10"), Err(400));
    }
}
