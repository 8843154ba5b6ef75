//! Which part of a building an explorer has seen, coarsely: so that another one need not look there
//! again. No part of the map, which says too little of what was seen: it is told among explorers
//! while they work.

use crate::model::ids::AuthorId;
use crate::model::validate::{Invalid, Validate, check};
use serde::{Deserialize, Serialize};

/// What an explorer says of a square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Square {
    /// It has not seen it.
    #[default]
    Unseen,
    /// It has seen it, or some of it, and nothing that stands there.
    Free,
    /// Something stands there.
    Occupied,
}

/// Squares of one kind that follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Run {
    /// What they are.
    pub square: Square,
    /// How many.
    pub length: u32,
}

/// Squares of the map frame, row by row from the south, each from the west.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeenArea {
    /// Who has seen it.
    pub author: AuthorId,
    /// The number of the newest increment that it had written then: what it had to say of the area.
    pub upto: u64,
    /// Side of a square, millimetres; square (i, j) reaches from (i, j) to (i + 1, j + 1) times
    /// this.
    pub square_mm: u16,
    /// Number of the first column.
    pub west: i32,
    /// Number of the first row.
    pub south: i32,
    /// Squares in a row.
    pub width: u16,
    /// Row by row, each as long as it can be.
    pub runs: Vec<Run>,
}

impl SeenArea {
    /// Sides of squares, millimetres: least and greatest.
    pub const SQUARES_MM: (u16, u16) = (20, 2000);
    /// Most squares: 200 m by 200 m of 0.1 m.
    pub const MAX_SQUARES: u64 = 4_000_000;
    /// Farthest square from the origin.
    pub const MAX_SQUARE: i32 = 1_000_000;

    /// Writes down squares, given row by row.
    #[must_use]
    pub fn runs_of(squares: impl IntoIterator<Item = Square>) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for square in squares {
            match runs.last_mut().filter(|run| run.square == square) {
                Some(run) => run.length += 1,
                None => runs.push(Run { square, length: 1 }),
            }
        }
        runs
    }

    /// The squares, row by row.
    pub fn squares(&self) -> impl Iterator<Item = Square> + '_ {
        self.runs.iter().flat_map(|run| std::iter::repeat_n(run.square, run.length as usize))
    }

    fn count(&self) -> u64 {
        self.runs.iter().map(|run| u64::from(run.length)).sum()
    }

    /// Whole rows.
    #[must_use]
    pub fn height(&self) -> usize {
        usize::try_from(self.count() / u64::from(self.width.max(1))).unwrap_or(0)
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
        let squares = self.count();
        check(squares <= Self::MAX_SQUARES, || format!("a seen area of {squares} squares"))?;
        check(squares.is_multiple_of(u64::from(self.width)), || "a seen area whose last row is not whole".to_owned())?;
        check(self.runs.iter().all(|run| run.length > 0), || "a seen area with a run of nothing".to_owned())?;
        let is_shortest = self.runs.windows(2).all(|pair| pair[0].square != pair[1].square);
        check(is_shortest, || "a seen area with two runs of one kind in a row".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{decode, encode};
    use proptest::prelude::*;

    fn area(width: u16, squares: &[Square]) -> SeenArea {
        let runs = SeenArea::runs_of(squares.iter().copied());
        SeenArea { author: AuthorId(7), upto: 12, square_mm: 200, west: -3, south: 5, width, runs }
    }

    proptest! {
        #[test]
        fn what_was_seen_comes_through(width in 1_u16..40, rows in prop::collection::vec(any::<u64>(), 0..40)) {
            let square = |row: &u64, column: u16| match row >> (column % 60) & 3 {
                0 => Square::Unseen,
                1 => Square::Occupied,
                _ => Square::Free,
            };
            let squares: Vec<Square> =
                rows.iter().flat_map(|row| (0..width).map(move |column| square(row, column))).collect();
            let area = area(width, &squares);
            prop_assert_eq!(area.height(), rows.len());
            let again: SeenArea = decode(&encode(&area).expect("it is valid")).expect("it decodes");
            prop_assert_eq!(again.squares().collect::<Vec<_>>(), squares);
            prop_assert_eq!(again, area);
        }
    }

    #[test]
    fn areas_that_are_too_large_or_crooked_are_refused() {
        use Square::{Free, Occupied, Unseen};
        let run = |square, length| Run { square, length };
        let good = area(2, &[Free, Unseen, Occupied, Occupied]);
        assert!(good.validate().is_ok());
        for bad in [
            SeenArea { width: 0, ..good.clone() },
            SeenArea { width: 3, ..good.clone() },
            SeenArea { square_mm: 1, ..good.clone() },
            SeenArea { west: i32::MIN, ..good.clone() },
            SeenArea { runs: vec![run(Free, u32::MAX), run(Occupied, u32::MAX - 1)], ..good.clone() },
            SeenArea { runs: vec![run(Free, 1), run(Free, 3)], ..good.clone() },
            SeenArea { runs: vec![run(Free, 4), run(Unseen, 0)], ..good.clone() },
        ] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
    }
}
