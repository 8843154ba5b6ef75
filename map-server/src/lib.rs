//! The map-server: takes increments in, keeps them, answers questions.
//!
//! ```text
//! Zenoh ── queue ── ingest ──→ log (redb, or memory in front of storages)
//!                     └──────→ catalog ──→ answer ── serve ── Zenoh
//! Zenoh ── hear ──→ live, fleet ─────────────┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | [`cli`] | the command line |
//! | [`access`] | who may do what: from roles to a router's access control |
//! | [`config`] | what a server is told at its start |
//! | [`session`] | the Zenoh session |
//! | [`denials`] | what access control denies, counted |
//! | [`queue`] | what has arrived, bounded in bytes |
//! | [`check`] | what is wrong with an increment |
//! | [`ingest`] | check, order, commit, apply: the one writer |
//! | [`refusals`] | what writers are told of refused increments |
//! | [`nursery`] | increments that came before the first of their map |
//! | [`log`] | what a log of increments is |
//! | [`store`] | the log in a file |
//! | [`memory`] | the log in memory |
//! | [`retention`] | folding old increments |
//! | [`catalog`] | the maps in memory, shared with the readers |
//! | [`basis`] | a state that paths are planned on: the newest, or a release |
//! | [`head_index`] | what finds things in a large map, kept up with it |
//! | [`live`] | what is closed now |
//! | [`fleet`] | the robots |
//! | [`hear`] | what robots say of themselves |
//! | [`answer`] | typed requests to replies |
//! | [`serve`] | queries over Zenoh |
//! | [`operate`] | what operators do: another program that talks to the server |
//! | [`throttle`] | at most one log line a period |
//!
//! An increment counts as acknowledged when the head that is published covers it, and a head covers only what a commit has
//! brought to the disk. Whatever waits while a commit is under way goes into the next one together.

pub mod access;
pub mod answer;
pub mod basis;
pub mod catalog;
pub mod check;
pub mod cli;
pub mod config;
pub mod denials;
pub mod fleet;
pub mod head_index;
pub mod hear;
pub mod ingest;
pub mod live;
pub mod log;
pub mod memory;
pub mod nursery;
pub mod operate;
pub mod queue;
pub mod refusals;
pub mod retention;
pub mod serve;
pub mod session;
pub mod store;
pub mod throttle;

pub use cli::main_with_args;
pub use config::ServerConfig;

use answer::Sources;
use catalog::Catalog;
use check::{Arrival, Refusal};
use fht_proto::keys::{ALL_INCREMENTS, ALL_QUERIES, Key, Topic};
use fht_proto::query::Head;
use fleet::Fleet;
use ingest::Ingest;
use live::LiveRules;
use log::{IncrementLog, StoreError};
use queue::Queue;
use refusals::Notice;
use serve::Service;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};
use store::Store;
use tokio::sync::oneshot;
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Why a server ends that was not told to.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The log cannot be opened, read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The network cannot be used.
    #[error(transparent)]
    Session(#[from] session::SessionError),
    /// A subscription was refused.
    #[error("Zenoh refuses: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// The system gives no threads.
    #[error("no threads: {0}")]
    Runtime(std::io::Error),
    /// The writer has ended for no reason that it gave.
    #[error("the writer has stopped")]
    WriterLost,
}

/// Microseconds since the Unix epoch.
pub(crate) fn now_us() -> u64 {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_epoch.as_micros()).unwrap_or(u64::MAX)
}

fn arrival(sample: &Sample, max_bytes: usize) -> Arrival {
    let bytes = sample.payload().len();
    let payload = match sample.kind() {
        SampleKind::Delete => Err(Refusal::Delete),
        // Not even copied.
        SampleKind::Put if bytes > max_bytes => Err(Refusal::TooLong { bytes }),
        SampleKind::Put => Ok(sample.payload().to_bytes().into_owned()),
    };
    Arrival { key: sample.key_expr().as_str().to_owned(), payload }
}

/// Publishes a head. Lost ones do no harm: writers ask when they hear nothing.
fn announce(session: &Session, head: &Head) {
    let put = |payload: Vec<u8>| {
        session
            .put(Key::topic(&head.map, Topic::Head).to_string(), payload)
            .encoding(Encoding::APPLICATION_JSON)
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::InteractiveHigh)
            .express(true)
            .wait()
    };
    let sent = serde_json::to_vec(head).map_err(zenoh::Error::from).and_then(put);
    if let Err(error) = sent {
        tracing::warn!(map = %head.map, "the head could not be published: {error}");
    }
}

/// Tells a writer why its increment was refused. Lost ones do no harm: the writer sends again and is told again.
fn tell(session: &Session, notice: &Notice) {
    let put = |payload: Vec<u8>| {
        session
            .put(Key::refused(&notice.map, notice.author).to_string(), payload)
            .encoding(Encoding::APPLICATION_JSON)
            .congestion_control(CongestionControl::Drop)
            .wait()
    };
    let sent = serde_json::to_vec(&notice.reply).map_err(zenoh::Error::from).and_then(put);
    if let Err(error) = sent {
        tracing::warn!(map = %notice.map, author = %notice.author, "a refusal could not be told: {error}");
    }
}

/// The writer's thread: until the queue is closed and empty, or the store fails.
fn write_all(
    mut ingest: Ingest,
    queue: &Queue,
    catalog: &Catalog,
    session: &Session,
    max_batch: usize,
) -> Result<(), StoreError> {
    while let Some(queue::Work { arrivals, jobs }) = queue.take(max_batch) {
        let dropped = queue.take_dropped();
        if dropped > 0 {
            tracing::warn!(dropped, "more increments came than could be taken in; their writers will send them again");
        }
        let count = arrivals.len();
        let taken = ingest.take(arrivals, now_us())?;
        taken.notices.iter().for_each(|notice| tell(session, notice));
        for map in taken.announce {
            if let Some(view) = catalog.view(&map) {
                tracing::debug!(%map, version = view.head.version, count, "stored");
                announce(session, &view.head);
            }
        }
        if !jobs.is_empty() {
            let before: BTreeMap<_, _> = catalog.heads().iter().map(|head| (head.map.clone(), head.version)).collect();
            jobs.into_iter().for_each(|job| job(&mut ingest));
            let grown = |head: &Arc<Head>| before.get(&head.map) != Some(&head.version);
            catalog.heads().iter().filter(|head| grown(head)).for_each(|head| announce(session, head));
        }
    }
    Ok(())
}

/// Runs a server until `shutdown` is done. Everything that has arrived by then is stored.
///
/// # Errors
/// [`ServerError`]: it could not start, or the store failed. Whatever was acknowledged is on the disk.
pub async fn run(config: ServerConfig, shutdown: impl Future<Output = ()>) -> Result<(), ServerError> {
    run_beside(config, shutdown, |_| Ok(())).await
}

/// As [`run`], with something else on the server's session: `beside` is called when the session is open, and what it returns is kept
/// until the server ends.
///
/// # Errors
/// As [`run`]; [`ServerError::Zenoh`] when `beside` fails.
pub async fn run_beside<T>(
    config: ServerConfig,
    shutdown: impl Future<Output = ()>,
    beside: impl FnOnce(&Session) -> Result<T, zenoh::Error>,
) -> Result<(), ServerError> {
    let log: Arc<dyn IncrementLog> = Arc::new(Store::open(&config.data)?);
    let catalog = Arc::new(Catalog::load(log.as_ref())?);
    let session = session::open(&config.link).await?;
    let beside = beside(&session)?;

    let sources = Sources {
        catalog: Arc::clone(&catalog),
        log: Arc::clone(&log),
        live: Arc::new(LiveRules::default()),
        fleet: Arc::new(Fleet::new(config.fleet)),
        config: Arc::new(config.answers),
    };
    let queue = Arc::new(Queue::new(config.limits.max_queue_bytes));
    let hearing = hear::hear(&session, &sources).await?;
    let service = Service::new(sources, Arc::clone(&queue), tokio::runtime::Handle::current());
    let queryable = session.declare_queryable(ALL_QUERIES).callback(move |query| service.take(query)).await?;
    let arriving = Arc::clone(&queue);
    let max_bytes = config.limits.max_increment_bytes;
    let arrive = move |sample: Sample| arriving.push(arrival(&sample, max_bytes));
    let subscriber = session.declare_subscriber(ALL_INCREMENTS).callback(arrive).await?;

    let (report, mut stopped) = oneshot::channel();
    let max_batch = config.limits.max_batch_bytes;
    let ingest = Ingest::new(log, Arc::clone(&catalog), config.limits);
    let writer = {
        let (queue, catalog, session) = (Arc::clone(&queue), Arc::clone(&catalog), session.clone());
        let write = move || _ = report.send(write_all(ingest, &queue, &catalog, &session, max_batch));
        std::thread::Builder::new().name("writer".to_owned()).spawn(write).map_err(ServerError::Runtime)?
    };
    for head in catalog.heads() {
        announce(&session, &head);
    }
    let (count, link) = (catalog.heads().len(), &config.link);
    let file = link.zenoh_config.iter().map(|file| format!("what {} says", file.display()));
    let endpoints: Vec<String> = link.listen.iter().chain(&link.connect).cloned().chain(file).collect();
    eprintln!("map-server: {count} map(s) in {}, on {}", config.data.display(), endpoints.join(", "));

    let outcome = tokio::select! {
        () = shutdown => {
            subscriber.undeclare().await?;
            queue.close();
            stopped.await
        }
        outcome = &mut stopped => outcome,
    };
    let _ = writer.join(); // it has reported, or panicked and said so
    drop((hearing, beside));
    queryable.undeclare().await?;
    session.close().await?;
    outcome.map_err(|_| ServerError::WriterLost)??;
    Ok(())
}
