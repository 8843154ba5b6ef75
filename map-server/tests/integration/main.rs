//! What a map-server keeps, answers and refuses: as a library, as a process, over Zenoh and HTTP.
//! One program, because each costs a build of Zenoh's sessions; `cargo xtask test` runs its modules
//! as programs of their own.
#![allow(clippy::unwrap_used)] // tests may panic

#[path = "../../../tests/src/packages.rs"]
#[allow(dead_code)] // other tests use more of it
mod packages;
mod support;

mod blocked;
mod damage;
mod deletion;
mod disk_faults;
mod displaced_store;
mod fair_queries;
mod full;
mod hostile;
mod imports;
mod ingest;
mod journal;
mod large;
#[cfg(feature = "web")]
mod metrics;
mod operators;
mod processes;
mod quarantine;
mod queries;
mod restore;
mod retention;
mod revocation;
mod roles;
mod sick_disk;
mod stateless;
#[cfg(feature = "otel")]
mod traces;
mod undo;
#[cfg(feature = "web")]
mod web;
#[cfg(feature = "web")]
mod web_browser;
