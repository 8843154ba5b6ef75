//! `journal`: what operators have changed, and who. The catalog has followed it: nothing is read.

use crate::access::RoleList;
use crate::catalog::MapView;
use crate::query::answer::reply::{Answer, json};
use crate::query::answer::sources::AnswerSources;
use fht_map::{OperatorChange, WriterRole, WriterRoles};
use fht_proto::AuthorId;
use fht_proto::api::reply::{ErrorReply, JournalCursor, JournalEntry, JournalReply};
use std::collections::{BTreeMap, BTreeSet};

/// So many changes that follow `after`.
pub(super) fn journal(
    view: &MapView,
    sources: &AnswerSources,
    (limit, after): (usize, Option<JournalCursor>),
) -> Result<Answer, ErrorReply> {
    let writers = sources.writers.as_ref().map(RoleList::now);
    // Who is listed as a robot only looked like an operator.
    let is_robot = |author| {
        let role = writers.as_ref().and_then(|writers| writers.role(author));
        role.is_some_and(|role| role != WriterRole::Operator)
    };
    let mut changes = view.journal.newest_first(after).filter(|(at, _)| !is_robot(at.author));
    let page: Vec<(JournalCursor, &OperatorChange)> = changes.by_ref().take(limit).collect();
    let next = page.last().filter(|_| changes.next().is_some()).map(|(at, _)| at.to_string());
    let names = names(view, sources, writers.as_deref(), page.iter().map(|(at, _)| at.author).collect());
    let entry = |(at, change): (JournalCursor, &OperatorChange)| JournalEntry {
        at_us: at.hlc_us,
        author: at.author,
        name: names.get(&at.author).cloned(),
        number: at.number,
        folded: change.is_folded,
        words: change.words.clone(),
    };
    let (map, version) = (view.head.map.clone(), view.head.version);
    json(&JournalReply { map, version, entries: page.into_iter().map(entry).collect(), next })
}

/// What authors are called, as far as anybody has said: the list of roles, operators, robots.
fn names(
    view: &MapView,
    sources: &AnswerSources,
    writers: Option<&WriterRoles>,
    authors: BTreeSet<AuthorId>,
) -> BTreeMap<AuthorId, String> {
    let listed = |author| writers.and_then(|writers| writers.name(author).map(str::to_owned));
    let known = |author| Some((author, listed(author).or_else(|| sources.operators.name(author))?));
    let mut names: BTreeMap<AuthorId, String> = authors.iter().filter_map(|author| known(*author)).collect();
    if names.len() < authors.len() {
        for (author, name) in sources.fleet.names(&view.head.map) {
            if authors.contains(&author) {
                names.entry(author).or_insert(name);
            }
        }
    }
    names
}
