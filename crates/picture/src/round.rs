//! Lengths that people like: 1, 2 and 5 times a power of ten.

/// What is lost by rounding is no difference.
const SLACK: f64 = 1e-9;

/// Round lengths around `metres`, ascending.
fn around(metres: f64) -> [f64; 5] {
    let power = 10f64.powf(metres.max(f64::MIN_POSITIVE).log10().floor());
    [0.5, 1.0, 2.0, 5.0, 10.0].map(|factor| factor * power)
}

/// The greatest round length that is not above `metres`.
pub(crate) fn at_most(metres: f64) -> f64 {
    let fits = |length: &f64| *length <= metres * (1.0 + SLACK);
    around(metres).into_iter().rfind(fits).unwrap_or(metres)
}

/// The least round length that is not below `metres`.
pub(crate) fn at_least(metres: f64) -> f64 {
    let fits = |length: &f64| *length >= metres * (1.0 - SLACK);
    around(metres).into_iter().find(fits).unwrap_or(metres)
}

/// The multiples of `step` from `least` to `most`.
pub(crate) fn multiples(step: f64, least: f64, most: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((least / step - SLACK).ceil() as i64, (most / step + SLACK).floor() as i64);
    (first..=last).map(move |count| count as f64 * step)
}

/// A multiple of the round length `step` as text, with the decimals that `step` needs.
pub(crate) fn text(metres: f64, step: f64) -> String {
    let decimals = if step >= 1.0 { 0 } else { (-step.log10()).ceil() as usize };
    // No minus before zero.
    let metres = if metres.abs() < step * 0.5 { 0.0 } else { metres };
    format!("{metres:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lengths_are_those_that_people_like() {
        for (metres, below, above) in [
            (1.0, 1.0, 1.0),
            (1.7, 1.0, 2.0),
            (4.9, 2.0, 5.0),
            (12.0, 10.0, 20.0),
            (99.0, 50.0, 100.0),
            (0.3, 0.2, 0.5),
        ] {
            assert!((at_most(metres) - below).abs() < 1e-9, "{metres}: {}", at_most(metres));
            assert!((at_least(metres) - above).abs() < 1e-9, "{metres}: {}", at_least(metres));
        }
        let texts: Vec<_> = multiples(0.5, -0.7, 1.0).map(|metres| text(metres, 0.5)).collect();
        assert_eq!(texts, ["-0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(text(20.0, 5.0), "20");
    }

    proptest! {
        #[test]
        fn they_are_near_what_was_asked_for(metres in 1e-3_f64..1e5) {
            prop_assert!(at_most(metres) <= metres * 1.000_001 && at_most(metres) >= metres / 2.500_001);
            prop_assert!(at_least(metres) >= metres / 1.000_001 && at_least(metres) <= metres * 2.500_001);
        }
    }
}
