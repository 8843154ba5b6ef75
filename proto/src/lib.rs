//! What travels between explorers, the map-server and client robots: types, their compact binary form, and the keys
//! they travel under. No I/O and no async, so that everything here can be tested with bytes alone.
//!
//! | module | idea |
//! | --- | --- |
//! | [`ids`] | who wrote what: authors, nodes, map names |
//! | [`geometry`] | positions, poses and rectangles in integer millimetres |
//! | [`signature`] | what a main node carries: descriptor and scan (paper, Table I) |
//! | [`increment`] | the operations that a map is made of, and their stamps |
//! | [`annotation`] | what operators add: named places, zones, releases |
//! | [`fold`] | what is left of old increments |
//! | [`version`] | version vectors and digests |
//! | [`packed`] | scans and descriptors as short streams of bits |
//! | [`envelope`] | bytes: magic, format version, kind, length, checksum around `postcard` |
//! | [`archive`] | a map in one file |
//! | [`validate`] | what is refused although it decodes |
//! | [`keys`] | key expressions, built and parsed |
//! | [`query`] | requests and replies, as JSON |
//! | [`fleet`] | what robots say of themselves |
//! | [`seen`] | which part of a building an explorer has seen |
//! | [`request`] | queries as they come, to typed requests |
//! | [`compact`] | the same replies for `fmt=postcard` |
//!
//! Lengths on the wire are integer millimetres and angles 1e-4 rad, so that a value means the same bytes on every
//! machine, `decode(encode(x)) == x` holds exactly, and digests agree.

pub mod annotation;
pub mod archive;
pub mod compact;
pub mod envelope;
pub mod fleet;
pub mod fold;
pub mod geometry;
pub mod ids;
pub mod increment;
pub mod keys;
pub mod packed;
pub mod query;
pub mod request;
mod rice;
pub mod seen;
pub mod signature;
pub mod validate;
pub mod version;
mod wire_id;

pub use annotation::{Label, Release, ReleaseId, ReleaseName, Zone, ZoneRule};
pub use envelope::{CodecError, decode, encode};
pub use fold::Fold;
pub use geometry::{FixedPoint, FixedPose, Rect};
pub use ids::{AuthorId, MapName, NodeId};
pub use increment::{EdgeKey, Increment, NodeKind, Op, Stamp};
pub use seen::{Run, SeenArea, Square};
pub use signature::{Descriptor, DescriptorModel, ModelId, ScanRecord, Signature};
pub use validate::Invalid;
pub use version::{Digest, VersionVector};
