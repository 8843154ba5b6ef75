//! What is refused although it decodes: numbers out of range, sizes over the limits, self-edges.

use crate::model::annotation::{Zone, ZoneRule};
use crate::model::compaction::{CompactedSeries, Series};
use crate::model::geometry::{FixedPoint, FixedPose};
use crate::model::increment::{EdgeKey, Increment, NodeKind, Op};
use crate::model::signature::{Descriptor, DescriptorModel, ScanRecord, Signature};
use crate::model::siting::{Datum, PlanImage};
use crate::model::version::VersionVector;
use std::f32::consts::TAU;

/// Why a decoded message was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Invalid(String);

impl Invalid {
    pub(crate) fn new(message: String) -> Self {
        Self(message)
    }
}

/// Checks a decoded value before use.
pub trait Validate {
    /// # Errors
    /// Names the first thing that is wrong.
    fn validate(&self) -> Result<(), Invalid>;
}

/// Greatest yaw, 1e-4 rad.
const MAX_YAW_E4: i16 = 31_416;
/// Greatest hybrid logical clock, microseconds: in the year 2255. Short of the type's limit, so
/// that a writer that has seen it can still use a greater one, and exact as a JSON number.
const MAX_HLC_US: u64 = 1 << 53;
/// Greatest number of an increment: a thousand a second for nine thousand years. The sum of those
/// of all authors of a map is a number yet.
const MAX_NUMBER: u64 = 1 << 48;

pub(crate) fn check(holds: bool, message: impl FnOnce() -> String) -> Result<(), Invalid> {
    if holds { Ok(()) } else { Err(Invalid(message())) }
}

/// Whether a letter is not seen: a control character, or one of those that turn the direction of
/// writing and make a sentence say something else.
pub(crate) fn is_unseen(letter: char) -> bool {
    letter.is_control() || matches!(letter, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

impl Validate for FixedPoint {
    fn validate(&self) -> Result<(), Invalid> {
        let near = |mm: i32| (-Self::MAX_MM..=Self::MAX_MM).contains(&mm);
        check(near(self.x_mm) && near(self.y_mm), || {
            format!("position ({}, {}) m is over 100 km from the origin", self.x(), self.y())
        })
    }
}

impl Validate for FixedPose {
    fn validate(&self) -> Result<(), Invalid> {
        self.position.validate()?;
        check((-MAX_YAW_E4..=MAX_YAW_E4).contains(&self.yaw_e4), || format!("yaw {} rad is beyond ±π", self.yaw()))
    }
}

impl Validate for Descriptor {
    fn validate(&self) -> Result<(), Invalid> {
        check((1..=Self::MAX_DIMENSION).contains(&self.values.len()), || {
            format!("a descriptor of {} numbers (1 to {} are allowed)", self.values.len(), Self::MAX_DIMENSION)
        })?;
        check(self.scale.is_finite() && self.scale > 0.0, || format!("descriptor scale {}", self.scale))
    }
}

impl Validate for DescriptorModel {
    fn validate(&self) -> Result<(), Invalid> {
        check((1..=Descriptor::MAX_DIMENSION).contains(&usize::from(self.dimension)), || {
            format!("descriptor model of dimension {}", self.dimension)
        })?;
        check(self.name.len() <= 64, || format!("descriptor model name of {} bytes", self.name.len()))?;
        check((-1000..=1000).contains(&self.match_threshold_e3), || {
            format!("match threshold {}/1000 is not a cosine", self.match_threshold_e3)
        })
    }
}

impl Validate for ScanRecord {
    fn validate(&self) -> Result<(), Invalid> {
        self.base_from_sensor.validate()?;
        check((1..=Self::MAX_BEAMS).contains(&self.ranges_mm.len()), || {
            format!("a scan of {} beams (1 to {} are allowed)", self.ranges_mm.len(), Self::MAX_BEAMS)
        })?;
        check(self.angle_min.is_finite() && self.angle_min.abs() <= 2.0 * TAU, || {
            format!("scan angle_min {} rad", self.angle_min)
        })?;
        check(self.angle_increment.is_finite() && self.angle_increment.abs() <= TAU, || {
            format!("scan angle_increment {} rad", self.angle_increment)
        })
    }
}

impl Validate for Signature {
    fn validate(&self) -> Result<(), Invalid> {
        self.scan.validate()?;
        self.descriptor.as_ref().map_or(Ok(()), Validate::validate)
    }
}

impl<Id: Copy + Ord + std::fmt::Display> Validate for EdgeKey<Id> {
    fn validate(&self) -> Result<(), Invalid> {
        check(self.low() < self.high(), || {
            format!("edge from node {} to {}, which does not sort after it", self.low(), self.high())
        })
    }
}

impl Validate for Op {
    fn validate(&self) -> Result<(), Invalid> {
        match self {
            Self::PutNode { pose, kind: NodeKind::Main | NodeKind::Support, .. } | Self::SetPose { pose, .. } => {
                pose.validate()
            }
            Self::SetSignature { signature, .. } => signature.validate(),
            Self::PutEdge { edge } | Self::RemoveEdge { edge } => edge.validate(),
            Self::PutModel { model } => model.validate(),
            Self::SetTrust { percent, .. } => {
                check(*percent <= 100, || format!("a trust of {percent} % (at most 100 are there)"))
            }
            Self::SetClosed { edge, .. } => edge.validate(),
            Self::SetPlace { pose, .. } => pose.as_ref().map_or(Ok(()), Validate::validate),
            Self::SetZone { zone, .. } => zone.as_ref().map_or(Ok(()), Validate::validate),
            Self::PutRelease { release, .. } => release.vector.validate(),
            Self::SetFloorPlan { plan } => plan.as_ref().map_or(Ok(()), Validate::validate),
            Self::SetDatum { datum } => datum.as_ref().map_or(Ok(()), Validate::validate),
            Self::RemoveNode { .. } | Self::SetFreeSpace { .. } | Self::RemoveRelease { .. } | Self::Enable { .. } => {
                Ok(())
            }
        }
    }
}

impl Validate for Increment {
    fn validate(&self) -> Result<(), Invalid> {
        check((1..=MAX_NUMBER).contains(&self.number), || {
            format!("increment number {} (1 to {MAX_NUMBER} are allowed)", self.number)
        })?;
        check(self.hlc_us <= MAX_HLC_US, || format!("clock of {} µs (at most {MAX_HLC_US})", self.hlc_us))?;
        check((1..=Self::MAX_OPS).contains(&self.ops.len()), || {
            format!("an increment of {} operations (1 to {} are allowed)", self.ops.len(), Self::MAX_OPS)
        })?;
        self.ops.iter().try_for_each(Validate::validate)
    }
}

impl Validate for VersionVector {
    fn validate(&self) -> Result<(), Invalid> {
        let authors = self.iter().count();
        check(authors <= Self::MAX_AUTHORS, || format!("a vector of {authors} authors"))?;
        check(self.iter().all(|(_, count)| (1..=MAX_NUMBER).contains(&count)), || {
            format!("a vector that counts none of an author's increments, or over {MAX_NUMBER}")
        })
    }
}

impl Zone {
    /// Whether its border is that of a zone. Stored zones may have any border; servers take no new
    /// ones that this refuses.
    ///
    /// # Errors
    /// Fewer than three corners, a border that crosses itself, no area.
    pub fn check_border(&self) -> Result<(), Invalid> {
        check(self.corners.len() >= 3, || format!("a zone has three corners or more, not {}", self.corners.len()))?;
        check(!self.crosses_itself(), || {
            "the border of the zone crosses itself: give its corners in order".to_owned()
        })?;
        let area_mm2 = self.area_mm2();
        check(area_mm2 >= Self::MIN_AREA_MM2, || {
            format!("the zone has an area of {:.4} m², and less than 0.01 m² is none", area_mm2 * 1e-6)
        })
    }
}

impl Validate for Zone {
    fn validate(&self) -> Result<(), Invalid> {
        let corners = self.corners.len();
        check((3..=Self::MAX_CORNERS).contains(&corners), || {
            format!("a zone of {corners} corners (3 to {} are allowed)", Self::MAX_CORNERS)
        })?;
        self.corners.iter().try_for_each(Validate::validate)?;
        check(self.rule != ZoneRule::SpeedLimit(0), || "a speed limit of 0: that is a zone to keep out of".to_owned())
    }
}

impl Validate for CompactedSeries {
    fn validate(&self) -> Result<(), Invalid> {
        check(1 <= self.first && self.first <= self.last && self.last <= MAX_NUMBER, || {
            format!("a fold of increments {} to {} (1 to {MAX_NUMBER} are allowed)", self.first, self.last)
        })?;
        let mut before = 0;
        for rest in &self.rests {
            let number = rest.number;
            check((self.first..=self.last).contains(&number) && number > before, || {
                format!("increment {number} out of place in a fold of {} to {}", self.first, self.last)
            })?;
            before = number;
            check(rest.hlc_us <= MAX_HLC_US, || format!("clock of {} µs (at most {MAX_HLC_US})", rest.hlc_us))?;
            check((1..=Increment::MAX_OPS).contains(&rest.ops.len()), || format!("{} operations", rest.ops.len()))?;
            let indices = rest.ops.iter().map(|(index, _)| usize::from(*index));
            let is_ascending = rest.ops.windows(2).all(|pair| pair[0].0 < pair[1].0);
            check(is_ascending && indices.max() < Some(Increment::MAX_OPS), || {
                format!("operations of increment {number} out of order")
            })?;
            rest.ops.iter().try_for_each(|(_, op)| op.validate())?;
        }
        Ok(())
    }
}

impl Validate for Series {
    fn validate(&self) -> Result<(), Invalid> {
        self.folds.iter().try_for_each(Validate::validate)?;
        self.increments.iter().try_for_each(Validate::validate)
    }
}

impl Validate for PlanImage {
    fn validate(&self) -> Result<(), Invalid> {
        let bytes = self.image.len();
        check(bytes <= Self::MAX_NAME_BYTES, || {
            format!("an image's name of {bytes} bytes (at most {} are allowed)", Self::MAX_NAME_BYTES)
        })?;
        check(!self.image.chars().any(char::is_control), || "an image's name with control characters".to_owned())?;
        check((1..=Self::MAX_UM_PER_PIXEL).contains(&self.um_per_pixel), || {
            format!("{} m a pixel (0.000001 to 10 are allowed)", f64::from(self.um_per_pixel) * 1e-6)
        })?;
        self.map_from_image.validate()
    }
}

impl Validate for Datum {
    fn validate(&self) -> Result<(), Invalid> {
        // At the poles there is no east.
        let (latitude, longitude) = (self.latitude_deg(), self.longitude_deg());
        check(latitude.abs() < 89.9, || format!("a latitude of {latitude}° (within ±89.9° are allowed)"))?;
        check(longitude.abs() <= 180.0, || format!("a longitude of {longitude}° (within ±180° are allowed)"))?;
        FixedPose { position: FixedPoint::default(), yaw_e4: self.yaw_e4 }.validate()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_place_is_refused() {
        let datum = Datum::from_degrees;
        assert!(datum(-33.9, 151.2, 6.0).validate().is_ok());
        for bad in [datum(90.0, 0.0, 0.0), datum(0.0, 180.1, 0.0), datum(f64::INFINITY, 0.0, 0.0)] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
        let plan = |image: &str, um_per_pixel| PlanImage {
            image: image.to_owned(),
            um_per_pixel,
            map_from_image: FixedPose::default(),
        };
        assert!(plan("Erdgeschoß.png", 50_000).validate().is_ok());
        for bad in [plan("a\nb", 1), plan("", 0), plan("", 10_000_001), plan(&"x".repeat(201), 1)] {
            assert!(bad.validate().is_err(), "{bad:?}");
        }
    }
}
