//! The other explorers of the same map.

mod founding;
mod joining;
mod peers;

pub(crate) use founding::{CLAIM_TIME, ROLL_CALL};
pub use joining::JoinConfig;
pub(crate) use joining::Joining;
pub use peers::EnterError;
pub(crate) use peers::{MapEntry, Peers};
