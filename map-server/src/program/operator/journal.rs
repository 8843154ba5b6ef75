//! What operators have changed on a map.

use crate::clock::utc_text;
use crate::program::operator::asking::ask_json;
use crate::program::operator::error::OperatorError;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{JournalCursor, JournalEntry, JournalReply};
use fht_proto::{AuthorId, MapName};
use zenoh::Session;

/// So many are asked for at a time.
const PAGE: u64 = 200;

/// The newest `last` changes. Who asks is known by name, whatever the server knows.
pub(super) async fn ask(
    session: &Session,
    map: &MapName,
    operator: &str,
    last: u64,
) -> Result<JournalReply, OperatorError> {
    let key = Key::topic(map, Topic::Journal);
    let mut journal: JournalReply = ask_json(session, &format!("{key}?limit={}", last.min(PAGE))).await?;
    while let Some(after) = journal.next.take() {
        let left = last.saturating_sub(journal.entries.len() as u64);
        if left == 0 {
            journal.next = Some(after);
            break;
        }
        let page: JournalReply = ask_json(session, &format!("{key}?limit={};after={after}", left.min(PAGE))).await?;
        journal.entries.extend(page.entries);
        // Places in a journal descend, or it would not end.
        let descends = |next: &String| next.parse::<JournalCursor>().ok() < after.parse().ok();
        journal.next = page.next.filter(descends);
    }
    let me = AuthorId::of_robot(operator);
    for entry in journal.entries.iter_mut().filter(|entry| entry.author == me) {
        entry.name.get_or_insert_with(|| operator.to_owned());
    }
    Ok(journal)
}

/// A line for each change, the newest first.
pub(super) fn in_words(journal: &JournalReply) -> String {
    if journal.entries.is_empty() {
        return format!("no change by an operator is known on map {}", journal.map);
    }
    let line = |entry: &JournalEntry| {
        let who = entry.name.clone().unwrap_or_else(|| entry.author.to_string());
        let folded = if entry.folded { " (folded: what is left of it)" } else { "" };
        format!("{}  {who}  {}{folded}", utc_text(entry.at_us), entry.words.join("; "))
    };
    journal.entries.iter().map(line).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_a_line_whatever_its_clock() {
        let map: MapName = "museum".parse().unwrap_or_else(|error| panic!("{error}"));
        let entry = |at_us, name: Option<&str>| JournalEntry {
            at_us,
            author: AuthorId(0xa),
            name: name.map(str::to_owned),
            number: 1,
            folded: at_us == u64::MAX,
            words: vec!["place dock is taken away".to_owned()],
        };
        let entries = vec![entry(u64::MAX, None), entry(1_795_824_000_000_000, Some("ada"))];
        let text = in_words(&JournalReply { map: map.clone(), version: 2, entries, next: None });
        let expected = "9999-12-31T23:59:59Z  0000000a  place dock is taken away (folded: what is left of it)\n\
                        2026-11-28T00:00:00Z  ada  place dock is taken away";
        assert_eq!(text, expected);
        let none = in_words(&JournalReply { map, version: 0, entries: Vec::new(), next: None });
        assert!(none.starts_with("no change by an operator is known"), "{none}");
    }
}
