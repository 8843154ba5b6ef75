//! `evaluate recorded`: robots set down in a recorded log, on a map of its first part, of another
//! log, or of a file.

mod looks;
mod pictures;
mod report;

use crate::files::Files;
use crate::numbers::metres;
use crate::output::{OutputArgs, say};
use clap::Args;
use fht_bag::{FrameConfig, TopicConfig};
use fht_eval::recorded::{
    JudgedDrive, KnownMap, LogDrive, RecordedFigures, RecordedLog, Registration, judge, set_down, starts,
};
use fht_localization::landmarks::Landmarks;
use fht_localization::localizer::LocalizerConfig;
use fht_map::MapState;
use fht_perception::pose::Pose2;
use fht_program::flags::{folder, how_many, number, output_file};
use fht_proto::codec::archive::Archive;
use indicatif::ProgressBar;
use pictures::Pictures;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

#[derive(Debug, Args)]
pub struct RecordedArgs {
    /// The logs: rosbag2 folders or MCAP files.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// The map is made of this share of each log's way (repeatable, or separated by commas); robots
    /// are set down in the rest.
    #[arg(long, value_delimiter = ',', default_value = "0.5", conflicts_with = "map", value_name = "SHARE",
          value_parser = share)]
    map_from: Vec<f64>,
    /// Another map: a log of the same building, or a file that 'map-server export' has written
    /// (*.fht). Where the logs lie in it is what most fixes agree on.
    #[arg(long, value_name = "LOG|FILE")]
    map: Option<PathBuf>,
    /// Robots that are set down in each log, at scans that are evenly spaced.
    #[arg(long, default_value_t = 100, value_parser = how_many)]
    starts: usize,
    /// A robot that has not declared a place after so many metres declares none.
    #[arg(long, default_value_t = 25.0, value_parser = metres)]
    drive_m: f64,
    /// Draw each wrong fix, all starts, and the reliability diagram in this folder.
    #[arg(long, value_name = "FOLDER", value_parser = folder)]
    pictures: Option<PathBuf>,
    /// Robots declare nothing, and what they say at each look is written to this file (CSV), with
    /// what speaks for it and how far it is from the truth.
    #[arg(long, value_name = "FILE", conflicts_with = "map", value_parser = output_file)]
    looks: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

fn share(text: &str) -> Result<f64, String> {
    number(text, 0.01..=0.99)
}

/// Threads that follow drives.
fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

impl RecordedArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        let files = Files::of(&self.output).reads("the log", &self.logs).reads("the map", &self.map);
        files.writes("--looks", &self.looks)
    }
}

pub fn run(args: &RecordedArgs) -> Result<(), String> {
    let mut runs = Vec::new();
    args.looks.as_deref().map(looks::begin).transpose()?;
    let pictures = args.pictures.as_deref().map(Pictures::into).transpose()?;
    let other = args.map.as_deref().map(|path| other_map(args, path)).transpose()?;
    for path in &args.logs {
        let log = read(args, path)?;
        let name = name_of(path);
        let maps: Vec<Option<f64>> = match &other {
            Some(_) => vec![None],
            None => args.map_from.iter().copied().map(Some).collect(),
        };
        for share in maps {
            let figures = match (share, &other) {
                (Some(share), _) => {
                    let first = log.frame_after(share);
                    let known = map_of_part(args, &log, first)?;
                    let map = format!("first {:.0} %", 100.0 * share);
                    evaluate(args, &log, (&name, &map), (&known, first), pictures.as_ref())?
                }
                (None, Some((map, known))) => evaluate(args, &log, (&name, map), (known, 0), pictures.as_ref())?,
                (None, None) => continue,
            };
            say(&report::text(&figures))?;
            runs.push(figures);
        }
    }
    if let Some(pictures) = &pictures {
        pictures.reliability(&runs)?;
    }
    if runs.len() > 1 {
        say(&report::sum(&runs))?;
    }
    args.output.write(&runs)
}

/// All robots of one log on one map.
fn evaluate(
    args: &RecordedArgs,
    log: &RecordedLog,
    (name, map): (&str, &str),
    (known, first): (&KnownMap, usize),
    pictures: Option<&Pictures>,
) -> Result<RecordedFigures, String> {
    let drives = follow(args, log, &known.landmarks, &starts(log, first, args.starts));
    let fixes = || {
        let fix = |drive: &LogDrive| drive.fix.map(|fix| (log.log_from_base[fix.frame], fix.map_from_base));
        drives.iter().filter_map(fix).collect::<Vec<(Pose2, Pose2)>>()
    };
    let registration = known.registration.clone().unwrap_or_else(|| Registration::of_fixes(&fixes()));
    let judged = drives.iter().map(|drive| judge(drive, log, &known.landmarks, &registration));
    let judged: Vec<JudgedDrive> =
        judged.collect::<Option<_>>().ok_or("no robot found its place: is it the map of this building?")?;
    if let Some(file) = &args.looks {
        looks::append(file, (name, map), &judged)?;
    }
    if let Some(pictures) = pictures {
        pictures.of_run(log, &known.landmarks, (name, map), &judged)?;
    }
    Ok(RecordedFigures { truth_lost: log.lost, frames: log.frames.len(), ..RecordedFigures::of(name, map, &judged) })
}

/// Lets robots follow the log, each on its own, in the order of `starts`.
fn follow(args: &RecordedArgs, log: &RecordedLog, landmarks: &Landmarks, starts: &[usize]) -> Vec<LogDrive> {
    let bar =
        args.output.progress_bar(starts.len() as u64, "{bar:40} {pos} of {len} robots, {elapsed} gone, {eta} to go");
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<Option<LogDrive>>> = Mutex::new(vec![None; starts.len()]);
    let mut config = LocalizerConfig::default();
    if args.looks.is_some() {
        config.relocalize.min_confidence = f64::INFINITY;
    }
    let _ = landmarks.walls(); // once, before all threads want them
    std::thread::scope(|scope| {
        for _ in 0..threads() {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&start) = starts.get(index) else { return };
                    let drive = set_down(log, landmarks, start, args.drive_m, &config);
                    done.lock().unwrap_or_else(PoisonError::into_inner)[index] = Some(drive);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    done.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

fn read(args: &RecordedArgs, path: &Path) -> Result<RecordedLog, String> {
    let topics = TopicConfig { cameras: None, ..TopicConfig::default() };
    let bar = args.output.progress_bar(1, "{bar:40} {percent:>3} % of the log, {elapsed} gone, {eta} to go");
    let watch = |read: u64, of: u64| {
        bar.set_length(of);
        bar.set_position(read);
    };
    let log = RecordedLog::read(path, FrameConfig { topics, ..FrameConfig::default() }, watch);
    bar.finish_and_clear();
    log.map_err(|error| format!("{}: {error}", path.display()))
}

fn map_of_part(args: &RecordedArgs, log: &RecordedLog, frames: usize) -> Result<KnownMap, String> {
    mapping(args, frames, |bar| {
        let watch = |frame: usize| bar.set_position(frame as u64);
        KnownMap::of_frames(&log.frames[..frames], Some(&log.log_from_base[..frames]), watch)
    })
}

fn mapping(
    args: &RecordedArgs,
    frames: usize,
    make: impl FnOnce(&ProgressBar) -> Result<KnownMap, fht_eval::recorded::RecordedError>,
) -> Result<KnownMap, String> {
    let bar =
        args.output.progress_bar(frames as u64, "{bar:40} {percent:>3} % of the map, {elapsed} gone, {eta} to go");
    let known = make(&bar).map_err(|error| error.to_string());
    bar.finish_and_clear();
    known.and_then(
        |known| if known.landmarks.is_empty() { Err("the map has no main node".to_owned()) } else { Ok(known) },
    )
}

/// The map of another log or of a file, and its name.
fn other_map(args: &RecordedArgs, path: &Path) -> Result<(String, KnownMap), String> {
    let name = name_of(path);
    if path.extension().is_none_or(|end| end != "fht") {
        let log = read(args, path)?;
        let make =
            |bar: &ProgressBar| KnownMap::of_frames(&log.frames, None, |frame: usize| bar.set_position(frame as u64));
        return Ok((name, mapping(args, log.frames.len(), make)?));
    }
    let wrong = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    let bytes = std::fs::read(path).map_err(|error| wrong(&error))?;
    let mut map = MapState::new();
    for series in Archive::open(&bytes).map_err(|error| wrong(&error))? {
        let series = series.map_err(|error| wrong(&error))?;
        series.folds.iter().for_each(|fold| map.apply_fold(fold));
        series.increments.iter().for_each(|increment| map.apply(increment));
    }
    Ok((name, KnownMap::of_state(&map)))
}

fn name_of(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}
