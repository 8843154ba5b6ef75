//! What a program gives out: lines on standard output, and files.

use std::fmt::Arguments;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

/// Writes a line to standard output. Whoever reads it may stop when it has seen enough, as `head`
/// does: what is left goes nowhere, and the program goes on.
pub fn write_line(line: Arguments<'_>) {
    let _ = writeln!(std::io::stdout().lock(), "{line}");
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
