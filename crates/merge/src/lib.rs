//! Two maps of one building, made apart, become one.
//!
//! [`lay`] finds out where the second map lies in the first: each of its main nodes is looked for
//! in the whole first map, matches that agree are made exact in a pose graph, and what each map's
//! scans say in the other decides whether to believe it. [`join`] then writes the operations that
//! bring into the first map what only the second one has. Both are plain computation over two
//! [`MapState`](fht_map::MapState)s, without network, clock or chance: the same maps give the same
//! operations. Poses are in metres and radians in the first map's frame.
//!
//! | module | idea |
//! | --- | --- |
//! | `alignment` | where the second map lies in the first: [`lay`] |
//! | `operations` | what brings the second map into the first: [`join`] |
//! | `config` | how all of it is done: [`MergeConfig`] |
//! | `refusal` | why two maps are not merged: [`MergeRefusal`] |
//!
//! ```
//! use fht_map::MapState;
//! use fht_merge::{MergeConfig, MergeOptions, MergeRefusal, join, lay};
//! use fht_proto::{AuthorId, Op};
//!
//! /// The operations that bring `b` into `a`, in batches: each is one increment of the operator's.
//! fn merge(a: &MapState, b: &MapState) -> Result<Vec<Vec<Op>>, MergeRefusal> {
//!     let config = MergeConfig::default();
//!     let laid = lay(a, b, &config)?;
//!     println!("{} of {} places match", laid.figures.matched, laid.figures.places);
//!     let author = AuthorId::of_robot("operator");
//!     let options = MergeOptions { author, suffix: "b", only_map: false };
//!     Ok(join(a, b, &laid, &options, &config)?.batches)
//! }
//!
//! let refusal = merge(&MapState::new(), &MapState::new()).unwrap_err();
//! assert!(matches!(refusal, MergeRefusal::NothingSeen { .. }), "{refusal}");
//! ```

mod alignment;
mod config;
mod operations;
mod refusal;

pub use alignment::{
    Alignment, AlignmentFigures, CandidateConfig, DecideConfig, MatchConsensusConfig, PoseAlignmentConfig, lay,
};
pub use config::MergeConfig;
pub use operations::{JointGridConfig, MergeFigures, MergeOptions, MergedOperations, NodeSelectionConfig, join};
pub use refusal::MergeRefusal;
