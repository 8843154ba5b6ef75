//! Questions that come over something else than Zenoh: they wait in the same rooms.

use crate::clock::passed_us;
use crate::network::query_counts::QueryCounts;
use crate::network::query_rooms::CostClass;
use crate::network::queryable::QueryService;
use crate::query::{Answer, AnswerSources, answer, answer_at_once, internal};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::ErrorReply;
use fht_proto::api::request::{Moment, Question, Request};
use std::time::Instant;

impl QueryService {
    /// What answers are made from.
    pub(crate) fn sources(&self) -> &AnswerSources {
        &self.sources
    }

    /// What was counted.
    pub(crate) fn counts(&self) -> &QueryCounts {
        &self.counts
    }

    /// Answers a request.
    ///
    /// # Errors
    /// What the asker is told instead; `BUSY` if there is no room.
    pub(crate) async fn ask(&self, request: Request) -> Result<Vec<Answer>, ErrorReply> {
        let (begun, key) = (Instant::now(), key_of(&request));
        let outcome = match answer_at_once(&request, &self.sources, passed_us()) {
            Some(outcome) => outcome,
            None => {
                let class = CostClass::of(&request);
                self.work(class, move |sources| answer(request, sources, passed_us())).await
            }
        };
        self.counts.note(&key, outcome.as_ref().err(), begun);
        outcome
    }

    /// Does other work of a class, in its room.
    ///
    /// # Errors
    /// What comes of the work; `BUSY` if there is no room.
    pub(crate) async fn work<T: Send + 'static>(
        &self,
        class: CostClass,
        work: impl FnOnce(&AnswerSources) -> Result<T, ErrorReply> + Send + 'static,
    ) -> Result<T, ErrorReply> {
        let place = self.rooms.enter(class, 1)?;
        let turn = match place.turn_at_once() {
            Some(turn) => turn,
            None => place.turn().await?,
        };
        let sources = self.sources.clone();
        let done = self.runtime.spawn_blocking(move || {
            let outcome = work(&sources);
            drop((place, turn));
            outcome
        });
        done.await.map_err(internal)?
    }
}

/// The key that a request would come under.
fn key_of(request: &Request) -> String {
    let Request::Map(map, question) = request else { return Key::Maps.to_string() };
    let topic = match question {
        Question::Head => Topic::Head,
        Question::Increments { moment: Moment::Now, .. } => Topic::Since,
        Question::Increments { .. } => Topic::Snapshot,
        Question::Path { .. } => Topic::Path,
        Question::Nodes { .. } => Topic::Nodes,
        Question::Releases => Topic::Releases,
        Question::Diff { .. } => Topic::Diff,
        Question::Rules => Topic::Rules,
        Question::Fleet { .. } => Topic::Fleet,
        Question::Match { .. } => Topic::Match,
    };
    Key::topic(map, topic).to_string()
}
        Question::Journal { .. } => Topic::Journal,
