//! The parts of a running server, and their shutdown.

use crate::catalog::Catalog;
use crate::clock::now_us;
use crate::config::{ServerConfig, ServerEndpoints};
use crate::ingest::{Ingest, WriterQueue};
use crate::network::{
    KnownKeys, QueryDoor, QueryService, RobotTopicSubscriptions, learn_blockages, publish_head, subscribe_increments,
    subscribe_robot_topics, successor, warn_of_other_servers,
};
use crate::query::AnswerSources;
use crate::replicated::Stateless;
use crate::server::disk_watch::DiskWatch;
use crate::server::error::ServerError;
use crate::server::side_doors::{OpenSideDoors, SideDoors};
use crate::server::writer::{Writer, WriterThread};
use crate::store::StoreError;
use fht_proto::api::keys::SERVERS_QUERIES;
use std::io::Write;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::runtime::Handle;
use tokio::task::AbortHandle;
use zenoh::Session;
use zenoh::query::Queryable;

/// The request that the server ends. It can be waited for again after it has come: while storages
/// are read, and later.
pub(super) struct ShutdownSignal<'a, F> {
    request: Pin<&'a mut F>,
    has_come: bool,
}

impl<'a, F: Future<Output = ()>> ShutdownSignal<'a, F> {
    pub(super) fn new(request: Pin<&'a mut F>) -> Self {
        Self { request, has_come: false }
    }

    async fn wait(&mut self) {
        if !self.has_come {
            self.request.as_mut().await;
            self.has_come = true;
        }
    }
}

/// What is served.
pub(super) struct ServingTask {
    pub(super) sources: AnswerSources,
    /// None where the server keeps its own log.
    pub(super) stateless: Option<Stateless>,
    /// Where queries wait already; none: nobody asks before everything is read.
    pub(super) door: Option<QueryDoor>,
    /// What else the server is reached over.
    pub(super) doors: SideDoors,
}

/// Why serving has ended.
pub(super) enum Served {
    /// It was told to.
    Ended,
    /// This session takes the place of the one it was served on.
    Succeeded(Session),
}

/// Serves what is in a log until shutdown, or until another session takes
/// the place of this one.
pub(super) async fn serve(
    config: &ServerConfig,
    session: &Session,
    ServingTask { sources, stateless, door, doors }: ServingTask,
    shutdown: &mut ShutdownSignal<'_, impl Future<Output = ()>>,
) -> Result<Served, ServerError> {
    let queue = Arc::new(WriterQueue::new(config.limits.max_queue_bytes));
    let robots = subscribe_robot_topics(session, &sources).await?;
    let max_bytes = config.limits.max_increment_bytes;
    let increments =
        subscribe_increments(session, &queue, (max_bytes, &sources.operators), stateless.is_some()).await?;
    let mut ingest = Ingest::new(Arc::clone(&sources.log), Arc::clone(&sources.catalog), config.limits.clone());
    if let Some(writers) = &config.writers {
        ingest = ingest.guarded_by(writers.clone(), config.quotas.clone())?;
    }
    let writer = Writer {
        ingest,
        queue: Arc::clone(&queue),
        sources: sources.clone(),
        session: session.clone(),
        stateless: stateless.clone(),
        max_batch_bytes: config.limits.max_batch_bytes,
        disk: DiskWatch::new(),
    };
    let mut writer = writer.spawn()?;

    let mut next = pin!(successor(session, &config.link));
    let mut other = None;
    // No queries before everything is read: nobody is told that a map does not exist while it is
    // being read.
    let is_ready = tokio::select! {
        () = shutdown.wait() => false,
        session = next.as_mut() => { other = Some(session); false }
        is_ready = writer.ready() => is_ready,
    };
    let answering = match is_ready {
        true => {
            Some(Answering::start(config, session, sources, &queue, (stateless.as_ref(), door, &doors), robots).await?)
        }
        false => None,
    };
    let stopped = match other {
        Some(_) => None,
        None => tokio::select! {
            () = shutdown.wait() => None,
            session = next => { other = Some(session); None }
            outcome = writer.stopped() => Some(outcome),
        },
    };

    increments.close().await?;
    queue.close();
    if let Some(stateless) = &stateless {
        stateless.close();
    }
    let outcome = finish_writing(writer, stopped).await;
    if let Some(answering) = answering {
        answering.close().await?;
    }
    outcome.map(|()| other.map_or(Served::Ended, Served::Succeeded))
}

/// Waits for the writer to store what is in the queue, unless it has `stopped` already.
async fn finish_writing(mut writer: WriterThread, stopped: Option<Result<(), ServerError>>) -> Result<(), ServerError> {
    let outcome = match stopped {
        Some(outcome) => outcome,
        None => match writer.stopped().await {
            // What could not be confirmed in time was not acknowledged.
            Err(ServerError::Store(StoreError::Unconfirmed)) => Ok(()),
            outcome => outcome,
        },
    };
    writer.join();
    outcome
}

/// What runs from the moment that everything is read until shutdown.
struct Answering {
    door: QueryDoor,
    /// Say that this server knows all about their keys; the first answers for them.
    _nearest: Vec<Queryable<()>>,
    gap_fill: Option<JoinHandle<()>>,
    following: AbortHandle,
    _robots: RobotTopicSubscriptions,
    _beside: OpenSideDoors,
}

impl Answering {
    async fn start(
        config: &ServerConfig,
        session: &Session,
        sources: AnswerSources,
        queue: &Arc<WriterQueue>,
        (stateless, door, doors): (Option<&Stateless>, Option<QueryDoor>, &SideDoors),
        robots: RobotTopicSubscriptions,
    ) -> Result<Self, ServerError> {
        let catalog = Arc::clone(&sources.catalog);
        if stateless.is_some() {
            // Concurrently: it may take a second, and until then paths are planned on what is
            // known.
            tokio::spawn(learn_blockages(session.clone(), sources.clone()));
        } else {
            tokio::spawn(warn_of_other_servers(session.clone()));
        }
        let service = QueryService::new(sources, Arc::clone(queue), session.clone(), Handle::current());
        let door = match door {
            Some(door) => door,
            None => QueryDoor::declare(session).await?,
        };
        let beside = doors.serve(&service, session).await?;
        door.open(service);
        // Of several servers the nearest is asked, and no other. What robots answer must come to
        // them, from wherever it is asked.
        let mut nearest = Vec::new();
        for keys in SERVERS_QUERIES.iter().filter(|_| stateless.is_some()) {
            nearest.push(session.declare_queryable(*keys).complete(true).callback(drop).await?);
        }
        catalog.heads().iter().for_each(|head| publish_head(session, head));
        warn_of_clocks(&catalog, config.limits.max_clock_ahead_s);
        print_where(config, catalog.heads().len());
        doors.print_where();
        let spawn_gap_fill = |stateless: &Stateless| stateless.spawn_gap_fill(Arc::clone(&catalog), Arc::clone(queue));
        let gap_fill = stateless.map(spawn_gap_fill).transpose().map_err(ServerError::Runtime)?;
        let keys = KnownKeys::new(session.clone());
        let following = tokio::spawn(follow_maps(keys, catalog, Arc::clone(queue))).abort_handle();
        Ok(Self { door, _nearest: nearest, gap_fill, following, _robots: robots, _beside: beside })
    }

    async fn close(self) -> Result<(), ServerError> {
        self.following.abort();
        // The thread has ended, or panicked and said so.
        let _ = self.gap_fill.map(JoinHandle::join);
        Ok(self.door.close().await?)
    }
}

/// Warns of maps that were written while a clock was wrong. Writers go on from their newest stamp.
fn warn_of_clocks(catalog: &Catalog, may_be_ahead_s: u64) {
    let now_us = now_us();
    for head in catalog.heads() {
        let ahead_s = head.clock_us.saturating_sub(now_us) / 1_000_000;
        if ahead_s > may_be_ahead_s {
            tracing::warn!(
                map = %head.map,
                "the newest change is stamped {ahead_s} s ahead of this clock, which was wrong then, or is now; \
                 later changes go on from that stamp"
            );
        }
    }
}

/// Sees soon which maps there are: makes the keys of new ones known to the routers, and has the
/// writer delete those whose grace period is over.
async fn follow_maps(mut keys: KnownKeys, catalog: Arc<Catalog>, queue: Arc<WriterQueue>) {
    const EVERY: Duration = Duration::from_millis(500);
    loop {
        let maps = catalog.heads().iter().map(|head| head.map.clone()).collect();
        if let Err(error) = keys.follow(&maps).await {
            tracing::debug!("the keys of maps cannot be declared: {error}");
        }
        if !catalog.due(now_us()).is_empty() {
            queue.push_job(Box::new(|ingest| {
                ingest.delete_due(now_us());
                Ok(())
            }));
        }
        tokio::time::sleep(EVERY).await;
    }
}

fn print_where(config: &ServerConfig, count: usize) {
    let place = match config.storages {
        None => config.data.display().to_string(),
        Some(quorum) => format!("{} storages", quorum.storages),
    };
    // A server whose log is full serves all the same.
    let (s, endpoints) = (if count == 1 { "" } else { "s" }, endpoints_in_words(&config.link));
    let _ = writeln!(std::io::stderr(), "map-server: {count} map{s} in {place}, on {endpoints}");
}

/// Where a server is reached. One that listens is there before it is linked to the routers that it
/// connects to.
fn endpoints_in_words(link: &ServerEndpoints) -> String {
    let file = link.zenoh_config.iter().map(|file| format!("what {} says", file.display()));
    // Zenoh does not say which one it has found.
    let listen = link.listen.iter().map(|endpoint| match endpoint.strip_suffix(":0") {
        Some(host) => format!("{host} (any free port)"),
        None => endpoint.clone(),
    });
    let here: Vec<String> = listen.chain(file).collect();
    match (here.join(", "), link.connect.join(", ")) {
        (here, connect) if connect.is_empty() => here,
        (here, connect) if here.is_empty() => connect,
        (here, connect) => format!("{here}, connecting to {connect}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_a_server_listens_is_told_from_where_it_connects_to() {
        let said = |listen: &[&str], connect: &[&str], file: Option<&str>| {
            let owned = |endpoints: &[&str]| endpoints.iter().map(|&endpoint| endpoint.to_owned()).collect();
            let (listen, connect, zenoh_config) = (owned(listen), owned(connect), file.map(Into::into));
            endpoints_in_words(&ServerEndpoints { listen, connect, zenoh_config, patience: None })
        };
        assert_eq!(said(&["tcp/[::]:0"], &[], None), "tcp/[::] (any free port)");
        assert_eq!(said(&[], &["tcp/a:1", "tcp/b:1"], None), "tcp/a:1, tcp/b:1");
        assert_eq!(said(&["tcp/a:1"], &["tcp/b:1"], None), "tcp/a:1, connecting to tcp/b:1");
        assert_eq!(said(&[], &["tcp/b:1"], Some("z.json5")), "what z.json5 says, connecting to tcp/b:1");
    }
}
