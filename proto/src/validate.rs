//! What is refused although it decodes: numbers out of range, sizes over the limits, self-edges.

use crate::compact::{CompactNodes, CompactPath};
use crate::geometry::{FixedPoint, FixedPose};
use crate::increment::{EdgeKey, Increment, NodeKind, Op};
use crate::query::{Head, Snapshot};
use crate::signature::{Descriptor, DescriptorModel, ScanRecord, Signature};
use crate::version::VersionVector;
use std::f32::consts::TAU;

/// Why a decoded message was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Invalid(String);

/// Checks a decoded value before use.
pub trait Validate {
    /// # Errors
    /// Names the first thing that is wrong.
    fn validate(&self) -> Result<(), Invalid>;
}

/// Farthest that anything may lie from the map's origin, millimetres (100 km).
const MAX_COORDINATE_MM: i32 = 100_000_000;
/// Greatest yaw, 1e-4 rad.
const MAX_YAW_E4: i16 = 31_416;
/// Greatest hybrid logical clock, microseconds: in the year 2255. Short of the type's limit, so that whoever has seen it can
/// still stamp with more, and exact as a JSON number.
const MAX_HLC_US: u64 = 1 << 53;

pub(crate) fn check(holds: bool, message: impl FnOnce() -> String) -> Result<(), Invalid> {
    if holds { Ok(()) } else { Err(Invalid(message())) }
}

impl Validate for FixedPoint {
    fn validate(&self) -> Result<(), Invalid> {
        let near = |mm: i32| (-MAX_COORDINATE_MM..=MAX_COORDINATE_MM).contains(&mm);
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
            Self::RemoveNode { .. } | Self::SetFreeSpace { .. } => Ok(()),
        }
    }
}

impl Validate for Increment {
    fn validate(&self) -> Result<(), Invalid> {
        check(self.number >= 1, || "increment number 0 (they start at 1)".to_owned())?;
        check(self.hlc_us <= MAX_HLC_US, || format!("clock of {} µs (at most {MAX_HLC_US})", self.hlc_us))?;
        check((1..=Self::MAX_OPS).contains(&self.ops.len()), || {
            format!("an increment of {} operations (1 to {} are allowed)", self.ops.len(), Self::MAX_OPS)
        })?;
        self.ops.iter().try_for_each(Validate::validate)
    }
}

impl Validate for Snapshot {
    fn validate(&self) -> Result<(), Invalid> {
        self.increments.iter().try_for_each(Validate::validate)
    }
}

impl Validate for Head {
    fn validate(&self) -> Result<(), Invalid> {
        let authors = self.vector.iter().count();
        check(authors <= VersionVector::MAX_AUTHORS, || format!("a head of {authors} authors"))?;
        check(self.version == self.vector.version(), || {
            format!("a head of version {} with vector {}", self.version, self.vector)
        })
    }
}

impl Validate for CompactPath {
    fn validate(&self) -> Result<(), Invalid> {
        self.waypoints.iter().try_for_each(|waypoint| waypoint.point.validate())
    }
}

impl Validate for CompactNodes {
    fn validate(&self) -> Result<(), Invalid> {
        self.nodes.iter().try_for_each(|node| {
            node.pose.validate()?;
            check(node.similarity.is_none_or(f32::is_finite), || "a similarity that is not finite".to_owned())?;
            node.signature.as_ref().map_or(Ok(()), Validate::validate)
        })
    }
}
