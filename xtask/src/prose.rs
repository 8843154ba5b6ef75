//! Comments and documents keep to 100 columns, those of configuration and scripts, too. Tables,
//! links, code blocks and headings may be longer.

use crate::Report;
use crate::source::{Source, SourceError, files, read};
use std::path::Path;

const COLUMNS: usize = 100;
/// How comments of configuration and scripts begin.
const CONFIGURATION: [(&str, &str); 7] =
    [(".toml", "#"), (".yaml", "#"), (".yml", "#"), (".sh", "#"), (".py", "#"), (".service", "#"), (".json5", "//")];

pub(crate) fn check(root: &Path, sources: &[Source]) -> Result<Report, SourceError> {
    let mut findings = Vec::new();
    for source in sources {
        let mut is_code = false;
        for (number, line) in source.text.lines().enumerate() {
            let is_comment = line.trim_start().starts_with("//");
            is_code = is_comment && (is_code ^ comment(line).starts_with("```"));
            if is_comment && !is_code && is_long(line) && !is_exempt(line) {
                findings.push(format!("{}:{}", source.path, number + 1));
            }
        }
    }
    for path in files(root, ".md")? {
        let text = read(&root.join(&path))?;
        let mut is_code = false;
        for (number, line) in text.lines().enumerate() {
            is_code ^= line.trim_start().starts_with("```");
            if !is_code && is_long(line) && !is_exempt(line) {
                findings.push(format!("{path}:{}", number + 1));
            }
        }
    }
    for (ending, mark) in CONFIGURATION {
        for path in files(root, ending)? {
            for (number, line) in read(&root.join(&path))?.lines().enumerate() {
                if line.trim_start().starts_with(mark) && is_long(line) && !is_exempt(line) {
                    findings.push(format!("{path}:{}", number + 1));
                }
            }
        }
    }
    Ok(Report { title: "lines of prose over 100 columns", findings, is_rule: true })
}

fn is_long(line: &str) -> bool {
    line.chars().count() > COLUMNS
}

/// What a comment says.
fn comment(line: &str) -> &str {
    line.trim_start().trim_start_matches(['/', '!']).trim_start()
}

/// Rows of tables, and lines that are one long word: a link or a path.
fn is_exempt(line: &str) -> bool {
    let text = comment(line);
    text.starts_with('|') || text.trim_start_matches(['[', '*', '-', ' ']).split_whitespace().count() <= 2
}
