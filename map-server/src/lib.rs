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
//! | [`quorum`] | the log in memory, in front of storages that hold it |
//! | [`storages`] | what storages are asked |
//! | [`catch_up`] | what a server in front of storages has missed |
//! | [`stateless`] | the threads of such a server |
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
//! brought to the disk, or to most of the storages. Whatever waits while a commit is under way goes into the next one together.

pub mod access;
pub mod answer;
pub mod basis;
pub mod catalog;
pub mod catch_up;
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
pub mod quorum;
pub mod refusals;
pub mod retention;
pub mod serve;
pub mod session;
pub mod stateless;
pub mod storages;
pub mod store;
pub mod throttle;

pub use cli::main_with_args;
pub use config::ServerConfig;

use answer::Sources;
use catalog::Catalog;
use check::{Arrival, Refusal};
use fht_proto::keys::{ALL_INCREMENTS, ALL_KEPT, ALL_QUERIES, Key, Topic};
use fht_proto::query::Head;
use fleet::Fleet;
use ingest::Ingest;
use live::LiveRules;
use log::{IncrementLog, StoreError};
use queue::Queue;
use quorum::QuorumLog;
use refusals::Notice;
use serve::Service;
use stateless::Stateless;
use std::collections::BTreeMap;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};
use store::Store;
use tokio::sync::oneshot;
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Locality, Sample, SampleKind};
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
    sources: &Sources,
    session: &Session,
    stateless: Option<&Stateless>,
    max_batch: usize,
) -> Result<(), StoreError> {
    let catalog = &sources.catalog;
    while let Some(queue::Work { arrivals, jobs }) = queue.take(max_batch) {
        let dropped = queue.take_dropped();
        if dropped > 0 {
            tracing::warn!(dropped, "more increments came than could be taken in; their writers will send them again");
        }
        let count = arrivals.len();
        let taken = ingest.take(arrivals, now_us())?;
        if let Some(stateless) = stateless {
            stateless.settle(&taken.disputed, sources.log.as_ref())?;
        }
        taken.notices.iter().for_each(|notice| tell(session, notice));
        for map in taken.announce {
            if let Some(view) = catalog.view(&map) {
                tracing::debug!(%map, version = view.head.version, count, "stored");
                announce(session, &view.head);
            }
        }
        if !jobs.is_empty() {
            let before: BTreeMap<_, _> = catalog.heads().iter().map(|head| (head.map.clone(), head.version)).collect();
            jobs.into_iter().try_for_each(|job| job(&mut ingest))?;
            let grown = |head: &Arc<Head>| before.get(&head.map) != Some(&head.version);
            catalog.heads().iter().filter(|head| grown(head)).for_each(|head| announce(session, head));
        }
    }
    Ok(())
}

/// Runs a server until `shutdown` is done. Everything that has arrived by then is stored, or at least not acknowledged.
///
/// # Errors
/// [`ServerError`]: it could not start, or the store failed. Whatever was acknowledged is on the disk, or in the storages.
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
    let mut ending = Ending { wish: pin!(shutdown), has_come: false };
    let Some(quorum) = config.storages else {
        let log: Arc<dyn IncrementLog> = Arc::new(Store::open(&config.data)?);
        let catalog = Arc::new(Catalog::load(log.as_ref())?);
        let session = session::open(&config.link).await?;
        let beside = beside(&session)?;
        let outcome = serve(&config, &session, log, catalog, None, &mut ending).await;
        drop(beside);
        session.close().await?;
        return outcome;
    };
    let session = session::open(&config.link).await?;
    let beside = beside(&session)?;
    let outcome = loop {
        let stateless = Stateless::new(&session, quorum);
        let log = Arc::new(QuorumLog::new(stateless.storages(), quorum));
        let outcome = serve(&config, &session, log, Arc::default(), Some(stateless), &mut ending).await;
        match outcome {
            Err(ServerError::Store(reason @ StoreError::Overruled { .. })) => {
                tracing::error!("{reason}: everything is read anew");
            }
            outcome => break outcome,
        }
    };
    drop(beside);
    session.close().await?;
    outcome
}

/// The wish that the server ends. It may be waited for again after it has come: at the start, while storages are read, and later.
struct Ending<'a, F> {
    wish: Pin<&'a mut F>,
    has_come: bool,
}

impl<F: Future<Output = ()>> Ending<'_, F> {
    async fn wait(&mut self) {
        if !self.has_come {
            self.wish.as_mut().await;
            self.has_come = true;
        }
    }
}

/// Serves what is in a log, until it is to end.
async fn serve(
    config: &ServerConfig,
    session: &Session,
    log: Arc<dyn IncrementLog>,
    catalog: Arc<Catalog>,
    stateless: Option<Stateless>,
    ending: &mut Ending<'_, impl Future<Output = ()>>,
) -> Result<(), ServerError> {
    let sources = Sources {
        catalog: Arc::clone(&catalog),
        log: Arc::clone(&log),
        live: Arc::new(LiveRules::default()),
        fleet: Arc::new(Fleet::new(config.fleet.clone())),
        config: Arc::new(config.answers.clone()),
    };
    let queue = Arc::new(Queue::new(config.limits.max_queue_bytes));
    let hearing = hear::hear(session, &sources).await?;
    let arrive = |max_bytes: usize| {
        let arriving = Arc::clone(&queue);
        move |sample: Sample| arriving.push(arrival(&sample, max_bytes))
    };
    let max_bytes = config.limits.max_increment_bytes;
    let subscriber = session.declare_subscriber(ALL_INCREMENTS).callback(arrive(max_bytes)).await?;
    let of_others = match &stateless {
        None => None,
        Some(_) => {
            let remote = session.declare_subscriber(ALL_KEPT).allowed_origin(Locality::Remote);
            Some(remote.callback(arrive(max_bytes)).await?)
        }
    };

    let (ready, is_ready) = oneshot::channel();
    let (report, mut stopped) = oneshot::channel();
    let max_batch = config.limits.max_batch_bytes;
    let mut ingest = Ingest::new(log, Arc::clone(&catalog), config.limits.clone());
    let writer = {
        let (queue, sources, session) = (Arc::clone(&queue), sources.clone(), session.clone());
        let stateless = stateless.clone();
        let write = move || {
            let written =
                stateless.as_ref().map_or(Ok(()), |stateless| stateless.restore(&mut ingest)).and_then(|()| {
                    let _ = ready.send(()); // nobody waits for it any more if the server ends
                    write_all(ingest, &queue, &sources, &session, stateless.as_ref(), max_batch)
                });
            let _ = report.send(written);
        };
        std::thread::Builder::new().name("writer".to_owned()).spawn(write).map_err(ServerError::Runtime)?
    };
    // Nobody is told that there is no such map while it is being read.
    let is_ready = tokio::select! {
        () = ending.wait() => false,
        ready = is_ready => ready.is_ok(),
    };
    let mut queryable = None;
    if is_ready {
        if stateless.is_some() {
            // Beside: it may take a second, and they are asked for paths on what they know meanwhile.
            tokio::spawn(hear::learn(session.clone(), sources.clone()));
        }
        let service = Service::new(sources, Arc::clone(&queue), tokio::runtime::Handle::current());
        // The nearest of several servers answers, and no other.
        let is_complete = stateless.is_some();
        let answers = session.declare_queryable(ALL_QUERIES).complete(is_complete);
        queryable = Some(answers.callback(move |query| service.take(query)).await?);
        for head in catalog.heads() {
            announce(session, &head);
        }
        tell_where(config, catalog.heads().len());
    }
    let looking = match &stateless {
        Some(stateless) if is_ready => Some(stateless.look(Arc::clone(&catalog), Arc::clone(&queue))?),
        _ => None,
    };

    let told = tokio::select! {
        () = ending.wait() => None,
        outcome = &mut stopped => Some(outcome),
    };
    subscriber.undeclare().await?;
    queue.close();
    if let Some(stateless) = &stateless {
        stateless.close();
    }
    let outcome = match told {
        Some(outcome) => outcome,
        // What could not be confirmed in time was not acknowledged.
        None => stopped.await.map(|written| {
            written.or_else(|error| match error {
                StoreError::Unconfirmed => Ok(()),
                other => Err(other),
            })
        }),
    };
    // They have reported, or panicked and said so.
    let _ = writer.join();
    let _ = looking.map(std::thread::JoinHandle::join);
    drop((hearing, of_others));
    if let Some(queryable) = queryable {
        queryable.undeclare().await?;
    }
    outcome.map_err(|_| ServerError::WriterLost)??;
    Ok(())
}

fn tell_where(config: &ServerConfig, count: usize) {
    let link = &config.link;
    let file = link.zenoh_config.iter().map(|file| format!("what {} says", file.display()));
    let endpoints: Vec<String> = link.listen.iter().chain(&link.connect).cloned().chain(file).collect();
    let place = match config.storages {
        None => config.data.display().to_string(),
        Some(quorum) => format!("{} storages", quorum.storages),
    };
    eprintln!("map-server: {count} map(s) in {place}, on {}", endpoints.join(", "));
}
