//! The configuration file: one documented TOML file for each robot or server.
//!
//! A program's configuration is an ordinary structure with defaults. Its keys, their types and
//! their documentation come from its JSON Schema, so what the file says, what `--print-config`
//! writes and what the documentation says are one.
//!
//! Precedence: defaults, then the file, then flags. A section that the file mentions keeps the
//! defaults of the keys that it leaves out, also where a nested default differs from that of its
//! type.

mod bounds;
mod contract;
mod printing;
mod reading;
mod schema;
mod tree;

pub use contract::{ConfigError, Configuration, PrintError, Problem, SECTIONS};

use std::path::Path;

/// Reads `file` over the defaults.
///
/// # Errors
/// [`ConfigError`] with the line and the key of whatever is unknown, of another type, or out of
/// range.
pub fn load<T: Configuration>(file: &Path) -> Result<T, ConfigError> {
    load_over(&T::default(), file)
}

/// As [`load`], over `defaults` in place of the type's.
///
/// # Errors
/// As [`load`].
pub fn load_over<T: Configuration>(defaults: &T, file: &Path) -> Result<T, ConfigError> {
    let text = std::fs::read_to_string(file).map_err(|source| ConfigError::Read { file: file.to_owned(), source })?;
    parse_over(defaults, &text, file)
}

/// Reads the text of a configuration file over the defaults. `file` names it in errors.
///
/// # Errors
/// As [`load`].
pub fn parse<T: Configuration>(text: &str, file: &Path) -> Result<T, ConfigError> {
    parse_over(&T::default(), text, file)
}

/// As [`parse`], over `defaults` in place of the type's.
///
/// # Errors
/// As [`load`].
pub fn parse_over<T: Configuration>(defaults: &T, text: &str, file: &Path) -> Result<T, ConfigError> {
    reading::read(defaults, text, file)
}

/// Writes `config` as TOML, each key with its documentation and each key that is not set as a
/// comment. What [`parse`] makes of it is equal to `config`.
///
/// # Errors
/// When a value has no TOML, such as a number that is not finite.
pub fn print<T: Configuration>(config: &T) -> Result<String, PrintError> {
    printing::print(config)
}
