//! The operators' subcommands, carried out.

use crate::config::{DEFAULT_LISTEN, ServerEndpoints};
use crate::ingest::Retained;
use crate::program::operator::arguments::{Operation, OperatorArgs};
use crate::program::operator::asking::{self, ask_json, connect, order, until_there};
use crate::program::operator::blocked;
use crate::program::operator::deletion;
use crate::program::operator::error::OperatorError;
use crate::program::operator::journal;
use crate::program::operator::merge::{self, MergeOrder};
use crate::program::operator::quota;
use crate::program::operator::release::{self, Changed, ReleaseAction};
use crate::program::operator::rename;
use crate::program::operator::robots;
use crate::program::operator::rule::{self, Corners};
use crate::program::operator::send;
use crate::program::operator::transfer;
use crate::program::operator::undo;
use crate::program::operator::words::{counted, health_in_words, maps_in_words, releases_in_words, rules_in_words};
use crate::program::operator::write::write;
use fht_merge::MergeConfig;
use fht_program::{Waiting, print_line};
use fht_proto::api::keys::{AdminAction, Key, Topic};
use fht_proto::api::reply::{DiffReply, MapsReply};
use fht_proto::{MapName, NodeId, Op, ReleaseName, RobotName, Zone, ZoneRule};
use fht_session::{SessionConfig, check_owner};
use serde::Serialize;
use std::io::IsTerminal;
use std::path::Path;
use std::time::Duration;
use zenoh::Session;

/// Prints the value as JSON, or what `words` makes of it.
fn show<T: Serialize>(value: &T, json: bool, words: impl FnOnce(&T) -> String) -> Result<(), OperatorError> {
    if json {
        print_line!("{}", serde_json::to_string(value).map_err(|error| OperatorError::json(&error))?);
    } else {
        print_line!("{}", words(value));
    }
    Ok(())
}

impl Operation {
    /// Carries it out over a session that `link` describes; by default on this machine. The server
    /// and the map are waited for as `waiting` says; once they are there, `once_there` is called.
    /// Maps are merged as `merge` says.
    ///
    /// # Errors
    /// [`OperatorError`].
    pub async fn carry_out(
        self,
        args: &OperatorArgs,
        mut link: ServerEndpoints,
        waiting: &Waiting,
        merge: MergeConfig,
        once_there: impl FnOnce(),
    ) -> Result<(), OperatorError> {
        if link.connect.is_empty() && link.zenoh_config.is_none() {
            link.connect.push(DEFAULT_LISTEN.to_owned());
        }
        // Whoever only looks may be anybody.
        if self.changes() {
            let certified = SessionConfig::from_options(link.connect.clone(), link.zenoh_config.clone());
            check_owner(&certified, "operator", args.operator.as_str())
                .map_err(|error| OperatorError::Usage(error.to_string()))?;
        }
        let session = connect(&link, waiting).await?;
        let outcome = match until_there(&session, self.map(), waiting).await {
            Ok(deletion) => {
                once_there();
                self.with_told(&session, args, merge, deletion).await
            }
            Err(error) => Err(error),
        };
        // Everything is answered; whether the goodbye arrives does not matter.
        let _ = session.close().await;
        outcome
    }

    /// The same, for a map of which `deletion` says that it will be deleted: whoever uses it is
    /// told once.
    async fn with_told(
        self,
        session: &Session,
        args: &OperatorArgs,
        config: MergeConfig,
        deletion: Option<String>,
    ) -> Result<(), OperatorError> {
        let (Some(map), Some(deletion)) = (self.map().cloned(), deletion) else {
            return self.with(session, args, config).await;
        };
        // What these two have to say is about nothing else.
        if !matches!(self, Self::Delete { .. } | Self::Undelete { .. }) {
            fht_program::tell_line!("map-server: {deletion}");
        }
        self.with(session, args, config).await.map_err(|error| match error {
            OperatorError::Refused(reply) if reply.message == deletion => OperatorError::ToBeDeleted { map },
            error => error,
        })
    }

    async fn with(self, session: &Session, args: &OperatorArgs, config: MergeConfig) -> Result<(), OperatorError> {
        let (json, operator) = (args.json, args.operator.as_str());
        match self {
            Self::Maps => show(&ask_json::<MapsReply>(session, &Key::Maps.to_string()).await?, json, maps_in_words),
            Self::Health => show(&ask_json::<MapsReply>(session, &Key::Maps.to_string()).await?, json, health_in_words),
            Self::Robots { map, watch: false } => show(&robots::fleet(session, &map).await?, json, robots::table),
            Self::Robots { map, watch: true } => watch_robots(session, &map, json).await,
            Self::Send { map, robot, to, id, to_nearest, wait_arrived } => {
                let id = id.map_or_else(send::new_id, |id| id.as_str().to_owned());
                let selector = send::selector((&map, robot.as_str()), &id, &to, to_nearest)?;
                let sent = send::send(session, &map, &selector).await?;
                let status = if wait_arrived { send::arrived(session, &map, sent).await? } else { sent };
                show(&status, json, send::in_words)
            }
            Self::Cancel { map, robot, id } => {
                let id = id.as_ref().map(RobotName::as_str);
                show(&send::cancel(session, &map, robot.as_str(), id).await?, json, send::in_words)
            }
            Self::Blocked { action } => show(&action.carry_out(session).await?, json, blocked::in_words),
            Self::Quota { action } => show(&action.carry_out(session).await?, json, quota::in_words),
            Self::Release { action } => action.carry_out(session, operator, json).await,
            Self::Diff { map, from, to } => {
                let selector = format!("{}?from={from};to={to}", Key::topic(&map, Topic::Diff));
                show(&ask_json::<DiffReply>(session, &selector).await?, json, |diff| {
                    format!("version {} to {}: {}", diff.from.version, diff.to.version, diff.words)
                })
            }
            Self::Rules { map } => show(&rule::list(session, &map).await?, json, rules_in_words),
            Self::Journal { map, last } => show_journal(session, args, &map, last).await,
            Self::Place { map, name, at, force, .. } => {
                let op = match at {
                    Some(at) => rule::place(session, &map, (name, at), force).await?,
                    None => rule::no_place(session, &map, name).await?,
                };
                change(session, args, &map, op).await
            }
            Self::Zone { map, name, corners, speed_limit, force, .. } => {
                let rule = speed_limit.map_or(ZoneRule::KeepOut, ZoneRule::SpeedLimit);
                let op = match corners {
                    Some(Corners(corners)) => rule::zone(session, &map, name, Zone { rule, corners }, force).await?,
                    None => rule::no_zone(session, &map, name).await?,
                };
                change(session, args, &map, op).await
            }
            Self::FloorPlan { map, plan } => change(session, args, &map, plan.op()).await,
            Self::Datum { map, datum } => change(session, args, &map, datum.op()).await,
            Self::Close { map, a, b } => close_edge(session, args, &map, [a, b], true).await,
            Self::Open { map, a, b } => close_edge(session, args, &map, [a, b], false).await,
            Self::Undo { map, last, author, against_roles, .. } => {
                let undone = undo::Undone::asked(last, author, against_roles.as_deref())?;
                show(&undo::undo(session, &map, operator, undone, json).await?, json, undo::in_words)
            }
            Self::Retain { map, keep } => show(&retain(session, map, keep).await?, json, retained_in_words),
            Self::Delete { map, reason, grace } => {
                let order = deletion::order(&args.operator, reason, grace, None);
                show(&deletion::delete(session, &map, &order).await?, json, deletion::in_words)
            }
            Self::Undelete { map } => show(&deletion::undelete(session, &map).await?, json, deletion::in_words),
            Self::Rename { old, new, reason, grace } => {
                let order = deletion::order(&args.operator, reason, grace, Some(new));
                show(&rename::rename(session, &old, order).await?, json, rename::in_words)
            }
            Self::Export { map, file, release } => {
                export(session, &map, &file, release.as_ref().map(ReleaseName::as_str), json).await
            }
            Self::Merge { first, second, into, dry_run, only_map } => {
                let order = MergeOrder { first, second, into, dry_run, only_map, operator, quiet: json, config };
                merged(session, &order).await
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

async fn show_journal(session: &Session, args: &OperatorArgs, map: &MapName, last: u64) -> Result<(), OperatorError> {
    show(&journal::ask(session, map, args.operator.as_str(), last).await?, args.json, journal::in_words)
}

async fn close_edge(
    session: &Session,
    args: &OperatorArgs,
    map: &MapName,
    ends: [NodeId; 2],
    is_closed: bool,
) -> Result<(), OperatorError> {
    change(session, args, map, rule::closing(session, map, ends, is_closed).await?).await
}

async fn export(
    session: &Session,
    map: &MapName,
    file: &Path,
    release: Option<&str>,
    json: bool,
) -> Result<(), OperatorError> {
    let done = transfer::export(session, map, file, release, json).await?;
    if file.as_os_str() == transfer::STANDARD_OUTPUT {
        return Ok(()); // the map is there, and nothing else
    }
    show(&done, json, |done| {
        format!("version {} of {} in {} ({} bytes)", done.version, done.map, file.display(), done.bytes)
    })
}

async fn merged(session: &Session, order: &MergeOrder<'_>) -> Result<(), OperatorError> {
    let (json, outcome) = (order.quiet, merge::merge(session, order).await);
    if let (Err(OperatorError::Merge(refusal)), true) = (&outcome, json) {
        show(&merge::refused(order, refusal), json, |_| String::new())?;
    }
    show(&outcome?, json, merge::in_words)
}

async fn retain(session: &Session, map: MapName, keep: u64) -> Result<Retained, OperatorError> {
    let key = Key::Admin { map, action: AdminAction::Retain };
    let answer = order(session, &format!("{key}?keep={keep}"), None).await?;
    serde_json::from_slice(&answer).map_err(|error| OperatorError::json(&error))
}

fn retained_in_words(done: &Retained) -> String {
    format!(
        "{} folded; {} instead of {} bytes; versions from {} on can be had",
        counted(done.folded, "increment"),
        done.bytes,
        done.bytes_before,
        done.oldest_version
    )
}

/// Writes the operation, unless the map is the same after it.
async fn change(session: &Session, args: &OperatorArgs, map: &MapName, op: Op) -> Result<(), OperatorError> {
    if rule::changes_nothing(&rule::list(session, map).await?, &op) {
        let head = asking::head(session, map).await?;
        return show(&head, args.json, |head| nothing_to_change(&head.map, head.version));
    }
    let head = write(session, map, args.operator.as_str(), vec![op]).await?;
    show(&head, args.json, |head| format!("written; map {} is at version {}", head.map, head.version))
}

fn nothing_to_change(map: &MapName, version: u64) -> String {
    format!("nothing to change; map {map} stays at version {version}")
}

impl ReleaseAction {
    async fn carry_out(self, session: &Session, operator: &str, json: bool) -> Result<(), OperatorError> {
        let changed = match self {
            Self::List { map } => Changed::Is(release::list(session, &map).await?),
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
            Self::Delete { map, name } => Changed::Is(release::delete(session, &map, operator, &name).await?),
        };
        match changed {
            Changed::Is(releases) => show(&releases, json, releases_in_words),
            Changed::Nothing(releases) => show(&releases, json, |releases| {
                format!("{}\n{}", nothing_to_change(&releases.map, releases.version), releases_in_words(releases))
            }),
        }
    }
}

/// Shows them every second. A server that goes may come back.
async fn watch_robots(session: &Session, map: &MapName, json: bool) -> Result<(), OperatorError> {
    /// Clears the terminal and goes to its top.
    const CLEAR: &str = "\x1b[2J\x1b[H";
    let (mut has_shown, mut is_silent) = (false, false);
    loop {
        let fleet = match robots::fleet(session, map).await {
            Ok(fleet) => Some(fleet),
            Err(error @ OperatorError::Silent) if has_shown => {
                if !is_silent {
                    fht_program::tell_line!("map-server: {error}; it is asked again");
                }
                None
            }
            Err(error) => return Err(error),
        };
        is_silent = fleet.is_none();
        if let Some(fleet) = fleet {
            if has_shown && !json && std::io::stdout().is_terminal() {
                print!("{CLEAR}");
            }
            show(&fleet, json, robots::table)?;
            has_shown = true;
        }
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
}
