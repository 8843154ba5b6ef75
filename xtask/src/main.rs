//! Checks of the house, and the tests, for CI and for everybody: `cargo xtask house`, `cargo xtask
//! test`.
//!
//! | module | what it checks |
//! | --- | --- |
//! | [`arrows`] | crates depend on each other as `docs/architecture.md` says, and in no other way |
//! | [`facade`] | the library `fht` is light without its features |
//! | [`circles`] | no modules of a crate use each other in a circle |
//! | [`names`] | no public type name stands twice |
//! | [`sizes`] | no function over 80 lines; files over 400 lines are listed |
//! | [`prose`] | comments and documents keep to 100 columns |
//! | [`paper_map`] | what `docs/paper-map.md` names is there |
//! | [`supply`] | what comes from others is what `deny.toml` allows; the bill of materials |
//! | [`test_programs`] | all tests, several programs at a time |
//! | [`source`] | the workspace's files |

mod arrows;
mod circles;
mod facade;
mod names;
mod paper_map;
mod prose;
mod sizes;
mod source;
mod supply;
mod test_programs;

use source::Source;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const USAGE: &str = "\
Usage: cargo xtask house [--all]
       cargo xtask test
       cargo xtask sbom [FILE]

house checks the house: arrows between crates, circles of modules, names, sizes, prose, the paper's
map, and what comes from others (deny.toml). It prints a line for each finding, all of them with
--all, and exits with 1 if a rule is broken.

test builds and runs all tests of the workspace, several programs at a time; those in documentation
come last.

sbom writes what the programs are made of, as CycloneDX 1.5 in JSON [default: sbom.cdx.json].
";

/// Findings of one kind that are printed without `--all`.
const SHOWN: usize = 20;

/// What one check found.
pub(crate) struct Report {
    /// What was counted, for the summary.
    pub(crate) title: &'static str,
    /// A line for each finding.
    pub(crate) findings: Vec<String>,
    /// Whether a finding breaks a rule; else it is only told.
    pub(crate) is_rule: bool,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["house"] => check(&root()).map(|reports| tell(&reports, false)),
        ["house", "--all"] => check(&root()).map(|reports| tell(&reports, true)),
        ["test"] => return test(&root()),
        ["sbom"] => write_bill(Path::new("sbom.cdx.json")),
        ["sbom", file] if !file.starts_with('-') => write_bill(Path::new(file)),
        _ => {
            eprint!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    done.unwrap_or_else(|error| {
        eprintln!("xtask: {error}");
        ExitCode::FAILURE
    })
}

fn test(root: &Path) -> ExitCode {
    match test_programs::run(root) {
        Ok(failed) if failed.is_empty() => ExitCode::SUCCESS,
        Ok(failed) => {
            let failed: Vec<String> = failed.iter().map(|source| source.display().to_string()).collect();
            eprintln!("xtask: tests failed in {}", failed.join(", "));
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}

fn write_bill(file: &Path) -> Result<ExitCode, source::SourceError> {
    let bill = supply::bill::of_materials(&root())?;
    std::fs::write(file, bill).map_err(|source| source::SourceError::Write { path: file.to_owned(), source })?;
    println!("{}", file.display());
    Ok(ExitCode::SUCCESS)
}

fn check(root: &Path) -> Result<Vec<Report>, source::SourceError> {
    let sources = Source::all(root)?;
    Ok(vec![
        arrows::check(root)?,
        facade::check(root)?,
        circles::check(&sources),
        names::check(&sources),
        sizes::functions(&sources),
        sizes::files(&sources),
        prose::check(root, &sources)?,
        paper_map::check(root)?,
        supply::check(root)?,
        Report {
            title: "lines of shipped code (without comments, blank lines and tests)",
            findings: vec![sizes::shipped(&sources).to_string()],
            is_rule: false,
        },
    ])
}

fn tell(reports: &[Report], shows_all: bool) -> ExitCode {
    let mut is_well = true;
    for report in reports {
        let count = report.findings.len();
        is_well &= count == 0 || !report.is_rule;
        let mark = if count == 0 {
            "ok"
        } else if report.is_rule {
            "BROKEN"
        } else {
            "told"
        };
        println!("{mark:7}{count:5}  {}", report.title);
        let shown = if shows_all { count } else { SHOWN };
        report.findings.iter().take(shown).for_each(|finding| println!("               {finding}"));
        if count > shown {
            println!("               … and {} more (--all)", count - shown);
        }
    }
    if is_well { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
