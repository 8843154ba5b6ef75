//! Which questions wait for which: each class of cost has a room of its own, so that long questions
//! never stand before short ones, however many there are.
//!
//! Zenoh does not tell a queryable who asks, so a class has room for all askers together: whoever
//! asks too much of one class takes it from the others of that class, and from nobody else.

use crate::config::AnswerConfig;
use fht_proto::api::reply::ErrorReply;
use fht_proto::api::request::{Moment, PathOn, Question, Request};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// What a question costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CostClass {
    /// Milliseconds, and little memory, or bounded by the bytes of the reply.
    Short,
    /// An old state of a map, read from the log.
    Snapshot,
    /// Old states are made anew: seconds, and hundreds of megabytes, on a large map.
    Long,
}

impl CostClass {
    /// The class of a request.
    pub(super) fn of(request: &Request) -> Self {
        match request {
            Request::Map(_, Question::Diff { .. } | Question::Path { on: PathOn::Release(_), .. }) => Self::Long,
            Request::Map(_, Question::Increments { moment, .. }) if *moment != Moment::Now => Self::Snapshot,
            Request::Map(..) | Request::Maps => Self::Short,
        }
    }
}

/// The rooms of all classes.
#[derive(Clone, Debug)]
pub(super) struct QueryRooms {
    short: Room,
    snapshots: Room,
    long: Room,
    max_wait: Duration,
}

/// Room for the questions of one class.
#[derive(Clone, Debug)]
struct Room {
    /// Of those that wait or are being answered.
    places: Arc<Semaphore>,
    /// Of those that are being answered; none: as many as there are threads.
    turns: Option<Arc<Semaphore>>,
    max_places: usize,
    /// When somebody for whom there is no place is to ask again, seconds.
    retry_after_s: u32,
}

impl Room {
    fn new(max_places: usize, at_once: Option<usize>, retry_after_s: u32) -> Self {
        let turns = at_once.map(|count| Arc::new(Semaphore::new(count.max(1))));
        let max_places = max_places.max(1);
        Self { places: Arc::new(Semaphore::new(max_places)), turns, max_places, retry_after_s }
    }

    fn busy(&self) -> ErrorReply {
        let seconds = self.retry_after_s;
        ErrorReply::busy(&format!("the server is busy; ask again after {seconds} s"), seconds)
    }
}

/// A place in a room: it is kept while the question waits, and while it is answered.
#[derive(Debug)]
pub(super) struct Place {
    room: Room,
    max_wait: Duration,
    _place: OwnedSemaphorePermit,
}

impl QueryRooms {
    pub(super) fn new(config: &AnswerConfig) -> Self {
        Self {
            short: Room::new(config.max_queries, None, 1),
            snapshots: Room::new(config.max_queries, Some(config.long_at_once), 2),
            long: Room::new(config.max_long, Some(config.long_at_once), 5),
            max_wait: Duration::try_from_secs_f64(config.max_wait_s).unwrap_or_default(),
        }
    }

    /// A place for a question that counts as `weight` of them.
    ///
    /// # Errors
    /// `BUSY`, with when to ask again, if there is none.
    pub(super) fn enter(&self, class: CostClass, weight: usize) -> Result<Place, ErrorReply> {
        let room = match class {
            CostClass::Short => &self.short,
            CostClass::Snapshot => &self.snapshots,
            CostClass::Long => &self.long,
        };
        let weight = u32::try_from(weight.min(room.max_places)).unwrap_or(u32::MAX);
        let place = Arc::clone(&room.places).try_acquire_many_owned(weight).map_err(|_| room.busy())?;
        Ok(Place { room: room.clone(), max_wait: self.max_wait, _place: place })
    }
}

/// The right to be answered now. It ends when dropped.
#[derive(Debug)]
pub(super) struct Turn {
    _permit: Option<OwnedSemaphorePermit>,
}

impl Place {
    /// A turn, if nobody has to be waited for.
    pub(super) fn turn_at_once(&self) -> Option<Turn> {
        match &self.room.turns {
            None => Some(Turn { _permit: None }),
            Some(turns) => Arc::clone(turns).try_acquire_owned().ok().map(|turn| Turn { _permit: Some(turn) }),
        }
    }

    /// A turn, first come, first served.
    ///
    /// # Errors
    /// `BUSY` if it does not come in time.
    pub(super) async fn turn(&self) -> Result<Turn, ErrorReply> {
        let Some(turns) = &self.room.turns else { return Ok(Turn { _permit: None }) };
        match tokio::time::timeout(self.max_wait, Arc::clone(turns).acquire_owned()).await {
            Ok(Ok(turn)) => Ok(Turn { _permit: Some(turn) }),
            Ok(Err(_)) | Err(_) => Err(self.room.busy()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::api::reply::ErrorCode;

    fn rooms() -> QueryRooms {
        QueryRooms::new(&AnswerConfig { max_queries: 4, max_long: 2, max_wait_s: 0.0, ..AnswerConfig::default() })
    }

    #[tokio::test]
    async fn long_questions_take_no_room_from_short_ones() {
        let rooms = rooms();
        let long: Vec<_> = (0..2).map(|_| rooms.enter(CostClass::Long, 1).unwrap()).collect();
        let refused = rooms.enter(CostClass::Long, 1).unwrap_err();
        assert_eq!((refused.code, refused.retry_after_s), (ErrorCode::Busy, Some(5)));
        let first = long[0].turn_at_once().unwrap();
        assert!(long[1].turn_at_once().is_none(), "one at a time");
        assert_eq!(long[1].turn().await.unwrap_err().code, ErrorCode::Busy, "no turn in time");
        let short = rooms.enter(CostClass::Short, 1).unwrap();
        assert!(short.turn_at_once().is_some());
        drop(first);
        assert!(long[1].turn_at_once().is_some());
    }

    #[test]
    fn payloads_count_more_and_never_more_than_there_is() {
        let rooms = rooms();
        let all = rooms.enter(CostClass::Short, 1000).unwrap();
        assert!(rooms.enter(CostClass::Short, 1).is_err());
        drop(all);
        assert!(rooms.enter(CostClass::Short, 1).is_ok());
    }
}
