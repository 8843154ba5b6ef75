//! Copies of a map at a stand-in for a map-server that misbehaves. One program, because each costs
//! a build of Zenoh's sessions; `cargo xtask test` runs its modules as programs of their own.
#![allow(clippy::unwrap_used)] // tests may panic

mod stand_in;

mod distrustful_replica;
mod live_replica;
mod lost_answers;
