//! What a main node carries beyond a support node: a visual descriptor φ and a laser scan ψ
//! (paper, Table I).

use crate::model::geometry::FixedPose;
use crate::packing::packed::{PackedRanges, UnpackError, pack_ranges, pack_values, unpack_ranges, unpack_values};
use serde::{Deserialize, Serialize};

/// Names the network and recipe that made a descriptor: the first four bytes of a hash over both.
/// Descriptors of different models are never compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ModelId(pub u32);

/// The description of a descriptor model as it travels with the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DescriptorModel {
    /// Which model.
    pub id: ModelId,
    /// Its name for people, such as `mobilenet-v2-b11`.
    pub name: String,
    /// Numbers in a descriptor, at most [`Descriptor::MAX_DIMENSION`].
    pub dimension: u16,
    /// Inner products above this, in thousandths, mean "near" (the paper's th_match).
    pub match_threshold_e3: i16,
}

/// A descriptor in whole steps: component = value × scale. It stands for a unit vector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "PackedDescriptor", try_from = "PackedDescriptor")]
pub struct Descriptor {
    /// The model that made it.
    pub model: ModelId,
    /// What one step of a value is worth; finite and positive.
    pub scale: f32,
    /// The components, in steps.
    pub values: Vec<i8>,
}

impl Descriptor {
    /// Most components that a descriptor may have.
    pub const MAX_DIMENSION: usize = 512;

    /// Steps to the root mean square of the components. Four turn the descriptor by 4° (cosine
    /// 0.9975) and leave 3.7 bits of a component; a component alone in
    /// [`MAX_DIMENSION`](Self::MAX_DIMENSION) takes 91 steps, which 8 bits hold.
    const STEPS_TO_RMS: f32 = 4.0;

    /// Quantises `components` in steps of a quarter of their root mean square. Non-finite
    /// components count as 0.
    #[must_use]
    pub fn quantise(model: ModelId, components: &[f32]) -> Self {
        let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
        let squares: f32 = components.iter().map(|&v| finite(v).powi(2)).sum();
        let step = (squares / components.len().max(1) as f32).sqrt() / Self::STEPS_TO_RMS;
        let scale = if step.is_normal() { step } else { 1.0 };
        // `as` saturates.
        Self { model, scale, values: components.iter().map(|&v| (finite(v) / scale).round() as i8).collect() }
    }

    /// The components as numbers.
    #[must_use]
    pub fn components(&self) -> Vec<f32> {
        self.values.iter().map(|&v| f32::from(v) * self.scale).collect()
    }

    /// Cosine of the angle between two descriptors; `None` if they are of different models or
    /// lengths, or zero.
    #[must_use]
    pub fn similarity(&self, other: &Self) -> Option<f32> {
        if self.model != other.model || self.values.len() != other.values.len() {
            return None;
        }
        let (mut dot, mut a2, mut b2) = (0_i64, 0_i64, 0_i64);
        for (&a, &b) in self.values.iter().zip(&other.values) {
            let (a, b) = (i64::from(a), i64::from(b));
            dot += a * b;
            a2 += a * a;
            b2 += b * b;
        }
        if a2 == 0 || b2 == 0 {
            return None;
        }
        Some((dot as f64 / ((a2 as f64).sqrt() * (b2 as f64).sqrt())) as f32)
    }
}

/// A laser scan as a main node keeps it. Beam `i` looks at `angle_min + i·angle_increment` in the
/// sensor's frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "PackedScan", try_from = "PackedScan")]
pub struct ScanRecord {
    /// Pose of the sensor on the robot: `base_link` from sensor (the lever arm).
    pub base_from_sensor: FixedPose,
    /// Angle of the first beam, radians.
    pub angle_min: f32,
    /// Angle between beams, radians.
    pub angle_increment: f32,
    /// Ranges in millimetres; 0 means no return. Any are kept exactly, and take less room when they
    /// are multiples of [`STEP_MM`](Self::STEP_MM).
    pub ranges_mm: Vec<u16>,
}

impl ScanRecord {
    /// Most beams that a scan may have.
    pub const MAX_BEAMS: usize = 4096;
    /// What ranges are rounded to when a record is made, millimetres: an error of 1.4 mm (standard
    /// deviation) beside the 10 mm of a scanner.
    pub const STEP_MM: u16 = 5;
}

/// Descriptor and scan of a main node. A robot without a camera leaves the descriptor out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Signature {
    /// The visual descriptor φ.
    pub descriptor: Option<Descriptor>,
    /// The laser scan ψ, taken at the node's pose.
    pub scan: ScanRecord,
}

/// [`ScanRecord`] as it travels.
#[derive(Serialize, Deserialize)]
struct PackedScan {
    base_from_sensor: FixedPose,
    angle_min: f32,
    angle_increment: f32,
    step_mm: u16,
    beams: u32,
    stream: Vec<u8>,
}

impl From<ScanRecord> for PackedScan {
    fn from(scan: ScanRecord) -> Self {
        let (step_mm, stream) = pack_ranges(&scan.ranges_mm);
        Self {
            base_from_sensor: scan.base_from_sensor,
            angle_min: scan.angle_min,
            angle_increment: scan.angle_increment,
            step_mm,
            beams: u32::try_from(scan.ranges_mm.len()).unwrap_or(u32::MAX), // refused: over the limit
            stream,
        }
    }
}

impl TryFrom<PackedScan> for ScanRecord {
    type Error = UnpackError;
    fn try_from(packed: PackedScan) -> Result<Self, UnpackError> {
        let PackedScan { base_from_sensor, angle_min, angle_increment, step_mm, beams, stream } = packed;
        let ranges_mm = unpack_ranges(&PackedRanges { step_mm, beams, stream: &stream }, Self::MAX_BEAMS)?;
        Ok(Self { base_from_sensor, angle_min, angle_increment, ranges_mm })
    }
}

/// [`Descriptor`] as it travels.
#[derive(Serialize, Deserialize)]
struct PackedDescriptor {
    model: ModelId,
    scale: f32,
    count: u32,
    stream: Vec<u8>,
}

impl From<Descriptor> for PackedDescriptor {
    fn from(descriptor: Descriptor) -> Self {
        let Descriptor { model, scale, values } = descriptor;
        // Over the limit: refused.
        let count = u32::try_from(values.len()).unwrap_or(u32::MAX);
        Self { model, scale, count, stream: pack_values(&values) }
    }
}

impl TryFrom<PackedDescriptor> for Descriptor {
    type Error = UnpackError;
    fn try_from(packed: PackedDescriptor) -> Result<Self, UnpackError> {
        let PackedDescriptor { model, scale, count, stream } = packed;
        Ok(Self { model, scale, values: unpack_values(count, &stream, Self::MAX_DIMENSION)? })
    }
}
