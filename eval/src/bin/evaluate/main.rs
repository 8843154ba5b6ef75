//! Evaluations on real logs and in simulated buildings, as the field measures them.

mod confidence;
mod construction;
mod contents;
mod files;
mod knobs;
mod maps;
mod missions;
mod numbers;
mod output;
mod paths;
mod people;
mod recorded;
mod relocalize;
mod search;
mod systems;
mod tables;
mod trials;

use clap::{Parser, Subcommand};
use construction::{explore, merge, slam, team};
use fht_program::flags::parse_args;
use fht_program::{ProgramFailure, exit_code, logging};
use files::Files;
use std::process::ExitCode;

/// Measures the map service as the field does.
#[derive(Debug, Parser)]
#[command(
    name = "evaluate",
    version,
    max_term_width = 100,
    after_help = "Examples:
  evaluate tables --worlds ../shared/data/maps/museum.yaml --starts 10 --pairs 100
  evaluate relocalize --worlds museum --starts 20
  evaluate slam ../shared/data/lidar/intel ../shared/data/lidar/intel.relations
  evaluate explore --worlds museum --seeds 3 --no-cameras"
)]
struct Cli {
    #[command(subcommand)]
    part: Part,
}

#[derive(Debug, Subcommand)]
enum Part {
    /// The SLAM on a recorded log, against relations between pairs of scans (Kümmerle et al., "On
    /// measuring the accuracy of SLAM algorithms", Autonomous Robots 2009).
    #[command(after_help = "Examples:
  evaluate slam ../shared/data/lidar/intel ../shared/data/lidar/intel.relations
  evaluate slam ../shared/data/lidar/aces aces.relations --json aces.json --picture aces.png
  evaluate slam ../shared/data/lidar/mit-csail             # no relations: a picture only

LOG is a rosbag2 folder or an MCAP file with /scan and /odom. Each line of RELATIONS is
't1 t2 x y z roll pitch yaw': the pose of the scan taken at t2 in the frame of the scan taken at t1,
metres and radians.")]
    Slam(slam::SlamArgs),
    /// Whole explorations of simulated buildings with drifting wheels: the error of trajectory and
    /// main nodes.
    #[command(after_help = "Examples:
  evaluate explore                                   all of them: about an hour
  evaluate explore --worlds museum --seeds 3 --no-cameras")]
    Explore(explore::ExploreArgs),
    /// Several explorers in one building, against one: the time they take, and how good their map
    /// is.
    #[command(after_help = "Examples:
  evaluate team --worlds office --seeds 3                  two explorers that begin in one room
  evaluate team --worlds office --apart-m inf              … or anywhere in the building
  evaluate team --worlds office --succeed-at 0.5   one dies half-way, another finishes")]
    Team(team::TeamArgs),
    /// Both tables of the paper, with our figures beside the printed ones: relocalization, paths
    /// and storage of our map, of MR-TopoMap, of the grid map and of main nodes only. Goes on where
    /// it stopped.
    #[command(after_help = "Examples:
  evaluate tables --worlds museum,../shared/data/maps/large_indoor.yaml --out tables.md
  evaluate tables --worlds ../shared/data/maps/museum.yaml --starts 10 --json tables.json

100 starts in a world take about half an hour on two cores.")]
    Tables(tables::TablesArgs),
    /// Paths that the map gives, against the shortest ways on the true plan.
    #[command(after_help = "Examples:
  evaluate paths --worlds ../shared/data/maps/museum.yaml,../shared/data/maps/large_indoor.yaml
  evaluate paths --worlds museum --pairs 200")]
    Paths(paths::PathsArgs),
    /// What maps consist of and take up, and how much of what a robot sees they know.
    #[command(after_help = "Examples:
  evaluate contents --worlds ../shared/data/maps/museum.yaml,../shared/data/maps/large_indoor.yaml
  evaluate contents --worlds museum --knob few-main-nodes")]
    Contents(contents::ContentsArgs),
    /// What each knob of the mapper buys: a building explored with one knob turned at a time, and
    /// what its map is worth then.
    #[command(after_help = "Examples:
  evaluate knobs --worlds ../shared/data/maps/museum.yaml --starts 50
  evaluate knobs --worlds museum --knobs few-main-nodes,no-coverage --out knobs.md")]
    Knobs(knobs::KnobsArgs),
    /// Robots dropped anywhere in an explored building: how soon and how well they know where they
    /// are.
    #[command(after_help = "Examples:
  evaluate relocalize --worlds ../shared/data/maps/museum.yaml --starts 100
  evaluate relocalize --worlds museum --starts 20")]
    Relocalize(relocalize::RelocalizeArgs),
    /// Robots that are set down anywhere in an explored building and drive as they like until they
    /// know where they are: to what tells places apart that look alike, or as luck has it.
    #[command(after_help = "Examples:
  evaluate search --worlds ../shared/data/maps/museum.yaml --no-cameras --starts 30
  evaluate search --worlds twins.yaml --no-cameras --json search.json
  evaluate search --worlds twins.yaml --no-cameras --wander")]
    Search(search::SearchArgs),
    /// Missions among people: robots dropped anywhere in an explored building find out where they
    /// are, and drive to a place far off.
    #[command(after_help = "Examples:
  evaluate people --worlds ../shared/data/maps/museum.yaml --people 20
  evaluate people --worlds office --people 40 --starts 20 --no-cameras")]
    People(people::PeopleArgs),
    /// Robots set down in a recorded log, on a map of its first part, of another log, or of a file:
    /// how soon they know where they are, how often they are wrong, and how far they can be
    /// believed.
    #[command(after_help = "Examples:
  evaluate recorded ../shared/data/lidar/intel
  evaluate recorded ../shared/data/lidar/intel --map-from 0.3,0.5,0.7 --pictures intel
  evaluate recorded ../shared/data/lidar/intel --starts 36 --looks looks.csv
  evaluate recorded monday.mcap --map sunday.mcap --starts 50
  evaluate recorded monday.mcap --map museum.fht

What is right, SLAM over the whole log says: within 1 m and 5°. Ground is known where the map
explains three quarters of what is seen on the first 5 m.")]
    Recorded(recorded::RecordedArgs),
    /// What a robot's grounds for a place are worth, fitted to looks of recorded drives; and how
    /// far it can be believed in logs that were left out.
    #[command(after_help = "Examples:
  evaluate recorded ../shared/data/lidar/intel ../shared/data/lidar/aces --looks looks.csv
  evaluate confidence looks.csv")]
    Confidence(confidence::ConfidenceArgs),
    /// Maps of one building that were made from different starts, merged; and maps of different
    /// buildings, refused.
    #[command(after_help = "Examples:
  evaluate merge                               the museum from three starts, and a second building
  evaluate merge --worlds museum,office,../shared/data/maps/museum.yaml --starts 4 --no-cameras")]
    Merge(merge::MergeArgs),
}

fn main() -> ExitCode {
    let cli: Cli = match parse_args(std::env::args_os()) {
        Ok(cli) => cli,
        Err(code) => return exit_code(code),
    };
    logging::init("error,fht_sim=warn");
    let outcome = match cli.part {
        Part::Slam(args) => carry_out(args.files(), || slam::run(&args)),
        Part::Explore(args) => carry_out(args.files(), || explore::run(&args)),
        Part::Team(args) => carry_out(args.files(), || team::run(&args)),
        Part::Tables(args) => carry_out(args.files(), || tables::run(&args)),
        Part::Paths(args) => carry_out(args.files(), || paths::run(&args)),
        Part::Contents(args) => carry_out(args.files(), || contents::run(&args)),
        Part::Knobs(args) => carry_out(args.files(), || knobs::run(&args)),
        Part::Relocalize(args) => carry_out(args.files(), || relocalize::run(&args)),
        Part::Search(args) => carry_out(args.files(), || search::run(&args)),
        Part::People(args) => carry_out(args.files(), || people::run(&args)),
        Part::Recorded(args) => carry_out(args.files(), || recorded::run(&args)),
        Part::Confidence(args) => carry_out(args.files(), || confidence::run(&args)),
        Part::Merge(args) => carry_out(args.files(), || merge::run(&args)),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.tell("evaluate"),
    }
}

/// Carries a part out if its files are as they should be.
fn carry_out(files: Files, run: impl FnOnce() -> Result<(), String>) -> Result<(), ProgramFailure> {
    files.check().map_err(ProgramFailure::of_input)?;
    run().map_err(ProgramFailure::of_run)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn every_part_has_examples_that_are_taken() {
        let command = Cli::command();
        let parts = command.get_subcommands().filter(|part| part.get_name() != "help");
        for part in std::iter::once(&command).chain(parts) {
            let help = part.get_after_help().map(ToString::to_string).unwrap_or_default();
            let examples: Vec<&str> = help.lines().filter_map(|line| line.strip_prefix("  ")).collect();
            assert!(!examples.is_empty(), "{} has no examples", part.get_name());
            for example in examples {
                let line = example.split("  ").next().unwrap_or_default();
                let parsed = Cli::try_parse_from(line.split_whitespace());
                assert!(parsed.is_ok(), "{line}: {:?}", parsed.err().map(|error| error.to_string()));
            }
            assert!(help.lines().all(|line| line.chars().count() <= 100), "{help}");
        }
    }
}
