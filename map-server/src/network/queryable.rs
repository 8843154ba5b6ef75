//! Answers queries over Zenoh: which keys are ours, who answers them, and how replies are sent.

#[cfg(feature = "web")]
mod beside;

use crate::clock::{now_us, passed_us};
use crate::ingest::{Ingest, Refusal, WriterQueue};
use crate::network::addressed::{Addressed, addressed, is_of_goals};
use crate::network::announcements::publish_head;
use crate::network::query_counts::QueryCounts;
use crate::network::query_rooms::{CostClass, Place, QueryRooms, Turn};
use crate::network::query_trace::{QueryTrace, Step};
use crate::query::{Answer, AnswerSources, answer, answer_at_once, internal, json, unknown_map};
use crate::store::StoreError;
use fht_proto::MapName;
use fht_proto::api::keys::{Key, PREFIX, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::api::request::{AdminOrder, Format, Question, Request, bad_request, parse, parse_order, shown};
use std::sync::Arc;
use std::time::Instant;
use tokio::runtime::Handle;
use zenoh::bytes::Encoding;
use zenoh::key_expr::KeyExpr;
use zenoh::query::Query;
use zenoh::{Session, Wait};

/// A waiting query counts once more for each so many bytes of its payload.
const BYTES_A_PERMIT: usize = 64 << 10;

/// Answers a bounded number of queries at a time, on threads of its own.
#[derive(Clone, Debug)]
pub(crate) struct QueryService {
    sources: AnswerSources,
    queue: Arc<WriterQueue>,
    rooms: QueryRooms,
    counts: Arc<QueryCounts>,
    session: Session,
    runtime: Handle,
}

impl QueryService {
    /// Answers from `sources`, on the blocking threads of `runtime`; operators' orders go through
    /// `queue`.
    #[must_use]
    pub(crate) fn new(sources: AnswerSources, queue: Arc<WriterQueue>, session: Session, runtime: Handle) -> Self {
        let rooms = QueryRooms::new(&sources.config);
        Self { sources, queue, rooms, counts: Arc::default(), session, runtime }
    }

    /// Takes a query. Never blocks: short work is done here, and when too many queries are under
    /// way the client is told that the server is busy.
    pub(crate) fn take_query(&self, query: Query) {
        let begun = Instant::now();
        let trace = QueryTrace::begin("zenoh", query.key_expr(), || asked_of(&query));
        let computing = trace.step(Step::Compute);
        if let Some((key, outcome)) = self.answer_at_once(&query) {
            computing.end();
            self.counts.note(&key, outcome.as_ref().err(), begun);
            reply(&query, &key, outcome, &trace);
            return;
        }
        computing.forget();
        let waiting = trace.step(Step::Wait);
        // Each query holds its payload until it is answered.
        let weight = query.payload().map_or(0, |payload| payload.len() / BYTES_A_PERMIT).saturating_add(1);
        let place = match self.rooms.enter(cost_class(&query), weight) {
            Ok(place) => place,
            Err(busy) => {
                self.counts.note(query.key_expr(), Some(&busy), begun);
                waiting.end();
                return refuse(&query, &busy, &trace);
            }
        };
        let (service, traced) = (self.clone(), trace.clone());
        let answer = move |query: Query, place: Place, turn: Turn| {
            waiting.end();
            service.reply(&query, begun, &traced);
            drop((place, turn));
        };
        if let Some(turn) = place.turn_at_once() {
            self.runtime.spawn_blocking(move || answer(query, place, turn));
            return;
        }
        let (runtime, counts) = (self.runtime.clone(), Arc::clone(&self.counts));
        self.runtime.spawn(async move {
            match place.turn().await {
                Ok(turn) => drop(runtime.spawn_blocking(move || answer(query, place, turn))),
                Err(busy) => {
                    counts.note(query.key_expr(), Some(&busy), begun);
                    drop(answer);
                    refuse(&query, &busy, &trace);
                }
            }
        });
    }

    fn answer_at_once(&self, query: &Query) -> Option<(String, Result<Vec<Answer>, ErrorReply>)> {
        let name = query.key_expr().as_str();
        let key @ Key::Topic { topic: Topic::Path | Topic::Head, .. } = name.parse().ok()? else { return None };
        if query.payload().is_some() {
            return None;
        }
        let request = parse(key, query.parameters().iter(), None).ok()?;
        Some((name.to_owned(), answer_at_once(&request, &self.sources, passed_us())?))
    }

    /// Whether a robot that is there may answer.
    fn is_left_to_a_robot(&self, expression: &str) -> bool {
        let mut chunks = expression.split('/').skip(1);
        let (map, robot) = (chunks.next().and_then(|map| map.parse().ok()), chunks.nth(1));
        let is_there = map.zip(robot).is_some_and(|(map, robot)| self.sources.fleet.is_alive(&map, robot));
        // A robot answers under its own keys, and no part of them.
        is_there && is_of_goals(expression) && !expression.contains('*')
    }

    fn reply(&self, query: &Query, begun: Instant, trace: &QueryTrace) {
        if self.is_left_to_a_robot(query.key_expr()) {
            return trace.is_left();
        }
        let maps = self.sources.catalog.heads().into_iter().map(|head| head.map.clone());
        match addressed(query.key_expr().as_str(), maps) {
            Addressed::One(key) => self.reply_to(query, key, begun, trace),
            Addressed::Several(keys) => keys.into_iter().for_each(|key| self.reply_to(query, key, begun, trace)),
            Addressed::Storages | Addressed::Robots => trace.is_left(),
            Addressed::Kept if self.sources.log.is_shared() => trace.is_left(),
            Addressed::Kept => {
                let text = format!(
                    "{} is kept by storages, and this server keeps its own log: {PREFIX}/MAP/{} answers with increments",
                    shown(query.key_expr()),
                    Topic::Since.as_str()
                );
                refuse(query, &bad_request(text), trace);
            }
            Addressed::NotAsked(text) => refuse(query, &bad_request(text), trace),
            Addressed::NoRobot(text) => refuse(query, &ErrorReply::new(ErrorCode::UnknownRobot, &text), trace),
            Addressed::Unknown => {
                let topics: Vec<&str> = Topic::ALL.iter().map(|topic| topic.as_str()).collect();
                let several =
                    if query.key_expr().contains('*') { " (nor several that are asked at a time)" } else { "" };
                let text = format!(
                    "{} is not a key of the map service{several}: ask {PREFIX}/maps or {PREFIX}/MAP/TOPIC with TOPIC one of {}",
                    shown(query.key_expr()),
                    topics.join(", ")
                );
                refuse(query, &bad_request(text), trace);
            }
        }
    }

    fn reply_to(&self, query: &Query, key: Key, begun: Instant, trace: &QueryTrace) {
        let name = key.to_string();
        let payload = query.payload().map(|payload| payload.to_bytes());
        if let Key::Admin { map, action } = key {
            match parse_order(action, query.parameters().iter(), payload.as_deref()) {
                Ok(AdminOrder::Unblock { robot, ignore_s }) => {
                    reply(query, &name, self.unblock(&map, robot, ignore_s), trace);
                }
                Ok(AdminOrder::KeepBlocked { robot, for_s }) => {
                    reply(query, &name, self.keep_blocked(&map, &robot, for_s), trace);
                }
                Ok(order) => self.carry_out(query.clone(), (name, trace.clone()), map, order),
                Err(error) => refuse(query, &error, trace),
            }
            return;
        }
        let computing = trace.step(Step::Compute);
        let outcome = parse(key, query.parameters().iter(), payload.as_deref())
            .and_then(|request| answer(request, &self.sources, passed_us()));
        computing.end();
        self.counts.note(&name, outcome.as_ref().err(), begun);
        reply(query, &name, outcome, trace);
    }

    /// Opens what robots reported blocked.
    fn unblock(&self, map: &MapName, robot: Option<String>, ignore_s: f64) -> Result<Vec<Answer>, ErrorReply> {
        let AnswerSources { catalog, active_rules, .. } = &self.sources;
        catalog.view(map).ok_or_else(|| unknown_map(map, catalog))?;
        let cleared = active_rules.clear_reports(map, robot.as_deref(), ignore_s, passed_us());
        if let Some(robot) = robot.as_deref().filter(|_| cleared == 0 && ignore_s <= 0.0) {
            return Err(nothing_blocked(robot, map));
        }
        let of = robot.as_deref().unwrap_or("all robots");
        if cleared > 0 || ignore_s > 0.0 {
            tracing::warn!(%map, cleared, ignore_s, "an operator has cleared what {of} reported blocked");
        }
        self.tell_blocked(map)
    }

    /// Has what a robot reported blocked stay so.
    fn keep_blocked(&self, map: &MapName, robot: &str, for_s: f64) -> Result<Vec<Answer>, ErrorReply> {
        let AnswerSources { catalog, active_rules, .. } = &self.sources;
        catalog.view(map).ok_or_else(|| unknown_map(map, catalog))?;
        if active_rules.keep_reports(map, robot, for_s, passed_us()) == 0 {
            return Err(nothing_blocked(robot, map));
        }
        tracing::warn!(%map, %robot, for_s, "an operator keeps closed what the robot reported blocked");
        self.tell_blocked(map)
    }

    /// Lets copies know that what is blocked is not what it was, and answers with it.
    fn tell_blocked(&self, map: &MapName) -> Result<Vec<Answer>, ErrorReply> {
        if let Some(head) = self.sources.catalog.count_cleared(map) {
            publish_head(&self.session, &head);
        }
        answer(Request::Map(map.clone(), Question::Rules), &self.sources, passed_us())
    }

    /// Has the writer do what an operator wants; it replies when that is durable.
    fn carry_out(&self, query: Query, (key, trace): (String, QueryTrace), map: MapName, order: AdminOrder) {
        if let Some(reason) = not_shared(&order).filter(|_| self.sources.log.is_shared()) {
            return refuse(&query, &bad_request(reason.to_owned()), &trace);
        }
        let waiting = trace.step(Step::Wait);
        let asker = Asker { query, key, trace, is_answered: false };
        let catalog = Arc::clone(&self.sources.catalog);
        self.queue.push_job(Box::new(move |ingest: &mut Ingest| {
            waiting.end();
            let computing = asker.trace.step(Step::Compute);
            if let Some(refusal) = ingest.refusal_at_present() {
                asker.answer(Err(refusal));
                return Ok(());
            }
            let (outcome, log) = match order {
                AdminOrder::Retain { keep } => match ingest.retain(&map, keep) {
                    Ok(Some(retained)) => (json(&retained), Ok(())),
                    Ok(None) => (Err(unknown_map(&map, &catalog)), Ok(())),
                    // Nothing has changed.
                    Err(cause) => (Err(not_done(ingest, &cause)), Ok(())),
                },
                AdminOrder::Import { whole: Some(whole), .. } if ingest.is_of_others(&map, &whole) => {
                    (Err(Refusal::OtherMap(map).reply()), Ok(()))
                }
                AdminOrder::Import { series, .. } => match ingest.import(&map, series, now_us()) {
                    Ok(Ok(())) => {
                        let none = || bad_request("nothing was imported: the series is empty".to_owned());
                        (catalog.view(&map).ok_or_else(none).and_then(|view| json(view.head.as_ref())), Ok(()))
                    }
                    Ok(Err(refusal)) => (Err(refusal.reply()), Ok(())),
                    // What was sorted but not stored must not count as stored.
                    Err(cause) => (Err(not_done(ingest, &cause)), Err(cause)),
                },
                AdminOrder::Delete(order) => {
                    let done = match order.moved_to.clone() {
                        Some(new) => ingest.rename(&map, &new, order, now_us()),
                        None => ingest.delete(&map, order, now_us()).map(Ok),
                    };
                    match done {
                        Ok(Ok(Some(head))) => (json(head.as_ref()), Ok(())),
                        Ok(Ok(None)) => (Err(unknown_map(&map, &catalog)), Ok(())),
                        Ok(Err(refusal)) => (Err(refusal), Ok(())),
                        Err(cause) => (Err(not_done(ingest, &cause)), Ok(())),
                    }
                }
                AdminOrder::Quota(_) if catalog.view(&map).is_none() => (Err(unknown_map(&map, &catalog)), Ok(())),
                AdminOrder::Quota(change) => {
                    let quotas = ingest.quotas(&map, change.as_ref());
                    (quotas.map_err(bad_request).and_then(|quotas| json(&quotas)), Ok(()))
                }
                // Answered without the writer.
                AdminOrder::Unblock { .. } | AdminOrder::KeepBlocked { .. } => return Ok(()),
                AdminOrder::Undelete => match ingest.undelete(&map) {
                    Ok(Some(head)) => (json(head.as_ref()), Ok(())),
                    Ok(None) if catalog.view(&map).is_none() => (Err(unknown_map(&map, &catalog)), Ok(())),
                    Ok(None) => (Err(bad_request(format!("map {map} is not going to be deleted"))), Ok(())),
                    Err(cause) => (Err(not_done(ingest, &cause)), Ok(())),
                },
            };
            computing.end();
            asker.answer(outcome);
            log
        }));
    }
}

fn nothing_blocked(robot: &str, map: &MapName) -> ErrorReply {
    bad_request(format!("{robot} reports nothing blocked on map {map}"))
}

/// What an operator is told whose order has failed.
fn not_done(ingest: &Ingest, cause: &StoreError) -> ErrorReply {
    ingest.refusal_at_present().unwrap_or_else(|| internal(cause))
}

/// Why an order is not carried out where several servers stand on storages.
fn not_shared(order: &AdminOrder) -> Option<&'static str> {
    match order {
        AdminOrder::Retain { .. } => {
            Some("increments are folded only where one server keeps its own log: here several stand on storages")
        }
        AdminOrder::Delete(_) | AdminOrder::Undelete => Some(
            "maps are deleted only where one server keeps its own log: here several stand on storages, and a storage that was \
             away would bring the map back",
        ),
        AdminOrder::Import { .. }
        | AdminOrder::Unblock { .. }
        | AdminOrder::KeepBlocked { .. }
        | AdminOrder::Quota(_) => None,
    }
}

/// An operator that waits for an answer. If its job is dropped, it is told to ask again.
struct Asker {
    query: Query,
    key: String,
    trace: QueryTrace,
    is_answered: bool,
}

impl Asker {
    fn answer(mut self, outcome: Result<Answer, ErrorReply>) {
        self.is_answered = true;
        reply(&self.query, &self.key, outcome.map(|answer| vec![answer]), &self.trace);
    }
}

impl Drop for Asker {
    fn drop(&mut self) {
        if !self.is_answered {
            refuse(&self.query, &busy(), &self.trace);
        }
    }
}

/// What a query costs, as far as its key and parameters say. Orders, wildcards and what cannot be
/// read are short work.
fn cost_class(query: &Query) -> CostClass {
    match query.key_expr().as_str().parse() {
        Ok(key @ Key::Topic { topic: Topic::Path | Topic::Diff | Topic::Since | Topic::Snapshot, .. }) => {
            let request = parse(key, query.parameters().iter(), None);
            request.map_or(CostClass::Short, |request| CostClass::of(&request))
        }
        _ => CostClass::Short,
    }
}

pub(super) fn busy() -> ErrorReply {
    ErrorReply::busy("the server is busy; ask again after 1 s", 1)
}

fn refuse(query: &Query, refusal: &ErrorReply, trace: &QueryTrace) {
    trace.outcome(Some(refusal));
    let _replying = trace.step(Step::Reply);
    reply_error(query, refusal);
}

fn reply(query: &Query, key: &str, outcome: Result<Vec<Answer>, ErrorReply>, trace: &QueryTrace) {
    trace.outcome(outcome.as_ref().err());
    let _replying = trace.step(Step::Reply);
    match outcome {
        Ok(answers) => {
            let bytes: usize = answers.iter().map(|answer| answer.bytes.len()).sum();
            tracing::info!(map = %map_in(key), asked = %asked_of(query), bytes, "answered");
            answers.into_iter().for_each(|answer| reply_answer(query, key, answer));
        }
        Err(error) => reply_error(query, &error),
    }
}

fn reply_answer(query: &Query, key: &str, answer: Answer) {
    let encoding = match answer.format {
        Format::Json => Encoding::APPLICATION_JSON,
        Format::Postcard => Encoding::APPLICATION_OCTET_STREAM,
    };
    let sent = KeyExpr::try_from(key).and_then(|key| query.reply(key, answer.bytes).encoding(encoding).wait());
    if let Err(error) = sent {
        tracing::debug!("a reply could not be sent: {error}"); // the asker has gone
    }
}

/// The map that a key names, for the log.
fn map_in(key: &str) -> &str {
    key.split('/').nth(1).unwrap_or_default()
}

/// What was asked, for the log.
fn asked_of(query: &Query) -> String {
    shown(&query.selector().to_string())
}

pub(super) fn reply_error(query: &Query, error: &ErrorReply) {
    tracing::info!(map = %map_in(query.key_expr()), asked = %asked_of(query), code = ?error.code, "refused: {error}");
    let payload = serde_json::to_vec(error).unwrap_or_default();
    if let Err(error) = query.reply_err(payload).encoding(Encoding::APPLICATION_JSON).wait() {
        tracing::debug!("an error reply could not be sent: {error}");
    }
}
