//! A bit stream of small whole numbers: Golomb-Rice codes whose parameter follows what was coded
//! lately, as in LOCO-I (Weinberger, Seroussi and Sapiro, IEEE Trans. Image Processing 2000). Whole
//! numbers only, so that every machine writes the same bits.
//!
//! A value `v` is its quotient `v >> k` in ones and a zero, then its `k` low bits. A quotient of
//! [`LONGEST_UNARY`] or more is that many ones and the rest as an Elias gamma code, so that a jump
//! costs some thirty bits.

/// Quotients below this are written in ones.
const LONGEST_UNARY: u32 = 12;
/// The mean follows with this weight: 2^-3 for each value.
const MEAN_SHIFT: u32 = 3;
/// What one value adds to the mean at most: a jump says little of what comes after it.
const MEAN_CAP: u32 = 80;

/// A stream that ends too early, or a code that no writer makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a bit stream that is cut or damaged")]
pub(crate) struct Damaged;

/// What is expected of the next value: the mean of the last ones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expectation {
    /// The mean, times 2^[`MEAN_SHIFT`].
    sum: u32,
}

impl Expectation {
    /// Before the first value. `mean` is at most 2^16.
    pub(crate) fn of(mean: u16) -> Self {
        Self { sum: u32::from(mean) << MEAN_SHIFT }
    }

    /// How many low bits are written as they are: the binary logarithm of the mean.
    fn low_bits(self) -> u32 {
        (self.sum >> MEAN_SHIFT).checked_ilog2().unwrap_or(0)
    }

    fn learn(&mut self, value: u32) {
        self.sum = self.sum - (self.sum >> MEAN_SHIFT) + value.min(MEAN_CAP);
    }
}

/// Writes bits, the highest of each byte first.
#[derive(Debug, Default)]
pub(crate) struct BitWriter {
    bytes: Vec<u8>,
    /// Bits used in the last byte, 0 for all of them.
    used: u32,
}

impl BitWriter {
    fn bit(&mut self, bit: bool) {
        if self.used == 0 {
            self.bytes.push(0);
        }
        if let Some(last) = self.bytes.last_mut().filter(|_| bit) {
            *last |= 0x80 >> self.used;
        }
        self.used = (self.used + 1) % 8;
    }

    fn bits(&mut self, value: u32, count: u32) {
        (0..count).rev().for_each(|at| self.bit(value >> at & 1 == 1));
    }

    /// Writes a value below 2^31.
    pub(crate) fn put(&mut self, value: u32, expected: &mut Expectation) {
        let low_bits = expected.low_bits();
        let quotient = value >> low_bits;
        (0..quotient.min(LONGEST_UNARY)).for_each(|_| self.bit(true));
        if quotient < LONGEST_UNARY {
            self.bit(false);
        } else {
            let rest = quotient - LONGEST_UNARY + 1;
            let more = rest.ilog2();
            self.bits(0, more);
            self.bits(rest, more + 1);
        }
        self.bits(value, low_bits);
        expected.learn(value);
    }

    /// The bytes, filled up with zeros to `least`.
    pub(crate) fn finish(mut self, least: usize) -> Vec<u8> {
        if self.bytes.len() < least {
            self.bytes.resize(least, 0);
        }
        self.bytes
    }
}

/// Reads what a [`BitWriter`] wrote.
#[derive(Debug)]
pub(crate) struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    fn bit(&mut self) -> Result<bool, Damaged> {
        let byte = self.bytes.get(self.at / 8).ok_or(Damaged)?;
        let bit = byte << (self.at % 8) & 0x80 != 0;
        self.at += 1;
        Ok(bit)
    }

    fn bits(&mut self, count: u32) -> Result<u32, Damaged> {
        (0..count).try_fold(0, |value, _| Ok(value << 1 | u32::from(self.bit()?)))
    }

    /// Reads a value.
    pub(crate) fn take(&mut self, expected: &mut Expectation) -> Result<u32, Damaged> {
        let low_bits = expected.low_bits();
        let mut quotient = 0;
        while quotient < LONGEST_UNARY && self.bit()? {
            quotient += 1;
        }
        if quotient == LONGEST_UNARY {
            let mut more = 0;
            while !self.bit()? {
                more += 1;
                if more > 30 {
                    return Err(Damaged);
                }
            }
            let rest = 1 << more | self.bits(more)?;
            quotient = LONGEST_UNARY - 1 + rest;
        }
        let high = quotient.checked_mul(1 << low_bits).filter(|high| *high < 1 << 31).ok_or(Damaged)?;
        let value = high | self.bits(low_bits)?;
        expected.learn(value);
        Ok(value)
    }

    /// Bytes that were not begun.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at.div_ceil(8)
    }
}

/// A signed number as an unsigned one, small if it is near 0. Magnitudes are below 2^30.
pub(crate) fn fold(value: i32) -> u32 {
    (value << 1 ^ value >> 31) as u32
}

/// What [`fold`] was given.
pub(crate) fn unfold(value: u32) -> i32 {
    (value >> 1) as i32 ^ -((value & 1) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn values_come_back(values in prop::collection::vec(prop_oneof![0..8_u32, 0..5000_u32, 0..1_u32 << 31], 0..200), mean: u16) {
            let mut writer = BitWriter::default();
            let mut expected = Expectation::of(mean);
            values.iter().for_each(|&value| writer.put(value, &mut expected));
            let bytes = writer.finish(0);
            let (mut reader, mut expected) = (BitReader::new(&bytes), Expectation::of(mean));
            for &value in &values {
                prop_assert_eq!(reader.take(&mut expected), Ok(value));
            }
            prop_assert_eq!(reader.left(), 0);
        }

        #[test]
        fn any_bytes_end(bytes in prop::collection::vec(any::<u8>(), 0..100), mean: u16) {
            let (mut reader, mut expected) = (BitReader::new(&bytes), Expectation::of(mean));
            let count = std::iter::from_fn(|| reader.take(&mut expected).ok()).count();
            prop_assert!(count <= 8 * bytes.len());
        }

        #[test]
        fn signs_come_back(value in -(1 << 30)..1_i32 << 30) {
            prop_assert_eq!(unfold(fold(value)), value);
        }
    }

    #[test]
    fn small_numbers_are_short_and_the_parameter_follows() {
        let bits = |values: &[u32]| {
            let (mut writer, mut expected) = (BitWriter::default(), Expectation::of(8));
            values.iter().for_each(|&value| writer.put(value, &mut expected));
            writer.finish(0).len() * 8
        };
        assert!(bits(&[0; 800]) <= 840);
        assert!(bits(&[60; 800]) <= 800 * 7 + 16);
        assert!(bits(&[2000]) <= 40, "a jump");
    }
}
