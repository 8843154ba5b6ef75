//! Increments to the server: each is put the moment it exists, and kept until the server's head
//! covers it and it was read back. After a lost link or a restarted server the rest is sent again
//! from there. With a spool each is on the robot's disk before it is put.
//!
//! | module | idea |
//! | --- | --- |
//! | `journal` | operations become increments, numbered and stamped |
//! | `outbox` | the robot's side: increments go in, and how far they have come is seen |
//! | `progress` | how far that is |
//! | `publisher` | puts them, and again what the server lacks |
//! | `window` | what the server does not have yet: which goes out next, and when again |
//! | `verify` | what the server has, read back |
//! | `head` | what the server has, asked of it |
//! | `spool` | what is not acknowledged, on the robot's disk |
//! | `recovery` | what the last run has left, delivered first |
//! | `linked` | a run whose map goes to a server while it is made |

mod error;
mod head;
mod journal;
mod linked;
mod outbox;
mod progress;
mod publisher;
mod recovery;
mod spool;
mod verify;
mod window;

pub use error::PublishError;
pub use head::find_head;
pub use journal::Journal;
pub use linked::LinkedError;
pub(crate) use linked::{Handover, Linked, Publication};
pub use outbox::{Closed, Outbox, outbox};
pub use progress::{EarlierDelivery, Progress, ServerLoss, why_not_acknowledged};
pub use recovery::{DeliverError, deliver};
pub use spool::{RunOrigin, Spool, SpoolError};
pub use verify::{NumberTaken, Verified};
pub use window::{Backlog, ForeignWriter, Window, WindowConfig};
