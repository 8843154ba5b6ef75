//! `evaluate tables`: the paper's two tables again, and what it does not say.

use crate::figures::{RelocalizeFigures, relocalize_figures};
use crate::maps::{MapArgs, Variant, short_name};
use crate::output::{OutputArgs, say, write_file};
use crate::paths::{self, PairArgs, PathFigures};
use crate::plot::{Axes, Line, steps, svg};
use crate::relocalize::{self, Start, TrialArgs, Trials};
use crate::report;
use crate::storage::Storage;
use crate::systems::{Column, System};
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub struct TablesArgs {
    #[command(flatten)]
    maps: MapArgs,
    #[command(flatten)]
    trials: TrialArgs,
    #[command(flatten)]
    pairs: PairArgs,
    /// Write the tables to this Markdown file, and the plots to a folder `results` beside it.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// All figures of one system in one world.
#[derive(Debug, Serialize)]
pub struct Entry {
    #[serde(flatten)]
    pub relocalize: RelocalizeFigures,
    pub c_path_mean: Option<f64>,
    pub c_path_p95: Option<f64>,
    pub c_path_max: Option<f64>,
    pub paths: usize,
    pub paths_blocked: usize,
    pub paths_refused: usize,
    pub authors_c_path: Option<[f64; 2]>,
    pub plan_ms_mean: f64,
    pub storage_bytes: usize,
    /// The grid deflated, for systems that need the grid.
    pub storage_deflated_bytes: Option<usize>,
}

/// The same, and how the system does after furniture has moved.
#[derive(Debug, Serialize)]
struct SystemEntry<'a> {
    #[serde(flatten)]
    entry: &'a Entry,
    furniture_moved: Option<&'a RelocalizeFigures>,
}

/// All that is known of one world.
pub struct WorldResults {
    /// Its name.
    pub world: String,
    /// Of all systems and columns.
    pub entries: Vec<Entry>,
    /// Bytes of our map.
    pub storage: Storage,
    /// Things gone, shifted or new in the column with furniture moved.
    pub changes: usize,
}

impl WorldResults {
    /// One entry for each system: of the building as mapped, if that was looked at.
    fn by_system(&self) -> Vec<SystemEntry<'_>> {
        let entry = |&system: &System| {
            let moved = self.entry(system, Column::FurnitureMoved);
            let entry = self.entry(system, Column::AsMapped).or(moved)?;
            Some(SystemEntry { entry, furniture_moved: moved.map(|moved| &moved.relocalize) })
        };
        System::value_variants().iter().filter_map(entry).collect()
    }

    /// A system's figures.
    pub fn entry(&self, system: System, column: Column) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.relocalize.system == system && entry.relocalize.column == column)
    }
}

pub fn run(args: &TablesArgs) -> Result<(), String> {
    let trials = relocalize::measure(&args.maps, &args.trials, &args.output)?;
    let paths = paths::measure(&args.maps, &args.pairs, &args.trials.systems, &args.output)?;
    let mut all = Vec::new();
    for world in &args.maps.worlds {
        let storage = Storage::of(&args.maps.survey(world, Variant::Ours)?)?;
        let name = short_name(world);
        let of_world = trials.iter().filter(|trials| trials.world == name);
        let entries: Vec<Entry> =
            of_world.filter_map(|trials| entry(relocalize_figures(trials), &paths, &storage)).collect();
        let changes = relocalize::changed(world)?.changes();
        all.push(WorldResults { world: name, entries, storage, changes });
    }
    args.output.write(&all.iter().flat_map(WorldResults::by_system).collect::<Vec<_>>())?;
    let plots = draw(&trials, &paths, args.trials.drive_m);
    let names: Vec<&str> = plots.iter().map(|(name, _)| name.as_str()).collect();
    let text = report::markdown(&all, &args.trials, args.pairs.pairs, &names);
    match &args.out {
        Some(out) => write(out, &text, &plots),
        None => say(&text),
    }
}

fn entry(relocalize: RelocalizeFigures, paths: &[PathFigures], storage: &Storage) -> Option<Entry> {
    let system = relocalize.system;
    let own = |paths: &&PathFigures| paths.world == relocalize.world && paths.system == system.planner();
    let paths = paths.iter().find(own)?;
    let is_grid = matches!(system, System::Amcl | System::AmclNav2);
    Some(Entry {
        c_path_mean: paths.c_path_mean,
        c_path_p95: paths.c_path_p95,
        c_path_max: paths.c_path_max,
        paths: paths.pairs,
        paths_blocked: paths.paths_blocked,
        paths_refused: paths.refused,
        authors_c_path: paths.authors_c_path,
        plan_ms_mean: paths.plan_ms_mean,
        storage_bytes: paths.storage_bytes,
        storage_deflated_bytes: is_grid.then_some(storage.grid_deflated),
        relocalize,
    })
}

/// Plots with their file names.
fn draw(trials: &[Trials], paths: &[PathFigures], drive_m: f64) -> Vec<(String, String)> {
    let mut plots = Vec::new();
    let mut worlds: Vec<&str> = trials.iter().map(|trials| trials.world.as_str()).collect();
    worlds.dedup();
    for world in worlds {
        for column in [Column::AsMapped, Column::FurnitureMoved] {
            let own = trials.iter().filter(|trials| trials.world == world && trials.column == column);
            let lines: Vec<Line> = own.map(|trials| success(trials, drive_m)).collect();
            if lines.is_empty() {
                continue;
            }
            let title = format!("{world}, {}: the place is known, and right", column.title());
            let axes = Axes {
                title: &title,
                x: "distance driven, m",
                y: "share of the starts",
                x_range: (0.0, drive_m),
                y_range: (0.0, 1.0),
            };
            let name = format!("success-{world}-{}.svg", column.title().replace(' ', "-"));
            plots.push((name, svg(&axes, &lines)));
        }
        let own = paths.iter().filter(|paths| paths.world == world);
        let lines: Vec<Line> = own
            .map(|paths| Line {
                label: paths.system.title().to_owned(),
                points: steps(paths.ratios.iter().map(|&ratio| f64::from(ratio)).collect(), paths.pairs, 2.0),
            })
            .collect();
        let title = format!("{world}: lengths of paths");
        let axes = Axes {
            title: &title,
            x: "length over the shortest, C_path",
            y: "share of the pairs",
            x_range: (1.0, 2.0),
            y_range: (0.0, 1.0),
        };
        plots.push((format!("paths-{world}.svg"), svg(&axes, &lines)));
    }
    plots
}

fn success(trials: &Trials, drive_m: f64) -> Line {
    let drawn: Vec<_> = trials.outcomes.iter().filter(|(start, _)| matches!(start, Start::Drawn(_))).collect();
    let right = drawn.iter().filter_map(|(_, outcome)| Some(outcome.right?.driven_m)).collect();
    Line { label: trials.system.title().to_owned(), points: steps(right, drawn.len(), drive_m) }
}

/// Where plots lie, beside the tables.
pub const PLOTS: &str = "results";

fn write(out: &Path, text: &str, plots: &[(String, String)]) -> Result<(), String> {
    let folder = out.with_file_name(PLOTS);
    std::fs::create_dir_all(&folder).map_err(|error| format!("{} cannot be written: {error}", folder.display()))?;
    for (name, svg) in plots {
        write_file(&folder.join(name), svg)?;
    }
    write_file(out, text)?;
    say(&format!("tables       {}\nplots        {} in {}", out.display(), plots.len(), folder.display()))
}
