//! The operators' subcommands.

use crate::config::{DEFAULT_LISTEN, ServerEndpoints};
use crate::ingest::Retained;
use crate::program::operator::asking::{ask, ask_json, connect};
use crate::program::operator::error::OperatorError;
use crate::program::operator::merge::{self, MergeOrder};
use crate::program::operator::release;
use crate::program::operator::robots;
use crate::program::operator::rule::{self, Corners, parse_corners, parse_pose, parse_speed};
use crate::program::operator::transfer;
use crate::program::operator::words::{maps_in_words, releases_in_words, rules_in_words};
use crate::program::operator::write::write;
use clap::{Args, Subcommand};
use fht_merge::MergeConfig;
use fht_proto::api::keys::{AdminAction, Key, Topic};
use fht_proto::api::reply::{DiffReply, MapsReply};
use fht_proto::{FixedPose, Label, MapName, NodeId, Op, ReleaseName, Zone, ZoneRule};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Duration;
use zenoh::Session;

/// What all operators' commands share.
#[derive(Clone, Debug, Args)]
pub struct OperatorArgs {
    /// The operator's name; what is written is written under it.
    #[arg(
        long,
        global = true,
        help_heading = "Operators' commands",
        default_value = "operator",
        env = "FHT_OPERATOR",
        value_name = "NAME"
    )]
    operator: String,
    /// Print JSON.
    #[arg(long, global = true, help_heading = "Operators' commands")]
    json: bool,
}

impl OperatorArgs {
    /// Whether JSON is to be printed.
    #[must_use]
    pub fn json(&self) -> bool {
        self.json
    }
}

/// What an operator can do.
#[derive(Clone, Debug, Subcommand)]
pub enum Operation {
    /// The maps that the server has.
    Maps,
    /// The robots of a map: what they run, where they are, who is behind.
    Robots {
        /// The map.
        map: MapName,
        /// Show them again every second, until interrupted.
        #[arg(long)]
        watch: bool,
    },
    /// Releases: states of the map with a name, which never change, and which robots can be told to
    /// use.
    Release {
        /// What to do.
        #[command(subcommand)]
        action: ReleaseAction,
    },
    /// What has changed between two states of a map.
    Diff {
        /// The map.
        map: MapName,
        /// From: a release, a version, a vector, or head.
        from: String,
        /// To: the same.
        #[arg(default_value = "head")]
        to: String,
    },
    /// Named places, zones, closed edges, and what robots found blocked.
    Rules {
        /// The map.
        map: MapName,
    },
    /// Names a place, so that robots and queries can go there by name.
    Place {
        /// The map.
        map: MapName,
        /// Its name: a letter, then letters, digits, _ or -.
        name: Label,
        /// Where: x,y or x,y,yaw (map frame, metres and degrees).
        #[arg(value_parser = parse_pose, allow_hyphen_values = true, required_unless_present = "remove")]
        at: Option<FixedPose>,
        /// Take the name away.
        #[arg(long, conflicts_with = "at")]
        remove: bool,
        /// Also where no robot can be, as far as the map knows.
        #[arg(long, conflicts_with = "remove")]
        force: bool,
    },
    /// Draws a zone that robots keep out of, or are slow in.
    Zone {
        /// The map.
        map: MapName,
        /// Its name: a letter, then letters, digits, _ or -.
        name: Label,
        /// Its corners in order, three or more, as one text: 'x,y x,y x,y' (map frame, metres).
        #[arg(value_parser = parse_corners, allow_hyphen_values = true, required_unless_present = "remove")]
        corners: Option<Corners>,
        /// Robots may enter, and drive at most so fast, metres per second. Without this they keep
        /// out.
        #[arg(long, value_parser = parse_speed, value_name = "M/S")]
        speed: Option<u16>,
        /// Take the zone away.
        #[arg(long, conflicts_with_all = ["corners", "speed"])]
        remove: bool,
        /// Also where the map is not.
        #[arg(long, conflicts_with = "remove")]
        force: bool,
    },
    /// Closes an edge: no path leads over it, until it is opened.
    Close {
        /// The map.
        map: MapName,
        /// One end.
        a: NodeId,
        /// The other end.
        b: NodeId,
    },
    /// Opens an edge again.
    Open {
        /// The map.
        map: MapName,
        /// One end.
        a: NodeId,
        /// The other end.
        b: NodeId,
    },
    /// Folds old increments: the newest versions and all releases stay what they are, what only
    /// older versions needed goes.
    Retain {
        /// The map.
        map: MapName,
        /// How many of the newest versions stay.
        #[arg(long, value_name = "VERSIONS")]
        keep: u64,
    },
    /// Writes a map to a file, with all its releases.
    Export {
        /// The map.
        map: MapName,
        /// The file.
        file: PathBuf,
        /// This release instead of the newest state.
        #[arg(long)]
        release: Option<ReleaseName>,
    },
    /// Takes a map in from a file.
    Import {
        /// The file.
        file: PathBuf,
        /// Under this name instead of the one that it had.
        #[arg(long)]
        map: Option<MapName>,
    },
    /// Merges two maps of one building that were made apart: finds out where the second lies in the
    /// first, and brings over what the first lacks. Refused, with the reason, when they are not
    /// surely of one building.
    #[command(after_help = "Examples:
  map-server merge museum museum-2 --dry-run        do they fit?
  map-server merge museum museum-2                  museum grows by what museum-2 has and it has not
  map-server merge museum museum-2 --into whole     both stay as they are

What is written is the operator's, like places and zones. A release before is the way back.")]
    Merge {
        /// The map whose frame stays.
        first: MapName,
        /// The map that is brought over. It stays as it is.
        second: MapName,
        /// Write to a new map of this name, which begins with all of the first, instead of into the
        /// first.
        #[arg(long, value_name = "MAP")]
        into: Option<MapName>,
        /// Only say how they fit.
        #[arg(long)]
        dry_run: bool,
        /// Leave out what operators wrote of the second: places, zones, closed edges.
        #[arg(long)]
        only_map: bool,
    },
}

/// What an operator can do with releases.
#[derive(Clone, Debug, Subcommand)]
pub enum ReleaseAction {
    /// Show them.
    List {
        /// The map.
        map: MapName,
    },
    /// Make one of the newest state, or of an older version.
    Create {
        /// The map.
        map: MapName,
        /// Its name [default: the day and a number, such as 2026-11-21.1].
        name: Option<ReleaseName>,
        /// Of this version.
        #[arg(long)]
        version: Option<u64>,
    },
    /// Tell robots to use one; 'head': the newest state, as it grows.
    Enable {
        /// The map.
        map: MapName,
        /// Its name, or name@author.
        name: String,
    },
    /// Tell robots to use the one that was made before the one that they use.
    Rollback {
        /// The map.
        map: MapName,
    },
    /// Delete one, for ever.
    Delete {
        /// The map.
        map: MapName,
        /// Its name, or name@author.
        name: String,
    },
}

/// Prints the value as JSON, or what `words` makes of it.
fn show<T: Serialize>(value: &T, json: bool, words: impl FnOnce(&T) -> String) -> Result<(), OperatorError> {
    if json {
        println!("{}", serde_json::to_string(value).map_err(|error| OperatorError::json(&error))?);
    } else {
        println!("{}", words(value));
    }
    Ok(())
}

impl Operation {
    /// Carries it out over a session that `link` describes; by default on this machine. Maps are
    /// merged as `merge` says.
    ///
    /// # Errors
    /// [`OperatorError`].
    pub async fn carry_out(
        self,
        args: &OperatorArgs,
        mut link: ServerEndpoints,
        merge: MergeConfig,
    ) -> Result<(), OperatorError> {
        if link.connect.is_empty() && link.zenoh_config.is_none() {
            link.connect.push(DEFAULT_LISTEN.to_owned());
        }
        let session = connect(&link).await?;
        let outcome = self.with(&session, args, merge).await;
        // Everything is answered; whether the goodbye arrives does not matter.
        let _ = session.close().await;
        outcome
    }

    async fn with(self, session: &Session, args: &OperatorArgs, config: MergeConfig) -> Result<(), OperatorError> {
        let (json, operator) = (args.json, args.operator.as_str());
        match self {
            Self::Maps => show(&ask_json::<MapsReply>(session, &Key::Maps.to_string()).await?, json, maps_in_words),
            Self::Robots { map, watch } => show_robots(session, &map, watch, json).await,
            Self::Release { action } => action.carry_out(session, operator, json).await,
            Self::Diff { map, from, to } => {
                let selector = format!("{}?from={from};to={to}", Key::topic(&map, Topic::Diff));
                show(&ask_json::<DiffReply>(session, &selector).await?, json, |diff| {
                    format!("version {} to {}: {}", diff.from.version, diff.to.version, diff.words)
                })
            }
            Self::Rules { map } => show(&rule::list(session, &map).await?, json, rules_in_words),
            Self::Place { map, name, at, force, .. } => {
                let op = match at {
                    Some(at) => rule::place(session, &map, (name, at), force).await?,
                    None => rule::no_place(session, &map, name).await?,
                };
                change(session, args, &map, op).await
            }
            Self::Zone { map, name, corners, speed, force, .. } => {
                let rule = speed.map_or(ZoneRule::KeepOut, ZoneRule::SpeedLimit);
                let op = match corners {
                    Some(Corners(corners)) => rule::zone(session, &map, name, Zone { rule, corners }, force).await?,
                    None => rule::no_zone(session, &map, name).await?,
                };
                change(session, args, &map, op).await
            }
            Self::Close { map, a, b } => {
                change(session, args, &map, rule::closing(session, &map, [a, b], true).await?).await
            }
            Self::Open { map, a, b } => {
                change(session, args, &map, rule::closing(session, &map, [a, b], false).await?).await
            }
            Self::Retain { map, keep } => {
                let key = Key::Admin { map, action: AdminAction::Retain };
                let answer = ask(session, &format!("{key}?keep={keep}"), None).await?;
                let retained: Retained =
                    serde_json::from_slice(&answer).map_err(|error| OperatorError::json(&error))?;
                show(&retained, json, |done| {
                    format!(
                        "{} increments folded; {} instead of {} bytes; versions from {} on can be had",
                        done.folded, done.bytes, done.bytes_before, done.oldest_version
                    )
                })
            }
            Self::Export { map, file, release } => {
                let release = release.as_ref().map(ReleaseName::as_str);
                let done = transfer::export(session, &map, &file, release, json).await?;
                show(&done, json, |done| {
                    format!("version {} of {} in {} ({} bytes)", done.version, done.map, file.display(), done.bytes)
                })
            }
            Self::Merge { first, second, into, dry_run, only_map } => {
                let order = MergeOrder { first, second, into, dry_run, only_map, operator, quiet: json, config };
                let outcome = merge::merge(session, &order).await;
                if let (Err(OperatorError::Merge(refusal)), true) = (&outcome, json) {
                    show(&merge::refused(&order, refusal), json, |_| String::new())?;
                }
                show(&outcome?, json, merge::in_words)
            }
            Self::Import { file, map } => {
                let done = transfer::import(session, &file, map, json).await?;
                show(&done, json, |done| {
                    format!("map {} is at version {}, digest {}", done.map, done.version, done.digest)
                })
            }
        }
    }
}

async fn change(session: &Session, args: &OperatorArgs, map: &MapName, op: Op) -> Result<(), OperatorError> {
    let head = write(session, map, &args.operator, vec![op]).await?;
    show(&head, args.json, |head| format!("written; map {} is at version {}", head.map, head.version))
}

impl ReleaseAction {
    async fn carry_out(self, session: &Session, operator: &str, json: bool) -> Result<(), OperatorError> {
        let releases = match self {
            Self::List { map } => release::list(session, &map).await?,
            Self::Create { map, name, version } => {
                let made = release::create(session, &map, operator, name, version).await?;
                return show(&made, json, |made| {
                    format!("release {}@{} of version {}", made.name, made.author, made.version)
                });
            }
            Self::Enable { map, name } => {
                release::enable(session, &map, operator, Some(name.as_str()).filter(|name| *name != "head")).await?
            }
            Self::Rollback { map } => release::roll_back(session, &map, operator).await?,
            Self::Delete { map, name } => release::delete(session, &map, operator, &name).await?,
        };
        show(&releases, json, releases_in_words)
    }
}

async fn show_robots(session: &Session, map: &MapName, watch: bool, json: bool) -> Result<(), OperatorError> {
    /// Clears the terminal and goes to its top.
    const CLEAR: &str = "\x1b[2J\x1b[H";
    loop {
        let fleet = robots::fleet(session, map).await?;
        if watch && !json {
            print!("{CLEAR}");
        }
        show(&fleet, json, robots::table)?;
        if !watch {
            return Ok(());
        }
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
}
