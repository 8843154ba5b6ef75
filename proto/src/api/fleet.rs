//! What robots publish about themselves, as JSON: where they are, what they run, what they found
//! blocked, where they are going.

use crate::model::geometry::{FixedPoint, FixedPose};
use crate::model::ids::{MapName, NodeId};
use crate::model::increment::EdgeKey;
use crate::model::validate::{Invalid, Validate, check};
use crate::model::version::VersionVector;
use serde::{Deserialize, Serialize};

/// How sure a robot is of where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum LocalizationState {
    /// No place fits yet.
    NotLocalized,
    /// Places fit, but not well enough or not clearly enough.
    Candidates,
    /// It knows where it is.
    Localized,
    /// It knew where it was, but what it senses no longer fits.
    Lost,
}

impl std::fmt::Display for LocalizationState {
    /// As it is written in JSON.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::NotLocalized => "NOT_LOCALIZED",
            Self::Candidates => "CANDIDATES",
            Self::Localized => "LOCALIZED",
            Self::Lost => "LOST",
        })
    }
}

/// What a robot puts under its `pose` key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotPose {
    /// The robot's name.
    pub robot: String,
    /// Whether it knows where it is; if not, the pose is absent.
    pub localized: bool,
    /// The same in more detail.
    pub state: LocalizationState,
    /// Probability that the pose, or the likeliest candidate, is right, as the robot sees it: 0 to
    /// 1.
    pub confidence: f64,
    /// Where it may be, likeliest first, at most five: `[x, y, yaw]` in the map frame, metres and
    /// radians. Empty once it knows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<[f64; 3]>,
    /// How probable each candidate is, in their order, 0 to 1; together 1 at most. Robots of
    /// earlier versions do not say it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub probabilities: Vec<f64>,
    /// `[x, y, yaw]` in the map frame, metres and radians.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map_from_base: Option<[f64; 3]>,
    /// Why it gave up the last place that it knew, in words. Absent once it knows again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lost_because: Option<String>,
    /// When that was, by the robot's clock: microseconds since 1970. Absent if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp_us: Option<u64>,
}

/// What a robot does with the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RobotRole {
    /// It writes the map.
    Explorer,
    /// It uses the map.
    Client,
}

/// What a robot puts under its `status` key, about once a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotStatus {
    /// The robot's name.
    pub robot: String,
    /// What it does with the map.
    pub role: RobotRole,
    /// The map that it uses.
    pub map: MapName,
    /// How many increments it has: the sum of the vector.
    pub version: u64,
    /// The increments that it has.
    pub vector: VersionVector,
    /// The release that it runs, as `name@author`; none when it runs the newest state that it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub release: Option<String>,
    /// Whether it knows where it is.
    pub state: LocalizationState,
    /// `[x, y, yaw]` in the map frame, metres and radians, if it knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map_from_base: Option<[f64; 3]>,
    /// When that was, by the robot's clock: microseconds since 1970. Absent if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp_us: Option<u64>,
}

impl Validate for RobotStatus {
    fn validate(&self) -> Result<(), Invalid> {
        let Some([x, y, yaw]) = self.map_from_base else { return Ok(()) };
        check([x, y].iter().all(|metres| metres.abs() <= FixedPoint::MAX_M), || {
            "a robot over 100 km from the origin".to_owned()
        })?;
        check(yaw.abs() <= FixedPose::MAX_YAW_RAD, || format!("a robot's yaw of {yaw:e} rad"))
    }
}

/// What a robot puts under its `blocked` key: what it could not pass. Everybody avoids it for the
/// time stated, from when the report arrives. A report without edges and places takes the robot's
/// earlier ones back; one with a field that is none of these is refused, since it may mean another.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct BlockedReport {
    /// For how long, seconds.
    pub for_s: f64,
    /// Edges, each by the ids of its ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<[String; 2]>,
    /// Places, `[x, y]` in the map frame, metres.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<[f64; 2]>,
}

impl BlockedReport {
    /// Longest time, seconds: a day. What is closed for longer is for an operator to close.
    pub const MAX_S: f64 = 86_400.0;
    /// Most edges and places in one report.
    pub const MAX_THINGS: usize = 64;

    /// The edges by their keys.
    ///
    /// # Errors
    /// The first that is not a pair of two nodes' ids.
    pub fn edge_keys(&self) -> Result<Vec<EdgeKey>, Invalid> {
        let key = |[a, b]: &[String; 2]| {
            let ids = a.parse::<NodeId>().ok().zip(b.parse::<NodeId>().ok()).filter(|(a, b)| a != b);
            ids.map(|(a, b)| EdgeKey::new(a, b)).ok_or_else(|| Invalid::new(format!("[{a}, {b}] is not an edge")))
        };
        self.edges.iter().map(key).collect()
    }
}

impl Validate for BlockedReport {
    fn validate(&self) -> Result<(), Invalid> {
        check((0.0..=Self::MAX_S).contains(&self.for_s), || {
            format!("blocked for {} s (0 to {} are allowed)", self.for_s, Self::MAX_S)
        })?;
        let things = self.edges.len() + self.places.len();
        check(things <= Self::MAX_THINGS, || format!("a report of {things} blocked things"))?;
        check(self.places.iter().flatten().all(|v| v.abs() <= FixedPoint::MAX_M), || {
            "a blocked place over 100 km from the origin".to_owned()
        })?;
        self.edge_keys().map(|_| ())
    }
}

/// What an explorer puts under its `goal` key, so that others go elsewhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ExplorerGoal {
    /// Where it is, `[x, y]` in the map frame, metres.
    pub at: [f64; 2],
    /// What it is heading for, `[x, y]` in the map frame, metres; none while it has chosen
    /// nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<[f64; 2]>,
    /// How far that is along its path, metres.
    pub remaining_m: f64,
    /// Whether it has nothing left to explore, and has written all of its map.
    #[serde(default)]
    pub finished: bool,
    /// Whether it drives no more and is writing the last of its map.
    #[serde(default)]
    pub finishing: bool,
}

impl Validate for ExplorerGoal {
    fn validate(&self) -> Result<(), Invalid> {
        let places = self.at.iter().chain(self.target.iter().flatten());
        check(places.chain([&self.remaining_m]).all(|metres| metres.abs() <= FixedPoint::MAX_M), || {
            "a goal over 100 km from the origin".to_owned()
        })?;
        check(self.remaining_m >= 0.0, || format!("{} m are left of the way", self.remaining_m))
    }
}

/// One robot in the reply to `fleet`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotView {
    /// Its last status.
    pub status: RobotStatus,
    /// Whether its liveliness token is there.
    pub alive: bool,
    /// How long ago that came, seconds.
    pub seen_s: f64,
    /// How many increments of the newest state it lacks.
    pub behind: u64,
    /// For how long it has lacked any, seconds.
    pub behind_s: f64,
    /// Whether it is there, and has lacked some, or has run another release than the enabled one,
    /// for too long.
    pub late: bool,
}

/// The reply to `fleet`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FleetReply {
    /// The map.
    pub map: MapName,
    /// Its newest version.
    pub version: u64,
    /// The release enabled, as `name@author`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enabled: Option<String>,
    /// Whether that release is not used, since not all of it is here, or its digest is wrong:
    /// robots go on with what they ran.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub enabled_unused: bool,
    /// By name.
    pub robots: Vec<RobotView>,
    /// Whether there are more.
    #[serde(default)]
    pub truncated: bool,
    /// What to ask as `after` for those; absent if there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_from_outside_are_checked() {
        let read = |json: &str| serde_json::from_str::<BlockedReport>(json).map(|report| report.validate().is_ok());
        assert!(read(r#"{"for_s":60,"edges":[["1a2b3c4d.17","1a2b3c4d.3"]],"places":[[1.5,-2]]}"#).unwrap_or(false));
        assert!(read(r#"{"for_s":0}"#).unwrap_or(false));
        for bad in [
            r#"{"for_s":-1}"#,
            r#"{"for_s":1e9}"#,
            r#"{"for_s":1,"edges":[["1a2b3c4d.17","1a2b3c4d.17"]]}"#,
            r#"{"for_s":1,"edges":[["a","b"]]}"#,
            r#"{"for_s":1,"places":[[1e9,0]]}"#,
        ] {
            assert!(!read(bad).unwrap_or(false), "{bad}");
        }
    }

    #[test]
    fn a_status_says_what_is_required_and_where_a_robot_may_be() {
        let read = |text: &str| serde_json::from_str::<RobotStatus>(text).map(|status| status.validate().is_ok());
        let required = r#""robot":"r","role":"client","map":"m","version":0,"vector":{},"state":"LOST""#;
        let status = |pose: &str| format!(r#"{{{required},"map_from_base":{pose}}}"#);
        for good in ["null", "[1,0.5,-1.25]", "[100000,-100000,6.2832]"] {
            assert!(read(&status(good)).unwrap_or(false), "{good}");
        }
        for bad in ["[1e300,0,0]", "[0,-100000.1,0]", "[0,0,1e300]", "[0,0,6.29]", "[0,0]", "[1e999,0,0]"] {
            assert!(!read(&status(bad)).unwrap_or(false), "{bad}");
        }
        assert!(read(r#"{"robot":"r","role":"client","map":"m"}"#).is_err());
    }
}
