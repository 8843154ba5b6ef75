//! The command line of `handoff`.

use crate::process::Role;
use clap::{Parser, Subcommand};
use fht_program::flags::CompletionsArgs;
use std::ffi::OsString;
use std::path::PathBuf;

/// Shows the whole loop: a robot maps a building, a server keeps the map, and a second robot,
/// dropped somewhere unknown, finds out where it is and drives to a goal on a path that the server
/// gave it.
///
/// Server, explorer and client are processes of their own that talk over Zenoh on this machine.
#[derive(Debug, Parser)]
#[command(
    name = "handoff",
    version,
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  handoff                                  the built-in museum
  handoff --world office --seed 3
  handoff --explorers 2                    two explorers at once
  handoff --succeed                        an explorer dies half-way, another one finishes the job
  handoff --world floor/map.yaml --textures pictures/
  handoff --people 20                      people walk about, stand and gather
  handoff --explorers 2 --people 20        two explorers among them, who see each other
  handoff --ros                            all of it over ROS 2 topics
  handoff --keep                           the server stays up, for `zenoh get`
  handoff --report figures.json            … the figures as JSON; --json FILE is the same flag

Ctrl-C ends all programs that it has started, and removes their folder."
)]
pub struct HandoffArgs {
    /// Something else than the demo.
    #[command(subcommand)]
    pub command: Option<HandoffCommand>,
    /// museum, office, or the path of a Nav2 map.yaml or a Gazebo .world.
    #[arg(long, value_name = "NAME|FILE", default_value = "museum")]
    pub world: String,
    /// Folder of pictures to paint the walls of a Nav2 map with.
    #[arg(long, value_name = "FOLDER")]
    pub textures: Option<PathBuf>,
    /// Seed of the drawing, the noise, the light, start and goal.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// So many explorers at once: they begin in one room, and divide the building among them.
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=8), conflicts_with = "succeed")]
    pub explorers: u8,
    /// So many people walk about. All robots are in one world: they meet the same people, and see
    /// each other.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub people: u16,
    /// The explorer dies half-way (SIGKILL), and another one finishes the job.
    #[arg(long)]
    pub succeed: bool,
    /// The robots speak ROS 2 over Zenoh, each at a router of its own: explorer and client drive
    /// them by their topics, without cameras.
    #[arg(long, conflicts_with_all = ["explorers", "succeed", "textures"])]
    pub ros: bool,
    /// Where the server listens.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7447")]
    pub listen: String,
    /// Leave the server running at the end, until Ctrl-C.
    #[arg(long)]
    pub keep: bool,
    /// Where the picture of the map goes, a PNG file [default: handoff-WORLD-SEED.png].
    #[arg(long, value_name = "FILE", value_parser = fht_program::flags::png_file)]
    pub picture: Option<PathBuf>,
    /// Write the figures to this file as JSON.
    #[arg(long, visible_alias = "json", value_name = "FILE", value_parser = fht_program::flags::output_file)]
    pub report: Option<PathBuf>,
    /// Do not fetch a missing ONNX Runtime library from PyPI: start no process for it.
    #[arg(long)]
    pub no_fetch: bool,
    /// No progress bars.
    #[arg(long, short)]
    pub quiet: bool,
}

/// Something else than the demo.
#[derive(Debug, Subcommand)]
pub enum HandoffCommand {
    /// Runs one of the programs: map-server, mapper, client-robot or sim.
    #[command(after_help = "Examples:
  handoff role map-server -- --data maps
  handoff role mapper -- explore --world museum")]
    Role {
        /// Which.
        role: Role,
        /// Its arguments.
        #[arg(last = true)]
        args: Vec<OsString>,
    },
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArgs),
}
