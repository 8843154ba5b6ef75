//! Exploring with a robot that speaks ROS 2 over Zenoh.

use super::keeping::{KeepError, Kept, RunKeeper};
use super::map_figures::MapFigures;
use super::nav2_guide::ExplorerGuide;
use super::picture::PictureTask;
use super::ros_outputs::MapOutputs;
use super::until_silent::UntilSilent;
use crate::mapping::Mapper;
use crate::run::{self, MappedFrame, MappingObserver, MappingOutcome, MappingTask, RunError};
use fht_perception::robot::{RobotError, SilenceConfig};
use fht_program::stop::Stop;
use fht_ros::{NodeConfig, RosError, RosNode};
use fht_ros_robot::{
    DrivenByNav2, IntakeReport, Nav2Driver, OutputRole, RosOutputs, RosRobot, RosRobotConfig, live_silence,
};
use fht_session::{SessionConfig, SessionError};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Who drives a robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Driver {
    /// The mapper: it explores.
    #[default]
    Mapper,
    /// Nav2, by its action navigate_to_pose: the mapper tells it what is to be seen.
    Nav2,
    /// Somebody else, a person or Nav2: the mapper maps what the robot sees, until its sensors fall
    /// silent for `--end-after`.
    Others,
}

/// Which robot explores, and where its map goes.
#[derive(Clone, Debug)]
pub struct RosExploreTask {
    /// The robot's router.
    pub graph: SessionConfig,
    /// Who the mapper is on the robot's graph.
    pub node: NodeConfig,
    /// The robot's topics and frames.
    pub robot: RosRobotConfig,
    /// How long to wait for the robot's router; none: for ever.
    pub patience: Option<Duration>,
    /// What to map, and where to publish it; cameras are used if the robot has four.
    pub mapping: MappingTask,
    /// Who drives the robot.
    pub driver: Driver,
    /// A bag to write: an `.mcap` file, or a folder.
    pub record: Option<PathBuf>,
    /// A picture to make of the map at the end.
    pub picture: Option<PictureTask>,
    /// Ends the exploration early, with the map finished as it is.
    pub stop: Stop,
}

/// Why an exploration with a ROS robot failed.
#[derive(Debug, thiserror::Error)]
pub enum RosExploreError {
    /// The robot's router is not there, or what names it is of no use.
    #[error("the robot's router: {0}")]
    Session(#[from] SessionError),
    /// The robot's graph cannot be joined.
    #[error(transparent)]
    Graph(#[from] RosError),
    /// The robot failed, or fell silent for good.
    #[error("{error}{}", trouble.as_ref().map(|trouble| format!(": {trouble}")).unwrap_or_default())]
    Robot {
        /// How.
        error: RobotError,
        /// What keeps its frames from coming.
        trouble: Option<String>,
    },
    /// The recording cannot be.
    #[error(transparent)]
    Keep(#[from] KeepError),
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RunError),
}

impl RosExploreError {
    /// Whether what was given is wrong, and not the run.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Session(error) => error.is_input(),
            Self::Graph(RosError::Name(_)) => true,
            Self::Keep(error) => error.is_input(),
            Self::Run(error) => error.is_input(),
            _ => false,
        }
    }
}

/// Figures of an exploration with a ROS robot.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RosExploreReport {
    /// What became of the sensors' messages.
    #[serde(flatten)]
    pub intake: IntakeReport,
    /// The map, and why the exploration ended: `complete`, `stuck`, `out_of_time` or `interrupted`.
    #[serde(flatten)]
    pub map: MapFigures,
    /// Free area on the grid, square metres.
    pub free_area_m2: f64,
    /// Distance driven by the wheels' word, metres.
    pub driven_m: f64,
    /// Time of the robot's clock from the first frame to the last, seconds.
    pub robot_s: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
    /// What else was left of it.
    #[serde(flatten)]
    pub kept: Kept,
}

/// What happens while it runs, for progress displays.
#[derive(Clone, Debug)]
pub struct RosSnapshot {
    /// Seconds of the robot's clock so far.
    pub robot_s: f64,
    /// Free area on the grid, square metres.
    pub free_area_m2: f64,
    /// Nodes of the map.
    pub nodes: usize,
    /// Increments written.
    pub written: u64,
    /// Of these, what the server has durably.
    pub acknowledged: u64,
}

impl RosSnapshot {
    fn of(mapper: &Mapper, robot_us: u64, written: u64, acknowledged: u64) -> Self {
        let counts = mapper.map().counts();
        Self {
            robot_s: robot_us as f64 * 1e-6,
            free_area_m2: mapper.free_area_m2(),
            nodes: counts.main_nodes + counts.support_nodes,
            written,
            acknowledged,
        }
    }
}

/// Counts the way, and tells `watch` about once a second.
struct Travel<W> {
    watch: W,
    next_us: u64,
    last_us: u64,
    driven_m: f64,
    last_odom: Option<Vector2<f64>>,
}

/// Time between two looks at the progress, microseconds.
const WATCH_EVERY_US: u64 = 1_000_000;

impl<W: FnMut(RosSnapshot)> MappingObserver for Travel<W> {
    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        self.last_us = mapped.elapsed_us;
        let odom_from_base = mapped.frame.odom_from_base.translation.vector;
        self.driven_m += self.last_odom.map_or(0.0, |last| (odom_from_base - last).norm());
        self.last_odom = Some(odom_from_base);
        if mapped.elapsed_us >= self.next_us {
            self.next_us = mapped.elapsed_us + WATCH_EVERY_US;
            (self.watch)(RosSnapshot::of(mapped.mapper, mapped.elapsed_us, mapped.written, mapped.acknowledged));
        }
        ControlFlow::Continue(())
    }
}

/// Explores with the robot and publishes the map. `watch` is called about once a second of the
/// robot's clock, and once more when all has ended. The robot stops when its sensors have been
/// silent for half a second, and at the end.
///
/// # Errors
/// [`RosExploreError`]; an exploration that ended is reported even if the server could not be
/// reached (`delivered` false).
pub async fn explore_robot(
    task: RosExploreTask,
    watch: impl FnMut(RosSnapshot) + Send + 'static,
) -> Result<RosExploreReport, RosExploreError> {
    let began = Instant::now();
    task.stop.doing(format!("waiting for the robot's router at {}", task.graph.places()));
    let session = fht_session::open_within(&task.graph, task.patience).await?;
    let node = RosNode::join(session, task.node).await?;
    let without_cameras = task.robot.without_cameras || !task.mapping.cameras;
    let robot = RosRobot::connect(&node, RosRobotConfig { without_cameras, ..task.robot }).await?;
    let keeper = RunKeeper::new(task.record.as_deref(), task.picture)?;
    let travel = Travel { watch, next_us: 0, last_us: 0, driven_m: 0.0, last_odom: None };
    let silence = live_silence(task.mapping.silence.clone());
    let cameras = task.mapping.cameras && robot.has_cameras();
    let mapping = MappingTask { cameras, silence, stop: task.stop, ..task.mapping };
    let outputs = MapOutputs::new(RosOutputs::start(&node, OutputRole::Mapping, robot.odom_frame()).await?);
    let nav2 = match task.driver {
        Driver::Nav2 => Some(Nav2Driver::start(&node).await?),
        Driver::Mapper | Driver::Others => None,
    };
    let observer = (keeper, (travel, (outputs, ExplorerGuide(nav2.clone()))));
    let outcome = match task.driver {
        Driver::Mapper | Driver::Nav2 => {
            let driven = DrivenByNav2::new(robot, nav2);
            let MappingOutcome { summary, mapper, robot, observer } = run::explore(mapping, driven, observer).await?;
            MappingOutcome { summary, mapper, robot: robot.into_inner(), observer }
        }
        Driver::Others => {
            let sensors = UntilSilent::new(robot, mapping.silence.end_after());
            let mapping = MappingTask { silence: SilenceConfig::patient(), ..mapping };
            let MappingOutcome { summary, mapper, robot, observer } = run::observe(mapping, sensors, observer).await?;
            MappingOutcome { summary, mapper, robot: robot.into_inner(), observer }
        }
    };
    let MappingOutcome { mut summary, mapper, robot, observer: (keeper, (mut travel, (outputs, _))) } = outcome;
    (travel.watch)(RosSnapshot::of(&mapper, travel.last_us, summary.written, summary.acknowledged()));
    if let Some(error) = summary.robot_error.take() {
        return Err(RosExploreError::Robot { error, trouble: robot.trouble() });
    }
    // The map's last state is on its way before the program ends.
    drop(outputs);
    let kept = keeper.finish(summary.frames)?;
    Ok(RosExploreReport {
        intake: robot.report(),
        map: MapFigures::of(&summary, &mapper),
        free_area_m2: mapper.free_area_m2(),
        driven_m: travel.driven_m,
        robot_s: travel.last_us as f64 * 1e-6,
        wall_s: began.elapsed().as_secs_f64(),
        kept,
    })
}
