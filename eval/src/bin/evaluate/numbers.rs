//! Numbers of flags that make sense.

use fht_program::flags::number;

/// The metres that somebody may drive.
pub fn metres(text: &str) -> Result<f64, String> {
    number(text, 0.1..=1e5)
}

/// A share of something.
pub fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1.0)
}

/// A factor of the wheels' drift.
pub fn drift(text: &str) -> Result<f64, String> {
    number(text, 0.0..=100.0)
}

/// How far apart robots begin, metres; `inf` is anywhere.
pub fn apart(text: &str) -> Result<f64, String> {
    if text == "inf" { Ok(f64::INFINITY) } else { metres(text).map_err(|error| format!("{error}, nor inf")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_sense_is_refused() {
        for text in ["nan", "-1", "1e300", "many"] {
            assert!([metres(text), share(text), drift(text), apart(text)].iter().all(Result::is_err), "{text}");
        }
        assert!(metres("inf").is_err() && metres("0").is_err());
        assert_eq!((apart("inf"), share("0.5"), drift("2")), (Ok(f64::INFINITY), Ok(0.5), Ok(2.0)));
    }
}
