//! What a program tells on standard output.

use std::fmt::Arguments;
use std::io::Write;

/// Writes a line to standard output. Whoever reads it may stop when it has seen enough, as `head`
/// does: what is left goes nowhere, and the program goes on.
pub fn write_line(line: Arguments<'_>) {
    let _ = writeln!(std::io::stdout().lock(), "{line}");
}

/// Prints a line as [`println!`](std::println) does, but for readers that may stop reading
/// ([`write_line`]).
#[macro_export]
macro_rules! print_line {
    ($($line:tt)*) => { $crate::write_line(::core::format_args!($($line)*)) };
}
