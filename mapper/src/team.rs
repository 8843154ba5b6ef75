//! The other explorers of the same map.

mod joining;
mod peers;

pub use joining::JoinConfig;
pub(crate) use joining::Joining;
pub use peers::EnterError;
pub(crate) use peers::{CLAIM_TIME, MapEntry, Peers, ROLL_CALL};
