//! Which numbers make sense. A key whose documentation gives a range has that range. For all others
//! one rule holds, which catches slips (a unit, a sign, a digit too many) without listing a range
//! for each of some hundred keys.

use super::schema::KeySchema;
use serde_json::Value;

/// How many times its default a number may be at most.
const MOST_TIMES: f64 = 1000.0;
/// The greatest number where the default is 0 or no number, if the unit says nothing.
const MOST: f64 = 1e6;
/// The greatest number of each unit.
const UNITS: [(&str, f64); 6] =
    [("_m", 100_000.0), ("_mm", 100_000_000.0), ("_s", 1e7), ("_rad", 6.3), ("_deg", 360.0), ("_mps", 100.0)];

/// Says why `number` makes no sense as the value of `key`.
pub(super) fn refusal(key: &str, number: f64, schema: KeySchema<'_>, default: Option<&Value>) -> Option<String> {
    if !number.is_finite() {
        return Some("must be a finite number".to_owned());
    }
    let default = default.and_then(Value::as_f64);
    let least = schema.number("minimum").unwrap_or(if default.is_some_and(|d| d >= 0.0) { 0.0 } else { f64::MIN });
    let most = schema.number("maximum").unwrap_or_else(|| greatest(key, default));
    let least = least.max(-greatest(key, default));
    (!(least..=most).contains(&number)).then(|| match default {
        Some(default) => format!("is {number}; it must be from {least} to {most} (default {default})"),
        None => format!("is {number}; it must be from {least} to {most}"),
    })
}

/// Seeds may be anything.
fn greatest(key: &str, default: Option<f64>) -> f64 {
    if key.contains("seed") {
        return f64::MAX;
    }
    let unit = UNITS.iter().find(|(unit, _)| key.ends_with(unit)).map(|(_, most)| *most);
    let times = default.filter(|default| *default != 0.0).map(|default| default.abs() * MOST_TIMES);
    match (unit, times) {
        (Some(unit), Some(times)) => unit.min(times),
        (unit, times) => times.or(unit).unwrap_or(MOST),
    }
}
