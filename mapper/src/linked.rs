//! A run whose map goes to a server while it is made.

use crate::mapping::Mapper;
use crate::publish::{Outbox, Progress, PublishError, find_head, outbox};
use fht_proto::{AuthorId, MapName, keys};
use fht_robot::link::{self, LinkConfig, LinkError};
use std::time::{Duration, Instant};

/// How long the server may take to tell whether the map exists.
const SERVER_PATIENCE: Duration = Duration::from_secs(30);

/// Where a run is published.
#[derive(Clone, Debug)]
pub struct Publication {
    /// The server.
    pub link: LinkConfig,
    /// The map.
    pub map: MapName,
    /// The robot; its author id follows from it.
    pub robot: String,
    /// How long to wait for the server's last acknowledgement.
    pub linger: Duration,
}

/// Why a run cannot be published.
#[derive(Debug, thiserror::Error)]
pub enum LinkedError {
    /// The session cannot be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Publishing failed.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// The map is there already: a second run would be in another frame.
    #[error(
        "the map '{map}' already has {version} increments on the server; choose another --map (a run starts a map of its \
         own, in a frame of its own)"
    )]
    MapExists {
        /// Its name.
        map: MapName,
        /// Its version.
        version: u64,
    },
    /// The run ended early: a defect.
    #[error("the mapping loop failed: {0}")]
    Loop(#[from] tokio::task::JoinError),
}

/// Runs `work` in a thread, publishes what it puts in its outbox, and waits until the server has it. The outcome of `work`
/// comes with how far publishing got.
///
/// # Errors
/// [`LinkedError`]; a server that falls silent is none (the progress tells).
pub async fn publish_while<R: Send + 'static>(
    publication: &Publication,
    work: impl FnOnce(&Outbox) -> R + Send + 'static,
) -> Result<(R, Progress), LinkedError> {
    let Publication { link, map, robot, linger } = publication;
    let session = link::open(link).await?;
    if let Some(head) = find_head(&session, map, SERVER_PATIENCE).await?
        && head.version > 0
    {
        return Err(LinkedError::MapExists { map: map.clone(), version: head.version });
    }
    let presence = keys::Key::Robot { map: map.clone(), robot: robot.clone() }.to_string();
    let token = session.liveliness().declare_token(presence).await.map_err(PublishError::from)?;
    let (outbox, publisher) = outbox(session.clone(), map.clone(), AuthorId::of_robot(robot));
    let mut publisher = tokio::spawn(publisher);
    // Once the outbox is closed, the publisher ends when everything is acknowledged.
    let run = tokio::task::spawn_blocking(move || (work(&outbox), outbox.close()));
    let (outcome, progress) = run.await?;
    let published = match tokio::time::timeout(*linger, &mut publisher).await {
        Ok(published) => published??,
        Err(_) => {
            publisher.abort();
            progress.borrow().clone()
        }
    };
    token.undeclare().await.map_err(PublishError::from)?;
    session.close().await.map_err(PublishError::from)?;
    Ok((outcome, published))
}

/// Hands what a mapper writes to the outbox, if there is one.
pub struct Handover<'a> {
    outbox: Option<&'a Outbox>,
    written: u64,
}

impl<'a> Handover<'a> {
    /// Before the first increment. Without an outbox increments are only counted.
    #[must_use]
    pub fn new(outbox: Option<&'a Outbox>) -> Self {
        Self { outbox, written: 0 }
    }

    /// Takes what `mapper` has written since the last call; returns the number of the newest increment.
    pub fn take_from(&mut self, mapper: &mut Mapper) -> u64 {
        for increment in mapper.take_increments() {
            self.written = increment.number;
            if let Some(outbox) = self.outbox {
                outbox.send(increment);
            }
        }
        self.written
    }

    /// How many increments the server has durably.
    #[must_use]
    pub fn acknowledged(&self) -> u64 {
        self.outbox.map_or(0, |outbox| outbox.progress().acknowledged)
    }

    /// Whether nobody takes the map any more; the publisher says why.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.outbox.is_some_and(Outbox::has_ended)
    }
}

/// Waits until it is time for what happens `elapsed_us` after `begin`, at `rate` seconds a second; not at all without a rate.
pub fn wait_for(begin: Instant, elapsed_us: u64, rate: Option<f64>) {
    if let Some(rate) = rate.filter(|rate| *rate > 0.0) {
        let due = Duration::try_from_secs_f64(elapsed_us as f64 * 1e-6 / rate).unwrap_or(Duration::MAX);
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
    }
}
