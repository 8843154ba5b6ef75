//! The map server: takes increments in, keeps every version of the maps, and answers queries over
//! Zenoh.
//!
//! ```text
//!            ┌─────────────── network ───────────────┐
//! increments │ subscribe ─→ WriterQueue              │
//!            │                  ↓                    │
//!            │   ingest: check, order, commit, apply │──→ store: log in a file (redb), or
//!            │                  ↓                    │    replicated: memory before storages
//! heads      │ publish ←── catalog: maps in memory   │
//!            │                  ↓                    │
//! queries    │ queryable ─→ query: answer            │←── robot topics: fleet, blocked edges
//!            └───────────────────────────────────────┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | [`config`] | where the maps are kept, what writers may do, how queries are answered |
//! | `server` | puts the parts together and takes them down in order: [`run`] |
//! | `network` | the service over Zenoh: subscriptions, announcements, the queryable |
//! | [`ingest`] | from arrivals to acknowledgement: the one writer |
//! | [`store`] | the log of increments |
//! | [`replicated`] | the log of a server that keeps nothing itself |
//! | [`catalog`] | the maps in memory, shared with readers |
//! | [`rescue`] | what still reads of a damaged log |
//! | [`query`] | typed requests to replies |
//! | [`access`] | who may do what: from roles to a router's access control |
//! | `web` | the operators' page, behind the feature of this name |
//! | `program` | the command line: serving, and what operators do with a server that runs |
//!
//! An increment is acknowledged when a published head covers it, and a head covers only what a
//! commit has brought to the disk, or to most of the storages. Everything that waits during a
//! commit goes into the next one.
//!
//! # Running a server
//!
//! ```no_run
//! use map_server::{ServerConfig, ServerEndpoints, run};
//!
//! # async fn example() -> Result<(), map_server::ServerError> {
//! let listen = vec!["tcp/127.0.0.1:7447".to_owned()];
//! let link = ServerEndpoints { listen, ..Default::default() };
//! let stop = async { /* until somebody wants the server to end */ };
//! run(ServerConfig::new("maps".into(), link), stop).await
//! # }
//! ```
//!
//! # Without a network
//!
//! Ingest, catalog and answers are plain data and functions, which is how tests and the simulated
//! fleet use them:
//!
//! ```
//! use fht_proto::api::keys::Key;
//! use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, encode};
//! use map_server::catalog::Catalog;
//! use map_server::config::Limits;
//! use map_server::ingest::{Arrival, Ingest};
//! use map_server::store::{IncrementLog, MemoryLog};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let log: Arc<dyn IncrementLog> = Arc::new(MemoryLog::new());
//! let catalog = Arc::new(Catalog::load(log.as_ref())?);
//! let mut ingest = Ingest::new(log, Arc::clone(&catalog), Limits::default());
//!
//! // A robot puts its first increment: one node at the origin of the map.
//! let (map, author): (MapName, _) = ("museum".parse()?, AuthorId::of_robot("amr-7"));
//! let id = NodeId { author, number: 0 };
//! let pose = FixedPose::from_metres(0.0, 0.0, 0.0);
//! let ops = vec![Op::PutNode { id, kind: NodeKind::Main, pose }];
//! let increment = Increment { author, number: 1, hlc_us: 1, ops };
//! let key = Key::increment(&map, author, 1).to_string();
//! let now_us = 1_000_000;
//! let arrival = Arrival { key, payload: Ok(encode(&increment)?) };
//! let outcome = ingest.take_arrivals(vec![arrival], now_us)?;
//!
//! // It is stored, and the map's new head is to be announced.
//! assert!(outcome.announce.contains(&map) && outcome.notices.is_empty());
//! let head = catalog.view(&map).expect("the map has begun").head;
//! assert_eq!((head.version, head.main_nodes), (1, 1));
//! # Ok(())
//! # }
//! ```

pub mod access;
pub mod catalog;
mod clock;
pub mod config;
pub mod ingest;
mod network;
#[cfg(feature = "program")]
mod program;
pub mod query;
pub mod replicated;
pub mod rescue;
mod server;
pub mod store;
mod throttle;
#[cfg(feature = "web")]
mod web;

pub use config::{QuorumConfig, ServerConfig, ServerEndpoints};
pub use network::ServerSessionError;
#[cfg(feature = "program")]
pub use program::{command, main_with_args, serve_until_signal};
pub use server::{ServerError, run, run_beside};
