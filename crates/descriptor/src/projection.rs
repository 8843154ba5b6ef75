//! A linear map from pooled features to fewer, better numbers, fitted so that what changes between
//! visits to a place counts little and what differs between places counts much.

/// A matrix of `dimension` rows and `channels` columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Projection {
    rows: Vec<f32>,
    channels: usize,
}

/// Why the bytes are not a projection.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProjectionError {
    /// The size of the file does not fit the description.
    #[error("a projection of {channels} channels to {dimension} has {expected} bytes, not {found}")]
    Size {
        /// Columns.
        channels: usize,
        /// Rows.
        dimension: usize,
        /// Bytes that these need as little-endian `f32`.
        expected: usize,
        /// Bytes found.
        found: usize,
    },
    /// A number is infinite or NaN.
    #[error("a projection has a number that is not finite")]
    NotFinite,
}

impl Projection {
    /// Reads little-endian `f32`, row by row.
    ///
    /// # Errors
    /// [`ProjectionError`] when the size is not that of `dimension` rows of `channels`, or a number
    /// is not finite.
    pub fn parse(bytes: &[u8], channels: usize, dimension: usize) -> Result<Self, ProjectionError> {
        let expected = channels * dimension * size_of::<f32>();
        if bytes.len() != expected || channels == 0 {
            return Err(ProjectionError::Size { channels, dimension, expected, found: bytes.len() });
        }
        let number = |chunk: &[u8]| f32::from_le_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]);
        let rows: Vec<f32> = bytes.chunks_exact(size_of::<f32>()).map(number).collect();
        if rows.iter().any(|value| !value.is_finite()) {
            return Err(ProjectionError::NotFinite);
        }
        Ok(Self { rows, channels })
    }

    /// The product with `features`, one number per row.
    #[must_use]
    pub fn apply(&self, features: &[f32]) -> Vec<f32> {
        let product = |row: &[f32]| row.iter().zip(features).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        self.rows.chunks_exact(self.channels).map(|row| product(row) as f32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_and_applied_in_order() {
        let bytes: Vec<u8> = [1.0_f32, 0.0, 2.0, 0.0, 1.0, -1.0].iter().flat_map(|value| value.to_le_bytes()).collect();
        let projection = Projection::parse(&bytes, 3, 2).unwrap();
        assert_eq!(projection.apply(&[1.0, 2.0, 3.0]), [7.0, -1.0]);
        assert!(matches!(Projection::parse(&bytes, 3, 3), Err(ProjectionError::Size { expected: 36, found: 24, .. })));
        assert!(Projection::parse(&[], 0, 0).is_err());
        let infinite = f32::INFINITY.to_le_bytes();
        assert_eq!(Projection::parse(&infinite, 1, 1), Err(ProjectionError::NotFinite));
    }
}
