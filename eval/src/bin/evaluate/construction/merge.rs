//! `evaluate merge`: maps made apart.

use crate::files::Files;
use crate::maps::short_name;
use crate::numbers::share;
use crate::output::{OutputArgs, say};
use clap::Args;
use fht_eval::{MadeMap, Merged, merge_and_measure, quantile_x};
use fht_eval::{Survey, SurveyTask};
use fht_merge::MergeConfig;
use fht_program::flags::{count, folder};
use fht_sim::Changes;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Buildings: museum, office, or paths of map.yaml and .world files, separated by
    /// commas.
    #[arg(long, value_delimiter = ',', default_value = "museum,office")]
    worlds: Vec<String>,
    /// Starts in each building, drawn at random.
    #[arg(long, default_value_t = 3, value_parser = count)]
    starts: u64,
    /// Maps without pictures: several times faster, and merged by scans alone.
    #[arg(long)]
    no_cameras: bool,
    /// Share of the furniture that has moved before the last start in each building.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    changed: Option<f64>,
    /// Also built-in buildings drawn from this seed, as buildings of their own.
    #[arg(long, value_name = "SEED")]
    drawn: Option<u64>,
    /// Where explored maps are kept.
    #[arg(long, value_name = "FOLDER", default_value = "target/evaluation", value_parser = folder)]
    kept: PathBuf,
    #[command(flatten)]
    output: OutputArgs,
}

/// A map of a building.
struct Made {
    building: String,
    name: String,
    made: MadeMap,
    /// What paths are checked against; none where furniture has moved between the maps.
    world: Option<Arc<fht_sim::World>>,
}

/// Two maps.
struct Pair {
    first: (String, MadeMap),
    second: (String, MadeMap),
    is_one_building: bool,
    world: Option<Arc<fht_sim::World>>,
}

/// One pair.
#[derive(Debug, Serialize)]
struct Row {
    first: String,
    second: String,
    is_one_building: bool,
    merged: Option<Merged>,
    refusal: Option<String>,
}

impl MergeArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.worlds)
    }
}

pub fn run(args: &MergeArgs) -> Result<(), String> {
    let mut maps = Vec::new();
    for world in &args.worlds {
        for start in 1..=args.starts {
            let is_last = start == args.starts;
            let changes = args.changed.filter(|_| is_last).map(|share| Changes { share, seed: 1 });
            maps.push(survey(args, world, 1, start, changes)?);
        }
        if let Some(drawn) = args.drawn.filter(|_| ["museum", "office"].contains(&world.as_str())) {
            maps.push(survey(args, world, drawn, 1, None)?);
        }
    }
    say(
        "| first map | second map | merged? | matched | overlap | contradicted | nodes off: mean, greatest | taken over | joined by | parts | paths: planned, touching | s |",
    )?;
    say("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    let mut rows = Vec::new();
    for Pair { first: (first, a), second: (second, b), is_one_building, world } in pairs(&maps) {
        let outcome = merge_and_measure(&a, &b, world.as_deref(), &MergeConfig::default());
        let (merged, refusal) = match outcome {
            Ok(merged) => (Some(merged), None),
            Err(refusal) => (None, Some(refusal.to_string())),
        };
        let row = Row { first, second, is_one_building, merged, refusal };
        say(&line(&row))?;
        rows.push(row);
        args.output.write(&rows)?;
    }
    say(&summary(&rows))
}

fn survey(args: &MergeArgs, world: &str, drawn: u64, start: u64, changes: Option<Changes>) -> Result<Made, String> {
    let loaded = fht_sim::load(world, None, drawn).map_err(|error| error.to_string())?;
    let task = SurveyTask {
        world_seed: drawn,
        changes,
        start: (start > 1).then(|| loaded.random_free_pose(start, 0.35)),
        seed: start,
        cameras: !args.no_cameras,
        ..SurveyTask::usual(world)
    };
    if !Survey::is_kept(&task, &args.kept) {
        fht_program::tell_line!("evaluate: {world} is explored from start {start}, once; that takes a while");
    }
    let survey = Survey::of(&task, &args.kept).map_err(|error| error.to_string())?;
    let drawn = if drawn == 1 { String::new() } else { format!(" drawn {drawn}") };
    let building = format!("{}{drawn}", short_name(world));
    let name = format!("{building} {start}{}", if changes.is_some() { ", furniture moved" } else { "" });
    let world = changes.is_none().then(|| Arc::clone(&survey.world));
    Ok(Made { building, name, made: MadeMap::of(&survey), world })
}

/// All pairs; of one building also parts of both maps, and one in a mirror.
fn pairs(maps: &[Made]) -> Vec<Pair> {
    let mut pairs = Vec::new();
    let named = |one: &Made| (one.name.clone(), one.made.clone());
    for (index, one) in maps.iter().enumerate() {
        for other in &maps[index + 1..] {
            let is_one_building = one.building == other.building;
            let world = one.world.clone().filter(|_| is_one_building && other.world.is_some());
            pairs.push(Pair { first: named(one), second: named(other), is_one_building, world: world.clone() });
            for share in [0.5, 0.3].into_iter().filter(|_| is_one_building) {
                // The given share of the building is in both maps, the rest in one of them.
                let (low, high) = (quantile_x(&one.made, 0.5 - 0.5 * share), quantile_x(&one.made, 0.5 + 0.5 * share));
                let (west, east) = (one.made.part(|at| at.x <= high), other.made.part(|at| at.x >= low));
                let name = |name: &str| format!("{name}, a part ({:.0} % in both)", 100.0 * share);
                let (first, second) = ((name(&one.name), west), (name(&other.name), east));
                pairs.push(Pair { first, second, is_one_building, world: world.clone() });
            }
        }
        let is_first = maps[..index].iter().all(|other| other.building != one.building);
        let second = maps[index + 1..].iter().find(|other| other.building == one.building);
        if let Some(other) = second.filter(|_| is_first) {
            let second = (format!("{}, mirrored", other.name), other.made.mirrored());
            pairs.push(Pair { first: named(one), second, is_one_building: false, world: None });
        }
    }
    pairs
}

fn line(row: &Row) -> String {
    let (first, second) = (&row.first, &row.second);
    match &row.merged {
        Some(Merged {
            alignment, joined, error_mean_m, error_max_m, parts, planned, paths, touching, seconds, ..
        }) => format!(
            "| {first} | {second} | yes | {} of {} | {:.0} m², {:.0} % | {:.1} % | {error_mean_m:.3} m, {error_max_m:.3} m | {} + {} of {} nodes | {} edges | {} | {planned} of {paths}, {touching} | {:.1} |",
            alignment.matched,
            alignment.places,
            alignment.overlap_m2,
            100.0 * alignment.overlap_share,
            100.0 * alignment.contradicted,
            joined.main_nodes,
            joined.support_nodes,
            joined.nodes,
            joined.joining_edges,
            parts[1],
            seconds.iter().sum::<f64>(),
        ),
        None => format!("| {first} | {second} | no: {} | | | | | | | | | |", row.refusal.as_deref().unwrap_or("?")),
    }
}

fn summary(rows: &[Row]) -> String {
    let count = |is_one: bool, is_merged: bool| {
        rows.iter().filter(|row| row.is_one_building == is_one && row.merged.is_some() == is_merged).count()
    };
    let worst = rows.iter().filter(|row| row.is_one_building).filter_map(|row| Some(row.merged.as_ref()?.error_max_m));
    format!(
        "of one building: {} merged, {} refused, greatest error {:.3} m; of different ones: {} merged, {} refused",
        count(true, true),
        count(true, false),
        worst.fold(0.0, f64::max),
        count(false, true),
        count(false, false)
    )
}
