//! Typed requests to replies, over a shared view of the maps.

mod history;
mod nodes;
mod operation;
mod path;

use crate::catalog::Catalog;
use crate::config::AnswerConfig;
use crate::fleet::Fleet;
use crate::live::LiveRules;
use crate::log::IncrementLog;
use fht_proto::MapName;
use fht_proto::encode;
use fht_proto::envelope::Message;
use fht_proto::query::{ErrorCode, ErrorReply, MapsReply};
use fht_proto::request::{Format, Question, Request};
use serde::Serialize;
use std::sync::Arc;

/// What is replied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// How it is written.
    pub format: Format,
    /// The payload.
    pub bytes: Vec<u8>,
}

/// What answers are made of.
#[derive(Clone, Debug)]
pub struct Sources {
    /// The maps.
    pub catalog: Arc<Catalog>,
    /// All their increments.
    pub log: Arc<dyn IncrementLog>,
    /// What is closed now.
    pub live: Arc<LiveRules>,
    /// The robots.
    pub fleet: Arc<Fleet>,
    /// How to answer.
    pub config: Arc<AnswerConfig>,
}

fn error(code: ErrorCode, message: impl AsRef<str>) -> ErrorReply {
    ErrorReply::new(code, message.as_ref())
}

pub(crate) fn internal(cause: impl std::fmt::Display) -> ErrorReply {
    tracing::error!("a query failed: {cause}");
    error(ErrorCode::Internal, "the server failed; its log says why")
}

pub(crate) fn json<T: Serialize>(value: &T) -> Result<Answer, ErrorReply> {
    let bytes = serde_json::to_vec(value).map_err(internal)?;
    Ok(Answer { format: Format::Json, bytes })
}

fn postcard<M: Message>(message: &M) -> Result<Answer, ErrorReply> {
    let bytes = encode(message).map_err(internal)?;
    Ok(Answer { format: Format::Postcard, bytes })
}

/// Answers a request at `now_us` (microseconds, the server's clock): with one reply, or with several if the asker wants pieces.
///
/// # Errors
/// What the asker is told instead.
pub fn answer(request: Request, sources: &Sources, now_us: u64) -> Result<Vec<Answer>, ErrorReply> {
    let catalog = &sources.catalog;
    let (map, question) = match request {
        Request::Maps => {
            let maps = catalog.heads().iter().map(|head| head.as_ref().clone()).collect();
            return json(&MapsReply { maps }).map(|answer| vec![answer]);
        }
        Request::Map(map, question) => (map, question),
    };
    let view = catalog.view(&map).ok_or_else(|| unknown_map(&map, catalog))?;
    let answer = match question {
        Question::Increments { moment, have, max_bytes, piece_bytes } => {
            return history::increments(&view, sources.log.as_ref(), &moment, &have, (max_bytes, piece_bytes));
        }
        Question::Head => json(view.head.as_ref()),
        Question::Path { from, to, on, format } => path::path(&view, sources, (&from, &to), &on, format, now_us),
        Question::Nodes { near, radius_m, limit, format } => nodes::near(&view, catalog, near, radius_m, limit, format),
        Question::Match { descriptor, limit, format } => nodes::alike(&view, catalog, &descriptor, limit, format),
        Question::Releases => history::releases(&view, sources.log.as_ref()),
        Question::Diff { from, to } => history::diff(&view, sources.log.as_ref(), &from, &to),
        Question::Rules => operation::rules(&view, &sources.live, now_us),
        Question::Fleet => operation::fleet(&view, &sources.fleet, now_us),
    };
    answer.map(|answer| vec![answer])
}

/// The same for questions that are short work and wait for nothing: heads, and most paths on small maps. `None`: ask [`answer`].
#[must_use]
pub fn answer_at_once(request: &Request, sources: &Sources, now_us: u64) -> Option<Result<Vec<Answer>, ErrorReply>> {
    let Request::Map(map, question) = request else { return None };
    let view = sources.catalog.view(map)?;
    let answer = match question {
        Question::Head => json(view.head.as_ref()),
        Question::Path { from, to, on, format } => path::at_once(&view, sources, (from, to), on, *format, now_us)?,
        _ => return None,
    };
    Some(answer.map(|answer| vec![answer]))
}

pub(crate) fn unknown_map(map: &MapName, catalog: &Catalog) -> ErrorReply {
    /// Names that are worth reading.
    const SHOWN: usize = 10;
    let names: Vec<String> = catalog.heads().iter().take(SHOWN).map(|head| head.map.to_string()).collect();
    let known = if names.is_empty() { "no maps yet".to_owned() } else { names.join(", ") };
    error(ErrorCode::UnknownMap, format!("there is no map {map} here (there is: {known})"))
}
