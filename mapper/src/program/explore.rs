//! Exploring a simulated building: the simulator behind the port, and the result scored against its
//! truth.

use super::keeping::{KeepError, RunKeeper};
use super::picture::PictureTask;
use super::report::ExploreReport;
use super::scoring::ExplorationScore;
use crate::mapping::Mapper;
use crate::run::{self, MappedFrame, MappingObserver, MappingOutcome, MappingSummary, MappingTask, RunError};
use fht_perception::robot::{Paced, RobotError, SilenceConfig};
use fht_program::stop::Stop;
use fht_shared_world::{JoinError, WorldExit, seat};
use fht_sim::{SimConfig, SimSetup, Simulator, StartError, WorldError};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

/// What to explore and where to publish.
#[derive(Clone, Debug)]
pub struct ExploreTask {
    /// The building, and the robot in it.
    pub setup: SimSetup,
    /// The robot's sensors and wheels.
    pub sim: SimConfig,
    /// What to map, and where to publish it.
    pub mapping: MappingTask,
    /// Simulated seconds per second; `None` is as fast as possible.
    pub rate: Option<f64>,
    /// A bag to write: an `.mcap` file, or a folder.
    pub record: Option<PathBuf>,
    /// A picture to make of the map at the end.
    pub picture: Option<PictureTask>,
    /// Ends the exploration early, with the map finished as it is.
    pub stop: Stop,
}

impl ExploreTask {
    /// As fast as possible, with the usual robot, neither recorded nor drawn.
    #[must_use]
    pub fn new(setup: SimSetup, mapping: MappingTask) -> Self {
        let (rate, record, picture) = (None, None, None);
        Self { setup, sim: SimConfig::default(), mapping, rate, record, picture, stop: Stop::default() }
    }
}

/// Why an exploration failed.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    /// The world cannot be loaded.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The robot cannot start there.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The robot cannot be in the world that it shares.
    #[error(transparent)]
    SharedWorld(#[from] JoinError),
    /// The recording cannot be.
    #[error(transparent)]
    Keep(#[from] KeepError),
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The simulator failed: a defect.
    #[error(transparent)]
    Robot(#[from] RobotError),
}

impl ExploreError {
    /// Whether what was given is wrong, and not the run.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::World(_) | Self::Start(_) => true,
            Self::SharedWorld(error) => error.is_input(),
            Self::Keep(error) => error.is_input(),
            Self::Run(error) => error.is_input(),
            _ => false,
        }
    }
}

/// What happens while it runs, for progress displays.
#[derive(Clone, Debug)]
pub struct ExploreProgress {
    /// Simulated seconds so far.
    pub sim_s: f64,
    /// Free area on the grid, square metres.
    pub free_area_m2: f64,
    /// Nodes of the map.
    pub nodes: usize,
    /// Increments that this robot has written, those of its earlier runs included.
    pub written: u64,
    /// Of these, what the server has durably.
    pub acknowledged: u64,
    /// Whether the robot knows where in the map it is.
    pub placed: bool,
}

/// Time between two looks at the progress, microseconds.
const WATCH_EVERY_US: u64 = 1_000_000;

impl ExploreProgress {
    fn of(mapper: &Mapper, sim_us: u64, written: u64, acknowledged: u64) -> Self {
        let counts = mapper.map().counts();
        Self {
            sim_s: sim_us as f64 * 1e-6,
            free_area_m2: mapper.free_area_m2(),
            nodes: counts.main_nodes + counts.support_nodes,
            written,
            acknowledged,
            placed: mapper.is_placed(),
        }
    }
}

/// Tells `watch` about once a simulated second.
struct Watcher<W> {
    watch: W,
    next_us: u64,
    last_us: u64,
}

impl<W: FnMut(ExploreProgress)> Watcher<W> {
    /// The run has ended, and what it wrote has come as far as it does.
    fn finish(&mut self, summary: &MappingSummary, mapper: &Mapper) {
        (self.watch)(ExploreProgress::of(mapper, self.last_us, summary.written, summary.acknowledged()));
    }
}

impl<W: FnMut(ExploreProgress)> MappingObserver for Watcher<W> {
    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        let time_us = mapped.frame.time_us;
        self.last_us = time_us;
        if time_us >= self.next_us {
            self.next_us = time_us + WATCH_EVERY_US;
            (self.watch)(ExploreProgress::of(mapped.mapper, time_us, mapped.written, mapped.acknowledged));
        }
        ControlFlow::Continue(())
    }
}

/// A robot that drives no more leaves the world that it shares: the others do not wait for it.
struct LeavesAtEnd(WorldExit);

impl MappingObserver for LeavesAtEnd {
    fn on_frame(&mut self, _: &MappedFrame<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn on_end(&mut self, _: &Mapper) {
        self.0.leave();
    }
}

/// Explores, publishes, and scores the result. `watch` is called about once a simulated second from
/// the loop's thread, and once more when all has ended.
///
/// # Errors
/// [`ExploreError`]; an exploration that ended is reported even if the server could not be reached
/// (`delivered` false).
pub async fn explore(
    task: ExploreTask,
    watch: impl FnMut(ExploreProgress) + Send + 'static,
) -> Result<ExploreReport, ExploreError> {
    let ExploreTask { setup, sim, mapping, .. } = task;
    let world = Arc::new(setup.load()?);
    let start = setup.start_in(&world, sim.radius_m)?.unwrap_or_else(|| world.start());
    let keeper = RunKeeper::new(task.record.as_deref(), task.picture)?;
    let camera_every = if mapping.cameras { sim.camera_every } else { 0 };
    let simulator = Simulator::new(world, SimConfig { camera_every, ..sim }, start, setup.seed);
    let (simulator, exit) = seat(simulator, &setup, &mapping.robot)?;
    let score = ExplorationScore::new(&simulator, setup.map_origin);
    let watcher = Watcher { watch, next_us: 0, last_us: 0 };
    // Its sensors are never silent, however slow the simulated time.
    let mapping = MappingTask { silence: SilenceConfig::patient(), stop: task.stop, ..mapping };
    let observer = (keeper, (watcher, (score, LeavesAtEnd(exit))));
    let outcome = run::explore(mapping, Paced::new(simulator, task.rate), observer).await?;
    let MappingOutcome { mut summary, mapper, observer: (keeper, (mut watcher, (score, _))), .. } = outcome;
    watcher.finish(&summary, &mapper);
    if let Some(error) = summary.robot_error.take() {
        return Err(error.into());
    }
    let kept = keeper.finish(summary.frames)?;
    Ok(score.report(&summary, &mapper, kept))
}
