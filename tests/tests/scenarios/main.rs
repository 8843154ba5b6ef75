//! End-to-end scenarios with real processes. One program, because each costs a build of Zenoh's
//! sessions; `cargo xtask test` runs its modules as programs of their own.
#![allow(clippy::unwrap_used)] // tests may panic

mod programs;
mod site;

mod arrivals;
mod bag_python;
mod deploy;
mod door;
mod explorers;
mod fetching;
mod fleet;
mod footprints;
mod goals;
mod handoff;
mod key_table;
mod library;
mod machines_killed;
mod map_deletion;
mod merge;
mod order_and_loss;
mod python_client;
mod recorded;
mod releases;
mod ros_bag;
mod ros_cameras;
mod ros_explore;
mod ros_handoff;
mod ros_hiroz;
mod ros_navigate;
mod ros_network_cut;
mod ros_rclpy;
mod ros_route;
mod ros_sdk;
mod routers;
mod secured_programs;
mod secured_storages;
mod security;
mod sent;
mod server_gone;
mod server_killed;
mod shared_world;
mod site_interrupted;
mod starts;
mod thin_link;
mod writers;
mod zenoh_cli;
