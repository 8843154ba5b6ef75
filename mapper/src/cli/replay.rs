//! `mapper replay` and `mapper info`: bags on the command line.

use super::{LinkArgs, rate, runtime, seconds, stop_on_signal};
use crate::mapping::MapperConfig;
use crate::replay::{ReplayReport, ReplaySnapshot, ReplayTask, replay};
use clap::Args;
use fht_proto::MapName;
use fht_robot::bag::odometry::OdometryConfig;
use fht_robot::bag::scan::ScanConfig;
use fht_robot::bag::{BagInfo, FrameConfig, TopicConfig, survey};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(super) struct ReplayArgs {
    /// The bag: a rosbag2 folder, an MCAP file, or a folder of MCAP files.
    bag: PathBuf,
    /// Name of the map; by default the bag's name.
    #[arg(long)]
    map: Option<MapName>,
    /// Name of the robot that wrote the bag.
    #[arg(long, default_value = "explorer")]
    robot: String,
    #[command(flatten)]
    link: LinkArgs,
    /// Map without a server.
    #[arg(long)]
    offline: bool,
    /// Another descriptor model: an ONNX file with its description beside it.
    #[arg(long)]
    model: Option<PathBuf>,
    /// Recorded seconds per second; by default as fast as possible.
    #[arg(long, value_parser = rate)]
    rate: Option<f64>,
    /// How long to wait at the end for the server to acknowledge everything, seconds.
    #[arg(long, default_value_t = 60.0, value_parser = seconds)]
    linger: f64,
    /// Write a bag with the map in it: a file (FILE.mcap) or a rosbag2 folder.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write the figures to this file as JSON.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Print the figures as JSON.
    #[arg(long)]
    json: bool,
    /// No progress bar.
    #[arg(long, short)]
    quiet: bool,
    // Last, since its heading holds for all that comes after it.
    #[command(flatten)]
    frames: FrameArgs,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "What is what in the bag")]
struct FrameArgs {
    /// Scans (sensor_msgs/LaserScan); by default /scan, or the only such topic.
    #[arg(long)]
    scan_topic: Option<String>,
    /// Odometry (nav_msgs/Odometry), or the topic of the transforms; by default /odom, the only such topic, or /tf.
    #[arg(long)]
    odom_topic: Option<String>,
    /// Moving transforms.
    #[arg(long, default_value = "/tf")]
    tf_topic: String,
    /// Fixed transforms.
    #[arg(long, default_value = "/tf_static")]
    tf_static_topic: String,
    /// Cameras ahead, left, behind, right, with commas between (sensor_msgs/Image or CompressedImage); NAME/compressed is
    /// looked for too. By default /camera_front/image, /camera_left/image, /camera_back/image, /camera_right/image.
    #[arg(long, value_delimiter = ',', value_name = "AHEAD,LEFT,BEHIND,RIGHT")]
    camera_topics: Vec<String>,
    /// Map with the LiDAR alone: nodes carry no descriptors.
    #[arg(long, conflicts_with = "camera_topics")]
    no_cameras: bool,
    /// The robot's frame; by default what the odometry says.
    #[arg(long)]
    base_frame: Option<String>,
    /// The frame that odometry transforms start from.
    #[arg(long, default_value = "odom")]
    odom_frame: String,
    /// Take ranges from here on as no return, metres.
    #[arg(long, default_value_t = ScanConfig::default().range_max_m)]
    range_max: f64,
    /// Longest time between two odometry messages that is interpolated over, seconds.
    #[arg(long, default_value_t = OdometryConfig::default().longest_gap_s)]
    odom_gap: f64,
    /// End with an error when no transform says where the scanner is, in place of taking it to be at the robot's centre.
    #[arg(long)]
    strict: bool,
}

impl FrameArgs {
    fn config(&self) -> Result<FrameConfig, String> {
        for (flag, value) in [("--range-max", self.range_max), ("--odom-gap", self.odom_gap)] {
            if !value.is_finite() || value <= 0.0 {
                return Err(format!("{flag} needs a positive number"));
            }
        }
        let usual = TopicConfig::default();
        let cameras = match <[String; 4]>::try_from(self.camera_topics.clone()) {
            _ if self.no_cameras => None,
            Ok(cameras) => Some(cameras),
            Err(none) if none.is_empty() => usual.cameras,
            Err(wrong) => return Err(format!("--camera-topics needs 4 topics, not {}", wrong.len())),
        };
        Ok(FrameConfig {
            topics: TopicConfig {
                scan: self.scan_topic.clone(),
                odometry: self.odom_topic.clone(),
                tf: self.tf_topic.clone(),
                tf_static: self.tf_static_topic.clone(),
                cameras,
            },
            scan: ScanConfig { range_max_m: self.range_max },
            odometry: OdometryConfig { longest_gap_s: self.odom_gap, ..OdometryConfig::default() },
            base_frame: self.base_frame.clone(),
            odom_frame: self.odom_frame.clone(),
            strict: self.strict,
            ..FrameConfig::default()
        })
    }
}

impl ReplayArgs {
    fn task(&self) -> Result<ReplayTask, String> {
        let name = self.bag.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        let map = match &self.map {
            Some(map) => map.clone(),
            None => name.parse().map_err(|error| format!("{error}; give the map a name with --map"))?,
        };
        Ok(ReplayTask {
            bag: self.bag.clone(),
            frames: self.frames.config()?,
            map,
            robot: self.robot.clone(),
            link: (!self.offline).then(|| self.link.config()),
            model: self.model.clone(),
            rate: self.rate,
            linger_s: self.linger,
            mapper: MapperConfig::default(),
            record: self.record.clone(),
            stop: stop_on_signal()?,
        })
    }
}

/// Runs `mapper replay`; `false` if the server did not take the whole map.
pub(super) fn replay_bag(args: &ReplayArgs) -> Result<bool, String> {
    let task = args.task()?;
    let bar = if args.quiet || args.json { ProgressBar::hidden() } else { progress_bar() };
    let watched = bar.clone();
    let watch = move |snapshot: ReplaySnapshot| {
        watched.set_length(snapshot.total_bytes);
        watched.set_position(snapshot.read_bytes);
        watched.set_message(format!(
            "{:.0} s, {} frames, {} nodes, {} of {} increments stored",
            snapshot.bag_s, snapshot.frames, snapshot.nodes, snapshot.acknowledged, snapshot.written
        ));
    };
    let report = runtime()?.block_on(replay(task, watch)).map_err(|error| error.to_string())?;
    bar.finish_and_clear();
    let json = serde_json::to_string_pretty(&report).map_err(|error| error.to_string())?;
    if let Some(file) = &args.report {
        std::fs::write(file, &json).map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    }
    if args.json {
        println!("{json}");
    } else {
        print_replay(&report);
    }
    if report.has_cameras && report.bag.panoramas == 0 {
        eprintln!("mapper: none of the pictures could be used, so the map has no main nodes; try --no-cameras");
    }
    if !args.offline && !report.delivered {
        super::complain_of_undelivered(args.linger, None);
        return Ok(false);
    }
    Ok(true)
}

fn progress_bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:24} {percent:>3} % {msg}");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn print_replay(report: &ReplayReport) {
    println!("bag         {}", report.bag.to_string().replace('\n', "\n            "));
    println!(
        "map         {} main nodes, {} support nodes, {} edges, version {}, {:.0} m² free",
        report.main_nodes, report.support_nodes, report.edges, report.version, report.free_area_m2
    );
    println!("bytes       {} of increments, {} on the wire", report.map_bytes, report.wire_bytes);
    println!(
        "time        {:.0} s and {:.0} m of the robot in {:.1} s; slowest frame {:.0} ms",
        report.bag_s, report.driven_m, report.wall_s, report.frame_max_ms
    );
    println!("digest      {}", report.digest);
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
pub(super) fn info(args: &InfoArgs) -> Result<bool, String> {
    let info = survey(&args.bag).map_err(|error| error.to_string())?;
    if args.json {
        println!("{}", serde_json::to_string_pretty(&info).map_err(|error| error.to_string())?);
    } else {
        print_info(&info);
    }
    Ok(info.broken.is_empty())
}

fn print_info(info: &BagInfo) {
    for file in &info.files {
        println!("file      {}", file.display());
    }
    println!("size      {:.1} MB, {} messages", info.bytes as f64 * 1e-6, info.messages);
    if let (Some(start), Some(end)) = (info.start_ns, info.end_ns) {
        let (start, end) = (start as f64 * 1e-9, end as f64 * 1e-9);
        println!("time      {start:.3} s to {end:.3} s since the epoch: {:.1} s", end - start);
    }
    for topic in &info.topics {
        let encoding = if topic.encoding == "cdr" { String::new() } else { format!(" ({})", topic.encoding) };
        println!("topic     {:<36} {:>8} × {}{encoding}", topic.name, topic.messages, topic.type_name);
    }
    for broken in &info.broken {
        println!("broken    {broken}");
    }
}
