//! Questions that come over something else than Zenoh: they wait in the same rooms.

use crate::clock::passed_us;
use crate::network::query_counts::QueryCounts;
use crate::network::query_rooms::CostClass;
use crate::network::query_trace::{QueryTrace, Step};
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
        let trace = QueryTrace::begin("http", &key, || key.clone());
        let computing = trace.step(Step::Compute);
        let outcome = match answer_at_once(&request, &self.sources, passed_us()) {
            Some(outcome) => {
                computing.end();
                outcome
            }
            None => {
                computing.forget();
                let (class, waiting, trace) = (CostClass::of(&request), trace.step(Step::Wait), trace.clone());
                let answered = self.work(class, move |sources| {
                    waiting.end();
                    let _computing = trace.step(Step::Compute);
                    answer(request, sources, passed_us())
                });
                answered.await
            }
        };
        self.counts.note(&key, outcome.as_ref().err(), begun);
        trace.outcome(outcome.as_ref().err());
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
        Question::Journal { .. } => Topic::Journal,
        Question::Match { .. } => Topic::Match,
    };
    Key::topic(map, topic).to_string()
}
