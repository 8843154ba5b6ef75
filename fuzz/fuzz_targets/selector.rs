#![no_main]
//! Keys and queries: `KEY?PARAMETERS`, a line end, and a payload.

use fht_proto::api::keys::{Key, RobotTopic};
use fht_proto::api::request::{parse, parse_goal, parse_goal_id, parse_order};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let (line, payload) = match bytes.iter().position(|&byte| byte == b'\n') {
        Some(end) => (&bytes[..end], Some(&bytes[end + 1..])),
        None => (bytes, None),
    };
    let Ok(selector) = std::str::from_utf8(line) else { return };
    let (key, parameters) = selector.split_once('?').unwrap_or((selector, ""));
    let Ok(key) = key.parse::<Key>() else { return };
    assert_eq!(key.to_string().parse::<Key>().as_ref(), Ok(&key));
    let pairs = parameters.split(';').map(|pair| pair.split_once('=').unwrap_or((pair, "")));
    let complaint = match key {
        Key::Admin { action, .. } => parse_order(action, pairs, payload).err(),
        Key::RobotTopic { topic: RobotTopic::Goal, .. } => parse_goal(pairs, payload).err(),
        Key::Goal { .. } => parse_goal_id(pairs, payload).err(),
        key => parse(key, pairs, payload).err(),
    };
    if let Some(error) = complaint {
        // Tools show the JSON of it with escapes.
        assert!(!error.message.is_empty() && !error.message.contains(['"', '\\']), "{error}");
    }
});
