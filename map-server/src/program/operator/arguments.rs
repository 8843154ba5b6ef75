//! The operators' subcommands, as they are written.

use crate::program::operator::blocked::BlockedAction;
use crate::program::operator::deletion::{grace, reason};
use crate::program::operator::quota::QuotaAction;
use crate::program::operator::release::ReleaseAction;
use crate::program::operator::rule::{Corners, parse_corners, parse_pose, parse_speed};
use crate::program::operator::siting::{DatumArgs, FloorPlanArgs};
use crate::query::DEFAULT_OPERATOR;
use clap::{Args, Subcommand};
use fht_program::flags::{count, wait};
use fht_proto::{FixedPose, Label, MapName, NodeId, ReleaseName, RobotName};
use std::path::PathBuf;
use std::time::Duration;

/// What all operators' commands share.
#[derive(Clone, Debug, Args)]
pub struct OperatorArgs {
    /// The operator's name: 1 to 64 of the letters a to z and A to Z, digits, _ or -. What is
    /// written is written under it.
    #[arg(
        long,
        global = true,
        help_heading = "Operators' commands",
        default_value = DEFAULT_OPERATOR,
        env = "FHT_OPERATOR",
        value_name = "NAME"
    )]
    pub(super) operator: RobotName,
    /// Print JSON.
    #[arg(long, global = true, help_heading = "Operators' commands")]
    pub(super) json: bool,
    /// Wait so long, from the start on, for the server and for the map; 'inf' is for ever. What is
    /// waited for is said every five seconds [default: 10 for the server; a map that it does not
    /// have is not waited for. A server itself waits for its routers for ever].
    #[arg(long, global = true, help_heading = "The way to the server", value_name = "SECONDS", value_parser = wait)]
    wait: Option<f64>,
}

impl OperatorArgs {
    /// Whether JSON is to be printed.
    #[must_use]
    pub fn json(&self) -> bool {
        self.json
    }

    /// What `--wait` says.
    #[must_use]
    pub fn wait(&self) -> Option<f64> {
        self.wait
    }
}

/// What an operator can do.
#[derive(Clone, Debug, Subcommand)]
pub enum Operation {
    /// The maps that the server has.
    #[command(after_help = "Examples:
  map-server maps
  map-server maps --connect tcp/10.0.0.5:7447 --json")]
    Maps,
    /// Whether the server answers, for health checks: exit code 0 if it does. It waits a second,
    /// unless --wait says otherwise.
    #[command(after_help = "Examples:
  map-server health
  map-server health --connect tcp/10.0.0.5:7447 --wait 5")]
    Health,
    /// The robots of a map: what they run, where they are, who is behind.
    #[command(after_help = "Examples:
  map-server robots museum
  map-server robots museum --watch")]
    #[command(alias = "fleet")]
    Robots {
        /// The map.
        map: MapName,
        /// Show them again every second, until interrupted.
        #[arg(long)]
        watch: bool,
    },
    /// Sends a robot that takes goals (client-robot serve) somewhere: at once, or next if it is
    /// under way. A goal that waits is replaced.
    #[command(after_help = "Examples:
  map-server send museum tug-1 dock
  map-server send museum tug-1 5,3,90 --wait-arrived      exit code 0: it is there
  map-server send museum tug-1 5,3 --id round-7           sent twice, it is one goal")]
    Send {
        /// The map.
        map: MapName,
        /// The robot.
        robot: RobotName,
        /// Where to: the name of a place, a node id, or x,y or x,y,yaw in the map frame, metres and
        /// degrees (or radians: 1.57rad).
        #[arg(allow_hyphen_values = true)]
        to: String,
        /// The goal's id: 1 to 64 of the letters a to z and A to Z, digits, _ or - [default: a new
        /// one].
        #[arg(long, value_name = "NAME")]
        id: Option<RobotName>,
        /// If the goal cannot be reached, to the nearest point that can.
        #[arg(long)]
        to_nearest: bool,
        /// Wait until the robot has arrived; fail if it does not.
        #[arg(long)]
        wait_arrived: bool,
    },
    /// Takes a robot's goal back: it stands, or goes on to the next one. Without an id all of its
    /// goals.
    #[command(after_help = "Examples:
  map-server cancel museum tug-1
  map-server cancel museum tug-1 round-7")]
    Cancel {
        /// The map.
        map: MapName,
        /// The robot.
        robot: RobotName,
        /// The goal's id.
        id: Option<RobotName>,
    },
    /// Releases: states of the map with a name, which never change, and which robots can be told to
    /// use.
    #[command(after_help = "Examples:
  map-server release create museum              a name for the state as it is now
  map-server release enable museum 2026-11-21.1
  map-server release rollback museum")]
    Release {
        /// What to do.
        #[command(subcommand)]
        action: ReleaseAction,
    },
    /// What robots report blocked: shows it, opens it, or has it stay closed.
    #[command(after_help = "Examples:
  map-server blocked list museum
  map-server blocked clear museum --robot amr-7 --ignore 1h
  map-server blocked keep museum --robot amr-7 --for 8h")]
    Blocked {
        /// What to do.
        #[command(subcommand)]
        action: BlockedAction,
    },
    /// What has changed between two states of a map.
    #[command(after_help = "Examples:
  map-server diff museum 2026-11-21.1           from the release to the newest state
  map-server diff museum 100 2026-11-21.1       from version 100 to the release")]
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
    #[command(after_help = "Examples:
  map-server rules museum
  map-server rules museum --json")]
    Rules {
        /// The map.
        map: MapName,
    },
    /// What operators have changed, and who, the newest first. Of folded changes only those are
    /// told that still count.
    #[command(after_help = "Examples:
  map-server journal museum
  map-server journal museum --last 200 --json")]
    Journal {
        /// The map.
        map: MapName,
        /// So many changes; a server knows the newest 1000.
        #[arg(long, value_name = "COUNT", default_value_t = 20, value_parser = count)]
        last: u64,
    },
    /// Names a place, so that robots and queries can go there by name.
    #[command(after_help = "Examples:
  map-server place museum dock 1.5,-2,90        1.5 m ahead of the origin, 2 m right, facing left
  map-server place museum Küche 4,1
  map-server place museum dock --remove")]
    Place {
        /// The map.
        map: MapName,
        /// Its name: a letter, then letters and digits of any script, _ or -; 64 characters at
        /// most.
        name: Label,
        /// Where, in the map frame: x,y or x,y,yaw, metres and degrees (or radians: 1.57rad).
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
    #[command(after_help = "Examples:
  map-server zone museum wet-floor '1,1 3,1 3,2 1,2'                     robots keep out
  map-server zone museum ramp '5,0 8,0 8,1 5,1' --speed-limit 0.3        … or drive slowly
  map-server zone museum wet-floor --remove")]
    Zone {
        /// The map.
        map: MapName,
        /// Its name: a letter, then letters and digits of any script, _ or -; 64 characters at
        /// most.
        name: Label,
        /// Its corners in order, three or more, as one text: 'x,y x,y x,y' (map frame, metres).
        #[arg(value_parser = parse_corners, allow_hyphen_values = true, required_unless_present = "remove")]
        corners: Option<Corners>,
        /// Robots may enter, and drive at most so fast, metres per second. Without this they keep
        /// out.
        #[arg(long, alias = "speed", value_parser = parse_speed, value_name = "M/S")]
        speed_limit: Option<u16>,
        /// Take the zone away.
        #[arg(long, conflicts_with_all = ["corners", "speed_limit"])]
        remove: bool,
        /// Also where the map is not.
        #[arg(long, conflicts_with = "remove")]
        force: bool,
    },
    /// Says how the image of a floor plan lies in the map: those who look lay it under the map.
    #[command(after_help = "Examples:
  map-server floor-plan museum ground-floor.png --scale 0.05 --at=-12.5,-8,90
  map-server floor-plan museum --remove")]
    FloorPlan {
        /// The map.
        map: MapName,
        #[command(flatten)]
        plan: FloorPlanArgs,
    },
    /// Says where on earth the map is.
    #[command(after_help = "Examples:
  map-server datum museum 52.5186,13.3973        the map's x axis points east
  map-server datum museum 52.5186,13.3973,90     … north
  map-server datum museum --remove")]
    Datum {
        /// The map.
        map: MapName,
        #[command(flatten)]
        datum: DatumArgs,
    },
    /// Closes an edge: no path leads over it, until it is opened.
    #[command(after_help = "Examples:
  map-server close museum 1a2b3c4d.5 1a2b3c4d.6")]
    Close {
        /// The map.
        map: MapName,
        /// One end.
        a: NodeId,
        /// The other end.
        b: NodeId,
    },
    /// Opens an edge again.
    #[command(after_help = "Examples:
  map-server open museum 1a2b3c4d.5 1a2b3c4d.6")]
    Open {
        /// The map.
        map: MapName,
        /// One end.
        a: NodeId,
        /// The other end.
        b: NodeId,
    },
    /// Takes back what this operator has written last: places, zones, closed edges, releases,
    /// merges. What others have changed since at the same thing is not overwritten.
    #[command(after_help = "Examples:
  map-server undo museum                        the last change of this operator
  map-server undo museum --last 3 --operator desk
  map-server undo museum --author amr-7 --against-roles roles.json5
      what an explorer wrote that only operators may write
  map-server undo museum --author amr-7 --all
      everything that a robot wrote which is not trusted any more

An undo is a change, too: the next one takes it back.")]
    Undo {
        /// The map.
        map: MapName,
        /// So many changes, the newest first. Each command that writes is one; a merge may be
        /// several.
        #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = count)]
        last: u64,
        /// Instead of the operator's own changes, those of this robot: those that its role does not
        /// allow, or all.
        #[arg(long, value_name = "NAME", requires = "of_author", conflicts_with = "last")]
        author: Option<RobotName>,
        /// The list of roles (JSON5); who is not in it counts as an explorer.
        #[arg(long, value_name = "ROLES.json5", requires = "author", group = "of_author")]
        against_roles: Option<PathBuf>,
        /// All that the robot wrote.
        #[arg(long, requires = "author", group = "of_author")]
        all: bool,
    },
    /// What writers take of the server's room, and what they may take: shows it, or changes it for
    /// one of them.
    #[command(after_help = "Examples:
  map-server quota show museum
  map-server quota set museum amr-7 --map-share 0.8")]
    Quota {
        /// What to do.
        #[command(subcommand)]
        action: QuotaAction,
    },
    /// Folds old increments: the newest versions and all releases stay what they are, what only
    /// older versions needed goes.
    #[command(after_help = "Examples:
  map-server retain museum --keep 1000")]
    Retain {
        /// The map.
        map: MapName,
        /// How many of the newest versions stay.
        #[arg(long, value_name = "VERSIONS")]
        keep: u64,
    },
    /// Writes a map to a file, with all its releases.
    #[command(after_help = "Examples:
  map-server export museum museum.fht
  map-server export museum museum.fht --release 2026-11-21.1")]
    Export {
        /// The map.
        map: MapName,
        /// The file. One that is there is replaced when the map is written whole; - is standard
        /// output.
        file: PathBuf,
        /// This release instead of the newest state.
        #[arg(long, value_name = "NAME")]
        release: Option<ReleaseName>,
    },
    /// Takes a map in from a file. If it ends early, such as on a full disk, what was taken in is
    /// there, and the same import goes on from there.
    #[command(after_help = "Examples:
  map-server import museum.fht
  map-server import museum.fht --map copy")]
    Import {
        /// The file.
        file: PathBuf,
        /// Under this name instead of the one that it had.
        #[arg(long, value_name = "NAME")]
        map: Option<MapName>,
    },
    /// Deletes a map after a grace period, in which it can be read and nobody writes to it. Robots
    /// are told, with the reason.
    #[command(after_help = "Examples:
  map-server delete musuem --reason 'mistyped: it is museum'
  map-server delete museum --reason 'the building is torn down' --grace 30d
  map-server delete trial --reason 'a trial' --grace 0s        at once, for ever

An export is the way back when the time is up. A map of the same name may be begun again then.")]
    Delete {
        /// The map.
        map: MapName,
        /// Why: everybody who uses the map is told.
        #[arg(long, value_name = "TEXT", value_parser = reason)]
        reason: String,
        /// After this time, such as 12h or 7d; 0s is at once.
        #[arg(long, value_name = "TIME", default_value = "7d", value_parser = grace, allow_hyphen_values = true)]
        grace: Duration,
    },
    /// Does not delete a map after all, while it is there.
    #[command(after_help = "Examples:
  map-server undelete museum")]
    Undelete {
        /// The map.
        map: MapName,
    },
    /// Gives a map another name: everything of it goes to a new map, and the old one is deleted
    /// after a grace period. Robots are told where it has moved to.
    #[command(after_help = "Examples:
  map-server rename musuem museum --reason mistyped
  map-server rename hall-2 hall-b --reason 'halls have letters' --grace 30d

It is done in one commit: a rename that was interrupted is done or not, and can be given again.")]
    Rename {
        /// The map.
        old: MapName,
        /// Its new name, which no map has.
        new: MapName,
        /// Why: everybody who uses the map is told.
        #[arg(long, value_name = "TEXT", value_parser = reason)]
        reason: String,
        /// After this time the old map is deleted, such as 12h or 7d; 0s is at once.
        #[arg(long, value_name = "TIME", default_value = "7d", value_parser = grace, allow_hyphen_values = true)]
        grace: Duration,
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

impl Operation {
    /// Whether it changes anything on the server.
    pub(crate) fn changes(&self) -> bool {
        let only_asks = matches!(
            self,
            Self::Maps
                | Self::Health
                | Self::Robots { .. }
                | Self::Diff { .. }
                | Self::Rules { .. }
                | Self::Journal { .. }
                | Self::Export { .. }
                | Self::Release { action: ReleaseAction::List { .. } }
                | Self::Blocked { action: BlockedAction::List { .. } }
                | Self::Quota { action: QuotaAction::Show { .. } }
                | Self::Merge { dry_run: true, .. }
        );
        !only_asks
    }

    /// The map that must be there.
    pub(super) fn map(&self) -> Option<&MapName> {
        match self {
            Self::Maps | Self::Health | Self::Import { .. } => None,
            Self::Release { action } => Some(action.map()),
            Self::Blocked { action } => Some(action.map()),
            Self::Quota { action } => Some(action.map()),
            Self::Robots { map, .. }
            | Self::Send { map, .. }
            | Self::Cancel { map, .. }
            | Self::Diff { map, .. }
            | Self::Rules { map }
            | Self::Journal { map, .. }
            | Self::Place { map, .. }
            | Self::Zone { map, .. }
            | Self::FloorPlan { map, .. }
            | Self::Datum { map, .. }
            | Self::Close { map, .. }
            | Self::Open { map, .. }
            | Self::Undo { map, .. }
            | Self::Retain { map, .. }
            | Self::Delete { map, .. }
            | Self::Undelete { map }
            | Self::Rename { old: map, .. }
            | Self::Export { map, .. }
            | Self::Merge { first: map, .. } => Some(map),
        }
    }
}
