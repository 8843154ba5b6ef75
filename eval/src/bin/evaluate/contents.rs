//! `evaluate contents`: what maps consist of, what they take up, and how much of what a robot sees
//! they know.

use crate::files::Files;
use crate::maps::{MapArgs, Variant};
use crate::output::{OutputArgs, say};
use clap::Args;
use fht_eval::KnownShare;
use fht_eval::Storage;
use fht_map::Counts;
use fht_program::flags::count;
use serde::Serialize;

#[derive(Debug, Args)]
pub struct ContentsArgs {
    #[command(flatten)]
    maps: MapArgs,
    /// Places to look around at, drawn uniformly from where the robot has room.
    #[arg(long, default_value_t = 1000, value_parser = count)]
    places: u64,
    #[command(flatten)]
    output: OutputArgs,
}

/// Figures of one world.
#[derive(Debug, Serialize)]
pub struct ContentsFigures {
    world: String,
    main_nodes: usize,
    support_nodes: usize,
    edges: usize,
    storage: Storage,
    known: KnownShare,
}

impl ContentsArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds)
    }
}

pub fn run(args: &ContentsArgs) -> Result<(), String> {
    let mut all = Vec::new();
    for world in &args.maps.worlds {
        let survey = args.maps.survey(world, Variant::Ours)?;
        let Counts { main_nodes, support_nodes, edges, .. } = survey.map.counts();
        let figures = ContentsFigures {
            world: survey.world.name().to_owned(),
            main_nodes,
            support_nodes,
            edges,
            storage: Storage::of(&survey.increments).map_err(|error| error.to_string())?,
            known: KnownShare::of(&survey, args.places),
        };
        say(&serde_json::to_string(&figures).map_err(|error| error.to_string())?)?;
        all.push(figures);
    }
    args.output.write(&all)
}
