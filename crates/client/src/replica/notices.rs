//! What a robot is told of its map's end, and of its server's: each thing once, however often it is
//! seen.

use fht_proto::api::deletion::MapDeletion;
use fht_proto::api::reply::Head;
use fht_proto::{MapName, VersionVector};
use std::time::{Duration, Instant};

/// A server that says nothing for so long is told of: a restart takes less.
const SILENT: Duration = Duration::from_secs(5);

/// What was told.
#[derive(Debug, Default)]
pub(super) struct Notices {
    /// Whether the server has ever had the map.
    is_known: bool,
    deletion: Option<MapDeletion>,
    /// What the map consisted of when it was to be deleted.
    vector: VersionVector,
    is_gone: bool,
    /// Since when the server has not answered.
    silent_since: Option<Instant>,
    /// Whether that was told.
    is_silent: bool,
}

impl Notices {
    /// A sentence, if `head` says something new.
    pub(super) fn head(&mut self, head: &Head) -> Option<String> {
        self.is_known = true;
        self.is_gone = head.deletion.as_ref().is_some_and(|deletion| deletion.done);
        if self.deletion == head.deletion {
            return None;
        }
        let vector = std::mem::replace(&mut self.vector, head.vector.clone());
        let was_to_be = self.deletion.as_ref().is_some_and(|deletion| !deletion.done);
        self.deletion.clone_from(&head.deletion);
        match &head.deletion {
            Some(deletion) if deletion.done => Some(gone(&deletion.sentence(&head.map))),
            Some(deletion) => Some(deletion.sentence(&head.map)),
            // Another map of the name: that is told when the copy is of it.
            None if !head.vector.covers(&vector) => None,
            None => was_to_be.then(|| format!("map {} is not going to be deleted any more", head.map)),
        }
    }

    /// Whether the server has answered the question for the head, `now`. A sentence, if it has been
    /// silent for long, or answers again.
    pub(super) fn answer(&mut self, is_answered: bool, now: Instant) -> Option<String> {
        if is_answered {
            self.silent_since = None;
            return std::mem::take(&mut self.is_silent).then(|| "the map-server answers again".to_owned());
        }
        let since = *self.silent_since.get_or_insert(now);
        if !self.is_known || self.is_silent || now.saturating_duration_since(since) < SILENT {
            return None;
        }
        self.is_silent = true;
        Some("the map-server does not answer: the copy of the map here is used until it does".to_owned())
    }

    /// The server has no such map, and says why. A sentence, if it had it, and it was not told.
    pub(super) fn no_map(&mut self, reason: String) -> Option<String> {
        if !self.is_known || self.is_gone {
            return None;
        }
        self.is_gone = true;
        Some(gone(&reason))
    }
}

/// The copy is now of another map of the name.
pub(super) fn replaced(map: &MapName) -> String {
    format!("another map has the name {map} now: places on the old one are no places on it")
}

fn gone(reason: &str) -> String {
    format!("{reason}; the copy here is kept as long as this program runs")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(deletion: Option<MapDeletion>) -> Head {
        Head { deletion, ..Head::of_nothing("museum".parse().unwrap()) }
    }

    #[test]
    fn a_server_that_goes_and_comes_back_is_told_of_once() {
        let (mut notices, begin) = (Notices::default(), Instant::now());
        let at = |notices: &mut Notices, is_answered, second| {
            notices.answer(is_answered, begin + Duration::from_secs(second)).is_some()
        };
        assert!(!at(&mut notices, false, 0) && !at(&mut notices, false, 100), "it was never there");
        notices.head(&head(None));
        assert!(!at(&mut notices, true, 101) && !at(&mut notices, false, 102) && !at(&mut notices, false, 104));
        assert!(!at(&mut notices, true, 105), "a short silence is not told");
        assert!(!at(&mut notices, false, 106) && at(&mut notices, false, 112) && !at(&mut notices, false, 120));
        assert!(at(&mut notices, true, 121) && !at(&mut notices, true, 122));
    }

    #[test]
    fn everything_is_told_once() {
        let deletion = MapDeletion {
            at_us: 1,
            at: "2026-11-28T10:00:00Z".to_owned(),
            by: "desk".to_owned(),
            reason: "mistyped".to_owned(),
            moved_to: None,
            done: false,
        };
        let mut notices = Notices::default();
        assert_eq!(notices.no_map("there is no map museum".to_owned()), None, "it was never there");
        assert_eq!(notices.head(&head(None)), None);
        let will_be = notices.head(&head(Some(deletion.clone()))).unwrap();
        assert_eq!(will_be, "map museum will be deleted at 2026-11-28T10:00:00Z by desk: mistyped");
        assert_eq!(notices.head(&head(Some(deletion.clone()))), None);
        assert!(notices.head(&head(None)).unwrap().contains("not going to be deleted"));
        assert!(notices.head(&head(Some(deletion.clone()))).is_some());
        let was = notices.head(&head(Some(MapDeletion { done: true, ..deletion.clone() }))).unwrap();
        assert!(was.starts_with("map museum was deleted at"), "{was}");
        assert_eq!(notices.no_map("there is no map museum".to_owned()), None, "it was told");
        assert_eq!(notices.head(&head(None)), None, "another map begins");
        let whole = Head { vector: "0000000a:1".parse().unwrap(), ..head(None) };
        assert_eq!(notices.head(&whole), None);
        assert!(notices.head(&Head { vector: whole.vector.clone(), ..head(Some(deletion)) }).is_some());
        assert_eq!(notices.head(&head(None)), None, "it was deleted, and another one is there");
        assert!(notices.no_map("there is no map museum".to_owned()).is_some());
        assert_eq!(notices.no_map("there is no map museum".to_owned()), None);
    }
}
