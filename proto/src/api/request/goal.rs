//! Where a robot is sent: a payload in JSON or the parameters of a query, read alike.

use super::parameters::{Parameters, bad_request, shown};
use crate::api::goal::GoalOrder;
use crate::api::reply::{ErrorReply, PlaceRef};
use crate::model::geometry::FixedPoint;
use crate::model::ids::is_name;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::Value;
use std::fmt::Formatter;

/// What a goal may say.
const OF_A_GOAL: [&str; 6] = ["id", "to", "x", "y", "yaw", "to_nearest"];

/// Reads where a robot is sent: `goal?id=7;to=dock`, or a payload such as `{"id": "7", "x": 4.5,
/// "y": 0, "yaw": 1.57}`.
///
/// # Errors
/// `BAD_REQUEST` with a sentence that says what was expected.
pub fn parse_goal<'a>(
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&[u8]>,
) -> Result<GoalOrder, ErrorReply> {
    read("a goal", parameters, payload, &OF_A_GOAL, |given| {
        let id = given.required("id", "goal?id=7;to=dock").and_then(checked_id)?;
        let number = |name| given.parsed::<f64>(name, "a number");
        let (x, y, yaw) = (number("x")?, number("y")?, number("yaw")?);
        let to = match (given.text("to")?, x, y) {
            (Some(to), None, None) => to.parse()?,
            (None, Some(x), Some(y)) => PlaceRef::Point(point(x, y)?),
            (None, None, None) => {
                return Err(bad_request("say where to: to=dock, or x=4.5;y=0 in metres (map frame)".to_owned()));
            }
            (Some(_), ..) => return Err(bad_request("give either to, or x and y".to_owned())),
            _ => return Err(bad_request("x and y go together".to_owned())),
        };
        if let Some(yaw) = yaw {
            if !matches!(to, PlaceRef::Point(_)) {
                return Err(bad_request("yaw goes with coordinates: a named place has its own".to_owned()));
            }
            if !(-GoalOrder::MAX_YAW_RAD..=GoalOrder::MAX_YAW_RAD).contains(&yaw) {
                let most = GoalOrder::MAX_YAW_RAD;
                return Err(bad_request(format!("yaw is {yaw}: it is in radians, -{most} to {most}")));
            }
        }
        let to_nearest = given.parsed("to_nearest", "true or false")?.unwrap_or(false);
        Ok(GoalOrder { id, to, yaw, to_nearest })
    })
}

/// Whether a payload sends a robot somewhere, and is not an explorer's word of where it goes.
#[must_use]
pub fn is_goal(payload: &[u8]) -> bool {
    parse_goal(std::iter::empty(), Some(payload)).is_ok()
}

/// Reads which goal is meant: `cancel?id=7`, or a payload such as `{"id": "7"}`; none if nothing is
/// said. An empty id is no goal's, and does not stand for all.
///
/// # Errors
/// `BAD_REQUEST` with a sentence that says what was expected.
pub fn parse_goal_id<'a>(
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&[u8]>,
) -> Result<Option<String>, ErrorReply> {
    read("this query", parameters, payload, &["id"], |given| given.given("id").map(checked_id).transpose())
}

fn checked_id(id: &str) -> Result<String, ErrorReply> {
    let wrong = || bad_request(format!("id={} is not 1 to 64 letters, digits, _ or -", shown(id)));
    is_name(id).then(|| id.to_owned()).ok_or_else(wrong)
}

fn point(x: f64, y: f64) -> Result<FixedPoint, ErrorReply> {
    let most = FixedPoint::MAX_M;
    let is_near = |metres: f64| metres.abs() <= most;
    let far =
        || bad_request(format!("({x:?}, {y:?}) lies outside of all maps: x and y are metres, from -{most} to {most}"));
    (is_near(x) && is_near(y)).then(|| FixedPoint::from_metres(x, y)).ok_or_else(far)
}

/// Reads what was given to `of`, as JSON if there is a payload.
fn read<'a, T>(
    of: &str,
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&[u8]>,
    known: &[&str],
    take: impl FnOnce(&Parameters<'_>) -> Result<T, ErrorReply>,
) -> Result<T, ErrorReply> {
    let Some(payload) = payload.filter(|payload| !payload.is_empty()) else {
        return take(&Parameters::of(of, parameters, known)?);
    };
    Parameters::of("a selector with a payload", parameters, &[])?;
    let texts = texts(payload)?;
    take(&Parameters::of(of, texts.iter().map(|(name, text)| (name.as_str(), text.as_str())), known)?)
}

/// The fields of a JSON object in their order, those that are given twice, too.
struct Fields(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Fields {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Collect;
        impl<'de> Visitor<'de> for Collect {
            type Value = Fields;

            fn expecting(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
                formatter.write_str("a map")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Fields, A::Error> {
                let mut fields = Vec::new();
                while let Some(field) = map.next_entry()? {
                    fields.push(field);
                }
                Ok(Fields(fields))
            }
        }
        deserializer.deserialize_map(Collect)
    }
}

/// The fields of a JSON object, each as a text.
fn texts(payload: &[u8]) -> Result<Vec<(String, String)>, ErrorReply> {
    if payload.len() > GoalOrder::MAX_BYTES {
        let (length, most) = (payload.len(), GoalOrder::MAX_BYTES);
        return Err(bad_request(format!("{length} bytes are too many for a goal: at most {most}")));
    }
    let Fields(fields) = serde_json::from_slice(payload).map_err(|error| {
        bad_request(format!(
            "the payload is no goal in JSON, an object with id, and to, or x and y; names and texts in double quotes: \
             {error}"
        ))
    })?;
    let text = |(name, value): (String, Value)| match value {
        Value::Null => None,
        Value::String(text) => Some(Ok((name, text))),
        Value::Number(number) => Some(Ok((name, number.to_string()))),
        Value::Bool(flag) => Some(Ok((name, flag.to_string()))),
        Value::Array(_) | Value::Object(_) => {
            Some(Err(bad_request(format!("{} is a list or an object", shown(&name)))))
        }
    };
    fields.into_iter().filter_map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::api::reply::ErrorCode;

    fn of_json(text: &str) -> Result<GoalOrder, ErrorReply> {
        parse_goal(std::iter::empty(), Some(text.as_bytes()))
    }

    fn of_parameters(text: &str) -> Result<GoalOrder, ErrorReply> {
        parse_goal(text.split(';').map(|pair| pair.split_once('=').unwrap_or((pair, ""))), None)
    }

    #[test]
    fn a_goal_reads_the_same_from_json_and_from_a_selector() {
        for (json, selector) in [
            (r#"{"id": "a-1", "to": "Küche"}"#, "id=a-1;to=Küche"),
            (r#"{"id": 7, "to": "4.5,-1", "to_nearest": true}"#, "id=7;to=4.5,-1;to_nearest=true"),
            (r#"{"id": "7", "x": 4.5, "y": -1, "yaw": 1.57, "to_nearest": null}"#, "id=7;x=4.5;y=-1;yaw=1.57"),
            (r#"{"id": "7", "to": "1a2b3c4d.17"}"#, "id=7;to=1a2b3c4d.17"),
        ] {
            let order = of_json(json);
            assert!(order.is_ok() && order == of_parameters(selector), "{json}: {order:?}");
        }
        let order = of_json(r#"{"id": "7", "x": 4.5, "y": -1, "yaw": 1.57}"#);
        let to = PlaceRef::Point(FixedPoint::from_metres(4.5, -1.0));
        assert_eq!(order, Ok(GoalOrder { id: "7".to_owned(), to, yaw: Some(1.57), to_nearest: false }));
        for (yaw, is_taken) in [("6.2832", true), ("-6.2832", true), ("6.2833", false), ("-6.29", false)] {
            assert_eq!(of_parameters(&format!("id=7;x=4.5;y=-1;yaw={yaw}")).is_ok(), is_taken, "{yaw}");
        }
    }

    #[test]
    fn what_is_no_goal_is_refused_with_what_was_expected() {
        let long = format!(r#"{{"id": "{}", "to": "dock"}}"#, "7".repeat(65));
        let huge = format!(r#"{{"id": "7", "to": "{}"}}"#, "x".repeat(5000));
        let deep = format!(r#"{{"id": {}"#, "[".repeat(4000));
        for (json, expected) in [
            ("{}", "parameter id is missing"),
            (r#"{"id": "7"}"#, "say where to"),
            (r#"{"id": "", "to": "dock"}"#, "parameter id is empty"),
            (r#"{"id": "7", "to": ""}"#, "parameter to is empty"),
            (r#"{"id": "7", "to": "", "x": 1, "y": 2}"#, "parameter to is empty"),
            (r#"{"id": "7", "too": "dock"}"#, "unknown parameter too; a goal takes: id, to, x"),
            (r#"{"id": "7/8", "to": "dock"}"#, "is not 1 to 64 letters"),
            (long.as_str(), "is not 1 to 64 letters"),
            (huge.as_str(), "bytes are too many"),
            (deep.as_str(), "no goal in JSON"),
            (r#"{"id": "7", "x": 1}"#, "x and y go together"),
            (r#"{"id": "7", "x": 1, "y": 2, "to": "dock"}"#, "either to, or x and y"),
            (r#"{"id": "7", "to": "dock", "yaw": 1}"#, "yaw goes with coordinates"),
            (r#"{"id": "7", "x": 1, "y": 2, "yaw": 90}"#, "it is in radians"),
            (r#"{"id": "7", "x": 1, "y": 2, "yaw": "nan"}"#, "it is in radians"),
            (r#"{"id": "7", "x": 1e300, "y": 2}"#, "lies outside of all maps"),
            (r#"{"id": "7", "x": "inf", "y": 2}"#, "lies outside of all maps"),
            (r#"{"id": "7", "x": 1e999, "y": 2}"#, "no goal in JSON"),
            (r#"{"id": "7", "x": [1], "y": 2}"#, "x is a list or an object"),
            (r#"{"id": "7", "to": "dock", "to_nearest": "maybe"}"#, "is not true or false"),
            (r#"{"id": "7", "id": "8", "to": "dock"}"#, "parameter id is given twice"),
            (r#"{"id": "7", "x": 1, "x": 1, "y": 0}"#, "parameter x is given twice"),
            ("[]", "no goal in JSON"),
            ("dock", "no goal in JSON"),
        ] {
            let refused = of_json(json).map_err(|error| (error.code, error.message));
            let is_told = refused.as_ref().is_err_and(|(code, text)| {
                *code == ErrorCode::BadRequest && text.contains(expected) && !text.contains(['"', '\\'])
            });
            assert!(is_told, "{json}: {refused:?}");
        }
        assert!(parse_goal(std::iter::empty(), Some(&[0xff, 0xfe, 0x00])).is_err(), "not UTF-8");
    }

    #[test]
    fn a_goal_may_be_named_or_not() {
        let read = |text: &str| parse_goal_id(std::iter::empty(), Some(text.as_bytes()));
        assert_eq!(parse_goal_id(std::iter::empty(), None), Ok(None));
        assert_eq!((read(""), read("{}")), (Ok(None), Ok(None)));
        assert_eq!(read(r#"{"id": "7"}"#), Ok(Some("7".to_owned())));
        for empty in [read(r#"{"id": ""}"#), parse_goal_id([("id", "")].into_iter(), None)] {
            assert!(empty.is_err_and(|error| error.message.contains("is not 1 to 64 letters")));
        }
        assert!(read(r#"{"ids": "7"}"#).is_err_and(|error| error.message.contains("this query takes: id")));
    }
}
