//! Which part of a building an explorer has seen, coarsely: so that another one need not look there again. No part of the map, which
//! says too little of what was seen: it is told among explorers while they work.

use crate::envelope::Message;
use crate::ids::AuthorId;
use crate::validate::{Invalid, Validate, check};
use serde::{Deserialize, Serialize};

/// Squares of the map frame that an explorer has seen, row by row from the south, each from the west: lengths of runs, in turn of squares not
/// seen and squares seen. Only the first run may be of no length.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeenArea {
    /// Who has seen it.
    pub author: AuthorId,
    /// The number of the newest increment that it had written then: what it had to say of the area.
    pub upto: u64,
    /// Side of a square, millimetres; square (i, j) reaches from (i, j) to (i + 1, j + 1) times this.
    pub square_mm: u16,
    /// Number of the first column.
    pub west: i32,
    /// Number of the first row.
    pub south: i32,
    /// Squares in a row.
    pub width: u16,
    /// The runs.
    pub runs: Vec<u32>,
}

impl SeenArea {
    /// Sides of squares, millimetres: least and greatest.
    pub const SQUARES_MM: (u16, u16) = (20, 2000);
    /// Most squares: 400 m by 400 m of 0.2 m.
    pub const MAX_SQUARES: u64 = 4_000_000;
    /// Farthest square from the origin.
    pub const MAX_SQUARE: i32 = 1_000_000;

    /// Writes down squares, given row by row.
    #[must_use]
    pub fn runs_of(squares: impl IntoIterator<Item = bool>) -> Vec<u32> {
        let mut runs = vec![0];
        let mut is_seen = false;
        for square in squares {
            if square != is_seen {
                runs.push(0);
                is_seen = square;
            }
            if let Some(run) = runs.last_mut() {
                *run += 1;
            }
        }
        runs
    }

    /// The squares, row by row.
    pub fn squares(&self) -> impl Iterator<Item = bool> + '_ {
        let runs = self.runs.iter().enumerate();
        runs.flat_map(|(index, &length)| std::iter::repeat_n(index % 2 == 1, length as usize))
    }

    /// Whole rows.
    #[must_use]
    pub fn height(&self) -> usize {
        let squares: u64 = self.runs.iter().map(|&run| u64::from(run)).sum();
        usize::try_from(squares / u64::from(self.width.max(1))).unwrap_or(0)
    }
}

impl Validate for SeenArea {
    fn validate(&self) -> Result<(), Invalid> {
        let (least, greatest) = Self::SQUARES_MM;
        check((least..=greatest).contains(&self.square_mm), || {
            format!("squares of {} mm ({least} to {greatest} are allowed)", self.square_mm)
        })?;
        check(self.width > 0, || "rows of no squares".to_owned())?;
        let far = self.west.unsigned_abs().max(self.south.unsigned_abs());
        check(far <= Self::MAX_SQUARE.unsigned_abs(), || format!("a seen area {far} squares from the origin"))?;
        let squares: u64 = self.runs.iter().map(|&run| u64::from(run)).sum();
        check(squares <= Self::MAX_SQUARES, || format!("a seen area of {squares} squares"))?;
        check(squares.is_multiple_of(u64::from(self.width)), || "a seen area whose last row is not whole".to_owned())?;
        let is_plain = !self.runs.is_empty() && self.runs.iter().skip(1).all(|&run| run > 0);
        check(is_plain, || "a seen area without runs, or with an empty one".to_owned())
    }
}

impl Message for SeenArea {
    const KIND: u8 = 8;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{decode, encode};
    use proptest::prelude::*;

    fn area(width: u16, squares: &[bool]) -> SeenArea {
        let runs = SeenArea::runs_of(squares.iter().copied());
        SeenArea { author: AuthorId(7), upto: 12, square_mm: 200, west: -3, south: 5, width, runs }
    }

    proptest! {
        #[test]
        fn what_was_seen_comes_through(width in 1_u16..40, rows in prop::collection::vec(any::<u64>(), 0..40)) {
            let bit = |row: &u64, column: u16| row >> (column % 64) & 1 == 1;
            let squares: Vec<bool> =
                rows.iter().flat_map(|row| (0..width).map(move |column| bit(row, column))).collect();
            let area = area(width, &squares);
            prop_assert_eq!(area.height(), rows.len());
            let again: SeenArea = decode(&encode(&area).expect("it is valid")).expect("it decodes");
            prop_assert_eq!(again.squares().collect::<Vec<_>>(), squares);
            prop_assert_eq!(again, area);
        }
    }

    #[test]
    fn areas_that_are_too_large_or_crooked_are_refused() {
        let good = area(2, &[true, false, true, true]);
        assert!(good.validate().is_ok());
        for bad in [
            SeenArea { width: 0, ..good.clone() },
            SeenArea { width: 3, ..good.clone() },
            SeenArea { square_mm: 1, ..good.clone() },
            SeenArea { west: i32::MIN, ..good.clone() },
            SeenArea { runs: vec![u32::MAX; 100], ..good.clone() },
            SeenArea { runs: vec![0, 1, 0, 3], ..good.clone() },
            SeenArea { runs: Vec::new(), ..good.clone() },
        ] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
    }
}
