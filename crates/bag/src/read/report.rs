//! What became of a bag's messages.

use super::stream::Broken;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Why a message was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dropped {
    /// A scan that cannot be decoded.
    ScanBroken,
    /// A scan without beams, angles or a range limit.
    ScanUnusable,
    /// A scan with the same stamp as the one before.
    ScanDuplicate,
    /// A scan with an older stamp than the one before.
    ScanTimeBack,
    /// A scan before the first or after the last odometry.
    ScanOutsideOdometry,
    /// A scan in a gap of the odometry.
    ScanOdometryGap,
    /// Odometry that cannot be decoded.
    OdometryBroken,
    /// Odometry that is not finite.
    OdometryUnusable,
    /// Odometry that is not newer than the one before.
    OdometryNotNewer,
    /// Transforms that cannot be decoded, or are not valid.
    TransformUnusable,
    /// One of four pictures cannot be decoded.
    PictureBroken,
    /// Four pictures that are not square or differ in size.
    PictureShape,
}

impl fmt::Display for Dropped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ScanBroken => "scans that cannot be decoded",
            Self::ScanUnusable => "scans without beams, sensible angles or a range limit",
            Self::ScanDuplicate => "scans with the stamp of the one before",
            Self::ScanTimeBack => "scans older than the one before",
            Self::ScanOutsideOdometry => "scans from before the first or after the last odometry",
            Self::ScanOdometryGap => "scans in gaps of the odometry",
            Self::OdometryBroken => "odometry messages that cannot be decoded",
            Self::OdometryUnusable => "odometry messages without a usable pose",
            Self::OdometryNotNewer => "odometry messages not newer than the one before",
            Self::TransformUnusable => "transforms that cannot be used",
            Self::PictureBroken => "panoramas with pictures that cannot be decoded",
            Self::PictureShape => "panoramas whose pictures are not square or not of one size",
        })
    }
}

/// What became of a bag's messages.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BagReport {
    /// Messages of all topics.
    pub messages: u64,
    /// Scans among them.
    pub scans: u64,
    /// Odometry messages, or transforms of the robot's base if there is no odometry topic.
    pub odometry: u64,
    /// Pictures among them.
    pub pictures: u64,
    /// Frames made from them.
    pub frames: u64,
    /// Frames with a panorama.
    pub panoramas: u64,
    /// Messages that were not used, by reason.
    pub dropped: BTreeMap<Dropped, u64>,
    /// How often the odometry was reset; the robot is assumed not to have moved across a reset.
    pub odometry_jumps: u64,
    /// When the first message was logged, seconds since the epoch.
    pub start_s: Option<f64>,
    /// When the last message was logged, seconds since the epoch.
    pub end_s: Option<f64>,
    /// Assumptions made, as sentences.
    pub notes: Vec<String>,
    /// Files that could not be read to the end.
    pub broken: Vec<Broken>,
}

impl BagReport {
    /// A sentence, if most of the scans were not used: why, and what may be done.
    #[must_use]
    pub fn hardly_used(&self) -> Option<String> {
        /// Of fewer a bag may have been read from its middle.
        const FEW: u64 = 20;
        let is_of_scan = |reason: Dropped| {
            use Dropped::{
                ScanBroken, ScanDuplicate, ScanOdometryGap, ScanOutsideOdometry, ScanTimeBack, ScanUnusable,
            };
            matches!(
                reason,
                ScanBroken | ScanDuplicate | ScanOdometryGap | ScanOutsideOdometry | ScanTimeBack | ScanUnusable
            )
        };
        let of_scans = || self.dropped.iter().filter(|(reason, _)| is_of_scan(**reason));
        let unused: u64 = of_scans().map(|(_, count)| count).sum();
        if unused < FEW || 2 * unused <= self.scans {
            return None;
        }
        let (reason, count) = of_scans().max_by_key(|(_, count)| **count)?;
        let remedy = match reason {
            Dropped::ScanTimeBack | Dropped::ScanOutsideOdometry => {
                ". Are its messages in the order of time? `mcap sort` puts them so"
            }
            _ => "",
        };
        Some(format!("{unused} of {} scans were not used, {count} of them are {reason}{remedy}", self.scans))
    }

    pub(crate) fn drop_one(&mut self, reason: Dropped) {
        *self.dropped.entry(reason).or_default() += 1;
    }
}

impl fmt::Display for BagReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} messages", self.messages)?;
        if let (Some(start), Some(end)) = (self.start_s, self.end_s) {
            write!(f, " over {:.1} s", end - start)?;
        }
        write!(f, ": {} scans and {} odometry messages made {} frames", self.scans, self.odometry, self.frames)?;
        if self.pictures > 0 {
            write!(f, ", {} of them with a panorama ({} pictures)", self.panoramas, self.pictures)?;
        }
        for (reason, count) in &self.dropped {
            write!(f, "\nnot used: {reason} ({count})")?;
        }
        if self.odometry_jumps > 0 {
            write!(f, "\nodometry that jumped, and goes on from where it was ({})", self.odometry_jumps)?;
        }
        for note in &self.notes {
            write!(f, "\nnote: {note}")?;
        }
        for broken in &self.broken {
            write!(f, "\nbroken: {broken}")?;
        }
        Ok(())
    }
}
