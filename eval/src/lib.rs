//! How good is it? What evaluations share: explored worlds, recorded drives, the compared systems,
//! and measures of their results. The programs `evaluate` and `recall` and the benchmarks are
//! beside it.
//!
//! ```text
//!  world ──→ Survey (explored once, kept) ──→ maps of all systems ─┐
//!    └─────→ RecordedDrive (recorded once) ────────────────────────┴─→ run_trial ──→ Ledger ──→ tables
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `survey` | a world explored with drifting wheels and our SLAM: [`Survey`] |
//! | `drive` | a recorded drive of a robot that does not know where it is: [`RecordedDrive`] |
//! | [`systems`] | what is compared: ours, AMCL, MR-TopoMap |
//! | `trial` | one system on one drive: [`run_trial`] |
//! | [`recorded`] | robots set down in recorded logs, right, wrong or none |
//! | `team` | several explorers in simulated time: [`explore_as_team`] |
//! | `merging` | maps made apart, merged, against the truth: [`merge_and_measure`] |
//! | `grid_map`, `storage`, `scan_coverage` | what maps take up, and how much they know |
//! | `ledger` | results that take minutes, kept as they come: [`Ledger`] |
//!
//! A result is computed once, however often an evaluation is interrupted:
//!
//! ```
//! use fht_eval::Ledger;
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("results.jsonl");
//! let mut ledger: Ledger<u64, f64> = Ledger::open(&path)?;
//! assert_eq!(ledger.get_or(3, || Ok::<_, std::io::Error>(0.25))?, 0.25);
//!
//! let mut again: Ledger<u64, f64> = Ledger::open(&path)?;
//! assert_eq!(again.get_or(3, || -> std::io::Result<f64> { unreachable!("it is known") })?, 0.25);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod drive;
mod grid_map;
mod ledger;
mod merging;
pub mod recorded;
mod scan_coverage;
mod storage;
mod survey;
pub mod systems;
mod team;
mod trial;

pub use drive::{DriveMoment, RecordedDrive, Sight};
pub use grid_map::GridMap;
pub use ledger::Ledger;
pub use merging::{MadeMap, Merged, merge_and_measure, quantile_x};
pub use scan_coverage::KnownShare;
pub use storage::Storage;
pub use survey::{ExplorationError, Survey, SurveyTask};
pub use team::{Member, MemberReport, TeamReport, TeamRun, TeamTask, explore_as_team};
pub use trial::{TrialFix, TrialOutcome, run_trial};
