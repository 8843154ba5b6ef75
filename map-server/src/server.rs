//! Runs a server: opens the log and the session, puts the parts together, and takes them down in
//! order.
//!
//! | module | idea |
//! | --- | --- |
//! | `serving` | the parts of a running server, and their shutdown |
//! | `side_doors` | what else than Zenoh the server is reached over |
//! | `writer` | the thread that writes |
//! | `disk_watch` | what becomes of the server when its disk takes nothing, and when it does again |
//! | `error` | why a server ends |

mod disk_watch;
mod error;
mod serving;
mod side_doors;
mod writer;

pub use error::ServerError;

use crate::access::{RouterFile, openings};
use crate::catalog::{Catalog, KnownOperators};
use crate::config::{QuorumConfig, ServerConfig, ServerEndpoints};
use crate::network::{self, QueryDoor};
use crate::query::{ActiveRules, AnswerSources, Fleet, OperatorNames};
use crate::replicated::{QuorumLog, Stateless};
use crate::store::{FILE_NAME, IncrementLog, RedbLog, StoreError};
use fht_map::WriterRole;
use serving::{Served, ServingTask, ShutdownSignal, serve};
use side_doors::SideDoors;
use std::pin::pin;
use std::sync::Arc;
use zenoh::Session;

/// Runs a server until `shutdown` completes. Everything that has arrived by then is stored, or at
/// least not acknowledged.
///
/// # Errors
/// [`ServerError`]: it could not start, or the store failed. Everything that was acknowledged is on
/// the disk, or in the storages.
pub async fn run(config: ServerConfig, shutdown: impl Future<Output = ()>) -> Result<(), ServerError> {
    run_beside(config, shutdown, |_| Ok(())).await
}

/// Like [`run`], with something else on the server's session: `beside` is called when the session
/// is open, and what it returns is kept until the server ends, or goes on with another session:
/// then it is called again.
///
/// # Errors
/// As [`run`]; [`ServerError::Zenoh`] when `beside` fails.
pub async fn run_beside<T>(
    config: ServerConfig,
    shutdown: impl Future<Output = ()>,
    beside: impl Fn(&Session) -> Result<T, zenoh::Error>,
) -> Result<(), ServerError> {
    network::check_certificate(&config.link)?;
    warn_of_strangers(&config);
    warn_of_openings(&config);
    let shutdown = pin!(shutdown);
    let mut shutdown = ShutdownSignal::new(shutdown);
    // An address that is taken is reported before anything is read.
    let doors = SideDoors::open(&config)?;
    let Some(quorum) = config.storages else {
        // A directory that is there comes first: that it is in use is reported before anybody can
        // connect. One that is not there is made when the server can listen.
        let is_there = config.data.exists();
        let early = if is_there { None } else { Some(reachable(&config.link).await?) };
        let log: Arc<dyn IncrementLog> = Arc::new(RedbLog::open(&config.data)?.warning_below(config.min_free_bytes));
        let file = config.data.join(FILE_NAME);
        let operators = Arc::new(operator_names(&config));
        let known = known_operators(&config, &operators);
        let catalog = Catalog::load_with(log.as_ref(), known).map_err(|error| error.of_file(&file))?;
        for head in catalog.damaged_heads() {
            tracing::error!("{}", catalog.damage(&head.map).unwrap_or_default());
        }
        let catalog = Arc::new(catalog);
        let (session, door) = match early {
            Some(early) => early,
            None => reachable(&config.link).await?,
        };
        let sources = sources(&config, operators, catalog, log);
        let (mut session, mut door) = (session, Some(door));
        loop {
            let kept = beside(&session)?;
            let task =
                ServingTask { sources: sources.clone(), stateless: None, door: door.take(), doors: doors.clone() };
            let served = serve(&config, &session, task, &mut shutdown).await;
            drop(kept);
            match end(served, session).await? {
                Some(other) => session = other,
                None => return Ok(()),
            }
        }
    };
    let mut session = network::open(&config.link).await?;
    loop {
        let kept = beside(&session)?;
        let served = serve_storages(&config, &session, (quorum, &doors), &mut shutdown).await;
        drop(kept);
        match end(served, session).await? {
            Some(other) => session = other,
            None => return Ok(()),
        }
    }
}

/// Ends a session when serving has ended. Returns the one to go on with, if there is one.
async fn end(served: Result<Served, ServerError>, session: Session) -> Result<Option<Session>, ServerError> {
    if let Ok(Served::Succeeded(other)) = served {
        fht_session::abandon(session).await;
        return Ok(Some(other));
    }
    session.close().await?;
    served.map(|_| None)
}

/// The operators that the configuration names.
fn operator_names(config: &ServerConfig) -> OperatorNames {
    let operators = OperatorNames::default();
    #[cfg(feature = "web")]
    config.web.iter().filter_map(|web| web.operator.as_ref()).for_each(|name| operators.learn(name.as_str()));
    #[cfg(not(feature = "web"))]
    let _ = config;
    operators
}

/// Who is listed is what the list says, and of others whoever has said its name as operators do.
fn known_operators(config: &ServerConfig, names: &Arc<OperatorNames>) -> KnownOperators {
    let (roles, names) = (config.writers.clone(), Arc::clone(names));
    KnownOperators::of(move |author| match roles.as_ref().and_then(|roles| roles.now().role(author)) {
        Some(role) => role == WriterRole::Operator,
        None => names.name(author).is_some(),
    })
}

/// What questions are answered from. It outlives sessions.
fn sources(
    config: &ServerConfig,
    operators: Arc<OperatorNames>,
    catalog: Arc<Catalog>,
    log: Arc<dyn IncrementLog>,
) -> AnswerSources {
    AnswerSources {
        catalog,
        log,
        writers: config.writers.clone(),
        active_rules: Arc::new(ActiveRules::new(config.reports.clone())),
        fleet: Arc::new(Fleet::new(config.fleet.clone())),
        operators,
        config: Arc::new(config.answers.clone()),
    }
}

/// Opens the session, and has whoever asks at once wait for an answer.
async fn reachable(link: &ServerEndpoints) -> Result<(Session, QueryDoor), ServerError> {
    let session = network::open(link).await?;
    let door = QueryDoor::declare(&session).await?;
    Ok((session, door))
}

/// Says at which endpoints anybody may write, unless that is meant.
fn warn_of_strangers(config: &ServerConfig) {
    // A configuration that cannot be used is an error when the session is opened.
    let endpoints = network::open_to_strangers(&config.link).unwrap_or_default().join(", ");
    if config.open || endpoints.is_empty() {
        return;
    }
    let who = match config.writers {
        None => "every stranger who reaches it may write and delete maps and send robots",
        Some(_) => "every stranger who reaches it may write under any name in the list of roles",
    };
    tracing::warn!(
        "{endpoints}: there is no access control, and {who}. deploy/README.md says how to set it up, with --roles; \
         --open says that it is meant to be so"
    );
}

/// Says what leaves a router with access control open all the same, as `map-server check-site`
/// does.
fn warn_of_openings(config: &ServerConfig) {
    let Some(file) = &config.link.zenoh_config else { return };
    // What cannot be used is an error when the session is opened.
    let Ok(zenoh) = network::to_zenoh(&config.link) else { return };
    let is = |key: &str, value: &str| zenoh.get_json(key).is_ok_and(|set| set == value);
    if is("mode", "\"router\"") && is("access_control/enabled", "true") {
        let router = RouterFile { name: file.display().to_string(), config: zenoh };
        openings(&[router]).iter().for_each(|text| tracing::warn!("{text}"));
    }
}

/// Serves what storages hold; starts over when another server's increment stands before one of this
/// server's.
async fn serve_storages(
    config: &ServerConfig,
    session: &Session,
    (quorum, doors): (QuorumConfig, &SideDoors),
    shutdown: &mut ShutdownSignal<'_, impl Future<Output = ()>>,
) -> Result<Served, ServerError> {
    loop {
        let stateless = Stateless::new(session, quorum, config.gaps.clone());
        let log = Arc::new(QuorumLog::new(stateless.storages(), quorum));
        // Another server of the site answers while this one reads.
        let operators = Arc::new(operator_names(config));
        let catalog = Arc::new(Catalog::of_nothing(known_operators(config, &operators)));
        let sources = sources(config, operators, catalog, log);
        let task = ServingTask { sources, stateless: Some(stateless), door: None, doors: doors.clone() };
        match serve(config, session, task, shutdown).await {
            Err(ServerError::Store(reason @ StoreError::Overruled { .. })) => {
                tracing::error!("{reason}: everything is read anew");
            }
            outcome => return outcome,
        }
    }
}
