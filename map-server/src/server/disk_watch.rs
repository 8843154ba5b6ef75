//! A disk that takes nothing: the server says so, tries again from time to time, and goes on by
//! itself. Until then it answers, and what comes is refused to be sent again.

use crate::catalog::Catalog;
use crate::ingest::Ingest;
use crate::store::IncrementLog;
use std::time::{Duration, Instant};

/// Whether the disk takes what is written, as of late.
#[derive(Debug)]
pub(super) struct DiskWatch {
    standing: Option<Standing>,
    warned: Option<Instant>,
    /// When the file and the room left were looked at last.
    looked: Option<Instant>,
}

/// The disk has refused something.
#[derive(Debug)]
struct Standing {
    since: Instant,
    tried: Instant,
}

/// What the heads say anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DiskChange {
    /// The server takes nothing in.
    ReadOnly,
    /// It does again.
    Writable,
}

impl DiskWatch {
    /// Between two attempts to write, and two looks at the file and the room left.
    pub(super) const EVERY: Duration = Duration::from_secs(5);
    /// Between two warnings of little room.
    const WARN_EVERY: Duration = Duration::from_secs(3600);

    /// The disk works as far as anybody knows.
    pub(super) fn new() -> Self {
        Self { standing: None, warned: None, looked: None }
    }

    /// Looks whether the disk has failed since, or works again.
    pub(super) fn look(
        &mut self,
        log: &dyn IncrementLog,
        catalog: &Catalog,
        ingest: &mut Ingest,
        now: Instant,
    ) -> Option<DiskChange> {
        let is_due = |last: Instant, every: Duration| now.duration_since(last) >= every;
        if self.looked.is_none_or(|looked| is_due(looked, Self::EVERY)) {
            self.looked = Some(now);
            log.look();
            self.look_at_room(log, now);
        }
        match (&mut self.standing, log.fault()) {
            (None, None) => None,
            (None, Some(reason)) => {
                tracing::error!(
                    "the disk cannot be written: {reason}. The server answers what it is asked and takes nothing in; it \
                     tries again every {} s",
                    Self::EVERY.as_secs()
                );
                self.standing = Some(Standing { since: now, tried: now });
                ingest.stand_still();
                catalog.set_read_only(true);
                Some(DiskChange::ReadOnly)
            }
            (Some(standing), _) if !is_due(standing.tried, Self::EVERY) => None,
            (Some(standing), _) => {
                standing.tried = now;
                if let Err(error) = log.try_again().and_then(|()| ingest.go_on()) {
                    tracing::info!("the disk still takes nothing: {error}");
                    return None;
                }
                let for_s = now.duration_since(standing.since).as_secs();
                tracing::warn!("the disk can be written again, after {for_s} s: the server takes in what it is sent");
                self.standing = None;
                catalog.set_read_only(false);
                Some(DiskChange::Writable)
            }
        }
    }

    fn look_at_room(&mut self, log: &dyn IncrementLog, now: Instant) {
        match log.warning() {
            None => self.warned = None,
            Some(warning) if self.warned.is_none_or(|at| now.duration_since(at) >= Self::WARN_EVERY) => {
                tracing::warn!("{warning}");
                self.warned = Some(now);
            }
            Some(_) => {}
        }
    }
}
