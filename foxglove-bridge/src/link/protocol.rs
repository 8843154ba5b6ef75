//! Foxglove's WebSocket protocol as text and bytes: what this side needs of it
//! (<https://github.com/foxglove/ws-protocol>). Numbers in bytes are little-endian.

use crate::channel::{BridgeChannel, ENCODING};
use crate::link::services::{JSON, ServiceKind};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};

/// The protocols that are spoken, the newest first: Foxglove's, and the older one of Lichtblick.
/// What this side says is the same in both.
pub(crate) const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// What bytes begin with.
const MESSAGE_DATA: u8 = 1;
const SERVICE_CALL: u8 = 2;
const SERVICE_REPLY: u8 = 3;

/// How bad what is said of a viewer's wish is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Severity {
    Warning = 1,
    Error = 2,
}

/// What a viewer wants to see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Subscription {
    pub(crate) id: u32,
    pub(crate) channel_id: u32,
}

/// A question of a viewer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ServiceCall {
    pub(crate) service: u32,
    pub(crate) call: u32,
    pub(crate) encoding: String,
    pub(crate) payload: Vec<u8>,
}

/// What a viewer says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ViewerWord {
    Subscribe(Vec<Subscription>),
    Unsubscribe(Vec<u32>),
    Call(ServiceCall),
    /// What this side does not do, or does not understand.
    Other(String),
}

#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum TextWord {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

impl ViewerWord {
    pub(crate) fn of_text(text: &str) -> Self {
        match serde_json::from_str(text) {
            Ok(TextWord::Subscribe { subscriptions }) => Self::Subscribe(subscriptions),
            Ok(TextWord::Unsubscribe { subscription_ids }) => Self::Unsubscribe(subscription_ids),
            Ok(TextWord::Other) => Self::Other("this bridge does not do that".to_owned()),
            Err(error) => Self::Other(format!("this message is not understood: {error}")),
        }
    }

    pub(crate) fn of_bytes(bytes: &[u8]) -> Self {
        let call = || {
            let (kind, rest) = bytes.split_first()?;
            let (service, rest) = number(rest)?;
            let (call, rest) = number(rest)?;
            let (length, rest) = number(rest)?;
            let (encoding, payload) = rest.split_at_checked(usize::try_from(length).ok()?)?;
            let encoding = String::from_utf8(encoding.to_vec()).ok()?;
            (*kind == SERVICE_CALL).then(|| ServiceCall { service, call, encoding, payload: payload.to_vec() })
        };
        call().map_or_else(|| Self::Other("these bytes are no call of a service".to_owned()), Self::Call)
    }
}

fn number(bytes: &[u8]) -> Option<(u32, &[u8])> {
    let (number, rest) = bytes.split_first_chunk()?;
    Some((u32::from_le_bytes(*number), rest))
}

/// Who this is and what it can do. `session` is another one after each start.
pub(crate) fn server_info(name: &str, session: &str) -> String {
    let info = json!({
        "op": "serverInfo", "name": name, "capabilities": ["services"], "supportedEncodings": [JSON], "metadata": {},
        "sessionId": session,
    });
    info.to_string()
}

/// All channels.
pub(crate) fn advertise() -> String {
    let channel = |channel: BridgeChannel| -> Option<Value> {
        let schema = channel.schema()?;
        Some(json!({
            "id": channel.id(), "topic": channel.topic(), "encoding": ENCODING, "schemaName": schema.name,
            "schemaEncoding": schema.encoding, "schema": STANDARD.encode(&schema.data),
        }))
    };
    let channels: Vec<Value> = BridgeChannel::ALL.into_iter().filter_map(channel).collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// All services.
pub(crate) fn advertise_services() -> String {
    let side = |name: String, schema: &str| -> Value {
        json!({ "encoding": JSON, "schemaName": name, "schemaEncoding": "jsonschema", "schema": schema })
    };
    let service = |kind: ServiceKind| {
        let (name, [request, reply]) = (kind.type_name(), kind.schemas());
        json!({
            "id": kind.id(), "name": kind.name(), "type": name,
            "request": side(format!("{name}Request"), request), "response": side(format!("{name}Reply"), reply),
        })
    };
    let services: Vec<Value> = ServiceKind::ALL.into_iter().map(service).collect();
    json!({ "op": "advertiseServices", "services": services }).to_string()
}

/// Why a call has no answer.
pub(crate) fn service_failure(service: u32, call: u32, message: &str) -> String {
    json!({ "op": "serviceCallFailure", "serviceId": service, "callId": call, "message": message }).to_string()
}

/// What is wrong with what a viewer said.
pub(crate) fn status(severity: Severity, message: &str) -> String {
    json!({ "op": "status", "level": severity as u8, "message": message }).to_string()
}

/// A message of a channel, to who subscribed to it.
pub(crate) fn message_data(subscription: u32, at_ns: u64, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(13 + payload.len());
    bytes.push(MESSAGE_DATA);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(at_ns.to_le_bytes());
    bytes.extend(payload);
    bytes
}

/// An answer.
pub(crate) fn service_reply(service: u32, call: u32, payload: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(17 + payload.len());
    bytes.push(SERVICE_REPLY);
    for number in [service, call, JSON.len() as u32] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(JSON.as_bytes());
    bytes.extend(payload);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_viewers_say_is_read_and_what_makes_no_sense_is_told() {
        let text = ViewerWord::of_text;
        let wanted = vec![Subscription { id: 3, channel_id: 1 }];
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":3,"channelId":1}]}"#;
        assert_eq!(text(subscribe), ViewerWord::Subscribe(wanted));
        assert_eq!(text(r#"{"op":"unsubscribe","subscriptionIds":[3,4]}"#), ViewerWord::Unsubscribe(vec![3, 4]));
        for odd in [
            r#"{"op":"advertise","channels":[]}"#,
            "",
            "[",
            "null",
            r#"{"op":"subscribe"}"#,
            r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#,
            r#"{"op":"unsubscribe","subscriptionIds":[4294967296]}"#,
        ] {
            assert!(matches!(text(odd), ViewerWord::Other(_)), "{odd}");
        }
        let call = [&[2, 1, 0, 0, 0, 9, 0, 0, 0, 4, 0, 0, 0][..], b"json{}"].concat();
        let read = ServiceCall { service: 1, call: 9, encoding: JSON.to_owned(), payload: b"{}".to_vec() };
        assert_eq!(ViewerWord::of_bytes(&call), ViewerWord::Call(read));
        for end in 0..17 {
            assert!(matches!(ViewerWord::of_bytes(&call[..end]), ViewerWord::Other(_)), "{end}");
        }
        let endless = [2, 1, 0, 0, 0, 9, 0, 0, 0, 255, 255, 255, 255, 7];
        assert!(matches!(ViewerWord::of_bytes(&endless), ViewerWord::Other(_)));
    }

    proptest! {
        #[test]
        fn whatever_comes_is_read_as_something(bytes: Vec<u8>, text: String) {
            let _ = ViewerWord::of_text(&text);
            let call = [&[SERVICE_CALL][..], &bytes].concat();
            if let ViewerWord::Call(read) = ViewerWord::of_bytes(&call) {
                let length = read.encoding.len() as u32;
                let numbers = [read.service, read.call, length].map(u32::to_le_bytes).concat();
                let again = [&[SERVICE_CALL][..], &numbers, read.encoding.as_bytes(), &read.payload].concat();
                prop_assert_eq!(again, call);
            }
        }
    }

    #[test]
    fn bytes_are_as_the_protocol_has_them() {
        let data = [&[1, 3, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0][..], b"x"].concat();
        assert_eq!(message_data(3, 7, b"x"), data);
        let reply = [&[3, 1, 0, 0, 0, 9, 0, 0, 0, 4, 0, 0, 0][..], b"json{}"].concat();
        assert_eq!(service_reply(1, 9, b"{}"), reply);
    }
}
