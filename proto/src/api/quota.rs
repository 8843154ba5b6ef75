//! How much of a server's room writers take and may take, and an operator's word on it.

use crate::model::ids::MapName;
use crate::model::validate::{Invalid, Validate, check};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};

/// Most increments a second that a quota can allow.
const MOST_INCREMENTS_PER_S: f64 = 1e6;

/// What an operator wants one writer's quota to be, until the server starts again. What is not said
/// stays as it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuotaChange {
    /// The writer.
    pub writer: String,
    /// First of all that of its role again.
    pub of_role: bool,
    /// Share of one map's bytes, and of its nodes and edges, 0 to 1.
    pub map_share: Option<f64>,
    /// Share of the bytes, and of the nodes and edges, of all maps, and of their number, 0 to 1.
    pub total_share: Option<f64>,
    /// Increments a second, 1 to a million.
    pub increments_per_s: Option<f64>,
    /// Share of others' nodes in a map that it may take away within an hour, 0 to 1.
    pub taken_per_hour_share: Option<f64>,
}

/// In words: whose quota, and what it is to be.
impl Display for QuotaChange {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { writer, of_role, map_share, total_share, increments_per_s, taken_per_hour_share } = self;
        let numbers = [
            ("map_share", map_share),
            ("total_share", total_share),
            ("increments_per_s", increments_per_s),
            ("taken_per_hour_share", taken_per_hour_share),
        ];
        let numbers = numbers.into_iter().filter_map(|(name, value)| Some(format!("{name} {}", (*value)?)));
        let of_role = of_role.then(|| "that of its role".to_owned());
        let all: Vec<String> = of_role.into_iter().chain(numbers).collect();
        write!(f, "{writer}: {}", all.join(", "))
    }
}

impl Validate for QuotaChange {
    fn validate(&self) -> Result<(), Invalid> {
        let Self { map_share, total_share, increments_per_s, taken_per_hour_share, .. } = *self;
        let shares =
            [("map_share", map_share), ("total_share", total_share), ("taken_per_hour_share", taken_per_hour_share)];
        for (name, share) in shares.into_iter().filter_map(|(name, share)| Some((name, share?))) {
            check((0.0..=1.0).contains(&share), || format!("{name}={share}: 0 to 1 are allowed"))?;
        }
        let per_s = increments_per_s.unwrap_or(1.0);
        check((1.0..=MOST_INCREMENTS_PER_S).contains(&per_s), || {
            format!("increments_per_s={per_s}: 1 to {MOST_INCREMENTS_PER_S} are allowed")
        })?;
        let says_nothing = *self == Self { writer: self.writer.clone(), ..Self::default() };
        check(!says_nothing, || format!("say what {}'s quota is to be, such as map_share=0.8", self.writer))
    }
}

/// How much is there of something, and how much there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QuotaUse {
    /// So much is there for the writer.
    pub used: u64,
    /// So much may be there.
    pub most: u64,
}

/// One writer's quota.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WriterQuotaView {
    /// Its name.
    pub writer: String,
    /// `explorer` or `operator`.
    pub role: String,
    /// Whether an operator has set it; else it is that of the role.
    pub is_own: bool,
    /// Bytes of the map.
    pub map_bytes: QuotaUse,
    /// Nodes and edges of the map.
    pub map_elements: QuotaUse,
    /// Bytes of all maps.
    pub total_bytes: QuotaUse,
    /// Nodes and edges of all maps.
    pub total_elements: QuotaUse,
    /// Maps that it writes in.
    pub maps: QuotaUse,
    /// Increments a second.
    pub increments_per_s: f64,
    /// Share of others' nodes in a map that it may take away within an hour.
    pub taken_per_hour_share: f64,
}

/// The quotas of all writers, as far as one map is concerned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuotaReply {
    /// The map.
    pub map: MapName,
    /// By name.
    pub writers: Vec<WriterQuotaView>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_in_words() {
        let change = QuotaChange { writer: "amr-7".to_owned(), of_role: true, ..QuotaChange::default() };
        assert_eq!(change.to_string(), "amr-7: that of its role");
        let change = QuotaChange { map_share: Some(0.8), increments_per_s: Some(10.0), ..change };
        assert_eq!(change.to_string(), "amr-7: that of its role, map_share 0.8, increments_per_s 10");
    }
}
