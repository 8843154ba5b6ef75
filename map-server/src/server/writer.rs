//! The thread that writes: it takes what has arrived from the queue, stores it, and announces the
//! new heads.

use crate::clock::{now_us, passed_us};
use crate::ingest::{Arrival, Ingest, WriterJob, WriterOutcome, WriterQueue, WriterWork};
use crate::network::{publish_head, publish_refusal};
use crate::query::AnswerSources;
use crate::replicated::Stateless;
use crate::server::disk_watch::DiskWatch;
use crate::server::error::ServerError;
use crate::store::StoreError;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, MapName};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Instant;
use tokio::sync::oneshot;
use zenoh::Session;

/// What the thread needs.
pub(super) struct Writer {
    pub(super) ingest: Ingest,
    pub(super) queue: Arc<WriterQueue>,
    pub(super) sources: AnswerSources,
    pub(super) session: Session,
    pub(super) stateless: Option<Stateless>,
    /// Bytes in one commit, as they travelled.
    pub(super) max_batch_bytes: usize,
    /// Whether the disk takes what is written.
    pub(super) disk: DiskWatch,
}

/// The running thread.
pub(super) struct WriterThread {
    thread: JoinHandle<()>,
    ready: oneshot::Receiver<()>,
    stopped: oneshot::Receiver<Result<(), StoreError>>,
}

impl Writer {
    /// Starts the thread. It ends when the queue is closed and empty, or the store fails.
    ///
    /// # Errors
    /// [`ServerError::Runtime`].
    pub(super) fn spawn(mut self) -> Result<WriterThread, ServerError> {
        let (report_ready, ready) = oneshot::channel();
        let (report_stopped, stopped) = oneshot::channel();
        let write = move || {
            let written = self.restore().and_then(|()| {
                self.look_after_disk(); // the log may have been opened without being written
                let _ = report_ready.send(()); // nobody waits for it if the server is ending
                self.write_all()
            });
            let _ = report_stopped.send(written);
        };
        let thread = std::thread::Builder::new().name("writer".to_owned()).spawn(write);
        Ok(WriterThread { thread: thread.map_err(ServerError::Runtime)?, ready, stopped })
    }

    /// A writer's name in the list of roles, if there is one.
    fn listed_name(&self, author: AuthorId) -> Option<String> {
        self.sources.writers.as_ref()?.now().name(author).map(str::to_owned)
    }

    fn restore(&mut self) -> Result<(), StoreError> {
        self.ingest.delete_due(now_us());
        self.stateless.as_ref().map_or(Ok(()), |stateless| stateless.restore(&mut self.ingest))
    }

    fn write_all(&mut self) -> Result<(), StoreError> {
        while let Some(work) = self.queue.take_work_within(self.max_batch_bytes, DiskWatch::EVERY) {
            match self.write(work) {
                // Whoever wrote it sends it again, since no head covers it.
                Err(error) if self.sources.log.fault().is_some() => tracing::debug!("not stored: {error}"),
                outcome => outcome?,
            }
            self.look_after_disk();
        }
        Ok(())
    }

    fn look_after_disk(&mut self) {
        let log = self.sources.log.as_ref();
        let change = self.disk.look(log, &self.sources.catalog, &mut self.ingest, Instant::now());
        if change.is_some() {
            self.sources.catalog.heads().iter().for_each(|head| publish_head(&self.session, head));
        }
    }

    /// Tells everybody of a map that has grown.
    fn announce(&self, head: &Head) {
        self.sources.fleet.map_changed(head, passed_us());
        publish_head(&self.session, head);
    }

    fn write(&mut self, WriterWork { arrivals, jobs }: WriterWork) -> Result<(), StoreError> {
        let dropped = self.queue.take_dropped();
        if dropped > 0 {
            tracing::warn!(dropped, "more increments arrived than the queue holds; their writers will send them again");
        }
        if !arrivals.is_empty() {
            self.take_in(arrivals)?;
        }
        if jobs.is_empty() { Ok(()) } else { self.do_jobs(jobs) }
    }

    fn take_in(&mut self, arrivals: Vec<Arrival>) -> Result<(), StoreError> {
        let writers = counted(&arrivals);
        let outcome = self.ingest.take_arrivals(arrivals, now_us())?;
        if let Some(stateless) = &self.stateless {
            stateless.settle_disputed(&outcome.disputed, self.sources.log.as_ref())?;
        }
        outcome.notices.iter().for_each(|notice| publish_refusal(&self.session, notice));
        for map in outcome.announce {
            if let Some(view) = self.sources.catalog.view(&map) {
                for (writer @ (_, author), arrived) in writers.iter().filter(|((of, _), _)| *of == map) {
                    let WriterOutcome { stored, refused } = outcome.written.get(writer).copied().unwrap_or_default();
                    let robot = self.sources.fleet.name_of(&map, *author).or_else(|| self.listed_name(*author));
                    let (robot, version) = (robot.map(tracing::field::display), view.head.version);
                    tracing::info!(%map, robot, %author, arrived, stored, refused, version, "increments have come");
                }
                self.announce(&view.head);
            }
        }
        Ok(())
    }

    /// Does what operators have ordered, and announces the maps that have grown by it, and those
    /// that will be deleted or are.
    fn do_jobs(&mut self, jobs: Vec<WriterJob>) -> Result<(), StoreError> {
        let catalog = Arc::clone(&self.sources.catalog);
        let by_name = |heads: Vec<Arc<Head>>| heads.into_iter().map(|head| (head.map.clone(), head)).collect();
        let before: BTreeMap<MapName, Arc<Head>> = by_name(catalog.heads());
        jobs.into_iter().try_for_each(|job| job(&mut self.ingest))?;
        let after: BTreeMap<MapName, Arc<Head>> = by_name(catalog.heads());
        let said = |head: &Arc<Head>| (head.version, head.deletion.clone());
        for (map, head) in &after {
            if before.get(map).map(said) != Some(said(head)) {
                self.announce(head);
            }
        }
        for (map, head) in before.into_iter().filter(|(map, _)| !after.contains_key(map)) {
            let deletion = catalog.deletion(&map).map(|record| record.deletion);
            publish_head(&self.session, &Head { deletion, ..Arc::unwrap_or_clone(head) });
        }
        Ok(())
    }
}

/// How many increments came from whom, by map and author, if anybody wants to know.
fn counted(arrivals: &[Arrival]) -> BTreeMap<(MapName, AuthorId), usize> {
    let mut counts = BTreeMap::new();
    if tracing::enabled!(tracing::Level::INFO) {
        for arrival in arrivals {
            if let Ok(Key::Increment { map, author, .. } | Key::Kept { map, author, .. }) = arrival.key.parse() {
                *counts.entry((map, author)).or_default() += 1;
            }
        }
    }
    counts
}

impl WriterThread {
    /// Waits until everything is read that the server serves; false if the thread ended before.
    pub(super) async fn ready(&mut self) -> bool {
        (&mut self.ready).await.is_ok()
    }

    /// Waits until the thread has nothing left to do.
    ///
    /// # Errors
    /// [`ServerError::Store`]; [`ServerError::WriterLost`] if it panicked.
    pub(super) async fn stopped(&mut self) -> Result<(), ServerError> {
        (&mut self.stopped).await.map_err(|_| ServerError::WriterLost)?.map_err(ServerError::Store)
    }

    /// Waits for the thread itself, after [`stopped`](Self::stopped).
    pub(super) fn join(self) {
        // It has reported, or panicked and said so.
        let _ = self.thread.join();
    }
}
