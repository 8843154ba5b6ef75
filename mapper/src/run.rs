//! A robot that makes a map: it senses, maps and, if it explores, drives, whatever robot stands
//! behind the port. What it maps goes to a server while it is made. [`explore`] drives the robot;
//! [`observe`] maps what it senses while others drive.

mod observer;
mod outcome;

pub use observer::{MappedFrame, MappingObserver};
pub use outcome::{MappingOutcome, MappingSummary};

use crate::camera::CameraError;
use crate::explore::Ending;
use crate::haste::Haste;
use crate::mapping::{Mapper, MapperConfig, MapperStep};
use crate::publish::{Handover, Linked, LinkedError, Outbox, Progress, Publication, WindowConfig};
use crate::team::{MapEntry, Peers};
use fht_descriptor::{DescriptorError, DescriptorNet, Fetching};
use fht_perception::frame::SensorFrame;
use fht_perception::robot::{Robot, RobotError, Sensors, SilenceConfig, Supervised};
use fht_program::Stop;
use fht_proto::{AuthorId, MapName, VersionVector, encode};
use fht_session::SessionConfig;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::runtime::Handle;
use tokio::time::timeout;

/// What to map, and where to publish it.
#[derive(Clone, Debug)]
pub struct MappingTask {
    /// Name of the map to write.
    pub map: MapName,
    /// Name of this robot; its author id follows from it.
    pub robot: String,
    /// The server; `None` maps without publishing.
    pub link: Option<SessionConfig>,
    /// Folder in which what the server has not acknowledged survives the run.
    pub spool: Option<PathBuf>,
    /// How much may be under way to the server, and how long.
    pub window: WindowConfig,
    /// Another descriptor model than the built-in one.
    pub model: Option<PathBuf>,
    /// What may be done if there is no ONNX Runtime.
    pub fetching: Fetching,
    /// Whether nodes carry descriptors: the robot has four cameras.
    pub cameras: bool,
    /// Give up after this much time of the sensors' clock, seconds.
    pub max_s: f64,
    /// How long to wait for a server and its first answer; none: for ever for the server, and for
    /// half a minute for its answer.
    pub wait: Option<Duration>,
    /// How long to wait for the server's last acknowledgement, seconds.
    pub linger_s: f64,
    /// How long the sensors may be silent.
    pub silence: SilenceConfig,
    /// Ends the run early: the map is finished as it is, and what the server has not acknowledged
    /// within a moment is left in the spool. Default never.
    pub stop: Stop,
    /// Algorithm parameters. A live robot sets [`pace`](MapperConfig::pace) to real time.
    pub mapper: MapperConfig,
}

impl MappingTask {
    /// `robot` makes `map`, alone and with its cameras; defaults for everything else.
    #[must_use]
    pub fn new(map: MapName, robot: &str) -> Self {
        Self {
            map,
            robot: robot.to_owned(),
            link: None,
            spool: None,
            window: WindowConfig::default(),
            model: None,
            fetching: Fetching::default(),
            cameras: true,
            max_s: 14_400.0,
            wait: None,
            linger_s: 60.0,
            silence: SilenceConfig::default(),
            stop: Stop::default(),
            mapper: MapperConfig::default(),
        }
    }
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The descriptor network cannot be loaded.
    #[error("{0}; --no-cameras maps without appearance")]
    Descriptor(#[from] DescriptorError),
    /// The map cannot be published.
    #[error(transparent)]
    Linked(#[from] LinkedError),
    /// The cameras failed on the way.
    #[error(transparent)]
    Cameras(#[from] CameraError),
    /// The system gave no thread.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The loop ended early: a defect.
    #[error("the mapping loop failed: {0}")]
    Loop(#[from] tokio::task::JoinError),
}

impl RunError {
    /// Whether what was given is wrong, and not the run.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Descriptor(_)
            | Self::Linked(LinkedError::RobotName(_) | LinkedError::NameTaken(_) | LinkedError::MapExists { .. }) => {
                true
            }
            Self::Linked(LinkedError::Link(error)) => error.is_input(),
            _ => false,
        }
    }
}

/// Explores with `robot` and publishes the map. The loop runs in a thread of its own; the robot's
/// futures may use the Tokio runtime of the caller, which must have its clock and its I/O enabled,
/// and more than one thread if there is a server. While the sensors are silent the robot stands,
/// and at the end, however that comes, it is told to stop.
///
/// # Errors
/// [`RunError`]. A run that ended is an outcome even if the server could not be reached, or the
/// robot failed.
pub async fn explore<R, O>(task: MappingTask, robot: R, observer: O) -> Result<MappingOutcome<R, O>, RunError>
where
    R: Robot + Send + 'static,
    O: MappingObserver + Send + 'static,
{
    let net = || net(&task);
    let author = AuthorId::of_robot(&task.robot);
    let runtime = Handle::current();
    let Some(link) = task.link.clone() else {
        let mapper = Mapper::new(task.mapper.clone(), author, net()?)?;
        let run = move || runtime.block_on(Run::new(&task, mapper, None).explore(robot, observer, None));
        return tokio::task::spawn_blocking(run).await?;
    };
    let linked = Linked::open(publication(&task, link)).await?;
    let (peers, entry) = linked.enter().await?;
    let mut mapper = match entry {
        MapEntry::Found { stored } => {
            let mut mapper = Mapper::new(task.mapper.clone(), author, net()?)?;
            mapper.share(&peers.map(), stored);
            mapper
        }
        MapEntry::Join { .. } => Mapper::joining(task.mapper.clone(), author, net()?, net()?)?,
    };
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    mapper.set_began(u64::try_from(wall.as_micros()).unwrap_or(u64::MAX));
    let run = move |outbox: &Outbox| {
        runtime.block_on(Run::new(&task, mapper, Some(outbox)).explore(robot, observer, Some(peers)))
    };
    let (outcome, published) = linked.publish_while(entry, run).await?;
    Ok(outcome?.with(published))
}

/// Maps what `sensors` say of a robot that others drive, such as a recorded run, until they end;
/// publishes the map, which must be new to the server. In all else as [`explore`].
///
/// # Errors
/// [`RunError`].
pub async fn observe<S, O>(task: MappingTask, sensors: S, observer: O) -> Result<MappingOutcome<S, O>, RunError>
where
    S: Sensors + Send + 'static,
    O: MappingObserver + Send + 'static,
{
    let net = net(&task)?;
    let mapper = Mapper::new(task.mapper.clone(), AuthorId::of_robot(&task.robot), net)?;
    let runtime = Handle::current();
    let Some(link) = task.link.clone() else {
        let run = move || runtime.block_on(Run::new(&task, mapper, None).observe(sensors, observer));
        return tokio::task::spawn_blocking(run).await?;
    };
    let publication = publication(&task, link);
    let run = move |outbox: &Outbox| runtime.block_on(Run::new(&task, mapper, Some(outbox)).observe(sensors, observer));
    let linked = Linked::open(publication).await?;
    linked.require_new()?;
    let (outcome, published) = linked.publish_while(MapEntry::Found { stored: 0 }, run).await?;
    Ok(outcome?.with(published))
}

/// The network, if nodes carry descriptors.
fn net(task: &MappingTask) -> Result<Option<DescriptorNet>, DescriptorError> {
    task.cameras.then(|| DescriptorNet::load_with(task.model.as_deref(), task.fetching)).transpose()
}

fn publication(task: &MappingTask, link: SessionConfig) -> Publication {
    // What is no duration is for ever.
    let linger = Duration::try_from_secs_f64(task.linger_s.max(0.0)).unwrap_or(Duration::MAX);
    let MappingTask { map, robot, spool, window, wait, stop, .. } = task.clone();
    Publication { link, wait, map, robot, spool, window, linger, stop }
}

/// How long finishing the map may go on after the run was told to end. Files are to be in order
/// within a second.
const HURRIED_FINISH: Duration = Duration::from_millis(300);

/// A run in progress.
struct Run<'a> {
    task: &'a MappingTask,
    mapper: Mapper,
    handover: Handover<'a>,
    /// Without a server: what there would be to publish.
    unsent: Option<Progress>,
    /// Time of the first frame, microseconds.
    first_us: Option<u64>,
    frames: usize,
    frames_refused: usize,
    frame_max: Duration,
}

/// How a loop ended: the robot's failure is not the run's.
type LoopEnd = Result<Result<Ending, RobotError>, RunError>;

impl<'a> Run<'a> {
    fn new(task: &'a MappingTask, mapper: Mapper, outbox: Option<&'a Outbox>) -> Self {
        let (handover, unsent) = (Handover::new(outbox), outbox.is_none().then(Progress::default));
        Self { task, mapper, handover, unsent, first_us: None, frames: 0, frames_refused: 0, frame_max: Duration::ZERO }
    }

    /// Hands over what the mapper has written, or counts it; returns the number of the robot's
    /// newest increment.
    fn hand_over(&mut self) -> u64 {
        let Some(unsent) = &mut self.unsent else { return self.handover.take_from(&mut self.mapper) };
        for increment in self.mapper.take_increments() {
            unsent.written = increment.number;
            unsent.map_bytes += encode(&increment).map_or(0, |bytes| bytes.len() as u64);
        }
        unsent.written
    }

    async fn explore<R: Robot, O: MappingObserver>(
        mut self,
        robot: R,
        mut observer: O,
        mut peers: Option<Peers>,
    ) -> Result<MappingOutcome<R, O>, RunError> {
        let _order = self.task.stop.in_order();
        observer.on_start(&self.mapper);
        let mut robot = Supervised::new(robot, self.task.silence.clone());
        let end = self.drive(&mut robot, &mut observer, peers.as_mut()).await;
        robot.stop().await;
        self.finish(end?, peers.as_mut(), robot.into_inner(), observer).await
    }

    /// The loop of a robot that explores: sense, think, drive.
    async fn drive<R: Robot>(
        &mut self,
        robot: &mut Supervised<R>,
        observer: &mut impl MappingObserver,
        mut peers: Option<&mut Peers>,
    ) -> LoopEnd {
        loop {
            let frame = tokio::select! {
                biased;
                () = self.task.stop.requested() => return Ok(Ok(Ending::Interrupted)),
                frame = robot.sense() => match frame {
                    Ok(frame) => frame,
                    Err(error) => return Ok(Err(error)),
                },
            };
            let thinking = Instant::now();
            if let Some(peers) = &mut peers {
                peers.exchange(&mut self.mapper, frame.time_us, self.handover.acknowledged());
            }
            let step = match self.mapper.step(&frame) {
                Ok(step) => step,
                Err(error) => return Ok(Err(error.into())),
            };
            let (flow, elapsed_us) = self.after_frame(&frame, thinking, observer)?;
            if self.handover.has_ended() {
                return Ok(Ok(Ending::Interrupted));
            }
            let twist = match step {
                MapperStep::Drive(_) if flow.is_break() => return Ok(Ok(Ending::Interrupted)),
                MapperStep::Drive(twist) if (elapsed_us as f64) * 1e-6 < self.task.max_s => twist,
                MapperStep::Drive(_) => return Ok(Ok(Ending::OutOfTime)),
                MapperStep::Done(ending) => return Ok(Ok(ending)),
            };
            if let Err(error) = robot.drive(twist).await {
                return Ok(Err(error));
            }
        }
    }

    async fn observe<S: Sensors, O: MappingObserver>(
        mut self,
        mut sensors: S,
        mut observer: O,
    ) -> Result<MappingOutcome<S, O>, RunError> {
        let _order = self.task.stop.in_order();
        observer.on_start(&self.mapper);
        let end = self.listen(&mut sensors, &mut observer).await?;
        self.finish(end, None, sensors, observer).await
    }

    /// The loop of a robot that others drive: sense, think.
    async fn listen<S: Sensors>(&mut self, sensors: &mut S, observer: &mut impl MappingObserver) -> LoopEnd {
        let patience = self.task.silence.end_after();
        loop {
            let sensed = tokio::select! {
                biased;
                () = self.task.stop.requested() => return Ok(Ok(Ending::Interrupted)),
                sensed = timeout(patience, sensors.sense()) => sensed,
            };
            let frame = match sensed {
                Ok(Ok(frame)) => frame,
                Ok(Err(RobotError::Ended)) => return Ok(Ok(Ending::Complete)),
                Ok(Err(error)) => return Ok(Err(error)),
                Err(_) => return Ok(Err(RobotError::Silent { waited: patience })),
            };
            self.first_us.get_or_insert(frame.time_us);
            let thinking = Instant::now();
            if let Err(error) = self.mapper.observe(&frame) {
                tracing::warn!("a frame is left out: {error}");
                self.frames_refused += 1;
                continue;
            }
            let (flow, _) = self.after_frame(&frame, thinking, observer)?;
            if flow.is_break() || self.handover.has_ended() {
                return Ok(Ok(Ending::Interrupted));
            }
        }
    }

    /// Hands over what the frame led to, and tells the observer; returns the time since the first
    /// frame, too, microseconds.
    fn after_frame(
        &mut self,
        frame: &SensorFrame,
        thinking: Instant,
        observer: &mut impl MappingObserver,
    ) -> Result<(ControlFlow<()>, u64), RunError> {
        self.mapper.check()?;
        let written = self.hand_over();
        self.frames += 1;
        self.frame_max = self.frame_max.max(thinking.elapsed());
        let elapsed_us = frame.time_us.saturating_sub(*self.first_us.get_or_insert(frame.time_us));
        let acknowledged = self.handover.acknowledged();
        let mapped = MappedFrame { frame, elapsed_us, mapper: &self.mapper, written, acknowledged };
        Ok((observer.on_frame(&mapped), elapsed_us))
    }

    /// Finishes the map; once the run is to end, with what there is time for. Whether it is whole.
    fn finish_map(&mut self) -> bool {
        let (stop, told, is_whole) = (self.task.stop.clone(), OnceLock::new(), Arc::new(AtomicBool::new(true)));
        let remark = Arc::clone(&is_whole);
        let haste = Haste::while_there_is(move || {
            let has_time = !stop.is_set() || told.get_or_init(Instant::now).elapsed() < HURRIED_FINISH;
            if !has_time {
                remark.store(false, Ordering::Relaxed);
            }
            has_time
        });
        self.mapper.finish_while(&haste);
        is_whole.load(Ordering::Relaxed)
    }

    /// Finishes the map as it is.
    async fn finish<R, O: MappingObserver>(
        mut self,
        end: Result<Ending, RobotError>,
        peers: Option<&mut Peers>,
        robot: R,
        mut observer: O,
    ) -> Result<MappingOutcome<R, O>, RunError> {
        peers.as_ref().into_iter().for_each(|peers| peers.begin_finish(&self.mapper));
        let is_whole = self.frames == 0 || self.finish_map();
        let written = self.hand_over();
        self.handover.finish().await;
        let vector = peers.as_ref().map(|peers| peers.taken(&self.mapper));
        let version = vector.as_ref().map_or(written, VersionVector::version);
        if let Some(peers) = peers {
            peers.finish(&self.mapper);
        }
        observer.on_end(&self.mapper);
        let (ending, robot_error) = match end {
            Ok(Ending::Complete) if !is_whole => (Ending::Interrupted, None),
            Ok(ending) => (ending, None),
            Err(error) => (Ending::RobotFailed, Some(error)),
        };
        let summary = MappingSummary {
            ending,
            robot_error,
            frames: self.frames,
            frames_refused: self.frames_refused,
            version,
            vector,
            written,
            frame_max: self.frame_max,
            // Of nothing, nobody is to think that it was delivered.
            published: self.unsent.filter(|unsent| unsent.written > 0),
        };
        Ok(MappingOutcome { summary, mapper: self.mapper, robot, observer })
    }
}
