//! A run whose map goes to a server while it is made.

use crate::mapping::Mapper;
use crate::publish::{
    DeliverError, EarlierDelivery, Outbox, Progress, PublishError, RunOrigin, Spool, SpoolError, WindowConfig, deliver,
    find_head, outbox,
};
use crate::team::{EnterError, MapEntry, Peers};
use fht_client::{Presence, ReplicaError};
use fht_program::Stop;
use fht_proto::api::fleet::RobotRole;
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, Increment, MapName, ParseIdError, RobotName};
use fht_session::{SessionConfig, SessionError};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

/// How long the server may take to send the map, and to acknowledge anything of what the last run
/// has left; and to tell whether there is a map, if nobody says how long to wait.
const SERVER_PATIENCE: Duration = Duration::from_secs(30);
/// Within this the names of the robots that are there are known.
const ROLL_CALL: Duration = Duration::from_secs(1);
/// A robot that is gone without a word is there for so long: a session's lease, and a little more.
const LEASE: Duration = Duration::from_secs(12);
/// While it waits for the name, it says so again after each such time.
const REMARK_EVERY: Duration = Duration::from_secs(5);
/// How long it may take to put into the spool what is not acknowledged in the end.
const LEAVE_TIME: Duration = Duration::from_secs(10);
/// How long a run that was interrupted waits for acknowledgements that are under way, and for its
/// goodbye.
const PARTING_TIME: Duration = Duration::from_millis(200);

/// Where a run is published.
#[derive(Clone, Debug)]
pub struct Publication {
    /// The server.
    pub link: SessionConfig,
    /// How long to wait for it and its first answer; none: for ever for it, and for half a minute
    /// for its answer.
    pub wait: Option<Duration>,
    /// The map.
    pub map: MapName,
    /// The robot; its author id follows from it.
    pub robot: String,
    /// Folder in which what is not acknowledged survives the run; none: it does not.
    pub spool: Option<PathBuf>,
    /// How much may be under way, and how long.
    pub window: WindowConfig,
    /// How long to wait for the server's last acknowledgement.
    pub linger: Duration,
    /// Ends the wait.
    pub stop: Stop,
}

/// Why a run cannot be published.
#[derive(Debug, thiserror::Error)]
pub enum LinkedError {
    /// The session cannot be opened.
    #[error(transparent)]
    Link(#[from] SessionError),
    /// The robot's name is none.
    #[error(transparent)]
    RobotName(#[from] ParseIdError),
    /// A robot of this name is there.
    #[error("a robot called {0} is there already; give this one another --robot")]
    NameTaken(String),
    /// Publishing failed.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// Publishing has ended before the run was published whole.
    #[error("{error}; {}", fate(spool.as_deref()))]
    NotPublished {
        /// Why.
        error: PublishError,
        /// Where what is not acknowledged waits, if it is kept.
        spool: Option<PathBuf>,
    },
    /// The robot's disk is of no use.
    #[error(transparent)]
    Spool(#[from] SpoolError),
    /// What the last run has left is not delivered.
    #[error(transparent)]
    Deliver(#[from] DeliverError),
    /// The map is there already: a recorded run would be in another frame.
    #[error(
        "the map '{map}' already has {version} increments on the server; choose another --map (a recorded run starts a map of \
         its own, in a frame of its own)"
    )]
    MapExists {
        /// Its name.
        map: MapName,
        /// Its version.
        version: u64,
    },
    /// There is no copy of the map to join.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The map cannot be joined.
    #[error(transparent)]
    Enter(#[from] EnterError),
    /// The run ended early: a defect.
    #[error("the mapping loop failed: {0}")]
    Loop(#[from] tokio::task::JoinError),
}

/// What becomes of what the server has not acknowledged.
fn fate(spool: Option<&Path>) -> String {
    match spool {
        Some(file) => format!(
            "what is not acknowledged is kept in {}: when the reason is gone, the next run of this robot on this map \
             sends it first (--spool {})",
            file.display(),
            file.parent().unwrap_or(file).display()
        ),
        None => "what is not acknowledged is lost (--spool DIR keeps it)".to_owned(),
    }
}

impl LinkedError {
    /// Publishing has ended; `spool` is where the rest waits. Of a spool that has failed nothing is
    /// promised.
    fn not_published(error: PublishError, spool: Option<&Path>) -> Self {
        match error {
            PublishError::Spool(_) => Self::Publish(error),
            error => Self::NotPublished { error, spool: spool.map(Path::to_owned) },
        }
    }
}

/// A session with a server, over which a run is published.
pub struct Linked {
    publication: Publication,
    session: Session,
    spool: Option<Spool>,
    head: Option<Head>,
    earlier: Option<EarlierDelivery>,
    token: LivelinessToken,
}

/// Why it is waited for a name, and for how long at most.
fn waits_for_name(robot: &str, at_most: Duration) -> String {
    format!(
        "waiting for the name {robot}, {:.0} s at most: a robot called so is there, or has lost its power a moment ago",
        at_most.as_secs_f64()
    )
}

/// Waits until no other robot has the name. One that lost its power has it until its session's
/// lease is over.
async fn free_name(presence: Presence) -> Result<Presence, LinkedError> {
    let wait = move || {
        let began = Instant::now();
        let mut remark_due = Duration::ZERO;
        while presence.is_taken(ROLL_CALL).map_err(PublishError::from)? {
            let waited = began.elapsed();
            if waited >= LEASE {
                return Err(LinkedError::NameTaken(presence.robot().to_owned()));
            }
            if waited >= remark_due {
                remark_due = waited + REMARK_EVERY;
                // Robots show it, unlike most of what publishing has to say.
                tracing::warn!(target: "mapper::notice", "{}", waits_for_name(presence.robot(), LEASE - waited));
            }
            std::thread::sleep(ROLL_CALL);
        }
        Ok(presence)
    };
    tokio::task::spawn_blocking(wait).await?
}

impl Linked {
    /// Opens the session, delivers what the last run of this robot has left, and asks the server
    /// about the map.
    ///
    /// # Errors
    /// [`LinkedError`].
    pub async fn open(publication: Publication) -> Result<Self, LinkedError> {
        let began = Instant::now();
        let Publication { link, wait, map, robot, spool, window, stop, .. } = &publication;
        robot.parse::<RobotName>()?;
        let spool = spool.as_deref().map(|dir| Spool::open(dir, map, AuthorId::of_robot(robot))).transpose()?;
        stop.doing(format!("waiting for a server at {}", link.places()));
        let session = fht_session::open_within(link, *wait).await?;
        stop.doing("asking whether a robot of this name is there already");
        let presence = free_name(Presence::new(&session, map, robot, RobotRole::Explorer)?).await?;
        stop.doing(match &spool {
            Some(spool) => format!(
                "asking the server about map '{map}'; what the last run has left, if anything, stays in {}",
                spool.file().display()
            ),
            None => format!("asking the server about map '{map}'"),
        });
        let patience = wait.map_or(SERVER_PATIENCE, |wait| wait.saturating_sub(began.elapsed()));
        let head = find_head(&session, map, patience).await;
        let mut earlier = None;
        let head = match &spool {
            Some(spool) => {
                head.map_err(|error| DeliverError::Publish { error, file: spool.file().to_owned() })?;
                let waiting = EarlierDelivery::of(&spool.backlog()?);
                let head = deliver(&session, map, robot, spool, window, SERVER_PATIENCE).await?;
                earlier = waiting;
                head
            }
            None => head?,
        };
        if let Some(deletion) = head.as_ref().and_then(|head| head.deletion.as_ref()) {
            return Err(PublishError::Refused(deletion.refusal(map)).into());
        }
        let token = presence.declare().map_err(PublishError::from)?;
        Ok(Self { head, earlier, session, spool, token, publication })
    }

    /// Insists that nobody has written the map before.
    ///
    /// # Errors
    /// [`LinkedError::MapExists`].
    pub fn require_new(&self) -> Result<(), LinkedError> {
        match &self.head {
            Some(head) if head.version > 0 => {
                Err(LinkedError::MapExists { map: self.publication.map.clone(), version: head.version })
            }
            _ => Ok(()),
        }
    }

    /// Begins to listen to other explorers, and finds out whether this one begins the map or joins
    /// it.
    ///
    /// # Errors
    /// [`LinkedError`].
    pub async fn enter(&self) -> Result<(Peers, MapEntry), LinkedError> {
        let (session, head, Publication { map, robot, .. }) =
            (self.session.clone(), self.head.clone(), self.publication.clone());
        let enter = move || {
            let mut fellows = Peers::start(&session, &map, &robot)?;
            let entry = fellows.enter(head.as_ref(), SERVER_PATIENCE)?;
            Ok::<_, LinkedError>((fellows, entry))
        };
        tokio::task::spawn_blocking(enter).await?
    }

    /// Runs `work` in a thread, publishes what it puts in its outbox, and waits until the server
    /// has it. The outcome of `work` comes with how far publishing got. `entry` says how this run
    /// begins.
    ///
    /// # Errors
    /// [`LinkedError`]; a server that falls silent is none (the progress tells).
    pub async fn publish_while<R: Send + 'static>(
        self,
        entry: MapEntry,
        work: impl FnOnce(&Outbox) -> R + Send + 'static,
    ) -> Result<(R, Progress), LinkedError> {
        let Self { publication, session, head, earlier, spool, token } = self;
        let Publication { map, robot, window, linger, stop, .. } = publication;
        let _order = stop.in_order();
        let (MapEntry::Found { stored } | MapEntry::Join { stored }) = entry;
        if let Some(spool) = &spool {
            let basis = head.map(|head| head.vector).unwrap_or_default();
            spool.begin(RunOrigin { is_founder: matches!(entry, MapEntry::Found { .. }), basis }).await?;
        }
        let kept_in = spool.as_ref().map(|spool| spool.file().to_owned());
        let failed = |error| LinkedError::not_published(error, kept_in.as_deref());
        let (outbox, publisher) = outbox(session.clone(), map, AuthorId::of_robot(&robot), stored, spool, window);
        let mut publisher = tokio::spawn(publisher);
        // Once the outbox is closed, the publisher ends when everything is acknowledged.
        let run = tokio::task::spawn_blocking(move || (work(&outbox), outbox.close()));
        let (outcome, closed) = run.await?;
        let enough = async {
            let asked = async {
                stop.requested().await;
                tokio::time::sleep(PARTING_TIME).await;
            };
            _ = tokio::time::timeout(linger, asked).await;
        };
        let published = tokio::select! {
            biased;
            published = &mut publisher => published?.map_err(failed)?,
            () = enough => {
                closed.leave();
                match tokio::time::timeout(LEAVE_TIME, &mut publisher).await {
                    Ok(published) => published?.map_err(failed)?,
                    Err(_) => {
                        publisher.abort();
                        closed.progress()
                    }
                }
            }
        };
        let goodbye = async {
            token.undeclare().await.map_err(PublishError::from)?;
            session.close().await.map_err(PublishError::from)
        };
        let hurried = async {
            stop.requested().await;
            tokio::time::sleep(PARTING_TIME).await;
        };
        tokio::select! {
            said = goodbye => said?,
            () = hurried => {}
        }
        Ok((outcome, Progress { earlier, ..published }))
    }
}

/// Hands what a mapper writes to the outbox, if there is one. The robot's loop never waits for it:
/// what the outbox cannot take yet is kept here.
pub struct Handover<'a> {
    outbox: Option<&'a Outbox>,
    waiting: VecDeque<Increment>,
    written: u64,
}

impl<'a> Handover<'a> {
    /// Before the first increment of this run. Without an outbox increments are only counted.
    #[must_use]
    pub fn new(outbox: Option<&'a Outbox>) -> Self {
        let written = outbox.map_or(0, |outbox| outbox.progress().written);
        Self { outbox, waiting: VecDeque::new(), written }
    }

    /// Takes what `mapper` has written since the last call; returns the number of the robot's
    /// newest increment, be it of an earlier run.
    pub fn take_from(&mut self, mapper: &mut Mapper) -> u64 {
        for increment in mapper.take_increments() {
            self.written = increment.number;
            if self.outbox.is_some() {
                self.waiting.push_back(increment);
            }
        }
        while let Some((outbox, increment)) = self.outbox.zip(self.waiting.pop_front()) {
            if let Err(increment) = outbox.offer(increment) {
                self.waiting.push_front(increment);
                break;
            }
        }
        self.written
    }

    /// Hands over what still waits, and waits for that.
    pub async fn finish(&mut self) {
        while let Some((outbox, increment)) = self.outbox.zip(self.waiting.pop_front()) {
            if !outbox.deliver(increment).await {
                return;
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::api::reply::{ErrorCode, ErrorReply};

    #[test]
    fn who_waits_for_a_name_says_for_which_and_how_long() {
        let said = waits_for_name("twin", Duration::from_millis(11_600));
        assert!(said.contains("the name twin, 12 s at most"), "{said}");
    }

    #[test]
    fn who_is_refused_is_told_where_the_rest_is_and_how_it_is_sent() {
        let refused = || PublishError::Refused(ErrorReply::new(ErrorCode::NotPermitted, "this robot may not write"));
        let said = LinkedError::not_published(refused(), Some(Path::new("waiting/museum.a.spool"))).to_string();
        for part in
            ["this robot may not write", "kept in waiting/museum.a.spool", "next run of this robot", "--spool waiting)"]
        {
            assert!(said.contains(part), "{part}: {said}");
        }
        let said = LinkedError::not_published(refused(), None).to_string();
        assert!(said.contains("is lost (--spool DIR keeps it)"), "{said}");
        let broken = SpoolError::InUse { file: PathBuf::from("waiting/museum.a.spool") };
        assert!(!LinkedError::not_published(broken.into(), Some(Path::new("waiting"))).to_string().contains("is kept"));
    }
}
