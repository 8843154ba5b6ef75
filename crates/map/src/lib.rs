//! The FHT-Map as a data structure: what the increments of [`fht_proto`] add up to, how to find
//! things in it, and paths through it. There is no I/O and no clock, so that server, mapper and
//! client compute the same from the same increments. Everything is in the map frame; `_m` are
//! metres, `_mm` millimetres, `_um` micrometres.
//!
//! ```text
//! increments ─→ crdt ─→ graph ─→ index ─┐
//!                  └──→ navmesh ────────┴─→ plan ─→ paths
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | [`crdt`] | the map as a join of increments: state, replica, compaction, difference |
//! | [`graph`] | nodes and edges as a graph; A* with landmarks (ALT) and overlay cells |
//! | [`index`] | nodes by place and by appearance, kept up with the map |
//! | `navmesh` | free space as a mesh of triangles, and Polyanya's search through it |
//! | [`plan`] | paths (the paper's section III-C-2, equation 11) that obey what is closed |
//! | `permission` | who may write what, by role |
//! | `operator_journal` | what operators have done, in words |
//!
//! ```
//! use fht_map::{FreeSpace, MapState, NodeRouteConfig, Rules};
//! use fht_proto::{AuthorId, FixedPoint, FixedPose, Increment, NodeId, NodeKind, Op, Rect};
//!
//! // A corridor of two nodes, 5 m apart.
//! let author = AuthorId::of_robot("explorer");
//! let node = |number: u32, x: f64| {
//!     let (id, pose) = (NodeId { author, number }, FixedPose::from_metres(x, 0.0, 0.0));
//!     let rect = Rect::around(pose.position, (x - 3.0, -1.0), (x + 3.0, 1.0));
//!     let put = Op::PutNode { id, kind: NodeKind::Support, pose };
//!     [put, Op::SetFreeSpace { id, rect: Some(rect) }]
//! };
//! let ops = [node(0, 0.0), node(1, 5.0)].concat();
//! let increment = Increment { author, number: 1, hlc_us: 1, ops };
//!
//! let mut map = MapState::new();
//! map.apply(&increment);
//! let digest = map.digest();
//! map.apply(&increment);
//! assert_eq!(map.digest(), digest, "order and repetition do not matter");
//!
//! let rules = Rules::of(&map, Vec::new());
//! let space = FreeSpace::of(&map, &rules.space_config());
//! let (from, to) = (FixedPoint::from_metres(-2.0, 0.5), FixedPoint::from_metres(7.0, -0.5));
//! let path = rules.plan(&map, &space, from, to, &NodeRouteConfig::default())?;
//! assert!((path.length_m - from.distance(to)).abs() < 1e-9, "straight ahead");
//! # Ok::<(), fht_map::PlanError>(())
//! ```

pub mod crdt;
pub mod graph;
pub mod index;
mod navmesh;
mod operator_journal;
mod permission;
pub mod plan;

pub use crdt::annotations::{Annotations, ReleaseRef};
pub use crdt::replica::{Accepted, Replica};
pub use crdt::state::{Counts, FULL_TRUST, MapState, NodeRef};
pub use index::map_index::{IndexConfig, MapIndex, SearchIndexJob};
pub use index::spatial::Places;
pub use navmesh::entry_config::EntryConfig;
pub use navmesh::free_space::{FreeSpace, SpaceConfig};
pub use navmesh::limits::{OverBudget, SpaceLimits};
pub use navmesh::outside::Ground;
pub use operator_journal::{OperatorChange, OperatorJournal};
pub use permission::{NotPermitted, RoleViolation, WriterRole, WriterRoles, may_write, takes_from_others};
pub use plan::node_route::{NodeRoute, NodeRouteConfig, PathEnds, RouteError};
pub use plan::rules::{PlanError, Rules};
pub use plan::words::{DoubtfulWords, check_place, check_zone};
