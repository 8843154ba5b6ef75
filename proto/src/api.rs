//! What is said over Zenoh.
//!
//! | module | idea |
//! | --- | --- |
//! | [`keys`] | key expressions, built and parsed in one place |
//! | [`request`] | queries as they come, to typed requests |
//! | [`reply`] | replies as JSON, and error replies |
//! | [`compact`] | the same replies for `fmt=postcard` |
//! | [`fleet`] | what robots say of themselves |
//! | [`deletion`] | that a map will be deleted, or was |
//! | [`quota`] | what writers take of a server's room |
//! | [`goal`] | where robots are sent, and what becomes of it |

pub mod compact;
pub mod deletion;
pub mod fleet;
pub mod goal;
pub mod keys;
pub mod quota;
pub mod reply;
pub mod request;
