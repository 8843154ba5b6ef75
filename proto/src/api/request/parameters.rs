//! The parameters of a query: each is known, given once, and read as what it should be.

use crate::api::reply::{ErrorCode, ErrorReply};
use crate::{Footprint, VersionVector};
use std::collections::BTreeMap;
use std::str::FromStr;

/// How a reply is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// For people and tools.
    Json,
    /// Compact, in an envelope.
    Postcard,
}

/// A complaint about a request.
#[must_use]
pub fn bad_request(message: String) -> ErrorReply {
    ErrorReply::new(ErrorCode::BadRequest, &message)
}

/// Text from outside, cut to a sensible length for a message; what was cut off ends in `…`.
#[must_use]
pub fn shown(text: &str) -> String {
    shown_upto(text, 80)
}

/// The same, up to so many characters.
#[must_use]
pub fn shown_upto(text: &str, most: usize) -> String {
    let mut letters = text.chars();
    let mut shown: String = letters.by_ref().take(most).collect();
    if letters.next().is_some() {
        shown.push('…');
    }
    shown
}

/// The parameters of a query, checked against those that the topic knows.
pub(super) struct Parameters<'a> {
    values: BTreeMap<&'a str, &'a str>,
}

impl<'a> Parameters<'a> {
    /// Those of the query that is called `of`, which takes the `known` ones.
    pub(super) fn of(
        of: &str,
        pairs: impl Iterator<Item = (&'a str, &'a str)>,
        known: &[&str],
    ) -> Result<Self, ErrorReply> {
        let mut values = BTreeMap::new();
        // Names with an underscore are Zenoh's own.
        for (name, value) in pairs.filter(|(name, _)| !name.is_empty() && !name.starts_with('_')) {
            if !known.contains(&name) {
                let name = shown(name);
                return Err(bad_request(match known.is_empty() {
                    true => format!("unknown parameter {name}; {of} takes none"),
                    false => format!("unknown parameter {name}; {of} takes: {}", known.join(", ")),
                }));
            }
            if value.contains('&') {
                return Err(bad_request(format!("{name}={}: parameters are joined by ; and not by &", shown(value))));
            }
            if values.insert(name, value).is_some() {
                return Err(bad_request(format!("parameter {name} is given twice")));
            }
        }
        Ok(Self { values })
    }

    /// Those of a query that is answered in JSON and asks for nothing in particular.
    pub(super) fn json_only(of: &str, pairs: impl Iterator<Item = (&'a str, &'a str)>) -> Result<(), ErrorReply> {
        Self::of(of, pairs, &["fmt"])?.in_json(of)
    }

    /// That a query is not asked for another form than the one that it has.
    pub(super) fn in_json(&self, of: &str) -> Result<(), ErrorReply> {
        match self.format(Format::Json)? {
            Format::Json => Ok(()),
            Format::Postcard => Err(bad_request(format!("fmt=postcard: {of} is answered in JSON only"))),
        }
    }

    pub(super) fn required(&self, name: &str, example: &str) -> Result<&'a str, ErrorReply> {
        match self.given(name) {
            None => Err(bad_request(format!("parameter {name} is missing; for example: {example}"))),
            Some("") => Err(bad_request(format!("parameter {name} is empty; for example: {example}"))),
            Some(value) => Ok(value),
        }
    }

    /// What was given, also if that is nothing: where a parameter left out means something else.
    pub(super) fn given(&self, name: &str) -> Option<&'a str> {
        self.values.get(name).copied()
    }

    /// What was given, if the parameter was: nothing is no text, and does not stand for a parameter
    /// left out.
    pub(super) fn text(&self, name: &str) -> Result<Option<&'a str>, ErrorReply> {
        match self.given(name) {
            Some("") => Err(bad_request(format!("parameter {name} is empty: give a value, or leave it out"))),
            value => Ok(value),
        }
    }

    pub(super) fn parsed<T: FromStr>(&self, name: &str, expected: &str) -> Result<Option<T>, ErrorReply> {
        let parse = |value: &&str| {
            value.trim().parse().map_err(|_| bad_request(format!("{name}={} is not {expected}", shown(value))))
        };
        self.values.get(name).map(parse).transpose()
    }

    pub(super) fn limit(&self, name: &str, (default, most): (usize, usize)) -> Result<usize, ErrorReply> {
        let limit = self.parsed(name, &format!("a number from 1 to {most}"))?.unwrap_or(default);
        if (1..=most).contains(&limit) { Ok(limit) } else { Err(bad_request(format!("{name} must be 1 to {most}"))) }
    }

    pub(super) fn format(&self, default: Format) -> Result<Format, ErrorReply> {
        match self.values.get("fmt").copied() {
            None => Ok(default),
            Some("json") => Ok(Format::Json),
            Some("postcard") => Ok(Format::Postcard),
            Some(other) => Err(bad_request(format!("fmt={} is neither json nor postcard", shown(other)))),
        }
    }

    pub(super) fn footprint(&self) -> Result<Option<Footprint>, ErrorReply> {
        let parse = |text: &str| {
            text.parse().map_err(|error| bad_request(format!("footprint={} cannot be used: {error}", shown(text))))
        };
        self.values.get("footprint").copied().map(parse).transpose()
    }

    pub(super) fn vector(&self, name: &str) -> Result<Option<VersionVector>, ErrorReply> {
        let parse = |value: &&str| value.parse().map_err(|error| bad_request(format!("{name}: {error}")));
        self.values.get(name).map(parse).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::shown;
    use crate::api::keys::{Key, Topic};
    use crate::api::request::parse;

    #[test]
    fn an_empty_value_is_none_and_does_not_stand_for_a_parameter_left_out() {
        let asked = |topic, parameters: &str| {
            let key = Key::topic(&"museum".parse().expect("a name"), topic);
            let pairs = parameters.split(';').filter_map(|pair| pair.split_once('='));
            parse(key, pairs, None).map_err(|error| error.message)
        };
        for (topic, parameters, name) in [
            (Topic::Path, "from=0,0;to=", "to"),
            (Topic::Path, "from=;to=1,1", "from"),
            (Topic::Path, "from=0,0;to=1,1;release=", "release"),
            (Topic::Snapshot, "release=", "release"),
            (Topic::Snapshot, "piece_bytes=", "piece_bytes"),
            (Topic::Diff, "from=1;to=", "to"),
            (Topic::Nodes, "near=", "near"),
        ] {
            let refused = asked(topic, parameters);
            let expected = format!("parameter {name} is empty");
            assert!(refused.as_ref().is_err_and(|said| said.starts_with(&expected)), "{parameters}: {refused:?}");
        }
        assert!(asked(Topic::Diff, "from=1").is_ok() && asked(Topic::Path, "from=0,0;to=1,1").is_ok());
        assert!(asked(Topic::Path, "from=0,0").is_err_and(|said| said.contains("parameter to is missing")));
        // Nothing is a vector and a page.
        assert!(asked(Topic::Since, "vector=").is_ok() && asked(Topic::Nodes, "near=0,0;after=").is_ok());
    }

    #[test]
    fn what_is_cut_off_is_marked() {
        assert_eq!((shown("Küche"), shown(&"ü".repeat(80))), ("Küche".to_owned(), "ü".repeat(80)));
        assert_eq!(shown(&"ü".repeat(81)), "ü".repeat(80) + "…");
    }
}
