//! Relocalization on real recordings: a robot is set down somewhere in a log, on a map of an
//! earlier part of it, of another log, or of a file, and says where it is.
//!
//! ```text
//!  log ──→ RecordedLog (SLAM over all of it: the truth) ──→ set_down ──→ LogDrive ─┐
//!  map ──→ KnownMap ───────────────────────────────────────────┘                ├─→ judge ──→ figures
//!                └──→ Registration (where the log's places lie in the map) ─────┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `log` | frames, and where they were taken: [`RecordedLog`] |
//! | `known_map` | what the robot is given: [`KnownMap`] |
//! | `set_down` | a robot that follows the log from somewhere, and what it says: [`set_down`] |
//! | `registration` | where the log's places lie in the map: [`Registration`] |
//! | `judgement` | right, wrong or none: [`judge`] |
//! | `figures` | all drives together: [`RecordedFigures`] |
//! | `calibration` | what grounds are worth, fitted to looks: [`calibrate`] |

mod calibration;
mod figures;
mod judgement;
mod known_map;
mod log;
mod registration;
mod set_down;

pub use calibration::{Calibration, Look, calibrate};
pub use figures::{RecordedFigures, Reliability, STATED};
pub use judgement::{JudgedDrive, JudgedStatement, judge};
pub use known_map::KnownMap;
pub use log::{RecordedError, RecordedLog};
pub use registration::Registration;
pub use set_down::{LogDrive, Statement, set_down, starts};
