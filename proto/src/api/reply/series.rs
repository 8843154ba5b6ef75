//! Increments as JSON: what `since` and `snapshot` reply with `fmt=json`, for clients without the
//! codec.
//!
//! Nothing is lost. Lengths are metres and angles radians, with as many decimals as the wire has (1
//! mm and 1e-4 rad): `round(metres × 1000)` and `round(radians × 10000)` are the integers that
//! travel in the binary form.

use crate::api::reply::rules::{DatumView, FloorPlanView, RuleView};
use crate::model::annotation::Zone;
use crate::model::compaction::{CompactedSeries, Rest, Series};
use crate::model::geometry::{FixedPose, Rect};
use crate::model::ids::{AuthorId, MapName};
use crate::model::increment::{Increment, NodeKind, Op};
use crate::model::signature::{Descriptor, ScanRecord};
use crate::model::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};

/// The reply to `since` and `snapshot` with `fmt=json`: the first increments that the asker lacks.
/// Whoever applies them and asks again, with its new vector, has everything when a reply comes
/// without any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SeriesReply {
    /// The map.
    pub map: MapName,
    /// The state asked for: what the asker has in the end.
    pub vector: VersionVector,
    /// What is left of compacted increments. Each comes before all other increments of its author.
    pub compacted: Vec<CompactedSeriesView>,
    /// The increments, in an order in which each author's numbers ascend.
    pub increments: Vec<IncrementView>,
}

impl SeriesReply {
    /// A series of a map, which leads to the state `vector`.
    #[must_use]
    pub fn new(map: MapName, vector: VersionVector, series: &Series) -> Self {
        let compacted = series.folds.iter().map(CompactedSeriesView::from).collect();
        Self { map, vector, compacted, increments: series.increments.iter().map(IncrementView::from).collect() }
    }
}

/// One increment: a numbered batch of operations by one author.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct IncrementView {
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
    /// The hybrid logical clock of all its operations, microseconds.
    pub hlc_us: u64,
    /// The changes, in order. An operation's stamp is `(hlc_us, author, its index here)`.
    pub ops: Vec<OpView>,
}

impl From<&Increment> for IncrementView {
    fn from(increment: &Increment) -> Self {
        let Increment { author, number, hlc_us, ops } = increment;
        Self { author: *author, number: *number, hlc_us: *hlc_us, ops: ops.iter().map(OpView::from).collect() }
    }
}

/// What is left of an author's increments `first` to `last` after the server compacted them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CompactedSeriesView {
    /// Who wrote them.
    pub author: AuthorId,
    /// Number of the first increment that it stands for, from 1.
    pub first: u64,
    /// Number of the last one.
    pub last: u64,
    /// What is left, by number. Of most increments nothing is left.
    pub increments: Vec<CompactedIncrementView>,
}

impl From<&CompactedSeries> for CompactedSeriesView {
    fn from(series: &CompactedSeries) -> Self {
        let increments = series.rests.iter().map(CompactedIncrementView::from).collect();
        Self { author: series.author, first: series.first, last: series.last, increments }
    }
}

/// What is left of one increment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CompactedIncrementView {
    /// The increment's number.
    pub number: u64,
    /// The increment's clock, microseconds.
    pub hlc_us: u64,
    /// The operations that are left.
    pub ops: Vec<CompactedOpView>,
}

impl From<&Rest> for CompactedIncrementView {
    fn from(rest: &Rest) -> Self {
        let ops = rest.ops.iter().map(|(index, op)| CompactedOpView { index: *index, op: op.into() }).collect();
        Self { number: rest.number, hlc_us: rest.hlc_us, ops }
    }
}

/// An operation of a compacted increment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CompactedOpView {
    /// Its index in the increment, which is the last part of its stamp.
    pub index: u16,
    /// The operation.
    #[serde(flatten)]
    pub op: OpView,
}

/// One change of the map. Nodes are named by their ids, edges by the ids of their ends, in
/// ascending order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "op", rename_all = "snake_case")]
pub enum OpView {
    /// Adds a node, or gives it a new kind and pose.
    PutNode {
        /// Which node.
        id: String,
        /// Main or support.
        kind: NodeKind,
        /// `[x, y, yaw]` in the map frame, metres and radians.
        pose: [f64; 3],
    },
    /// Removes a node. Its edges are no longer shown.
    RemoveNode {
        /// Which node.
        id: String,
    },
    /// Moves a node, and with it everything that is kept relative to it.
    SetPose {
        /// Which node.
        id: String,
        /// `[x, y, yaw]` in the map frame, metres and radians.
        pose: [f64; 3],
    },
    /// Sets a node's rectangle of free space, or takes it away.
    SetFreeSpace {
        /// Which node.
        id: String,
        /// How far the rectangle reaches from the node: `[west, south, east, north]`, metres along
        /// -x, -y, +x, +y of the map frame. Null: it has none.
        reach: Option<[f64; 4]>,
    },
    /// Sets a main node's descriptor and scan.
    SetSignature {
        /// Which node.
        id: String,
        /// What it looks like; null if its maker has no camera.
        descriptor: Option<DescriptorView>,
        /// The laser scan, taken at the node's pose.
        scan: ScanView,
    },
    /// Adds an edge that can be driven in a straight line.
    PutEdge {
        /// Its ends.
        edge: [String; 2],
    },
    /// Removes an edge.
    RemoveEdge {
        /// Its ends.
        edge: [String; 2],
    },
    /// Describes a descriptor model used by signatures of this map.
    PutModel {
        /// The model, as eight hexadecimal digits.
        model: String,
        /// Its name for people.
        name: String,
        /// Numbers in a descriptor.
        dimension: u16,
        /// Cosines above this mean "near".
        match_threshold: f64,
    },
    /// Says how far a node is still believed.
    SetTrust {
        /// Which node.
        id: String,
        /// From 0 to 100; a node without this operation has 100.
        percent: u8,
    },
    /// Closes an edge, or opens it again.
    SetClosed {
        /// Its ends.
        edge: [String; 2],
        /// Whether no path may use it.
        closed: bool,
    },
    /// Names a place, moves it, or takes the name away.
    SetPlace {
        /// The name.
        name: String,
        /// `[x, y, yaw]` in the map frame, metres and radians. Null: there is no place of this name
        /// any more.
        pose: Option<[f64; 3]>,
    },
    /// Draws a zone, changes it, or takes it away.
    SetZone {
        /// The name.
        name: String,
        /// Its rule and border. Null: there is no zone of this name any more.
        zone: Option<ZoneShape>,
    },
    /// Makes a release. The first one that an author makes under a name stays.
    PutRelease {
        /// The name.
        name: String,
        /// The increments that it consists of.
        vector: VersionVector,
        /// Hash of the map that they add up to.
        digest: Digest,
    },
    /// Deletes a release for ever.
    RemoveRelease {
        /// The release, as `name@author`.
        release: String,
    },
    /// Says which release robots are to use.
    Enable {
        /// The release, as `name@author`. Null: the newest state.
        release: Option<String>,
    },
    /// Says how a floor plan's image lies in the map.
    SetFloorPlan {
        /// The plan. Null: there is none.
        plan: Option<FloorPlanView>,
    },
    /// Says where on earth the map is.
    SetDatum {
        /// The place. Null: nobody knows.
        datum: Option<DatumView>,
    },
}

/// `[x, y, yaw]`, metres and radians.
fn pose_view(pose: &FixedPose) -> [f64; 3] {
    [pose.position.x(), pose.position.y(), pose.yaw()]
}

impl From<&Op> for OpView {
    fn from(op: &Op) -> Self {
        match op {
            Op::PutNode { id, kind, pose } => Self::PutNode { id: id.to_string(), kind: *kind, pose: pose_view(pose) },
            Op::RemoveNode { id } => Self::RemoveNode { id: id.to_string() },
            Op::SetPose { id, pose } => Self::SetPose { id: id.to_string(), pose: pose_view(pose) },
            Op::SetFreeSpace { id, rect } => {
                Self::SetFreeSpace { id: id.to_string(), reach: rect.as_ref().map(Rect::reach_m) }
            }
            Op::SetSignature { id, signature } => Self::SetSignature {
                id: id.to_string(),
                descriptor: signature.descriptor.as_ref().map(DescriptorView::from),
                scan: (&signature.scan).into(),
            },
            Op::PutEdge { edge } => Self::PutEdge { edge: edge.to_texts() },
            Op::RemoveEdge { edge } => Self::RemoveEdge { edge: edge.to_texts() },
            Op::PutModel { model } => Self::PutModel {
                model: format!("{:08x}", model.id.0),
                name: model.name.clone(),
                dimension: model.dimension,
                match_threshold: f64::from(model.match_threshold_e3) / 1000.0,
            },
            Op::SetTrust { id, percent } => Self::SetTrust { id: id.to_string(), percent: *percent },
            Op::SetClosed { edge, closed } => Self::SetClosed { edge: edge.to_texts(), closed: *closed },
            Op::SetPlace { name, pose } => {
                Self::SetPlace { name: name.to_string(), pose: pose.as_ref().map(pose_view) }
            }
            Op::SetZone { name, zone } => {
                Self::SetZone { name: name.to_string(), zone: zone.as_ref().map(ZoneShape::from) }
            }
            Op::PutRelease { name, release } => {
                Self::PutRelease { name: name.to_string(), vector: release.vector.clone(), digest: release.digest }
            }
            Op::RemoveRelease { id } => Self::RemoveRelease { release: id.to_string() },
            Op::Enable { release } => Self::Enable { release: release.as_ref().map(ToString::to_string) },
            Op::SetFloorPlan { plan } => Self::SetFloorPlan { plan: plan.as_ref().map(FloorPlanView::from) },
            Op::SetDatum { datum } => Self::SetDatum { datum: datum.map(DatumView::from) },
        }
    }
}

/// What a main node looks like. Component `i` is `values[i] × scale`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DescriptorView {
    /// The model that made it, as eight hexadecimal digits. Descriptors of different models cannot
    /// be compared.
    pub model: String,
    /// What one step of a value is worth (32-bit float).
    pub scale: f32,
    /// The components, in steps.
    pub values: Vec<i8>,
}

impl From<&Descriptor> for DescriptorView {
    fn from(descriptor: &Descriptor) -> Self {
        let Descriptor { model, scale, values } = descriptor;
        Self { model: format!("{:08x}", model.0), scale: *scale, values: values.clone() }
    }
}

/// A laser scan. Beam `i` looks at `angle_min + i × angle_increment` in the sensor's frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ScanView {
    /// Pose of the sensor on the robot: `[x, y, yaw]` in the robot's frame, metres and radians.
    pub base_from_sensor: [f64; 3],
    /// Angle of the first beam, radians (32-bit float).
    pub angle_min: f32,
    /// Angle between beams, radians (32-bit float).
    pub angle_increment: f32,
    /// Ranges in millimetres; 0 means no return.
    pub ranges_mm: Vec<u16>,
}

impl From<&ScanRecord> for ScanView {
    fn from(scan: &ScanRecord) -> Self {
        let ScanRecord { base_from_sensor, angle_min, angle_increment, ranges_mm } = scan;
        let base_from_sensor = pose_view(base_from_sensor);
        Self {
            base_from_sensor,
            angle_min: *angle_min,
            angle_increment: *angle_increment,
            ranges_mm: ranges_mm.clone(),
        }
    }
}

/// A zone without its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ZoneShape {
    /// What holds there.
    pub rule: RuleView,
    /// Its corners `[x, y]` in the map frame, metres.
    pub corners: Vec<[f64; 2]>,
}

impl From<&Zone> for ZoneShape {
    fn from(zone: &Zone) -> Self {
        Self { rule: zone.rule.into(), corners: zone.corners.iter().map(|corner| [corner.x(), corner.y()]).collect() }
    }
}
