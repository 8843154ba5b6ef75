//! What robots report blocked: operators open it, or have it stay closed.

use crate::program::operator::asking::order_all_json;
use crate::program::operator::error::OperatorError;
use crate::program::operator::robots::fleet;
use crate::program::operator::rule;
use clap::Subcommand;
use fht_proto::api::fleet::BlockedReport;
use fht_proto::api::keys::{AdminAction, Key};
use fht_proto::api::reply::{BlockedView, IgnoredView, RulesReply, known_names};
use fht_proto::{MapName, RobotName};
use serde::Serialize;
use std::time::Duration;
use zenoh::Session;

/// What an operator can do with what robots report blocked.
#[derive(Clone, Debug, Subcommand)]
pub enum BlockedAction {
    /// Show it.
    #[command(after_help = "Examples:
  map-server blocked list museum")]
    List {
        /// The map.
        map: MapName,
    },
    /// Open it. A robot that still finds its way blocked says so again.
    #[command(after_help = "Examples:
  map-server blocked clear museum
  map-server blocked clear museum --robot amr-7 --ignore 1h")]
    Clear {
        /// The map.
        map: MapName,
        /// What this robot has reported [default: what all have].
        #[arg(long, value_name = "NAME")]
        robot: Option<RobotName>,
        /// Let the robot's reports not count for this time, such as 10m; a day at most. 0s: they
        /// count again.
        #[arg(long, value_name = "TIME", requires = "robot", value_parser = up_to_a_day, allow_hyphen_values = true)]
        ignore: Option<Duration>,
    },
    /// Have it stay closed, whatever the robot says or does. To close something for longer than a
    /// day, use close or zone.
    #[command(after_help = "Examples:
  map-server blocked keep museum --robot amr-7 --for 8h")]
    Keep {
        /// The map.
        map: MapName,
        /// What this robot has reported.
        #[arg(long, value_name = "NAME")]
        robot: RobotName,
        /// For this time, such as 30m or 8h; a day at most.
        #[arg(long = "for", value_name = "TIME", value_parser = up_to_a_day, allow_hyphen_values = true)]
        duration: Duration,
    },
}

/// A time such as `8h`.
fn up_to_a_day(text: &str) -> Result<Duration, String> {
    let time = humantime::parse_duration(text).map_err(|error| format!("{error}; write 30m or 8h"))?;
    let is_short = time.as_secs_f64() <= BlockedReport::MAX_S;
    if is_short { Ok(time) } else { Err("that is more than a day".to_owned()) }
}

impl BlockedAction {
    /// The map.
    pub(super) fn map(&self) -> &MapName {
        match self {
            Self::List { map } | Self::Clear { map, .. } | Self::Keep { map, .. } => map,
        }
    }

    /// What is blocked after it. Of several servers every one is told: each keeps what it has
    /// heard.
    ///
    /// # Errors
    /// [`OperatorError`].
    pub(super) async fn carry_out(self, session: &Session) -> Result<Blocked, OperatorError> {
        let see = format!("rules {}", self.map());
        let order = |map: &MapName, action| Key::Admin { map: map.clone(), action }.to_string();
        let is_list = matches!(self, Self::List { .. });
        let rules: RulesReply = match &self {
            Self::List { map } => rule::list(session, map).await?,
            Self::Clear { map, robot, ignore } => {
                let robot = robot.as_ref().map(|robot| format!("?robot={robot}")).unwrap_or_default();
                let ignore = ignore.map(|ignore| format!(";ignore_s={}", ignore.as_secs_f64())).unwrap_or_default();
                let key = order(map, AdminAction::Unblock);
                order_all_json(session, &format!("{key}{robot}{ignore}"), &see).await?
            }
            Self::Keep { map, robot, duration } => {
                let key = order(map, AdminAction::KeepBlocked);
                let selector = format!("{key}?robot={robot};for_s={}", duration.as_secs_f64());
                order_all_json(session, &selector, &see).await?
            }
        };
        let unheard = match &self {
            Self::Clear { map, robot: Some(robot), ignore: Some(time) } if !time.is_zero() => {
                unheard(session, map, robot).await
            }
            _ => None,
        };
        Ok(Blocked { map: rules.map, blocked: rules.blocked, ignored: rules.ignored, is_list, unheard })
    }
}

/// That no robot of this name has told its state, a sentence: it may be mistyped.
async fn unheard(session: &Session, map: &MapName, robot: &RobotName) -> Option<String> {
    let robots = fleet(session, map).await.ok()?.robots;
    let names: Vec<&str> = robots.iter().map(|known| known.status.robot.as_str()).collect();
    (!names.contains(&robot.as_str())).then(|| {
        format!(
            "no robot called {robot} has told its state on map {map} ({}): --ignore 0s takes it back",
            known_names(names)
        )
    })
}

/// What is blocked on a map.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Blocked {
    map: MapName,
    blocked: Vec<BlockedView>,
    ignored: Vec<IgnoredView>,
    /// Whether it was only asked for.
    #[serde(skip)]
    is_list: bool,
    /// That there may be no such robot as the one whose reports shall not count.
    #[serde(skip_serializing_if = "Option::is_none")]
    unheard: Option<String>,
}

/// A time to the second, such as `8h` or `1m 30s`.
fn time_in_words(seconds: f64) -> humantime::FormattedDuration {
    humantime::format_duration(Duration::from_secs(seconds.max(0.0).round() as u64)) // saturates
}

pub(super) fn in_words(blocked: &Blocked) -> String {
    let one = |view: &BlockedView| {
        let edges = view.edges.iter().map(|[a, b]| format!("edge {a} {b}"));
        let places = view.places.iter().map(|[x, y]| format!("({x:.2}, {y:.2})"));
        let things: Vec<String> = edges.chain(places).collect();
        format!("{}, for another {}: {}", view.robot, time_in_words(view.for_s), things.join(", "))
    };
    let ignored = |view: &IgnoredView| {
        format!("what {} reports does not count for another {}", view.robot, time_in_words(view.for_s))
    };
    let mut lines: Vec<String> = blocked.blocked.iter().map(one).collect();
    if lines.is_empty() {
        let any_more = if blocked.is_list { "" } else { " any more" };
        lines.push(format!("robots report nothing blocked on map {}{any_more}", blocked.map));
    }
    lines.extend(blocked.ignored.iter().map(ignored));
    lines.extend(blocked.unheard.clone());
    lines.join("\n")
}
