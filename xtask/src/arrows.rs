//! The arrows between crates: those of the block `arrows` in `docs/architecture.md`, and no others.
//!
//! A line of the block is `crate -> dependency dependency (optional)`. Dependencies for tests alone
//! do not count.

use crate::Report;
use crate::source::{SourceError, output, read};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const DOCUMENT: &str = "docs/architecture.md";
const BEGIN: &str = "```arrows\n";

type Arrows = BTreeMap<String, BTreeSet<String>>;

pub(crate) fn check(root: &Path) -> Result<Report, SourceError> {
    let drawn = drawn(root)?;
    let real = real(root)?;
    let mut findings = Vec::new();
    let crates: BTreeSet<&String> = drawn.keys().chain(real.keys()).collect();
    let none = BTreeSet::new();
    for name in crates {
        let (drawn, real) = (drawn.get(name), real.get(name));
        match (drawn, real) {
            (None, _) => findings.push(format!("{name} is not in {DOCUMENT}")),
            (_, None) => findings.push(format!("{DOCUMENT} has {name}, the workspace does not")),
            _ => {}
        }
        let (drawn, real) = (drawn.unwrap_or(&none), real.unwrap_or(&none));
        findings.extend(real.difference(drawn).map(|to| format!("{name} -> {to} is not in {DOCUMENT}")));
        findings.extend(drawn.difference(real).map(|to| format!("{name} -> {to} is drawn, and nothing needs it")));
    }
    Ok(Report { title: "arrows between crates that the architecture does not have", findings, is_rule: true })
}

fn drawn(root: &Path) -> Result<Arrows, SourceError> {
    let path = root.join(DOCUMENT);
    let text = read(&path)?;
    let lacks = || SourceError::Lacks { path: path.clone(), what: "block of arrows" };
    let block = text.split_once(BEGIN).and_then(|(_, rest)| rest.split_once("```")).ok_or_else(lacks)?.0;
    // An indented line goes on with the one above it.
    let block = block.replace("\n ", " ");
    let lines = block.lines().filter(|line| !line.trim().is_empty());
    Ok(lines
        .map(|line| {
            let (from, to) = line.split_once("->").unwrap_or((line, ""));
            let to = to.split_whitespace().map(|name| name.trim_matches(['(', ')', ',']).to_owned());
            (from.trim().to_owned(), to.filter(|name| !name.is_empty() && name != "-").collect())
        })
        .collect())
}

fn real(root: &Path) -> Result<Arrows, SourceError> {
    let json = output(root, "cargo", &["metadata", "--format-version", "1", "--no-deps"])?;
    let broken = |reason: String| SourceError::Command { command: "cargo metadata", reason };
    let metadata: Value = serde_json::from_str(&json).map_err(|error| broken(error.to_string()))?;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let packages = list(&metadata["packages"]);
    let ours: BTreeSet<String> = packages.iter().map(|package| text(&package["name"])).collect();
    Ok(packages
        .iter()
        .map(|package| {
            let needed = list(&package["dependencies"]).into_iter().filter(|dependency| dependency["kind"].is_null());
            let names = needed.map(|dependency| text(&dependency["name"]));
            (text(&package["name"]), names.filter(|name| ours.contains(name)).collect())
        })
        .collect())
}
