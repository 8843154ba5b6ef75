//! `docs/paper-map.md` names files and what is in them, as `path/to/file.rs::item`: they are there.

use crate::Report;
use crate::source::{SourceError, read};
use std::path::Path;

const DOCUMENT: &str = "docs/paper-map.md";
/// Equations of the paper.
const EQUATIONS: u32 = 11;

pub(crate) fn check(root: &Path) -> Result<Report, SourceError> {
    let text = read(&root.join(DOCUMENT))?;
    let mut findings = Vec::new();
    // Every second piece is between backticks.
    for named in text.split('`').skip(1).step_by(2) {
        let Some((file, item)) = named.split_once(".rs::") else { continue };
        let file = format!("{file}.rs");
        match std::fs::read_to_string(root.join(&file)) {
            Err(_) => findings.push(format!("{file} is not there")),
            Ok(code) if !defines(&code, item) => findings.push(format!("{file} has no {item}")),
            Ok(_) => {}
        }
    }
    let lacks = |number: &u32| !text.contains(&format!("| {number} |"));
    findings.extend((1..=EQUATIONS).filter(lacks).map(|number| format!("{DOCUMENT} has no row for equation {number}")));
    Ok(Report { title: "items of the paper's map that are not there", findings, is_rule: true })
}

/// Whether a file defines an item, or a method of this name (`Type::method` looks for both).
fn defines(code: &str, item: &str) -> bool {
    item.split("::").all(|name| {
        let name = name.trim_end_matches("()");
        ["fn", "struct", "enum", "const", "trait", "type", "mod"].iter().any(|kind| {
            let wanted = format!("{kind} {name}");
            let is_whole = |at: usize| {
                let next = code[at + wanted.len()..].chars().next();
                !next.is_some_and(|next| next.is_alphanumeric() || next == '_')
            };
            code.match_indices(&wanted).any(|(at, _)| is_whole(at))
        })
    })
}
