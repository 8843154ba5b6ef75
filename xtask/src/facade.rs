//! The library `fht` stays light: without features it brings neither the simulator nor command
//! lines, bags or the ONNX Runtime to who depends on it.

use crate::Report;
use crate::source::{SourceError, output};
use std::path::Path;

/// Packages that integrators are spared.
const SPARED: [&str; 10] = [
    "clap",
    "fht-bag",
    "fht-descriptor",
    "fht-program",
    "fht-shared-world",
    "fht-sim",
    "indicatif",
    "mapper",
    "mcap",
    "ort",
];

pub(crate) fn check(root: &Path) -> Result<Report, SourceError> {
    let args = ["tree", "--package", "fht", "--edges", "normal", "--prefix", "none", "--format", "{p}"];
    let tree = output(root, "cargo", &args)?;
    let mut findings: Vec<String> = tree
        .lines()
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| SPARED.contains(name))
        .map(|name| format!("fht -> … -> {name}"))
        .collect();
    findings.sort();
    findings.dedup();
    Ok(Report { title: "packages that the library fht should spare its users", findings, is_rule: true })
}
