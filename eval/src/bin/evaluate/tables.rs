//! `evaluate tables`: the paper's two tables with our figures, and more.

mod paper;
pub mod plot;
mod report;
mod results;

use crate::files::Files;
use crate::maps::{MapArgs, Variant, short_name};
use crate::output::{OutputArgs, say, write_file};
use crate::paths::{self, PairArgs, PathFigures};
use crate::relocalize;
use crate::systems::Column;
use crate::systems::storage::StorageFigures;
use crate::trials::figures::relocalize_figures;
use crate::trials::{Start, TrialArgs, Trials};
use clap::Args;
use plot::{Axes, Line, steps, svg};
use results::{PLOTS, TableEntry, WorldResults, entry};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub struct TablesArgs {
    #[command(flatten)]
    maps: MapArgs,
    #[command(flatten)]
    trials: TrialArgs,
    #[command(flatten)]
    pairs: PairArgs,
    /// Write the tables to this Markdown file, and the plots to a folder `plots` beside it.
    #[arg(long, value_name = "FILE", value_parser = fht_program::flags::output_file)]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

impl TablesArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds).writes("--out", &self.out)
    }
}

pub fn run(args: &TablesArgs) -> Result<(), String> {
    let trials = relocalize::measure(&args.maps, &args.trials, &args.output)?;
    let paths = paths::measure(&args.maps, &args.pairs, &args.trials.systems, &args.output)?;
    let mut all = Vec::new();
    for world in &args.maps.worlds {
        let storage = StorageFigures::of(&args.maps.survey(world, Variant::Ours)?)?;
        let name = short_name(world);
        let of_world = trials.iter().filter(|trials| trials.world == name);
        let entries: Vec<TableEntry> =
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

fn write(out: &Path, text: &str, plots: &[(String, String)]) -> Result<(), String> {
    let folder = out.with_file_name(PLOTS);
    std::fs::create_dir_all(&folder).map_err(|error| format!("{} cannot be written: {error}", folder.display()))?;
    for (name, svg) in plots {
        write_file(&folder.join(name), svg)?;
    }
    write_file(out, text)?;
    say(&format!("tables       {}\nplots        {} in {}", out.display(), plots.len(), folder.display()))
}
