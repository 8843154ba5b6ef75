//! `evaluate slam`: the SLAM alone, on a log.

mod chart;
mod relations;
mod scan_pairs;

use crate::files::Files;
use crate::output::{OutputArgs, say};
use chart::{Posed, draw};
use clap::Args;
use fht_bag::{FrameConfig, Frames, TopicConfig};
use fht_perception::pose::{Point2, Pose2};
use fht_picture::default_file;
use fht_worker::Pace;
use mapper::slam::{Anchored, Slam, SlamConfig, Tracking};
use relations::Errors;
use scan_pairs::ScanPairs;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Debug, Args)]
pub struct SlamArgs {
    /// The log: a rosbag2 folder or an MCAP file.
    log: PathBuf,
    /// The relations; without them there is a picture only.
    relations: Option<PathBuf>,
    /// Where the picture goes: the scans and the trajectory [default: slam-LOG.png].
    #[arg(long, value_name = "FILE", value_parser = fht_program::flags::png_file)]
    picture: Option<PathBuf>,
    /// Scans (sensor_msgs/LaserScan); by default /scan, or the only such topic.
    #[arg(long)]
    scan_topic: Option<String>,
    /// Odometry; by default /odom, the only such topic, or /tf.
    #[arg(long)]
    odom_topic: Option<String>,
    #[command(flatten)]
    output: OutputArgs,
}

/// The result of a log.
#[derive(Debug, Serialize)]
struct Report {
    /// Mean absolute translational error, metres.
    translation_mean_m: Option<f64>,
    translation_std_m: Option<f64>,
    translation_max_m: Option<f64>,
    /// Mean absolute rotational error, degrees.
    rotation_mean_deg: Option<f64>,
    rotation_std_deg: Option<f64>,
    rotation_max_deg: Option<f64>,
    /// Relations judged.
    relations: usize,
    /// Relations whose scans the log does not have.
    relations_missing: usize,
    /// What the two scans of relations say themselves.
    scan_pairs: Option<ScanPairs>,
    /// Scans, and those of them that could not be matched.
    scans: usize,
    scans_unmatched: usize,
    scans_lost: usize,
    keyframes: usize,
    /// Loop closures nearby, and after a long way.
    closures_near: usize,
    closures_far: usize,
    optimisations: usize,
    /// Distance driven, metres.
    driven_m: f64,
    /// From the first scan to the last, seconds.
    log_s: f64,
    /// Reading and SLAM, seconds on the clock.
    wall_s: f64,
}

impl SlamArgs {
    /// What it reads and writes.
    pub fn files(&self) -> Files {
        let files = Files::of(&self.output).reads("the log", [&self.log]).reads("the relations", &self.relations);
        files.writes("--picture", [&self.picture_file()])
    }

    fn picture_file(&self) -> PathBuf {
        self.picture.clone().unwrap_or_else(|| default_file("slam", &self.log.to_string_lossy(), None))
    }
}

pub fn run(args: &SlamArgs) -> Result<(), String> {
    let known = args.relations.as_deref().map(relations::read).transpose()?.unwrap_or_default();
    let topics = TopicConfig {
        scan: args.scan_topic.clone(),
        odometry: args.odom_topic.clone(),
        cameras: None,
        ..TopicConfig::default()
    };
    let frames = FrameConfig { topics, ..FrameConfig::default() };
    let mut frames = Frames::open(&args.log, frames).map_err(|error| error.to_string())?;
    let bar = args
        .output
        .progress_bar(frames.progress().1, "{bar:40} {percent:>3} % of the log, {elapsed} gone, {eta} to go");

    let begin = Instant::now();
    let mut slam = Slam::new(SlamConfig::default(), Pace::Repeatable).map_err(|error| error.to_string())?;
    let mut scans: Vec<(u64, Anchored, Vec<Point2>)> = Vec::new();
    let (mut unmatched, mut lost) = (0, 0);
    while let Some(frame) = frames.next() {
        let frame = frame.map_err(|error| error.to_string())?;
        let update = slam.update(&frame);
        unmatched += usize::from(update.tracking != Tracking::Matched);
        lost += usize::from(update.tracking == Tracking::Lost);
        scans.push((frame.time_us, update.anchored, frame.scan.points_in_base()));
        if scans.len().is_multiple_of(100) {
            bar.set_position(frames.progress().0);
        }
    }
    slam.finish();
    let wall_s = begin.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let report_of_bag = frames.report();
    if !report_of_bag.broken.is_empty() || scans.is_empty() {
        fht_program::tell_line!("{report_of_bag}");
    }
    let trajectory: Vec<(u64, Pose2)> =
        scans.iter().map(|(time_us, anchored, _)| (*time_us, slam.locate(anchored))).collect();
    let (Some(first), Some(last)) = (trajectory.first(), trajectory.last()) else {
        return Err("the log has no scan with odometry".to_owned());
    };
    let errors = (!known.is_empty()).then(|| relations::errors(&trajectory, &known));
    let points: Vec<&[Point2]> = scans.iter().map(|(_, _, points)| points.as_slice()).collect();
    let counts = slam.counts();
    let judged = errors.as_ref().filter(|errors| errors.relations > 0);
    let of = |value: fn(&Errors) -> f64| judged.map(value);
    let report = Report {
        translation_mean_m: of(|errors| errors.translation_m.mean),
        translation_std_m: of(|errors| errors.translation_m.std),
        translation_max_m: of(|errors| errors.translation_m.max),
        rotation_mean_deg: of(|errors| errors.rotation_deg.mean),
        rotation_std_deg: of(|errors| errors.rotation_deg.std),
        rotation_max_deg: of(|errors| errors.rotation_deg.max),
        relations: errors.map_or(0, |errors| errors.relations),
        relations_missing: errors.map_or(0, |errors| errors.missing),
        scan_pairs: ScanPairs::of(&trajectory, &points, &known),
        scans: scans.len(),
        scans_unmatched: unmatched,
        scans_lost: lost,
        keyframes: slam.poses().len(),
        closures_near: counts.near,
        closures_far: counts.far,
        optimisations: counts.optimised,
        driven_m: length_m(&trajectory),
        log_s: (last.0 - first.0) as f64 * 1e-6,
        wall_s,
    };
    say(&text(&report))?;
    args.output.write(&report)?;
    let posed = scans.iter().zip(&trajectory);
    let posed: Vec<Posed<'_>> =
        posed.map(|((.., points), (_, map_from_base))| Posed { map_from_base: *map_from_base, points }).collect();
    let path = args.picture_file();
    draw(&posed, &trajectory, &title(args), &path).map_err(|error| error.to_string())?;
    say(&format!("picture      {}", path.display()))?;
    relations::check_judged(errors.as_ref(), &known, [first.0, last.0])
}

fn title(args: &SlamArgs) -> String {
    format!("slam: {}", args.log.file_stem().unwrap_or_default().to_string_lossy())
}

fn length_m(trajectory: &[(u64, Pose2)]) -> f64 {
    let steps = trajectory.windows(2);
    steps.map(|pair| (pair[1].1.translation.vector - pair[0].1.translation.vector).norm()).sum()
}

/// The figures for people.
fn text(report: &Report) -> String {
    let mut lines = Vec::new();
    if let (Some(mean_m), Some(std_m), Some(mean_deg), Some(std_deg)) =
        (report.translation_mean_m, report.translation_std_m, report.rotation_mean_deg, report.rotation_std_deg)
    {
        lines.push(format!(
            "translation  {mean_m:.4} ± {std_m:.4} m, at most {:.3} m",
            report.translation_max_m.unwrap_or(0.0)
        ));
        lines.push(format!(
            "rotation     {mean_deg:.3} ± {std_deg:.3}°, at most {:.2}°",
            report.rotation_max_deg.unwrap_or(0.0)
        ));
        lines.push(format!(
            "relations    {} judged, {} without their scans",
            report.relations, report.relations_missing
        ));
        lines.extend(report.scan_pairs.iter().map(ScanPairs::text));
    }
    lines.push(format!(
        "scans        {}, {} by the wheels alone, {} lost",
        report.scans, report.scans_unmatched, report.scans_lost
    ));
    lines.push(format!(
        "graph        {} keyframes, {} closures near and {} far, optimised {} times",
        report.keyframes, report.closures_near, report.closures_far, report.optimisations
    ));
    lines.push(format!(
        "time         {:.0} s and {:.0} m of the robot in {:.1} s: {:.0} times faster than it drove",
        report.log_s,
        report.driven_m,
        report.wall_s,
        report.log_s / report.wall_s.max(1e-9)
    ));
    lines.join("\n")
}
