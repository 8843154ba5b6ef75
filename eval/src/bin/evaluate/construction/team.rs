//! `evaluate team`: several explorers in one building against one.

use crate::files::Files;
use crate::maps::short_name;
use crate::numbers::{apart, share};
use crate::output::{OutputArgs, say};
use crate::paths::{PathFigures, quality};
use clap::Args;
use fht_demo::TrueFloor;
use fht_eval::{GridMap, Member, Survey, TeamReport, TeamRun, TeamTask, explore_as_team};
use fht_picture::{MapPicture, PictureConfig, default_file};
use fht_program::flags::{count, folder, how_many};
use fht_proto::encode;
use fht_sim::{World, start_near};
use mapper::MapperConfig;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug, Args)]
pub struct TeamArgs {
    /// Buildings: museum, office, or paths of Nav2 map.yaml or Gazebo .world files, separated
    /// by commas.
    #[arg(long, value_delimiter = ',', default_value = "office")]
    worlds: Vec<String>,
    /// Seeds of noise, wheels and starts, from 1 up to this.
    #[arg(long, default_value_t = 3, value_parser = count)]
    seeds: u64,
    /// Explorers.
    #[arg(long, default_value_t = 2, value_parser = how_many)]
    explorers: usize,
    /// The others begin at most so far from the first, in its sight; 'inf': anywhere. Metres.
    #[arg(long, default_value_t = 3.0, value_parser = apart)]
    apart_m: f64,
    /// The first one dies after this share of the time that it would take alone, and one more
    /// begins 30 s later.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    succeed_at: Option<f64>,
    /// Pairs of places for the quality of paths; 0: none.
    #[arg(long, default_value_t = 1000)]
    pairs: usize,
    /// Without cameras: several times faster.
    #[arg(long)]
    no_cameras: bool,
    /// A picture of each map of a team, in this folder.
    #[arg(long, value_name = "FOLDER", value_parser = folder)]
    pictures: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// One seed in one building.
#[derive(Serialize)]
struct Row {
    world: String,
    seed: u64,
    alone: TeamReport,
    team: TeamReport,
    /// Time of the team over the time of one.
    ratio: f64,
    paths_alone: Option<PathFigures>,
    paths_team: Option<PathFigures>,
}

/// Simulated time after which an exploration is given up, seconds.
const PATIENCE_S: f64 = 4.0 * 3600.0;
/// A successor begins so long after a death, seconds.
const SUCCEEDED_AFTER_S: f64 = 30.0;

impl TeamArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.worlds)
    }
}

pub fn run(args: &TeamArgs) -> Result<(), String> {
    say(
        "| world | seed | one: time, explored | team: time, explored | ratio | joined after | parts | nodes' errors, mean and greatest | collisions |",
    )?;
    say("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    let mut rows = Vec::new();
    for spec in &args.worlds {
        let world = Arc::new(fht_sim::load(spec, None, 1).map_err(|error| error.to_string())?);
        for seed in 1..=args.seeds {
            let row = compare(args, spec, &world, seed)?;
            say(&line(&row))?;
            for paths in [&row.paths_alone, &row.paths_team].into_iter().flatten() {
                say(&format!("    {}", paths.line()))?;
            }
            rows.push(row);
            args.output.write(&rows)?;
        }
    }
    Ok(())
}

fn compare(args: &TeamArgs, spec: &str, world: &Arc<World>, seed: u64) -> Result<Row, String> {
    let first = Member::at(world.start());
    let alone = explore(args, world, vec![first.clone()], seed, "alone")?;
    let members = match args.succeed_at {
        Some(share) => {
            let dies_s = share * alone.report.time_s;
            let begins_s = dies_s + SUCCEEDED_AFTER_S;
            let next = Member { begins_s, ..Member::at(start_near(world, &first.start, args.apart_m, seed)) };
            vec![Member { dies_s: Some(dies_s), ..first }, next]
        }
        None => {
            let start = |number: usize| start_near(world, &first.start, args.apart_m, 100 * seed + number as u64);
            let others = (1..args.explorers).map(|number| Member::at(start(number)));
            std::iter::once(first.clone()).chain(others).collect()
        }
    };
    let team = explore(args, world, members, seed, "team")?;
    if let Some(folder) = &args.pictures {
        std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
        let path = folder.join(default_file("team", spec, Some(seed)));
        let title = format!("team of {}: {}, seed {seed}", team.report.members.len(), short_name(spec));
        let floor = TrueFloor::new(world.plan(), team.world_from_map);
        let picture = MapPicture { title, floor: &floor, map: &team.map, driven: &[], marks: &[] };
        picture.save(&PictureConfig::default(), &path).map_err(|error| error.to_string())?;
    }
    let ratio = team.report.time_s / alone.report.time_s.max(1e-9);
    let paths = |run: &TeamRun| -> Result<Option<PathFigures>, String> {
        let survey = survey(world, run)?;
        (args.pairs > 0).then(|| quality(&survey, spec, args.pairs, &args.output)).transpose()
    };
    let (paths_alone, paths_team) = (paths(&alone)?, paths(&team)?);
    let (alone, team) = (alone.report, team.report);
    Ok(Row { world: short_name(spec), seed, alone, team, ratio, paths_alone, paths_team })
}

fn explore(args: &TeamArgs, world: &Arc<World>, members: Vec<Member>, seed: u64, of: &str) -> Result<TeamRun, String> {
    let mapper = MapperConfig::default();
    let task = TeamTask { members, seed, cameras: !args.no_cameras, mapper, most_s: PATIENCE_S };
    let bar = args.output.progress_bar(0, "{spinner} {msg}, {elapsed} gone");
    let watch = |now_s: f64, free_m2: f64| {
        bar.set_message(format!(
            "{}, seed {seed}, {of}: {now_s:.0} s of robot time, {free_m2:.0} m² free",
            world.name()
        ));
        bar.tick();
    };
    let outcome =
        explore_as_team(world, &task, watch).map_err(|error| format!("{}, seed {seed}: {error}", world.name()));
    bar.finish_and_clear();
    outcome
}

fn survey(world: &Arc<World>, run: &TeamRun) -> Result<Survey, String> {
    let increments = run.increments.iter().map(encode).collect::<Result<_, _>>().map_err(|error| error.to_string())?;
    Ok(Survey {
        world: world.clone(),
        world_from_map: run.world_from_map,
        map: run.map.clone(),
        increments,
        grid: GridMap::of(&run.grid).map_err(|error| error.to_string())?,
        passes: Vec::new(),
        identity: run.map.digest().to_string(),
    })
}

fn line(row: &Row) -> String {
    let Row { world, seed, alone, team, ratio, .. } = row;
    let joined = |joined: Option<[f64; 2]>| joined.map_or("never".to_owned(), |[s, m]| format!("{s:.0} s, {m:.1} m"));
    let each =
        |show: &dyn Fn(&fht_eval::MemberReport) -> String| team.members.iter().map(show).collect::<Vec<_>>().join("; ");
    format!(
        "| {world} | {seed} | {:.0} s, {:.1} % | {:.0} s ({}), {:.1} % | {ratio:.3} | {} | {} ({:.1} %) | {} | {} |",
        alone.time_s,
        100.0 * alone.explored_fraction,
        team.time_s,
        each(&|member| format!(
            "{:.0} s, {:.0} m, {}",
            member.ended_s,
            member.driven_m,
            member.ending.map_or("died".to_owned(), |e| e.to_string())
        )),
        100.0 * team.explored_fraction,
        each(&|member| joined(member.joined)),
        team.parts,
        100.0 * team.largest_part,
        each(&|member| format!("{:.3}, {:.3} m", member.node_error_mean_m, member.node_error_max_m)),
        each(&|member| member.collisions.to_string()),
    )
}
