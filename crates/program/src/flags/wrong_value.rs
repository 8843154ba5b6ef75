//! Values of flags that are no numbers, in words.

use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::error::Error as _;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};

/// Why `text` is not the whole number that it should be.
pub(super) fn no_whole_number(text: &str, error: &ParseIntError) -> String {
    // Where no number may be negative, the sign is no digit.
    let is_negative = text.strip_prefix('-').is_some_and(|rest| rest.parse::<u64>().is_ok());
    match error.kind() {
        IntErrorKind::PosOverflow => format!("'{text}' is too large"),
        IntErrorKind::NegOverflow => format!("'{text}' is too small"),
        _ if is_negative => format!("'{text}' is below 0"),
        _ => format!("'{text}' is no whole number"),
    }
}

/// The same error with words of ours, if a value is no number: clap says what Rust says, such as
/// `invalid digit found in string`.
pub(super) fn in_words(error: clap::Error, command: &Command) -> clap::Error {
    match sentence(&error) {
        Some(sentence) => {
            let message = format!("{sentence}\n\nFor more information, try '--help'.\n");
            clap::Error::raw(ErrorKind::ValueValidation, message).with_cmd(command)
        }
        None => error,
    }
}

fn sentence(error: &clap::Error) -> Option<String> {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.as_str()),
        _ => None,
    };
    let (flag, value, source) = (text(ContextKind::InvalidArg)?, text(ContextKind::InvalidValue)?, error.source()?);
    let whole = source.downcast_ref::<ParseIntError>().map(|error| no_whole_number(value, error));
    let any = source.downcast_ref::<ParseFloatError>().map(|_| format!("'{value}' is no number"));
    Some(format!("invalid value '{value}' for '{flag}': {}", whole.or(any)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};

    #[derive(Debug, Parser)]
    struct Lamp {
        #[arg(long, value_name = "NUMBER")]
        seed: Option<u64>,
        #[arg(long, value_name = "N")]
        lamps: Option<u16>,
        #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
        reach: Option<f64>,
    }

    fn said(flag: &str, value: &str) -> String {
        let mut command = Lamp::command();
        let given = command.try_get_matches_from_mut(["lamp", &format!("{flag}={value}")]);
        given.map_err(|error| in_words(error, &command)).map_or_else(|error| error.to_string(), |_| String::new())
    }

    #[test]
    fn what_is_no_number_is_told_in_words() {
        for (flag, value, reason) in [
            ("--seed", "abc", "'abc' is no whole number"),
            ("--seed", "1.5", "'1.5' is no whole number"),
            ("--seed", "-1", "'-1' is below 0"),
            ("--seed", "99999999999999999999", "'99999999999999999999' is too large"),
            ("--lamps", "x", "'x' is no whole number"),
            ("--reach", "foo", "'foo' is no number"),
        ] {
            let said = said(flag, value);
            let begin = format!("error: invalid value '{value}' for '{flag} <");
            assert!(said.starts_with(&begin) && said.contains(&format!(">': {reason}\n")), "{said}");
            assert!(said.ends_with("For more information, try '--help'.\n"), "{said}");
        }
        assert!([said("--seed", "7"), said("--reach", "-0.5")].iter().all(String::is_empty));
        assert!(said("--colour", "red").contains("unexpected argument"));
    }
}
