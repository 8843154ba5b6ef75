//! `mapper replay` and `mapper info`: bags on the command line.

use super::replay::{ReplayReport, ReplaySnapshot, ReplayTask, replay};
use super::running::{RunArgs, RunEnd, increments, runtime};
use super::settings::MapperFile;
use clap::Args;
use fht_bag::{BagInfo, FrameConfig, TopicConfig, examine, files_of};
use fht_program::{ProgramFailure, Stop, print_line};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// The bag: a rosbag2 folder, an MCAP file, or a folder of MCAP files.
    bag: PathBuf,
    #[command(flatten)]
    run: RunArgs,
    // Last, since its heading holds for all that comes after it.
    #[command(flatten)]
    frames: FrameArgs,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "What is what in the bag")]
struct FrameArgs {
    /// Scans (sensor_msgs/LaserScan); by default /scan, or the only such topic.
    #[arg(long, value_name = "TOPIC")]
    scan_topic: Option<String>,
    /// Odometry (nav_msgs/Odometry), or the topic of the transforms; by default /odom, the only
    /// such topic, or /tf.
    #[arg(long, value_name = "TOPIC")]
    odom_topic: Option<String>,
    /// Moving transforms [default: /tf].
    #[arg(long, value_name = "TOPIC")]
    tf_topic: Option<String>,
    /// Fixed transforms [default: /tf_static].
    #[arg(long, value_name = "TOPIC")]
    tf_static_topic: Option<String>,
    /// Cameras ahead, left, behind, right, with commas between (sensor_msgs/Image or
    /// CompressedImage); NAME/compressed is looked for too. By default /camera_front/image,
    /// /camera_left/image, /camera_back/image, /camera_right/image.
    #[arg(long, value_delimiter = ',', value_name = "AHEAD,LEFT,BEHIND,RIGHT")]
    camera_topics: Vec<String>,
    /// Map with the LiDAR alone: nodes carry no descriptors.
    #[arg(long, conflicts_with = "camera_topics")]
    no_cameras: bool,
    /// The robot's frame; by default what the odometry says.
    #[arg(long, value_name = "FRAME")]
    base_frame: Option<String>,
    /// The frame that odometry transforms start from [default: odom].
    #[arg(long, value_name = "FRAME")]
    odom_frame: Option<String>,
    /// Take ranges from here on as no return, metres [default: 200].
    #[arg(long, value_name = "METRES")]
    range_max: Option<f64>,
    /// Longest time between two odometry messages that is interpolated over, seconds [default:
    /// 0.5].
    #[arg(long, value_name = "SECONDS")]
    odom_gap: Option<f64>,
    /// End with an error when no transform says where the scanner is, in place of taking it to be
    /// at the robot's centre.
    #[arg(long)]
    strict: bool,
}

impl FrameArgs {
    /// These flags over what the file says.
    fn over(&self, file: FrameConfig) -> Result<FrameConfig, String> {
        for (flag, value) in [("--range-max", self.range_max), ("--odom-gap", self.odom_gap)] {
            if value.is_some_and(|value| !value.is_finite() || value <= 0.0) {
                return Err(format!("{flag} needs a positive number"));
            }
        }
        let cameras = match <[String; 4]>::try_from(self.camera_topics.clone()) {
            _ if self.no_cameras => None,
            Ok(cameras) => Some(cameras),
            Err(none) if none.is_empty() => file.topics.cameras,
            Err(wrong) => return Err(format!("--camera-topics needs 4 topics, not {}", wrong.len())),
        };
        let mut frames = FrameConfig {
            topics: TopicConfig {
                scan: self.scan_topic.clone().or(file.topics.scan),
                odometry: self.odom_topic.clone().or(file.topics.odometry),
                tf: self.tf_topic.clone().unwrap_or(file.topics.tf),
                tf_static: self.tf_static_topic.clone().unwrap_or(file.topics.tf_static),
                cameras,
            },
            base_frame: self.base_frame.clone().or(file.base_frame),
            odom_frame: self.odom_frame.clone().unwrap_or(file.odom_frame),
            strict: self.strict || file.strict,
            ..file
        };
        frames.scan.range_max_m = self.range_max.unwrap_or(frames.scan.range_max_m);
        frames.odometry.longest_gap_s = self.odom_gap.unwrap_or(frames.odometry.longest_gap_s);
        Ok(frames)
    }
}

impl ReplayArgs {
    /// Refuses a run that would destroy one of its own files; `config` is that of its
    /// configuration.
    pub(super) fn check_files(&self, config: Option<&Path>) -> Result<(), ProgramFailure> {
        let picture = self.run.picture("replay", &self.bag, None);
        let inputs = [("the bag", Some(self.bag.as_path())), ("the configuration", config)];
        self.run.check_files(inputs, picture.as_ref())
    }

    /// These flags over what the file says.
    fn task(&self, file: MapperFile, stop: Stop) -> Result<ReplayTask, String> {
        // What is no bag gives no map its name.
        files_of(&self.bag).map_err(|error| error.to_string())?;
        let mapping = self.run.over(&file, &self.bag)?;
        let mut frames = self.frames.over(file.bag)?;
        frames.topics.cameras = frames.topics.cameras.filter(|_| mapping.cameras);
        let (rate, record) = (self.run.rate.or(file.mapper.rate), self.run.record.clone());
        let picture = self.run.picture("replay", &self.bag, None);
        Ok(ReplayTask { bag: self.bag.clone(), frames, mapping, rate, record, picture, stop })
    }
}

/// Runs `mapper replay`; `false` if the bag is broken or hardly used, or the server did not take
/// the whole map.
pub(super) fn replay_bag(args: &ReplayArgs, file: MapperFile, stop: Stop) -> Result<bool, ProgramFailure> {
    let task = args.task(file, stop.clone()).map_err(ProgramFailure::of_input)?;
    let linger_s = task.mapping.linger_s;
    tracing::info!(map = %task.mapping.map, robot = task.mapping.robot, bag = %task.bag.display(), "replays");
    let bar = if args.run.quiet || args.run.report.json { ProgressBar::hidden() } else { progress_bar() };
    let (watched, is_offline) = (bar.clone(), args.run.offline);
    let watch = move |snapshot: ReplaySnapshot| {
        watched.set_length(snapshot.total_bytes);
        watched.set_position(snapshot.read_bytes);
        watched.set_message(format!(
            "{:.0} s of robot time, {} frames, {} nodes, {}",
            snapshot.bag_s,
            snapshot.frames,
            snapshot.nodes,
            increments(snapshot.written, snapshot.acknowledged, is_offline)
        ));
    };
    let runtime = runtime().map_err(ProgramFailure::of_run)?;
    let report = runtime.block_on(replay(task, watch));
    let report = report.map_err(|error| ProgramFailure::of(error.is_input(), error))?;
    bar.finish_and_clear();
    let given = args.run.give(&report, Some(print_replay));
    if report.has_cameras && report.bag.panoramas == 0 {
        fht_program::tell_line!(
            "mapper: none of the pictures could be used, so the map has no main nodes; try --no-cameras"
        );
    }
    let end = RunEnd {
        map: &report.map,
        is_offline: args.run.offline,
        linger_s,
        is_asked_to_end: stop.is_set(),
        spool: None,
    };
    for broken in &report.bag.broken {
        fht_program::tell_line!("mapper: the bag is broken, and the map is of what can be read: {broken}");
    }
    let hardly_used = report.bag.hardly_used();
    if let Some(sentence) = &hardly_used {
        fht_program::tell_line!("mapper: the map is of a small part of the bag: {sentence}");
    }
    Ok(end.conclude(&report.kept, given)? && report.bag.broken.is_empty() && hardly_used.is_none())
}

fn progress_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:24} {percent:>3} % of the bag, {msg}");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn print_replay(report: &ReplayReport) {
    print_line!("bag         {}", report.bag.to_string().replace('\n', "\n            "));
    report.map.print_size(&format!(", {:.0} m² free", report.free_area_m2));
    print_line!(
        "time        {:.0} s and {:.0} m of the robot in {:.1} s; slowest frame {:.0} ms",
        report.bag_s,
        report.driven_m,
        report.wall_s,
        report.map.frame_max_ms
    );
    print_line!("digest      {}", report.map.digest);
    report.kept.print();
}

#[derive(Debug, Args)]
pub(super) struct InfoArgs {
    /// The bag: a rosbag2 folder, an MCAP file, or a folder of MCAP files.
    bag: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs `mapper info`; `false` if the bag is broken.
pub(super) fn info(args: &InfoArgs) -> Result<bool, ProgramFailure> {
    let info = examine(&args.bag).map_err(ProgramFailure::of_input)?;
    if args.json {
        print_line!("{}", serde_json::to_string_pretty(&info).map_err(ProgramFailure::of_run)?);
    } else {
        print_info(&info);
    }
    Ok(info.broken.is_empty())
}

fn print_info(info: &BagInfo) {
    for file in &info.files {
        print_line!("file      {}", file.display());
    }
    print_line!("size      {:.1} MB, {} messages", info.bytes as f64 * 1e-6, info.messages);
    if let (Some(start), Some(end)) = (info.start_ns, info.end_ns) {
        let (start, end) = (start as f64 * 1e-9, end as f64 * 1e-9);
        print_line!("time      {start:.3} s to {end:.3} s since the epoch: {:.1} s", end - start);
    }
    for topic in &info.topics {
        let encoding = if topic.encoding == "cdr" { String::new() } else { format!(" ({})", topic.encoding) };
        print_line!("topic     {:<36} {:>8} × {}{encoding}", topic.name, topic.messages, topic.type_name);
    }
    for broken in &info.broken {
        print_line!("broken    {broken}");
    }
}

#[cfg(test)]
mod tests {
    use super::super::arguments::{Cli, Command};
    use super::*;
    use clap::Parser;

    #[test]
    fn what_is_no_bag_is_refused_before_a_map_is_named_after_it() {
        let cli = Cli::try_parse_from(["mapper", "replay", "my run.mcap", "--offline"]).unwrap();
        let Some(Command::Replay(args)) = cli.command else { panic!("another command") };
        let said = args.task(MapperFile::default(), Stop::default()).err().unwrap_or_default();
        assert!(said.starts_with("cannot read my run.mcap"), "{said}");
    }
}
