//! From arrivals to acknowledgement: check, put in order, store in one commit, apply, announce.
//! Nothing here knows the network, so everything can be tested with bytes.
//!
//! ```text
//! WriterQueue ─→ check ─→ role, room ─→ reorder ─→ commit to log ─→ catalog ─→ BatchOutcome
//!                  └ refusal ─→ RefusalThrottle ─→ RefusalNotice
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `queue` | what has arrived, bounded in bytes, and the operators' jobs |
//! | `check` | what is wrong with an increment |
//! | `admission` | who may write what, and how much |
//! | `guard` | the writer judges by that |
//! | `room` | the limits, and what can be done when one is reached |
//! | `beyond` | what is taken all the same |
//! | `intake` | what the writer knows about a map |
//! | `pipeline` | check, order, commit, apply: the one writer |
//! | `batch` | what one commit adds |
//! | `import` | takes in maps from files, and from storages |
//! | `pending_maps` | increments that arrived before the first of their map |
//! | `refusals` | what writers are told about refused increments |
//! | `retention` | compacts old increments |
//! | `deletion` | deletes maps after a grace period |
//! | `renaming` | a map goes on under another name |
//! | `standstill` | what is refused while nothing can be stored, and how the writer goes on |

mod admission;
mod batch;
mod beyond;
mod check;
mod deletion;
mod guard;
mod import;
mod intake;
mod pending_maps;
mod pipeline;
mod queue;
mod refusals;
mod renaming;
mod retention;
mod room;
mod standstill;

pub use batch::{BatchOutcome, WriterOutcome};
pub use check::{Arrival, Checked, Refusal, check};
pub use pipeline::Ingest;
pub use queue::{WriterJob, WriterQueue, WriterWork};
pub use refusals::{RefusalNotice, RefusalThrottle};
pub use retention::Retained;
pub use room::RoomLimit;
