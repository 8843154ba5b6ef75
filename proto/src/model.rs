//! What a map is made of.
//!
//! | module | idea |
//! | --- | --- |
//! | [`ids`] | who wrote what: authors, nodes, map names |
//! | [`geometry`] | positions, poses and rectangles in integer millimetres |
//! | [`footprint`] | the ground that a robot covers, and the clearances around it |
//! | [`siting`] | where a map lies: against a floor plan, and on earth |
//! | [`signature`] | what a main node carries: descriptor and scan (paper, Table I) |
//! | [`increment`] | the operations that a map is made of, and their stamps |
//! | [`annotation`] | what operators add: named places, zones, releases |
//! | [`compaction`] | what is left of old increments, and series of increments |
//! | [`version`] | version vectors and digests |
//! | [`seen`] | which part of a building an explorer has seen |
//! | [`validate`] | what is refused although it decodes |

pub mod annotation;
pub mod compaction;
pub mod footprint;
pub mod geometry;
pub mod ids;
pub mod increment;
pub mod seen;
pub mod signature;
pub mod siting;
pub mod validate;
pub mod version;
