//! What operators add to a map: names for places, zones with rules, releases. They are written as
//! increments like everything else.

use crate::model::geometry::FixedPoint;
use crate::model::ids::{AuthorId, ParseIdError, is_name, name_of};
use crate::model::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use unicode_normalization::UnicodeNormalization;
use unicode_normalization::char::is_combining_mark;

/// The name of a place or a zone: a letter, then letters, digits, `_` or `-`, 64 characters at
/// most, so that it is neither coordinates nor a node id in a query. Letters and digits are those
/// of all scripts, with the marks that belong to them (`Küche`, `倉庫`, `ห้อง`). However
/// it is typed, it is in the composed form (NFC), so that what looks alike is the same. It is in no
/// key.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Label(String);

/// The name of a release: 1 to 64 of `a-z A-Z 0-9 _ - .`, such as `2026-11-21.1`; neither a number,
/// which would be a version, nor `head`, which is the newest state.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ReleaseName(String);

fn is_label(text: &str) -> bool {
    let is_inner = |letter: char| letter.is_alphanumeric() || matches!(letter, '_' | '-') || is_combining_mark(letter);
    text.starts_with(char::is_alphabetic) && text.chars().all(is_inner) && text.chars().count() <= 64
}

/// The composed form of a text that may be a name. Longer ones are refused as they are.
fn composed(text: &str) -> String {
    /// Longest text that can be a name, bytes: a letter may be typed as several.
    const MAX_BYTES: usize = 1024;
    if text.len() > MAX_BYTES { text.to_owned() } else { text.nfc().collect() }
}

fn is_release_name(text: &str) -> bool {
    let is_taken = text == "head" || text.bytes().all(|byte| byte.is_ascii_digit());
    text.len() <= 64 && text.split('.').all(is_name) && !is_taken
}

name_of!(
    Label,
    is_label,
    "a name of a place or zone (a letter, then letters and digits of any script, _ or -; 64 characters at most)",
    composed
);
name_of!(
    ReleaseName,
    is_release_name,
    "a release name (1 to 64 letters, digits, _, - or single dots; neither a number nor head)"
);

/// What holds inside a zone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ZoneRule {
    /// No robot's centre may enter.
    KeepOut,
    /// Robots drive no faster than this, millimetres per second.
    SpeedLimit(u16),
}

impl ZoneRule {
    /// A speed limit, given in metres per second, in whole millimetres per second; none outside of
    /// 0.001 to 65 m/s.
    #[must_use]
    pub fn limit_mm_per_s(mps: f64) -> Option<u16> {
        (0.001..=65.0).contains(&mps).then(|| (mps * 1000.0).round() as u16)
    }
}

/// A part of the floor with a rule.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Zone {
    /// What holds there.
    pub rule: ZoneRule,
    /// Its border: a polygon in the map frame, closed by itself, that does not cross itself.
    pub corners: Vec<FixedPoint>,
}

impl Zone {
    /// Most corners.
    pub const MAX_CORNERS: usize = 256;

    /// Whether a point lies inside (even-odd; exact in whole millimetres).
    #[must_use]
    pub fn contains(&self, point: FixedPoint) -> bool {
        let wide = |p: FixedPoint| (i64::from(p.x_mm), i64::from(p.y_mm));
        let (x, y) = wide(point);
        let mut is_inside = false;
        for (a, b) in self.sides() {
            let ((ax, ay), (bx, by)) = (wide(a), wide(b));
            if (ay > y) != (by > y) {
                // Left of the side where it crosses the point's height.
                let across = (bx - ax) * (y - ay) - (x - ax) * (by - ay);
                is_inside ^= (across > 0) == (by > ay);
            }
        }
        is_inside
    }

    /// The sides of its border, from corner to corner.
    pub fn sides(&self) -> impl Iterator<Item = (FixedPoint, FixedPoint)> + '_ {
        let next = self.corners.iter().skip(1).chain(self.corners.first());
        self.corners.iter().copied().zip(next.copied())
    }

    /// Least area, square millimetres: a decimetre by a decimetre.
    pub const MIN_AREA_MM2: f64 = 10_000.0;

    /// Area within its border, if that does not cross itself, square millimetres.
    #[must_use]
    pub fn area_mm2(&self) -> f64 {
        let wide = |p: FixedPoint| (i128::from(p.x_mm), i128::from(p.y_mm));
        let doubled = self.sides().map(|(a, b)| wide(a).0 * wide(b).1 - wide(b).0 * wide(a).1).sum::<i128>();
        0.5 * doubled.unsigned_abs() as f64
    }

    /// Whether any two sides that do not follow each other cross (exact in whole millimetres).
    #[must_use]
    pub fn crosses_itself(&self) -> bool {
        let sides: Vec<(FixedPoint, FixedPoint)> = self.sides().collect();
        let wide = |p: FixedPoint| (i64::from(p.x_mm), i64::from(p.y_mm));
        let turn = |a: FixedPoint, b: FixedPoint, c: FixedPoint| {
            let ((ax, ay), (bx, by), (cx, cy)) = (wide(a), wide(b), wide(c));
            ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)).signum()
        };
        let cross = |(a, b): (FixedPoint, FixedPoint), (c, d): (FixedPoint, FixedPoint)| {
            turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0
        };
        sides.iter().enumerate().any(|(i, &one)| sides[i + 1..].iter().any(|&other| cross(one, other)))
    }
}

/// A release: who made it, and its name. Shown as `2026-11-21.1@1a2b3c4d`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ReleaseId {
    /// The operator that made it.
    pub author: AuthorId,
    /// The name that the operator gave it.
    pub name: ReleaseName,
}

impl fmt::Display for ReleaseId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.name, self.author)
    }
}

impl FromStr for ReleaseId {
    type Err = ParseIdError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || ParseIdError::new(text, "a release such as 2026-11-21.1@1a2b3c4d");
        let (name, author) = text.split_once('@').ok_or_else(error)?;
        Ok(Self { author: author.parse()?, name: name.parse()? })
    }
}

/// What a release names: a state of the map, for ever. The hash lets everybody check that they have
/// that state.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Release {
    /// The increments that it consists of.
    pub vector: VersionVector,
    /// Hash of the canonical map that they add up to.
    pub digest: Digest,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(corners: &[(i32, i32)]) -> Zone {
        let corners = corners.iter().map(|&(x_mm, y_mm)| FixedPoint { x_mm, y_mm }).collect();
        Zone { rule: ZoneRule::KeepOut, corners }
    }

    #[test]
    fn points_are_inside_or_not_whichever_way_the_border_runs() {
        let corners = [(0, 0), (4000, 0), (4000, 3000), (2000, 1000), (0, 3000)];
        let mut reversed = corners;
        reversed.reverse();
        for zone in [zone(&corners), zone(&reversed)] {
            let is_inside = |x_mm, y_mm| zone.contains(FixedPoint { x_mm, y_mm });
            assert!(is_inside(1000, 500) && is_inside(500, 2000) && is_inside(3500, 2000));
            assert!(!is_inside(2000, 1500) && !is_inside(-1, 500) && !is_inside(4001, 500) && !is_inside(2000, 3000));
        }
    }

    #[test]
    fn names_are_told_apart_from_places() {
        assert!("dock-1".parse::<Label>().is_ok());
        let longest = "ä".repeat(64);
        for good in ["Küche", "倉庫", "Лифт-2", "ß", longest.as_str()] {
            assert!(good.parse::<Label>().is_ok(), "{good}");
        }
        let too_long = "ä".repeat(65);
        for bad in ["", "1", "-a", "1,2", "1a2b3c4d.17", "a/b", "a b", "a;to=b", "a=b", "a*", "😀", too_long.as_str()]
        {
            assert!(bad.parse::<Label>().is_err(), "{bad}");
        }
        for typed in ["ห้อง", "विश्राम", "Ku\u{308}che"] {
            assert!(typed.parse::<Label>().is_ok(), "{typed}");
        }
        assert_eq!("Ku\u{308}che".parse::<Label>(), "Küche".parse::<Label>());
        for mark in ["\u{308}a", "a\u{202e}b"] {
            assert!(mark.parse::<Label>().is_err(), "{mark:?}");
        }
        assert!("2026-11-21.1".parse::<ReleaseName>().is_ok());
        for bad in ["", ".", "a..b", "a@b", "a/b", "17", "head"] {
            assert!(bad.parse::<ReleaseName>().is_err(), "{bad}");
        }
        let id: ReleaseId = "2026-11-21.1@1a2b3c4d".parse().unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(id.to_string(), "2026-11-21.1@1a2b3c4d");
    }
}
