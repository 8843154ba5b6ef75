//! What travels between explorers, the map-server and client robots: types, their compact binary
//! form, and the keys they travel under. There is no I/O and no async, so that everything here can
//! be tested with bytes alone. `docs/protocol.md` is the reference for clients in other languages.
//!
//! Lengths on the wire are integer millimetres and angles 1e-4 rad, so that a value means the same
//! bytes on every machine, `decode(encode(x)) == x` holds exactly, and digests agree.
//!
//! | module | idea |
//! | --- | --- |
//! | [`model`] | what a map is made of: ids, poses, increments, signatures, releases |
//! | [`codec`] | bytes: the envelope around every message, and a map in one file |
//! | [`api`] | keys, queries and replies, what robots say of themselves |
//! | `packing` | scans and descriptors as short streams of bits |
//! | `schema` | JSON Schemas of all JSON messages (feature `schema`) |
//!
//! ```
//! use fht_proto::api::keys::Key;
//! use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op, decode, encode};
//!
//! let author = AuthorId::of_robot("explorer");
//! let pose = FixedPose::from_metres(1.5, -2.0, 0.5);
//! let put = Op::PutNode { id: NodeId { author, number: 0 }, kind: NodeKind::Support, pose };
//! let increment = Increment { author, number: 1, hlc_us: 1_700_000_000_000_000, ops: vec![put] };
//!
//! let key = Key::increment(&"museum".parse()?, author, increment.number);
//! assert_eq!(key.to_string(), "fht/museum/inc/70e47b4b/1");
//! let bytes = encode(&increment)?;
//! assert_eq!(decode::<Increment>(&bytes)?, increment);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod api;
pub mod codec;
pub mod model;
mod packing;
#[cfg(feature = "schema")]
pub mod schema;

pub use codec::envelope::{CodecError, decode, encode};
pub use model::annotation::{Label, Release, ReleaseId, ReleaseName, Zone, ZoneRule};
pub use model::compaction::CompactedSeries;
pub use model::footprint::{Footprint, FootprintShape};
pub use model::geometry::{FixedPoint, FixedPose, Rect};
pub use model::ids::{AuthorId, MapName, NodeId, ParseIdError, RobotName, SharedWorldName};
pub use model::increment::{EdgeKey, Increment, NodeKind, Op, Stamp};
pub use model::seen::{Run, SeenArea, Square};
pub use model::signature::{Descriptor, DescriptorModel, ModelId, ScanRecord, Signature};
pub use model::siting::{Datum, PlanImage};
pub use model::validate::Invalid;
pub use model::version::{Digest, VersionVector};
