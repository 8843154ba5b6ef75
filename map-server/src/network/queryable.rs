//! Answers queries over Zenoh: which keys are ours, who answers them, and how replies are sent.

use crate::clock::now_us;
use crate::ingest::{Ingest, WriterQueue};
use crate::query::{Answer, AnswerSources, answer, answer_at_once, internal, json, unknown_map};
use fht_proto::MapName;
use fht_proto::api::keys::{AdminAction, Key, PREFIX, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::api::request::{AdminOrder, Format, bad_request, parse, parse_order, shown};
use std::sync::Arc;
use tokio::runtime::Handle;
use tokio::sync::Semaphore;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::key_expr::{KeyExpr, keyexpr};
use zenoh::query::Query;

/// A waiting query counts once more for each so many bytes of its payload.
const BYTES_A_PERMIT: usize = 64 << 10;

/// Answers a bounded number of queries at a time, on threads of its own.
#[derive(Clone, Debug)]
pub(crate) struct QueryService {
    sources: AnswerSources,
    queue: Arc<WriterQueue>,
    permits: Arc<Semaphore>,
    runtime: Handle,
}

/// What a key expression asks for.
#[derive(Debug, PartialEq, Eq)]
enum Addressed {
    /// One topic.
    One(Key),
    /// A wildcard over heads and the list of maps.
    Several(Vec<Key>),
    /// What storages keep: one increment.
    Kept,
    /// The same by wildcards, as the servers of a site ask all of their storages. A refusal would
    /// be taken for one of a storage.
    Storages,
    /// What robots answer, of several of them: a refusal would be taken for one of a robot.
    Robots,
    /// What is put and not asked for: the sentence says what to ask.
    NotAsked(String),
    /// Nothing that exists.
    Unknown,
}

fn addressed(expression: &str, maps: impl Iterator<Item = MapName>) -> Addressed {
    if !expression.contains('*') {
        return match expression.parse::<Key>() {
            Ok(key @ (Key::Maps | Key::Topic { .. } | Key::Admin { .. })) => Addressed::One(key),
            _ => put_only(expression),
        };
    }
    let Ok(asked) = keyexpr::new(expression) else { return Addressed::Unknown };
    let covers = |key: &str| keyexpr::new(key).is_ok_and(|key| asked.intersects(key));
    let heads = maps.map(|map| Key::topic(&map, Topic::Head));
    let several: Vec<Key> = std::iter::once(Key::Maps).chain(heads).filter(|key| covers(&key.to_string())).collect();
    if !several.is_empty() { Addressed::Several(several) } else { put_only(expression) }
}

/// What a key that is put says when it is asked for, by its chunk behind the map.
fn put_only(expression: &str) -> Addressed {
    let mut chunks = expression.split('/').skip(1);
    let (map, kind) = (chunks.next().unwrap_or_default(), chunks.next().unwrap_or_default());
    let map = if map.parse::<MapName>().is_ok() { map } else { "MAP" };
    let key = shown(expression);
    let fleet = Topic::Fleet.as_str();
    match kind {
        "kept" if matches!(expression.parse(), Ok(Key::Kept { .. })) => Addressed::Kept,
        "kept" => Addressed::Storages,
        "robots" if is_of_goals(expression) && expression.contains('*') => Addressed::Robots,
        "robots" if is_of_goals(expression) => Addressed::NotAsked(format!(
            "{key} is answered by the robot itself, and this one takes no goals: does client-robot serve run? \
             {PREFIX}/{map}/{fleet} answers which robots there are"
        )),
        "robots" => Addressed::NotAsked(format!(
            "{key} is put by robots: subscribe to it; {PREFIX}/{map}/{fleet} answers which robots there are"
        )),
        "inc" => Addressed::NotAsked(format!(
            "{key} is put by writers: subscribe to it; {PREFIX}/{map}/{} answers with increments",
            Topic::Since.as_str()
        )),
        "refused" => Addressed::NotAsked(format!(
            "{key} is where the server puts why it refused an increment: subscribe to it; {PREFIX}/{map}/{} answers what \
             it has",
            Topic::Head.as_str()
        )),
        "admin" => {
            let actions: Vec<&str> = AdminAction::ALL.iter().map(|action| action.as_str()).collect();
            Addressed::NotAsked(format!(
                "{key} is no order: ask {PREFIX}/{map}/admin/ACTION with ACTION one of {}",
                actions.join(", ")
            ))
        }
        _ => Addressed::Unknown,
    }
}

/// Whether a robot that takes goals would answer.
fn is_of_goals(expression: &str) -> bool {
    let chunks: Vec<&str> = expression.split('/').skip(3).collect();
    matches!(chunks.as_slice(), [_, "goal"] | [_, "goal", _])
}

impl QueryService {
    /// Answers from `sources`, on the blocking threads of `runtime`; operators' orders go through
    /// `queue`.
    #[must_use]
    pub(crate) fn new(sources: AnswerSources, queue: Arc<WriterQueue>, runtime: Handle) -> Self {
        let permits = Arc::new(Semaphore::new(sources.config.max_queries));
        Self { sources, queue, permits, runtime }
    }

    /// Takes a query. Never blocks: short work is done here, and when too many queries are under
    /// way the client is told that the server is busy.
    pub(crate) fn take_query(&self, query: Query) {
        if let Some((key, outcome)) = self.answer_at_once(&query) {
            reply(&query, &key, outcome);
            return;
        }
        // Each query holds its payload until it is answered.
        let weight = query.payload().map_or(0, |payload| payload.len() / BYTES_A_PERMIT).saturating_add(1);
        let weight = u32::try_from(weight.min(self.sources.config.max_queries)).unwrap_or(u32::MAX);
        let Ok(permit) = Arc::clone(&self.permits).try_acquire_many_owned(weight) else {
            reply_error(&query, &busy());
            return;
        };
        let service = self.clone();
        self.runtime.spawn_blocking(move || {
            service.reply(&query);
            drop(permit);
        });
    }

    fn answer_at_once(&self, query: &Query) -> Option<(String, Result<Vec<Answer>, ErrorReply>)> {
        let name = query.key_expr().as_str();
        let key @ Key::Topic { topic: Topic::Path | Topic::Head, .. } = name.parse().ok()? else { return None };
        if query.payload().is_some() {
            return None;
        }
        let request = parse(key, query.parameters().iter(), None).ok()?;
        Some((name.to_owned(), answer_at_once(&request, &self.sources, now_us())?))
    }

    /// Whether a robot that is there may answer.
    fn is_left_to_a_robot(&self, expression: &str) -> bool {
        let mut chunks = expression.split('/').skip(1);
        let (map, robot) = (chunks.next().and_then(|map| map.parse().ok()), chunks.nth(1));
        let is_there = map.zip(robot).is_some_and(|(map, robot)| self.sources.fleet.is_alive(&map, robot));
        is_there && is_of_goals(expression)
    }

    fn reply(&self, query: &Query) {
        if self.is_left_to_a_robot(query.key_expr()) {
            return;
        }
        let maps = self.sources.catalog.heads().into_iter().map(|head| head.map.clone());
        match addressed(query.key_expr().as_str(), maps) {
            Addressed::One(key) => self.reply_to(query, key),
            Addressed::Several(keys) => keys.into_iter().for_each(|key| self.reply_to(query, key)),
            Addressed::Storages | Addressed::Robots => {}
            Addressed::Kept if self.sources.log.is_shared() => {}
            Addressed::Kept => {
                let text = format!(
                    "{} is kept by storages, and this server keeps its own log: {PREFIX}/MAP/{} answers with increments",
                    shown(query.key_expr()),
                    Topic::Since.as_str()
                );
                reply_error(query, &bad_request(text));
            }
            Addressed::NotAsked(text) => reply_error(query, &bad_request(text)),
            Addressed::Unknown => {
                let topics: Vec<&str> = Topic::ALL.iter().map(|topic| topic.as_str()).collect();
                let text = format!(
                    "{} is not a key of the map service: ask {PREFIX}/maps or {PREFIX}/MAP/TOPIC with TOPIC one of {}",
                    shown(query.key_expr()),
                    topics.join(", ")
                );
                reply_error(query, &bad_request(text));
            }
        }
    }

    fn reply_to(&self, query: &Query, key: Key) {
        let name = key.to_string();
        let payload = query.payload().map(|payload| payload.to_bytes());
        if let Key::Admin { map, action } = key {
            match parse_order(action, query.parameters().iter(), payload.as_deref()) {
                Ok(order) => self.carry_out(query.clone(), name, map, order),
                Err(error) => reply_error(query, &error),
            }
            return;
        }
        let outcome = parse(key, query.parameters().iter(), payload.as_deref())
            .and_then(|request| answer(request, &self.sources, now_us()));
        reply(query, &name, outcome);
    }

    /// Has the writer do what an operator wants; it replies when that is durable.
    fn carry_out(&self, query: Query, name: String, map: MapName, order: AdminOrder) {
        if let Some(reason) = not_shared(&order).filter(|_| self.sources.log.is_shared()) {
            reply_error(&query, &bad_request(reason.to_owned()));
            return;
        }
        let asker = Asker { query, key: name, is_answered: false };
        let catalog = Arc::clone(&self.sources.catalog);
        self.queue.push_job(Box::new(move |ingest: &mut Ingest| {
            let (outcome, log) = match order {
                AdminOrder::Retain { keep } => match ingest.retain(&map, keep) {
                    Ok(Some(retained)) => (json(&retained), Ok(())),
                    Ok(None) => (Err(unknown_map(&map, &catalog)), Ok(())),
                    // Nothing has changed.
                    Err(cause) => (Err(internal(cause)), Ok(())),
                },
                AdminOrder::Import { series } => match ingest.import(&map, series, now_us()) {
                    Ok(Ok(())) => {
                        let none = || bad_request("nothing was imported: the series is empty".to_owned());
                        (catalog.view(&map).ok_or_else(none).and_then(|view| json(view.head.as_ref())), Ok(()))
                    }
                    Ok(Err(refusal)) => (Err(refusal.reply()), Ok(())),
                    // What was sorted but not stored must not count as stored.
                    Err(cause) => (Err(internal(&cause)), Err(cause)),
                },
                AdminOrder::Delete(order) => match ingest.delete(&map, order, now_us()) {
                    Ok(Some(head)) => (json(head.as_ref()), Ok(())),
                    Ok(None) => (Err(unknown_map(&map, &catalog)), Ok(())),
                    Err(cause) => (Err(internal(cause)), Ok(())),
                },
                AdminOrder::Undelete => match ingest.undelete(&map) {
                    Ok(Some(head)) => (json(head.as_ref()), Ok(())),
                    Ok(None) if catalog.view(&map).is_none() => (Err(unknown_map(&map, &catalog)), Ok(())),
                    Ok(None) => (Err(bad_request(format!("map {map} is not going to be deleted"))), Ok(())),
                    Err(cause) => (Err(internal(cause)), Ok(())),
                },
            };
            asker.answer(outcome);
            log
        }));
    }
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
        AdminOrder::Import { .. } => None,
    }
}

/// An operator that waits for an answer. If its job is dropped, it is told to ask again.
struct Asker {
    query: Query,
    key: String,
    is_answered: bool,
}

impl Asker {
    fn answer(mut self, outcome: Result<Answer, ErrorReply>) {
        self.is_answered = true;
        reply(&self.query, &self.key, outcome.map(|answer| vec![answer]));
    }
}

impl Drop for Asker {
    fn drop(&mut self) {
        if !self.is_answered {
            reply_error(&self.query, &busy());
        }
    }
}

fn busy() -> ErrorReply {
    ErrorReply::new(ErrorCode::Internal, "the server is busy; ask again")
}

fn reply(query: &Query, key: &str, outcome: Result<Vec<Answer>, ErrorReply>) {
    match outcome {
        Ok(answers) => {
            let bytes: usize = answers.iter().map(|answer| answer.bytes.len()).sum();
            tracing::info!(map = map_in(key), asked = %asked_of(query), bytes, "answered");
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

fn reply_error(query: &Query, error: &ErrorReply) {
    tracing::info!(map = map_in(query.key_expr()), asked = %asked_of(query), code = ?error.code, "refused: {error}");
    let payload = serde_json::to_vec(error).unwrap_or_default();
    if let Err(error) = query.reply_err(payload).encoding(Encoding::APPLICATION_JSON).wait() {
        tracing::debug!("an error reply could not be sent: {error}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(expression: &str) -> Addressed {
        addressed(expression, ["a", "b"].into_iter().map(|name| name.parse().unwrap()))
    }

    #[test]
    fn keys_are_told_apart() {
        let a: MapName = "a".parse().unwrap();
        let b: MapName = "b".parse().unwrap();
        assert_eq!(asked("fht/maps"), Addressed::One(Key::Maps));
        assert_eq!(asked("fht/a/path"), Addressed::One(Key::topic(&a, Topic::Path)));
        assert_eq!(asked("fht/x/path"), Addressed::One(Key::topic(&"x".parse().unwrap(), Topic::Path)));
        let heads = vec![Key::topic(&a, Topic::Head), Key::topic(&b, Topic::Head)];
        assert_eq!(asked("fht/*/head"), Addressed::Several(heads));
        assert_eq!(asked("fht/*"), Addressed::Several(vec![Key::Maps]));
        for (others, instead) in [
            ("fht/a/inc/**", "fht/a/since"),
            ("fht/*/inc/**", "fht/MAP/since"),
            ("fht/a/inc/00000001/1", "fht/a/since"),
            ("fht/a/robots", "fht/a/fleet"),
            ("fht/a/robots/r", "fht/a/fleet"),
            ("fht/a/robots/**", "fht/a/fleet"),
            ("fht/a/robots/r/pose", "fht/a/fleet"),
            ("fht/*/robots/*/status", "fht/MAP/fleet"),
            ("fht/a/refused/00000001", "fht/a/head"),
            ("fht/a/admin/dance", "retain, import"),
            ("fht/a/robots/r/goal", "client-robot serve"),
            ("fht/a/robots/r/goal/status", "client-robot serve"),
        ] {
            let said = asked(others);
            assert!(matches!(&said, Addressed::NotAsked(text) if text.contains(instead)), "{others}: {said:?}");
        }
        assert_eq!(asked("fht/a/kept/00000001/1"), Addressed::Kept);
        for storages in ["fht/*/kept/**", "fht/a/kept/00000001/*", "fht/*/kept/*/1", "fht/-/kept/presence"] {
            assert_eq!(asked(storages), Addressed::Storages, "{storages}");
        }
        for several in ["fht/a/robots/*/goal/status", "fht/*/robots/*/goal/cancel"] {
            assert_eq!(asked(several), Addressed::Robots, "{several}");
        }
        for unknown in ["fht", "fht/a", "fht/a/paths", "fht/a/path/b", "fht/a b/path", "fht/*/path"] {
            assert_eq!(asked(unknown), Addressed::Unknown, "{unknown}");
        }
    }
}
