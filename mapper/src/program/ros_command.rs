//! `mapper explore --ros` and `mapper ros check` on the command line.

use super::arguments::ExploreArgs;
use super::ros::{Driver, RosExploreReport, RosExploreTask, RosSnapshot, explore_robot};
use super::ros_arguments::CheckArgs;
use super::running::{RunEnd, exploring_spinner, increments, runtime};
use super::settings::MapperFile;
use fht_perception::robot::Sensors;
use fht_program::{ProgramFailure, Stop, Waiting, print_line};
use fht_ros::{Endpoint, RosError, RosNode};
use fht_ros_robot::{Finding, IntakeReport, Readiness, RosRobot, RosRobotConfig, check};
use fht_session::{SessionConfig, SessionError, open_within};
use fht_worker::Pace;
use indicatif::ProgressBar;
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// How many frames may wait for a mapper that only listens: ten seconds of them at 10 Hz.
const LISTENER_BACKLOG: usize = 100;

fn router(endpoint: &str) -> SessionConfig {
    SessionConfig::from_options(vec![endpoint.to_owned()], None)
}

impl ExploreArgs {
    /// The task of the robot at `endpoint`: these flags over what the file says.
    fn robot_task(&self, endpoint: &str, file: MapperFile, stop: Stop) -> Result<RosExploreTask, String> {
        let source = Path::new(if self.graph.node.namespace.is_empty() { "robot" } else { &self.graph.node.namespace });
        let mut mapping = self.run.over(&file, source)?;
        mapping.spool = self.spool_over(mapping.spool)?;
        mapping.max_s = self.max_sim.unwrap_or(mapping.max_s);
        mapping.cameras &= !self.no_cameras;
        mapping.mapper.join.looks_again |= self.again;
        // Others do not wait for what the mapper does, and it need not hurry.
        if self.drive != Driver::Others {
            mapping.mapper.pace = Pace::RealTime;
        }
        if let Some(end_after_s) = self.end_after {
            mapping.silence.end_after_s = end_after_s;
        }
        let mut robot = RosRobotConfig { others_drive: self.drive != Driver::Mapper, ..self.graph.robot(file.ros) };
        if self.drive == Driver::Others {
            robot.backlog = robot.backlog.max(LISTENER_BACKLOG);
        }
        Ok(RosExploreTask {
            graph: router(endpoint),
            node: self.graph.node.node("mapper"),
            robot,
            patience: Waiting::new("mapper", self.run.link.wait, None).for_session(),
            driver: self.drive,
            record: self.run.record.clone(),
            picture: self.run.picture("explore", source, None),
            stop,
            mapping,
        })
    }
}

/// Runs `mapper explore --ros`; `false` if the map is not complete, or the server did not take all
/// of it.
pub(super) fn explore_ros(
    args: &ExploreArgs,
    endpoint: &str,
    file: MapperFile,
    stop: Stop,
) -> Result<bool, ProgramFailure> {
    let task = args.robot_task(endpoint, file, stop.clone()).map_err(ProgramFailure::of_input)?;
    let (linger_s, spool) = (task.mapping.linger_s, task.mapping.spool.clone());
    let runtime = runtime().map_err(ProgramFailure::of_run)?;
    tracing::info!(map = %task.mapping.map, robot = task.mapping.robot, router = endpoint, "explores");
    let bar = if args.run.quiet || args.progress_json { ProgressBar::hidden() } else { exploring_spinner() };
    let (watched, is_offline, progress_json) = (bar.clone(), args.run.offline, args.progress_json);
    let watch = move |snapshot: RosSnapshot| {
        let RosSnapshot { robot_s, free_area_m2, nodes, written, acknowledged } = snapshot;
        if progress_json {
            print_line!(
                "{}",
                serde_json::json!({
                    "sim_s": robot_s,
                    "free_area_m2": free_area_m2,
                    "nodes": nodes,
                    "written": written,
                    "acknowledged": acknowledged,
                })
            );
        }
        let sent = increments(written, acknowledged, is_offline);
        watched.set_message(format!("{free_area_m2:.0} m² free, {nodes} nodes on the map, {sent}, {robot_s:.0} s"));
        watched.tick();
    };
    let report = runtime.block_on(explore_robot(task, watch));
    let report = report.map_err(|error| ProgramFailure::of(error.is_input(), error))?;
    bar.finish_and_clear();
    let in_words = (!args.progress_json).then_some(print_report as fn(&RosExploreReport));
    let given = args.run.give(&report, in_words);
    let end = RunEnd {
        map: &report.map,
        is_offline: args.run.offline,
        linger_s,
        is_asked_to_end: stop.is_set(),
        spool: spool.as_deref(),
    };
    end.conclude(&report.kept, given)
}

fn print_report(report: &RosExploreReport) {
    let intake = &report.intake;
    print_line!("ended       {}", report.map.ending);
    print_line!(
        "frames      {} of {} scans, {} with pictures, {} late, {} lost; the odometry was reset {} times",
        intake.frames,
        intake.scans,
        intake.panoramas,
        intake.frames_late,
        intake.frames_lost,
        intake.odometry_jumps
    );
    report.map.print_size(&format!(", {:.0} m² free", report.free_area_m2));
    print_line!(
        "time        {:.0} s and {:.0} m of the robot in {:.1} s; slowest frame {:.0} ms",
        report.robot_s,
        report.driven_m,
        report.wall_s,
        report.map.frame_max_ms
    );
    print_line!("digest      {}", report.map.digest);
    report.kept.print();
}

/// What `mapper ros check` finds.
#[derive(Debug, Serialize)]
struct CheckReport {
    findings: Vec<Finding>,
    /// Frames that came while it listened.
    frames: u64,
    /// Of these, with a panorama of four cameras.
    panoramas: u64,
    /// What kept frames from coming, if none came.
    trouble: Option<String>,
    /// What is odd about stamps.
    doubts: Vec<String>,
}

/// Why a robot's graph cannot be looked at.
#[derive(Debug, thiserror::Error)]
enum CheckError {
    #[error("the robot's router: {0}")]
    Session(#[from] SessionError),
    #[error(transparent)]
    Graph(#[from] RosError),
}

impl CheckReport {
    fn is_good(&self) -> bool {
        self.frames > 0 && !self.findings.iter().any(is_missing)
    }
}

fn is_missing(finding: &Finding) -> bool {
    finding.readiness == Readiness::Missing
}

/// Runs `mapper ros check`; `false` if something is missing.
pub(super) fn check_robot(args: &CheckArgs, file: MapperFile) -> Result<bool, ProgramFailure> {
    let runtime = runtime().map_err(ProgramFailure::of_run)?;
    let report = runtime.block_on(look(args, file.ros)).map_err(|error| {
        let is_input = matches!(&error, CheckError::Graph(RosError::Name(_)))
            || matches!(&error, CheckError::Session(error) if error.is_input());
        ProgramFailure::of(is_input, error)
    })?;
    if args.json {
        print_line!("{}", serde_json::to_string_pretty(&report).map_err(ProgramFailure::of_run)?);
    } else {
        for Finding { topic, readiness, sentence } in &report.findings {
            let word = match readiness {
                Readiness::Good => "good    ",
                Readiness::Doubtful => "doubtful",
                Readiness::Missing => "missing ",
            };
            print_line!("{word}  {topic}: {sentence}");
        }
        for doubt in &report.doubts {
            print_line!("doubtful  {doubt}");
        }
        match &report.trouble {
            Some(trouble) => print_line!("no frame  {trouble}"),
            None => {
                print_line!("frames    {} in {} s, {} with pictures", report.frames, args.wait, report.panoramas);
            }
        }
    }
    Ok(report.is_good())
}

async fn look(args: &CheckArgs, file: RosRobotConfig) -> Result<CheckReport, CheckError> {
    let wait = Duration::try_from_secs_f64(args.wait).unwrap_or(Duration::MAX);
    let session = open_within(&router(&args.endpoint), Some(wait)).await?;
    let node = RosNode::join(session, args.graph.node.node("mapper")).await?;
    let config = args.graph.robot(file);
    // Before the own subscriptions are there.
    let endpoints = node.endpoints(wait).await?;
    let judge = |endpoints: &[Endpoint]| check(endpoints, &config, &args.graph.node.namespace).map_err(RosError::Name);
    let mut findings = judge(&endpoints)?;
    let mut robot = RosRobot::connect(&node, config.clone()).await?;
    let began = Instant::now();
    while let Some(left) = wait.checked_sub(began.elapsed())
        && matches!(tokio::time::timeout(left, robot.sense()).await, Ok(Ok(_)))
    {}
    let IntakeReport { frames, panoramas, .. } = robot.report();
    let mut trouble = if frames == 0 { robot.trouble() } else { None };
    let doubts = robot.doubts().map(str::to_owned).collect();
    if findings.iter().any(is_missing) {
        // What was missing may have been started meanwhile.
        drop(robot);
        findings = judge(&node.endpoints(wait).await?)?;
    }
    if trouble.is_some() && findings.iter().any(is_missing) {
        trouble = Some("what is missing above keeps them from coming".to_owned());
    }
    Ok(CheckReport { findings, frames, panoramas, trouble, doubts })
}
