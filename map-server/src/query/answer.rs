//! Typed requests to replies, over a shared view of the maps.
//!
//! | module | topics |
//! | --- | --- |
//! | `history` | `since`, `snapshot`, `releases`, `diff` |
//! | `journal` | `journal` |
//! | `nodes` | `nodes`, `match` |
//! | `operation` | `rules`, `fleet` |
//! | `path` | `path` |

mod history;
mod journal;
mod nodes;
mod operation;
mod path;
mod release_name;
mod reply;
mod sources;

#[cfg(feature = "web")]
pub(crate) use history::state_of;
#[cfg(feature = "web")]
pub(crate) use nodes::node_view;
#[cfg(feature = "web")]
pub(crate) use operation::written_rules;
#[cfg(feature = "web")]
pub(crate) use release_name::find_release;
pub use reply::Answer;
pub(crate) use reply::{internal, json};
pub use sources::AnswerSources;

use crate::catalog::Catalog;
use fht_proto::MapName;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, MapsReply, known_names};
use fht_proto::api::request::{Question, Request};
use reply::error;

/// Answers a request at `now_us` (microseconds, by a clock that nobody sets): with one reply, or
/// with several if the client asks for pieces.
///
/// # Errors
/// What the client is told instead.
pub fn answer(request: Request, sources: &AnswerSources, now_us: u64) -> Result<Vec<Answer>, ErrorReply> {
    let catalog = &sources.catalog;
    let (map, question) = match request {
        Request::Maps => {
            let mut maps: Vec<Head> = catalog.heads().iter().map(|head| head.as_ref().clone()).collect();
            maps.extend(catalog.damaged_heads());
            maps.sort_by(|a, b| a.map.cmp(&b.map));
            let log = &sources.log;
            let reply = MapsReply { maps, read_only: log.fault(), warning: log.warning() };
            return json(&reply).map(|answer| vec![answer]);
        }
        Request::Map(map, question) => (map, question),
    };
    let view = catalog.view(&map).ok_or_else(|| unknown_map(&map, catalog))?;
    let answer = match question {
        Question::Increments { moment, have, max_bytes, piece_bytes, format } => {
            let form = history::SeriesForm { max_bytes, piece_bytes, format };
            return history::increments(&view, sources.log.as_ref(), &moment, &have, form);
        }
        Question::Head => json(view.head.as_ref()),
        ref question @ Question::Path { .. } => {
            let asked = path::PathQuestion::of(question).ok_or_else(|| internal("a path is no path"))?;
            path::path(&view, sources, &asked, now_us)
        }
        Question::Nodes { near, radius_m, limit, after, format } => {
            nodes::near(&view, catalog, &nodes::NodesQuestion { near, radius_m, limit, after, format })
        }
        Question::Match { descriptor, limit, format } => nodes::alike(&view, catalog, &descriptor, limit, format),
        Question::Releases => history::releases(&view, sources.log.as_ref()),
        Question::Diff { from, to } => history::diff(&view, sources.log.as_ref(), &from, &to),
        Question::Rules => operation::rules(&view, &sources.active_rules, now_us),
        Question::Journal { limit, after } => journal::journal(&view, sources, (limit, after)),
        Question::Fleet { limit, after } => operation::fleet(&view, &sources.fleet, (limit, after.as_ref()), now_us),
    };
    answer.map(|answer| vec![answer])
}

/// The same for questions that are short work and block on nothing: heads, and most paths on small
/// maps. `None`: call [`answer`].
#[must_use]
pub fn answer_at_once(
    request: &Request,
    sources: &AnswerSources,
    now_us: u64,
) -> Option<Result<Vec<Answer>, ErrorReply>> {
    let Request::Map(map, question) = request else { return None };
    let view = sources.catalog.view(map)?;
    let answer = match question {
        Question::Head => json(view.head.as_ref()),
        question => path::at_once(&view, sources, &path::PathQuestion::of(question)?, now_us)?,
    };
    Some(answer.map(|answer| vec![answer]))
}

pub(crate) fn unknown_map(map: &MapName, catalog: &Catalog) -> ErrorReply {
    if let Some(damage) = catalog.damage(map) {
        return error(ErrorCode::Damaged, damage);
    }
    let was = match catalog.deletion(map) {
        Some(record) => format!(": {}", record.deletion.sentence(map)),
        None => String::new(),
    };
    let known = known_names(catalog.heads().iter().map(|head| &head.map));
    error(ErrorCode::UnknownMap, format!("there is no map {map} here ({known}){was}"))
}
