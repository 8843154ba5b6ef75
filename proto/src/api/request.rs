//! Queries as they come: parameters to typed requests. Every complaint says what was expected.

mod goal;
mod order;
mod parameters;

use crate::api::keys::{Key, Topic};
use crate::api::reply::{ErrorReply, JournalCursor, NodesCursor, PlaceRef, parse_point};
use crate::{Descriptor, FixedPoint, Footprint, MapName, ReleaseId, ReleaseName, RobotName, VersionVector, decode};
pub use goal::{is_goal, parse_goal, parse_goal_id};
pub use order::{AdminOrder, parse_order};
use parameters::Parameters;
pub use parameters::{Format, bad_request, shown, shown_upto};

/// A state of a map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The first so many increments that the server stored.
    Version(u64),
    /// These increments.
    Vector(VersionVector),
    /// A release, by its name or `name@author`.
    Release(String),
    /// Everything now.
    Now,
}

impl Moment {
    /// Reads `head`, a version, a vector or the name of a release.
    fn parse(text: &str) -> Result<Self, ErrorReply> {
        if text == "head" {
            Ok(Self::Now)
        } else if text.contains(':') {
            text.parse()
                .map(Self::Vector)
                .map_err(|error| bad_request(format!("{} is no vector: {error}", shown(text))))
        } else if text.bytes().all(|byte| byte.is_ascii_digit()) {
            text.parse().map(Self::Version).map_err(|_| bad_request(format!("{} is no version", shown(text))))
        } else {
            release_name(text).map(Self::Release)
        }
    }
}

/// What could be the name of a release.
fn release_name(text: &str) -> Result<String, ErrorReply> {
    let is_one = text.parse::<ReleaseName>().is_ok() || text.parse::<ReleaseId>().is_ok();
    let complaint = || bad_request(format!("{} is no release: write its name or name@author", shown(text)));
    is_one.then(|| text.to_owned()).ok_or_else(complaint)
}

/// Which state a path is planned on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PathOn {
    /// The release that is enabled, or else the newest state.
    Enabled,
    /// The newest state.
    Head,
    /// This release, by its name or `name@author`.
    Release(String),
}

/// A question about one map.
#[derive(Clone, Debug, PartialEq)]
pub enum Question {
    /// Version, vector, digest, counts.
    Head,
    /// The increments of `moment` that the asker lacks (`since` and `snapshot`).
    Increments {
        /// What is asked for.
        moment: Moment,
        /// What the asker has.
        have: VersionVector,
        /// About how long the reply may be, bytes.
        max_bytes: usize,
        /// If given, it comes in several replies of about this length each.
        piece_bytes: Option<usize>,
        /// Of the reply.
        format: Format,
    },
    /// A path: `path?from=0,0;to=dock;footprint=0.3`.
    Path {
        /// The start.
        from: PlaceRef,
        /// The goal.
        to: PlaceRef,
        /// The state to plan on.
        on: PathOn,
        /// The robot that the path must be free for; none for the explorers' own. A radius in
        /// metres, `footprint=0.3`, or a convex polygon in the base frame, corners in metres,
        /// `footprint=0.3,0.2_-0.3,0.2_-0.3,-0.2_0.3,-0.2`, which is planned for as the smallest
        /// disc around the base's origin that covers it. [`Footprint::planned_as`] says what is
        /// rounded. For a robot larger than the explorers' (0.105 m) the path leads through free
        /// space that is wide enough for it from start to goal, or the answer is `NO_PATH`; it
        /// never leads over nodes and edges alone.
        footprint: Option<Footprint>,
        /// Whether the path may end at the nearest point that can be reached, if the goal cannot:
        /// `to_nearest=true`. None if nothing was said, which means no; then the compact form is
        /// the one without what it says.
        to_nearest: Option<bool>,
        /// Whether the compact reply tells the heading at the goal, too. JSON does anyway.
        goal_yaw: bool,
        /// Of the reply.
        format: Format,
    },
    /// Nodes near a place.
    Nodes {
        /// The place.
        near: FixedPoint,
        /// How near, metres.
        radius_m: f64,
        /// How many at most.
        limit: usize,
        /// Only those that follow: `after=` with what the page before gave as `next`, or with
        /// nothing for the first page. None if nothing was said, which is the first page; then the
        /// compact form is the one that does not tell of pages.
        after: Option<NodesCursor>,
        /// Of the reply.
        format: Format,
    },
    /// The releases.
    Releases,
    /// What has changed.
    Diff {
        /// From this state …
        from: Moment,
        /// … to this.
        to: Moment,
    },
    /// Named places, zones, closed edges, what is blocked.
    Rules,
    /// The robots, by name.
    Fleet {
        /// How many at most.
        limit: usize,
        /// Only those that follow: what the page before gave as `next`; none for the first page.
        after: Option<RobotName>,
    },
    /// What operators have changed, the newest first.
    Journal {
        /// How many changes at most.
        limit: usize,
        /// Only those that follow: what the page before gave as `next`; none for the first page.
        after: Option<JournalCursor>,
    },
    /// Nodes that look like a descriptor.
    Match {
        /// The descriptor.
        descriptor: Descriptor,
        /// How many at most.
        limit: usize,
        /// Of the reply.
        format: Format,
    },
}

/// A request to the server.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// The maps there are.
    Maps,
    /// A question about one map.
    Map(MapName, Question),
}

/// Default and greatest length of a series of increments, bytes. Short enough to share a thin link
/// with live increments.
const SERIES_BYTES: (usize, usize) = (64 << 10, 1 << 20);
/// Default and greatest number of nodes in a reply to `nodes`.
const NODES_LIMIT: (usize, usize) = (100, 1000);
/// Robots in a reply: unless told otherwise, and at most.
const FLEET_LIMIT: (usize, usize) = (200, 1000);
/// Changes in a reply to `journal`: unless told otherwise, and at most.
const JOURNAL_LIMIT: (usize, usize) = (50, 200);
/// Default and greatest number of nodes in a reply to `match`.
const MATCH_LIMIT: (usize, usize) = (5, 50);
/// Default and greatest radius of `nodes`, metres.
const RADIUS_M: (f64, f64) = (5.0, FixedPoint::MAX_M);

/// Reads a request.
///
/// # Errors
/// `BAD_REQUEST` with a sentence that says what was expected.
pub fn parse<'a>(
    key: Key,
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&[u8]>,
) -> Result<Request, ErrorReply> {
    match key {
        Key::Maps => Parameters::json_only("maps", parameters).map(|()| Request::Maps),
        Key::Topic { map, topic } => Ok(Request::Map(map, question(topic, parameters, payload)?)),
        Key::Increment { .. }
        | Key::Refused { .. }
        | Key::Robot { .. }
        | Key::RobotTopic { .. }
        | Key::Goal { .. }
        | Key::Kept { .. }
        | Key::Admin { .. } => Err(bad_request(format!("{key} is not a topic"))),
    }
}

fn fleet<'a>(parameters: impl Iterator<Item = (&'a str, &'a str)>) -> Result<Question, ErrorReply> {
    let given = Parameters::of("fleet", parameters, &["limit", "after", "fmt"])?;
    given.in_json("fleet")?;
    let after = given.parsed("after", "a robot's name")?;
    Ok(Question::Fleet { limit: given.limit("limit", FLEET_LIMIT)?, after })
}

fn journal<'a>(parameters: impl Iterator<Item = (&'a str, &'a str)>) -> Result<Question, ErrorReply> {
    let given = Parameters::of("journal", parameters, &["limit", "after", "fmt"])?;
    given.in_json("journal")?;
    let after = given.parsed("after", "what a reply gave as next")?;
    Ok(Question::Journal { limit: given.limit("limit", JOURNAL_LIMIT)?, after })
}

fn question<'a>(
    topic: Topic,
    parameters: impl Iterator<Item = (&'a str, &'a str)>,
    payload: Option<&[u8]>,
) -> Result<Question, ErrorReply> {
    match topic {
        Topic::Head => Parameters::json_only("head", parameters).map(|()| Question::Head),
        Topic::Since => {
            let given = Parameters::of("since", parameters, &["vector", "max_bytes", "piece_bytes", "fmt"])?;
            let have = given.vector("vector")?.unwrap_or_default();
            increments(&given, Moment::Now, have)
        }
        Topic::Snapshot => {
            let known = ["version", "vector", "release", "have", "max_bytes", "piece_bytes", "fmt"];
            let given = Parameters::of("snapshot", parameters, &known)?;
            let version = given.parsed("version", "a whole number")?.map(Moment::Version);
            let vector = given.vector("vector")?.map(Moment::Vector);
            let release = given.text("release")?.map(release_name).transpose()?.map(Moment::Release);
            let mut moments = version.into_iter().chain(vector).chain(release);
            let moment = moments.next().unwrap_or(Moment::Now);
            if moments.next().is_some() {
                return Err(bad_request("give only one of version, vector and release".to_owned()));
            }
            let have = given.vector("have")?.unwrap_or_default();
            increments(&given, moment, have)
        }
        Topic::Path => {
            let known = ["from", "to", "to_nearest", "release", "footprint", "goal_yaw", "fmt"];
            let given = Parameters::of("path", parameters, &known)?;
            let place = |name| given.required(name, "path?from=0,0;to=5,3").and_then(str::parse);
            let on = match given.text("release")? {
                None => PathOn::Enabled,
                Some("head") => PathOn::Head,
                Some(name) => PathOn::Release(release_name(name)?),
            };
            let (from, to, footprint) = (place("from")?, place("to")?, given.footprint()?);
            let to_nearest = given.parsed("to_nearest", "true or false")?;
            let goal_yaw = given.parsed("goal_yaw", "true or false")?.unwrap_or(false);
            let format = given.format(Format::Json)?;
            Ok(Question::Path { from, to, on, footprint, to_nearest, goal_yaw, format })
        }
        Topic::Nodes => {
            let given = Parameters::of("nodes", parameters, &["near", "radius", "limit", "after", "fmt"])?;
            let near = parse_point(given.required("near", "nodes?near=0,0;radius=5")?)?;
            let radius_m = given.parsed("radius", "a number of metres")?.unwrap_or(RADIUS_M.0);
            if !(0.0..=RADIUS_M.1).contains(&radius_m) {
                return Err(bad_request(format!("radius must be 0 to {} m", RADIUS_M.1)));
            }
            Ok(Question::Nodes {
                near,
                radius_m,
                limit: given.limit("limit", NODES_LIMIT)?,
                after: given.parsed("after", "what a reply gave as next")?,
                format: given.format(Format::Json)?,
            })
        }
        Topic::Releases => Parameters::json_only("releases", parameters).map(|()| Question::Releases),
        Topic::Rules => Parameters::json_only("rules", parameters).map(|()| Question::Rules),
        Topic::Fleet => fleet(parameters),
        Topic::Journal => journal(parameters),
        Topic::Diff => {
            let given = Parameters::of("diff", parameters, &["from", "to", "fmt"])?;
            given.in_json("diff")?;
            let from = Moment::parse(given.required("from", "diff?from=2026-11-21.1;to=head")?)?;
            let to = given.text("to")?.map_or(Ok(Moment::Now), Moment::parse)?;
            Ok(Question::Diff { from, to })
        }
        Topic::Match => {
            let given = Parameters::of("match", parameters, &["limit", "fmt"])?;
            let missing = || bad_request("match needs a descriptor in the payload, over Zenoh".to_owned());
            let descriptor = decode(payload.ok_or_else(missing)?)
                .map_err(|error| bad_request(format!("the payload is not a descriptor: {error}")))?;
            Ok(Question::Match {
                descriptor,
                limit: given.limit("limit", MATCH_LIMIT)?,
                format: given.format(Format::Json)?,
            })
        }
    }
}

/// The question for what `have` lacks of `moment`.
fn increments(given: &Parameters<'_>, moment: Moment, have: VersionVector) -> Result<Question, ErrorReply> {
    let max_bytes = given.limit("max_bytes", SERIES_BYTES)?;
    let piece_bytes = given.text("piece_bytes")?.map(|_| given.limit("piece_bytes", SERIES_BYTES)).transpose()?;
    Ok(Question::Increments { moment, have, max_bytes, piece_bytes, format: given.format(Format::Postcard)? })
}
