//! Releases: named states that robots are told to use.

use crate::clock::{now_us, utc_text};
use crate::program::operator::asking::{ask_json, head, state_of};
use crate::program::operator::error::OperatorError;
use crate::program::operator::write::{write, write_numbered};
use clap::Subcommand;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ReleaseView, ReleasesReply, known_names};
use fht_proto::{AuthorId, MapName, Op, Release, ReleaseId, ReleaseName};
use zenoh::Session;

/// What an operator can do with releases.
#[derive(Clone, Debug, Subcommand)]
pub enum ReleaseAction {
    /// Show them.
    #[command(after_help = "Examples:
  map-server release list museum")]
    List {
        /// The map.
        map: MapName,
    },
    /// Make one of the newest state, or of an older version.
    #[command(after_help = "Examples:
  map-server release create museum              named by the day, such as 2026-11-21.1
  map-server release create museum spring --version 100")]
    Create {
        /// The map.
        map: MapName,
        /// Its name [default: the day and a number, such as 2026-11-21.1].
        name: Option<ReleaseName>,
        /// Of this version.
        #[arg(long, value_name = "NUMBER")]
        version: Option<u64>,
    },
    /// Tell robots to use one; 'head': the newest state, as it grows.
    #[command(after_help = "Examples:
  map-server release enable museum 2026-11-21.1
  map-server release enable museum head         the newest state, as it grows")]
    Enable {
        /// The map.
        map: MapName,
        /// Its name, or name@author.
        name: String,
    },
    /// Tell robots to use the newest one that is of an earlier version than what they use.
    #[command(after_help = "Examples:
  map-server release rollback museum")]
    Rollback {
        /// The map.
        map: MapName,
    },
    /// Delete one, for ever.
    #[command(after_help = "Examples:
  map-server release delete museum 2026-11-21.1")]
    Delete {
        /// The map.
        map: MapName,
        /// Its name, or name@author.
        name: String,
    },
}

impl ReleaseAction {
    /// Its map.
    pub(super) fn map(&self) -> &MapName {
        match self {
            Self::List { map }
            | Self::Create { map, .. }
            | Self::Enable { map, .. }
            | Self::Rollback { map }
            | Self::Delete { map, .. } => map,
        }
    }
}

pub(super) async fn list(session: &Session, map: &MapName) -> Result<ReleasesReply, OperatorError> {
    ask_json(session, &Key::topic(map, Topic::Releases).to_string()).await
}

fn id_of(view: &ReleaseView) -> Result<ReleaseId, OperatorError> {
    format!("{}@{}", view.name, view.author).parse().map_err(|error| OperatorError::Answer(format!("{error}")))
}

/// The release that `text` names: `name@author`, or the name alone if it is unique.
fn find<'a>(releases: &'a ReleasesReply, text: &str) -> Result<&'a ReleaseView, OperatorError> {
    let is_meant = |view: &&ReleaseView| view.name == text || format!("{}@{}", view.name, view.author) == text;
    let found: Vec<&ReleaseView> = releases.releases.iter().filter(is_meant).collect();
    match found.as_slice() {
        [one] => Ok(one),
        [] => {
            let known = known_names(releases.releases.iter().map(|view| format!("{}@{}", view.name, view.author)));
            Err(OperatorError::Usage(format!("map {} has no release {text} ({known})", releases.map)))
        }
        several => {
            let names: Vec<String> = several.iter().map(|view| format!("{}@{}", view.name, view.author)).collect();
            Err(OperatorError::Usage(format!("more than one release is called {text}: {}", names.join(", "))))
        }
    }
}

/// Whether `author` deleted a release of this name.
fn is_deleted(releases: &ReleasesReply, name: &str, author: AuthorId) -> bool {
    releases.deleted.contains(&format!("{name}@{author}"))
}

/// The day, and the first number on it that `author` can use.
fn next_name(releases: &ReleasesReply, author: AuthorId, now_us: u64) -> Result<ReleaseName, OperatorError> {
    let day: String = utc_text(now_us).chars().take(10).collect();
    let is_free =
        |name: &String| releases.releases.iter().all(|view| view.name != *name) && !is_deleted(releases, name, author);
    let name = (1_u32..).map(|number| format!("{day}.{number}")).find(is_free).unwrap_or(day);
    name.parse().map_err(|error| OperatorError::Usage(format!("{error}")))
}

/// Makes a release of the newest state, or of an older version. Somebody else may make one under
/// the same operator's name at this moment: then it is looked again which names there are.
pub(super) async fn create(
    session: &Session,
    map: &MapName,
    operator: &str,
    name: Option<ReleaseName>,
    version: Option<u64>,
) -> Result<ReleaseView, OperatorError> {
    /// So often another number is tried.
    const TRIES: usize = 30;
    for _ in 1..TRIES {
        match create_next(session, map, operator, name.clone(), version).await {
            Err(OperatorError::Contended { .. }) => {}
            outcome => return outcome,
        }
    }
    create_next(session, map, operator, name, version).await
}

async fn create_next(
    session: &Session,
    map: &MapName,
    operator: &str,
    name: Option<ReleaseName>,
    version: Option<u64>,
) -> Result<ReleaseView, OperatorError> {
    // Before the names are looked at, so that nobody takes one in between.
    let number = head(session, map).await?.vector.get(AuthorId::of_robot(operator)) + 1;
    let (releases, author) = (list(session, map).await?, AuthorId::of_robot(operator));
    let name = match name {
        Some(name) => name,
        None => next_name(&releases, author, now_us())?,
    };
    if releases.releases.iter().any(|view| view.name == name.as_str()) {
        return Err(OperatorError::Usage(format!("map {map} has a release {name} already; releases never change")));
    }
    if is_deleted(&releases, name.as_str(), author) {
        let text = format!("{operator} deleted a release {name} of map {map} before: choose another name");
        return Err(OperatorError::Usage(text));
    }
    let version = version.map(|version| version.to_string());
    let state = state_of(session, map, version.as_deref()).await?;
    if state.version == 0 {
        return Err(OperatorError::Usage(format!("version 0 of map {map} is empty: no robot could use it")));
    }
    let release = Release { vector: state.vector, digest: state.digest };
    write_numbered(session, map, operator, number, vec![Op::PutRelease { name: name.clone(), release }]).await?;
    let made = find(&list(session, map).await?, &format!("{name}@{author}")).cloned()?;
    if made.available {
        Ok(made)
    } else {
        let text = format!("the state of release {name} was folded away meanwhile: delete it and make another one");
        Err(OperatorError::Usage(text))
    }
}

/// What a command has come to.
pub(super) enum Changed {
    /// It is so now.
    Is(ReleasesReply),
    /// It was so before.
    Nothing(ReleasesReply),
}

/// Tells robots to use a release, or the newest state, unless they do.
pub(super) async fn enable(
    session: &Session,
    map: &MapName,
    operator: &str,
    name: Option<&str>,
) -> Result<Changed, OperatorError> {
    let releases = list(session, map).await?;
    let release = match name {
        None if releases.releases.iter().all(|view| !view.enabled) => return Ok(Changed::Nothing(releases)),
        None => None,
        Some(name) => {
            let view = find(&releases, name)?;
            if !view.available {
                let why = format!("the server does not have all of release {name}, or not with its digest");
                return Err(OperatorError::Usage(why));
            }
            if view.enabled {
                return Ok(Changed::Nothing(releases));
            }
            Some(id_of(view)?)
        }
    };
    write(session, map, operator, vec![Op::Enable { release }]).await?;
    Ok(Changed::Is(list(session, map).await?))
}

/// Tells robots to use the newest release that is of an earlier version than what they use.
pub(super) async fn roll_back(session: &Session, map: &MapName, operator: &str) -> Result<Changed, OperatorError> {
    let releases = list(session, map).await?;
    let enabled = releases.releases.iter().find(|view| view.enabled).map_or(u64::MAX, |view| view.version);
    let earlier = releases.releases.iter().filter(|view| view.available && view.version < enabled);
    let Some(earlier) = earlier.max_by_key(|view| view.version) else {
        let text =
            format!("map {map} has no earlier release to roll back to; 'release enable {map} head' is without any");
        return Err(OperatorError::Usage(text));
    };
    let name = format!("{}@{}", earlier.name, earlier.author);
    enable(session, map, operator, Some(&name)).await
}

/// Deletes a release.
pub(super) async fn delete(
    session: &Session,
    map: &MapName,
    operator: &str,
    name: &str,
) -> Result<ReleasesReply, OperatorError> {
    let releases = list(session, map).await?;
    let view = find(&releases, name)?;
    if view.enabled {
        let text = format!("release {name} is what robots use: enable another one, or head, before you delete it");
        return Err(OperatorError::Usage(text));
    }
    write(session, map, operator, vec![Op::RemoveRelease { id: id_of(view)? }]).await?;
    list(session, map).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn releases_are_named_by_the_day() {
        let map: MapName = "m".parse().unwrap_or_else(|error| panic!("{error}"));
        let mut releases = ReleasesReply { map, version: 0, releases: Vec::new(), deleted: Vec::new() };
        let author = AuthorId::of_robot("desk");
        let name =
            |releases: &ReleasesReply| next_name(releases, author, 1_795_219_200_000_000).map(|name| name.to_string());
        assert_eq!(name(&releases).ok().as_deref(), Some("2026-11-21.1"));
        releases.releases.push(ReleaseView {
            name: "2026-11-21.1".to_owned(),
            author: "0000000a".to_owned(),
            version: 1,
            vector: fht_proto::VersionVector::default(),
            digest: fht_proto::Digest([0; 32]),
            made_us: 0,
            enabled: false,
            available: true,
        });
        assert_eq!(name(&releases).ok().as_deref(), Some("2026-11-21.2"));
        releases.deleted.push(format!("2026-11-21.2@{author}"));
        assert_eq!(name(&releases).ok().as_deref(), Some("2026-11-21.3"), "what was deleted stays taken");
        assert!(find(&releases, "2026-11-21.1").is_ok() && find(&releases, "2026-11-21.1@0000000a").is_ok());
        assert!(find(&releases, "2026-11-21.2").is_err());
    }
}
