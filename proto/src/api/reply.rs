//! Replies, as JSON (`application/json`) unless the asker wants the compact form
//! ([`crate::api::compact`]). Errors are error replies with an [`ErrorReply`] as JSON, never
//! silence.

mod cursor;
mod diff;
mod error;
mod head;
mod journal;
mod known_names;
mod nodes;
mod path;
mod place;
mod release;
mod rules;
mod series;

pub use crate::model::compaction::Series;
pub use cursor::ParseCursorError;
pub use diff::{DiffReply, MovedNode, StateView};
pub use error::{ErrorCode, ErrorReply};
pub use head::{Head, MapsReply};
pub use journal::{JournalCursor, JournalEntry, JournalReply};
pub use known_names::known_names;
pub use nodes::{NodeView, NodesCursor, NodesReply};
pub use path::{Obeyed, PathReply, SpeedLimit, Waypoint};
pub use place::{PlaceRef, check_yaw, parse_angle, parse_point};
pub use release::{ReleaseView, ReleasesReply};
pub use rules::{BlockedView, DatumView, FloorPlanView, IgnoredView, PlaceView, RuleView, RulesReply, ZoneView};
pub use series::{
    CompactedIncrementView, CompactedOpView, CompactedSeriesView, DescriptorView, IncrementView, OpView, ScanView,
    SeriesReply, ZoneShape,
};
