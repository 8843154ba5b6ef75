//! `evaluate knobs`: what each of the mapper's knobs buys, and what it costs in bytes of map.

use crate::files::Files;
use crate::maps::knob::Knob;
use crate::maps::{MapArgs, Variant, short_name};
use crate::numbers::metres;
use crate::output::{OutputArgs, none, number, say, write_file};
use crate::paths::{self, PairArgs, PathFigures};
use crate::relocalize;
use crate::systems::storage::StorageFigures;
use crate::systems::{Column, System};
use crate::trials::TrialArgs;
use crate::trials::figures::{RelocalizeFigures, relocalize_figures};
use clap::{Args, ValueEnum};
use fht_program::flags::output_file;
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub struct KnobsArgs {
    #[command(flatten)]
    maps: MapArgs,
    /// Knobs, separated by commas, each varied by itself [default: all].
    #[arg(long, value_enum, value_delimiter = ',')]
    knobs: Vec<Knob>,
    /// Starts in each world, drawn as for `relocalize`; the authors' own come on top.
    #[arg(long, default_value_t = 100, value_parser = fht_program::flags::count)]
    starts: u64,
    /// Distance after which a drive ends, metres.
    #[arg(long, default_value_t = 15.0, value_parser = metres)]
    drive_m: f64,
    #[command(flatten)]
    pairs: PairArgs,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE", value_parser = output_file)]
    out: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// What a map is worth.
#[derive(Debug, Serialize)]
struct KnobFigures {
    world: String,
    /// None: the default configuration.
    knob: Option<Knob>,
    storage: StorageFigures,
    relocalize: RelocalizeFigures,
    paths: PathFigures,
}

impl KnobsArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        Files::of(&self.output).in_worlds(&self.maps.worlds).writes("--out", &self.out)
    }
}

pub fn run(args: &KnobsArgs) -> Result<(), String> {
    if args.maps.knob.is_some() {
        return Err("all knobs are turned, one at a time: choose some by --knobs, not one by --knob".to_owned());
    }
    let knobs = if args.knobs.is_empty() { Knob::value_variants() } else { &args.knobs };
    let mut maps = args.maps.clone();
    let mut all = Vec::new();
    for world in &args.maps.worlds {
        for knob in std::iter::once(None).chain(knobs.iter().copied().map(Some)) {
            (maps.worlds, maps.knob) = (vec![world.clone()], knob);
            all.push(measure(args, &maps, world)?);
            // Results measured from here on are kept.
            maps.afresh = false;
        }
    }
    args.output.write(&all)?;
    let text = markdown(args, &all);
    match &args.out {
        Some(out) => write_file(out, &text),
        None => say(&text),
    }
}

fn measure(args: &KnobsArgs, maps: &MapArgs, world: &str) -> Result<KnobFigures, String> {
    let (systems, columns) = (vec![System::Ours], vec![Column::AsMapped]);
    let trials = TrialArgs { starts: args.starts, systems, columns, drive_m: args.drive_m, only_kept: false };
    let missing = || format!("{world}: nothing was measured");
    let relocalize = relocalize::measure(maps, &trials, &args.output)?.first().map(relocalize_figures);
    let paths = paths::measure(maps, &args.pairs, &trials.systems, &args.output)?.pop();
    Ok(KnobFigures {
        world: short_name(world),
        knob: maps.knob,
        storage: StorageFigures::of(&maps.survey(world, Variant::Ours)?)?,
        relocalize: relocalize.ok_or_else(missing)?,
        paths: paths.ok_or_else(missing)?,
    })
}

fn markdown(args: &KnobsArgs, all: &[KnobFigures]) -> String {
    let mut text = format!(
        "# What each knob buys\n\nWritten by `evaluate knobs`: one exploration for each row, {} starts, drives of at\n\
         most {} m, {} pairs of places. Success is that of declared poses within 1 m and 5°.\n",
        args.starts, args.drive_m, args.pairs.pairs
    );
    for world in &args.maps.worlds {
        let world = short_name(world);
        // Writing to a string cannot fail.
        write!(text, "\n## {world}\n\n{HEAD}").unwrap_or_default();
        for figures in all.iter().filter(|figures| figures.world == world) {
            writeln!(text, "{}", figures.row()).unwrap_or_default();
        }
    }
    text
}

const HEAD: &str = "\
| map | bytes | main nodes | support nodes | edges | success, % | l_reloca, m | false fixes | C_path: mean, 95 %, greatest | touch something | refused |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
";

impl KnobFigures {
    fn row(&self) -> String {
        let [main, support, edges] = self.storage.counts;
        let (known, paths) = (&self.relocalize, &self.paths);
        let ratio = |value: Option<f64>| value.map_or_else(none, |value| number(value, 3));
        format!(
            "| {} | {} | {main} | {support} | {edges} | {:.0} | {} | {} | {}, {}, {} | {} | {} |",
            self.knob.map_or("as it comes", Knob::title),
            self.storage.total,
            100.0 * known.success,
            number(known.l_reloca_mean_m, 3),
            known.false_fixes,
            ratio(paths.c_path_mean),
            ratio(paths.c_path_p95),
            ratio(paths.c_path_max),
            paths.paths_blocked,
            paths.refused
        )
    }
}
