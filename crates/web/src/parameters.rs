//! The parameters of a query, as Zenoh writes them (`a=1;b=2`) or as browsers do (`a=1&b=2`), with
//! whatever a URL cannot have written as `%XX`.

use fht_proto::api::reply::ErrorReply;
use fht_proto::api::request::bad_request;
use percent_encoding::percent_decode_str;

/// Names and values, in order.
pub(crate) struct QueryText(Vec<(String, String)>);

impl QueryText {
    /// Reads what stands behind the question mark.
    ///
    /// # Errors
    /// `BAD_REQUEST` if it is not UTF-8.
    pub(crate) fn parse(query: &str) -> Result<Self, ErrorReply> {
        let text = |part: &str| {
            let decoded = percent_decode_str(part).decode_utf8();
            decoded.map(Into::into).map_err(|_| bad_request("a parameter is not UTF-8".to_owned()))
        };
        let parts = query.split(['&', ';']).filter(|part| !part.is_empty());
        let pair = |part: &str| {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            Ok((text(name)?, text(value)?))
        };
        Ok(Self(parts.map(pair).collect::<Result<_, ErrorReply>>()?))
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(name, value)| (name.as_str(), value.as_str()))
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.iter().find(|(known, _)| *known == name).map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(query: &str) -> Option<Vec<(String, String)>> {
        QueryText::parse(query).ok().map(|text| text.0)
    }

    #[test]
    fn zenohs_way_and_browsers_way_are_the_same() {
        let expected = Some(vec![("from".to_owned(), "0,0".to_owned()), ("to".to_owned(), "Küche".to_owned())]);
        assert_eq!(read("from=0,0;to=K%C3%BCche"), expected);
        assert_eq!(read("from=0%2C0&to=K%C3%BCche&"), expected);
        assert_eq!(read("after="), Some(vec![("after".to_owned(), String::new())]));
        assert_eq!(read(""), Some(Vec::new()));
        // What is written as %XX separates nothing, and + is no blank.
        assert_eq!(read("a=1%3Bb=2"), Some(vec![("a".to_owned(), "1;b=2".to_owned())]));
        assert_eq!(read("a=1+1"), Some(vec![("a".to_owned(), "1+1".to_owned())]));
        assert_eq!(read("to=%FF"), None);
    }
}
