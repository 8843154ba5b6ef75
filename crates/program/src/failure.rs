//! How a program ends that does not what it was told: a sentence, and an exit code.

use std::fmt::Display;
use std::process::ExitCode;

/// Why a program ends without having done what it was told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramFailure {
    sentence: String,
    is_input: bool,
}

impl ProgramFailure {
    /// Wrong usage or bad input: given once more it fails again. Exit code 2.
    #[must_use]
    pub fn of_input(reason: impl Display) -> Self {
        Self::of(true, reason)
    }

    /// What was asked for makes sense, but failed. Exit code 1.
    #[must_use]
    pub fn of_run(reason: impl Display) -> Self {
        Self::of(false, reason)
    }

    /// One or the other.
    #[must_use]
    pub fn of(is_input: bool, reason: impl Display) -> Self {
        Self { sentence: reason.to_string(), is_input }
    }

    /// Says it on standard error, as `program`; returns the code to exit with.
    #[must_use]
    pub fn tell(&self, program: &str) -> ExitCode {
        crate::tell_line!("{program}: {}", self.sentence);
        if self.is_input { ExitCode::from(2) } else { ExitCode::FAILURE }
    }
}
