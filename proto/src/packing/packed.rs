//! Scans and descriptors as they travel: a bit stream of what is not foreseen.
//!
//! A scan's ranges are whole multiples of a step (the greatest common divisor: 5 mm as the mapper
//! makes them). Returns and missing returns take turns, by their counts. A range is foreseen on the
//! straight line from the third last to the last range of its run, or where the last one was if
//! those differ by more than an eighth; the difference is written. A descriptor's values are
//! written as they are.
//!
//! The streams are of `rice.rs` and hold a bit of its own for each value but for missing returns; a
//! scan's is filled up to a byte for each [`BEAMS_PER_BYTE`] beams, so that little never unpacks to
//! much.

use crate::packing::rice::{BitReader, BitWriter, Damaged, Expectation, fold, unfold};

/// Beams of a scan for each byte of its stream at most.
const BEAMS_PER_BYTE: usize = 16;
/// Expected of the first run of returns, beams.
const RUN: u16 = 32;
/// Expected of a range's difference, folded, steps.
const DIFFERENCE: u16 = 8;
/// Expected of a descriptor's value, folded.
const VALUE: u16 = 8;

/// Why a scan or descriptor cannot be unpacked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum UnpackError {
    /// More than may be, or more than its bytes can hold.
    #[error("{count} values in {bytes} bytes")]
    Count {
        /// Values stated.
        count: u32,
        /// Bytes given.
        bytes: usize,
    },
    /// The stream is cut, has bytes left over, or says what no writer says.
    #[error("a bit stream that is cut or damaged")]
    Damaged,
}

impl From<Damaged> for UnpackError {
    fn from(_: Damaged) -> Self {
        Self::Damaged
    }
}

/// Where the next range of a run of returns is expected, given the ranges so far.
fn foreseen(run: &[i32], before: i32) -> i32 {
    match run {
        [.., third, _, _, last] if (last - third).abs() * 8 <= *last => last + (last - third) / 3,
        [.., second, last] if (last - second).abs() * 8 <= *last => 2 * last - second,
        [.., last] => *last,
        [] => before,
    }
}

fn greatest_common_divisor(a: u16, b: u16) -> u16 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// Ranges as they travel.
pub(crate) struct PackedRanges<'a> {
    /// What one step is worth, millimetres.
    pub(crate) step_mm: u16,
    /// How many ranges there are.
    pub(crate) beams: u32,
    /// The stream.
    pub(crate) stream: &'a [u8],
}

/// The step that all ranges are multiples of, millimetres, at least 1; and the stream.
pub(crate) fn pack_ranges(ranges_mm: &[u16]) -> (u16, Vec<u8>) {
    let step_mm = ranges_mm.iter().copied().fold(0, greatest_common_divisor).max(1);
    let mut writer = BitWriter::default();
    let (mut run_length, mut difference) = (Expectation::of(RUN), Expectation::of(DIFFERENCE));
    let mut runs = ranges_mm.chunk_by(|a, b| (*a == 0) == (*b == 0));
    let steps: Vec<i32> = ranges_mm.iter().map(|&mm| i32::from(mm / step_mm)).collect();
    if ranges_mm.first() == Some(&0) {
        writer.put(0, &mut run_length);
    }
    let (mut at, mut before) = (0, 0);
    for run in runs.by_ref() {
        writer.put(run.len() as u32, &mut run_length);
        let end = at + run.len();
        if run[0] != 0 {
            for next in at..end {
                writer.put(fold(steps[next] - foreseen(&steps[at..next], before)), &mut difference);
            }
            before = steps[end - 1];
        }
        at = end;
    }
    (step_mm, writer.finish(ranges_mm.len().div_ceil(BEAMS_PER_BYTE)))
}

/// The ranges in millimetres, of which there may be `most`.
///
/// # Errors
/// [`UnpackError`]
pub(crate) fn unpack_ranges(packed: &PackedRanges<'_>, most: usize) -> Result<Vec<u16>, UnpackError> {
    let count = packed.beams as usize;
    let fits = count <= most && count <= packed.stream.len() * BEAMS_PER_BYTE;
    if !fits {
        return Err(UnpackError::Count { count: packed.beams, bytes: packed.stream.len() });
    }
    let mut reader = BitReader::new(packed.stream);
    let (mut run_length, mut difference) = (Expectation::of(RUN), Expectation::of(DIFFERENCE));
    let mut steps: Vec<i32> = Vec::with_capacity(count);
    let (mut is_return, mut before) = (true, 0);
    while steps.len() < count {
        let length = reader.take(&mut run_length)? as usize;
        let begin = steps.len();
        let end = begin + length;
        // Only the first run may be empty.
        if end > count || (length == 0 && begin > 0) {
            return Err(UnpackError::Damaged);
        }
        if is_return {
            for _ in 0..length {
                let folded = reader.take(&mut difference)?;
                let next = foreseen(&steps[begin..], before).checked_add(unfold(folded));
                let next = next.filter(|next| (1..=i32::from(u16::MAX)).contains(next)).ok_or(UnpackError::Damaged)?;
                steps.push(next);
                before = next;
            }
        } else {
            steps.resize(end, 0);
        }
        is_return = !is_return;
    }
    if reader.left() > 0 && packed.stream.len() != count.div_ceil(BEAMS_PER_BYTE) {
        return Err(UnpackError::Damaged);
    }
    let in_mm = |steps: i32| steps.checked_mul(packed.step_mm.into()).and_then(|mm| u16::try_from(mm).ok());
    steps.into_iter().map(|steps| in_mm(steps).ok_or(UnpackError::Damaged)).collect()
}

/// The stream of a descriptor's values.
pub(crate) fn pack_values(values: &[i8]) -> Vec<u8> {
    let (mut writer, mut expected) = (BitWriter::default(), Expectation::of(VALUE));
    values.iter().for_each(|&value| writer.put(fold(value.into()), &mut expected));
    writer.finish(0)
}

/// `count` values of a descriptor, of which there may be `most`.
///
/// # Errors
/// [`UnpackError`]
pub(crate) fn unpack_values(count: u32, stream: &[u8], most: usize) -> Result<Vec<i8>, UnpackError> {
    let bytes = stream.len();
    let fits = |count: usize| count <= most && count <= 8 * bytes;
    let error = UnpackError::Count { count, bytes };
    let count = usize::try_from(count).ok().filter(|count| fits(*count)).ok_or(error)?;
    let (mut reader, mut expected) = (BitReader::new(stream), Expectation::of(VALUE));
    let mut value = || i8::try_from(unfold(reader.take(&mut expected)?)).map_err(|_| UnpackError::Damaged);
    let values = (0..count).map(|_| value()).collect::<Result<_, _>>()?;
    if reader.left() > 0 {
        return Err(UnpackError::Damaged);
    }
    Ok(values)
}
