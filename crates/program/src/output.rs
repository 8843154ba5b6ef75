//! What a program gives out: lines on standard output, and files.

use std::fmt::Arguments;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether standard output has lost something that somebody wanted.
static IS_LOST: AtomicBool = AtomicBool::new(false);

/// Writes a line to standard output. Whoever reads it may stop when it has seen enough, as `head`
/// does: what is left goes nowhere, and the program goes on. Where the line cannot be written for
/// another reason, such as a full disk, that is said once, and [`exit_code`] knows.
pub fn write_line(line: Arguments<'_>) {
    written(writeln!(io::stdout().lock(), "{line}"));
}

/// Writes a line to standard error, if it takes one. Where it does not, such as a log on a full
/// disk, nobody is left to tell, and the program goes on.
pub fn write_error_line(line: Arguments<'_>) {
    // In one piece, for a log that several programs write.
    let _ = io::stderr().lock().write_all(format!("{line}\n").as_bytes());
}

/// What came of writing to standard output, as [`write_line`] has it.
pub(crate) fn written(outcome: io::Result<()>) {
    if let Err(error) = outcome
        && is_loss(&error)
        && !IS_LOST.swap(true, Ordering::Relaxed)
    {
        // Nobody is left to tell of what is lost there.
        let _ = writeln!(io::stderr(), "standard output cannot be written: {error}");
    }
}

/// Whether somebody wanted what was not written: a reader that has closed its pipe did not.
fn is_loss(error: &io::Error) -> bool {
    error.kind() != ErrorKind::BrokenPipe
}

/// What a program that would end with `code` ends with: what it was asked for is not done if its
/// output is lost.
#[must_use]
pub fn exit_code(code: ExitCode) -> ExitCode {
    if code == ExitCode::SUCCESS && IS_LOST.load(Ordering::Relaxed) { ExitCode::FAILURE } else { code }
}

/// Writes a file. When the disk does not take all of it, nothing of it stays.
///
/// # Errors
/// What the system says.
pub fn write_output(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut open = File::create(file)?;
    let written = open.write_all(bytes);
    if written.is_err() && open.metadata().is_ok_and(|it| it.is_file()) {
        let _ = std::fs::remove_file(file); // what failed is said
    }
    written
}

/// Prints a line as [`println!`](std::println) does, but for readers that may stop reading
/// ([`write_line`]).
#[macro_export]
macro_rules! print_line {
    ($($line:tt)*) => { $crate::write_line(::core::format_args!($($line)*)) };
}

/// Prints a line as [`eprintln!`](std::eprintln) does, but goes on where standard error cannot be
/// written ([`write_error_line`]).
#[macro_export]
macro_rules! tell_line {
    ($($line:tt)*) => { $crate::write_error_line(::core::format_args!($($line)*)) };
}

#[cfg(test)]
mod tests {
    use super::*;

    // One test, since what is lost is the process's.
    #[test]
    fn output_that_is_lost_fails_the_program_and_a_closed_pipe_does_not() {
        let after = |kind: ErrorKind| {
            written(Err(kind.into()));
            [exit_code(ExitCode::SUCCESS), exit_code(ExitCode::from(2))]
        };
        written(Ok(()));
        assert_eq!(after(ErrorKind::BrokenPipe), [ExitCode::SUCCESS, ExitCode::from(2)]);
        assert_eq!(after(ErrorKind::StorageFull), [ExitCode::FAILURE, ExitCode::from(2)]);
    }
}
