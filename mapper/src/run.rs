//! The explorer program: simulator, mapper and publisher put together.

use crate::camera::CameraError;
use crate::explore::Ending;
use crate::fellows::{Entry, Fellows};
use crate::linked::{Handover, Linked, LinkedError, Publication, wait_for};
use crate::mapping::{Located, Mapper, MapperConfig, Step};
use crate::publish::Outbox;
use crate::record::MapRecorder;
use crate::report::{ExploreReport, explored, main_node_errors, trajectory_error};
use fht_link::LinkConfig;
use fht_proto::{AuthorId, MapName};
use fht_robot::bag::WriteError;
use fht_robot::descriptor::{DescriptorError, DescriptorNet};
use fht_robot::frame::{FrameError, SensorFrame, Twist};
use fht_robot::pose::Pose2;
use fht_robot::stop::Stop;
use fht_sim::{SimConfig, Simulator, World, WorldError};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// What to explore and where to publish.
#[derive(Clone, Debug)]
pub struct ExploreTask {
    /// `museum`, `office` or the path of a Nav2 `map.yaml` or a Gazebo `.world`.
    pub world: String,
    /// Pictures for the walls of a Nav2 map.
    pub textures: Option<PathBuf>,
    /// Seed of the drawn world.
    pub world_seed: u64,
    /// The robot's sensors and wheels.
    pub sim: SimConfig,
    /// Seed of the sensors' noise and of the wheels' errors.
    pub seed: u64,
    /// Where the robot begins, world frame; none: the world's own start.
    pub start: Option<Pose2>,
    /// For scoring: where the frame of the map that it joins truly lies in the world; none: the world's own start.
    pub map_origin: Option<Pose2>,
    /// Name of the map to write.
    pub map: MapName,
    /// Name of this robot; its author id follows from it.
    pub robot: String,
    /// The server; `None` maps without publishing.
    pub link: Option<LinkConfig>,
    /// Folder in which what the server has not acknowledged survives the run.
    pub spool: Option<PathBuf>,
    /// Another descriptor model than the built-in one.
    pub model: Option<PathBuf>,
    /// Whether nodes carry descriptors.
    pub cameras: bool,
    /// Simulated seconds per second; `None` is as fast as possible.
    pub rate: Option<f64>,
    /// Give up after this much simulated time, seconds.
    pub max_sim_s: f64,
    /// How long to wait for the server's last acknowledgement, seconds.
    pub linger_s: f64,
    /// Algorithm parameters.
    pub mapper: MapperConfig,
    /// A bag to write: an `.mcap` file, or a folder.
    pub record: Option<PathBuf>,
    /// Ends the exploration early, with the map finished as it is.
    pub stop: Stop,
}

/// Why an exploration failed.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    /// The world cannot be loaded.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The descriptor network cannot be loaded.
    #[error("{0}; --no-cameras maps without appearance")]
    Descriptor(#[from] DescriptorError),
    /// The map cannot be published.
    #[error(transparent)]
    Linked(#[from] LinkedError),
    /// The recording failed.
    #[error("the recording failed: {0}")]
    Record(#[from] WriteError),
    /// The simulator made a frame that nothing can be made of: a defect.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The cameras failed on the way.
    #[error(transparent)]
    Cameras(#[from] CameraError),
    /// The system gave no thread.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The loop ended early: a defect.
    #[error("the exploration loop failed: {0}")]
    Loop(#[from] tokio::task::JoinError),
}

/// What happens while it runs, for progress displays.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Simulated seconds so far.
    pub sim_s: f64,
    /// Free area on the grid, square metres.
    pub free_area_m2: f64,
    /// Nodes of the map.
    pub nodes: usize,
    /// Increments written.
    pub written: u64,
    /// Increments that the server has durably.
    pub acknowledged: u64,
    /// Whether the robot knows where in the map it is.
    pub placed: bool,
}

/// Explores, publishes, and scores the result. `watch` is called about once a simulated second from the loop's thread.
///
/// # Errors
/// [`ExploreError`]; an exploration that ended is reported even if the server could not be reached (`delivered` false).
pub async fn explore(
    task: ExploreTask,
    watch: impl FnMut(Snapshot) + Send + 'static,
) -> Result<ExploreReport, ExploreError> {
    let world = Arc::new(fht_sim::load(&task.world, task.textures.as_deref(), task.world_seed)?);
    let net = || task.cameras.then(|| DescriptorNet::load(task.model.as_deref())).transpose();
    let author = AuthorId::of_robot(&task.robot);
    // What is no duration is for ever.
    let linger = Duration::try_from_secs_f64(task.linger_s.max(0.0)).unwrap_or(Duration::MAX);
    let recorder = task.record.as_deref().map(MapRecorder::start).transpose()?;

    let Some(link_config) = task.link.clone() else {
        let mapper = Mapper::new(task.mapper.clone(), author, net()?)?;
        let run = tokio::task::spawn_blocking(move || drive(task, world, mapper, recorder, None, watch));
        return run.await?;
    };
    let (map, robot, spool) = (task.map.clone(), task.robot.clone(), task.spool.clone());
    let publication = Publication { link: link_config, map, robot, spool, linger };
    let linked = Linked::open(publication).await?;
    let (fellows, entry) = linked.enter().await?;
    let mut mapper = match entry {
        Entry::Found { stored } => {
            let mut mapper = Mapper::new(task.mapper.clone(), author, net()?)?;
            mapper.share(&fellows.map(), stored);
            mapper
        }
        Entry::Join { .. } => Mapper::joining(task.mapper.clone(), author, net()?, net()?)?,
    };
    let wall = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    mapper.set_began(u64::try_from(wall.as_micros()).unwrap_or(u64::MAX));
    let run = move |outbox: &Outbox| drive(task, world, mapper, recorder, Some((outbox, fellows)), watch);
    let (report, published) = linked.publish_while(entry, run).await?;
    let mut report = report?;
    report.map_bytes = published.map_bytes;
    report.wire_bytes = published.wire_bytes;
    report.delivered = published.acknowledged >= report.version;
    Ok(report)
}

/// The robot's loop: sense, think, drive.
fn drive(
    task: ExploreTask,
    world: Arc<World>,
    mut mapper: Mapper,
    mut recorder: Option<MapRecorder>,
    link: Option<(&Outbox, Fellows)>,
    mut watch: impl FnMut(Snapshot),
) -> Result<ExploreReport, ExploreError> {
    let begin = Instant::now();
    let start = task.start.unwrap_or_else(|| world.start());
    let (outbox, mut fellows) = link.unzip();
    // A map that this robot begins has its frame where the robot begins.
    let founded = mapper.is_placed().then_some(start);
    let world_from_map = founded.or(task.map_origin).unwrap_or_else(|| world.start());
    let mut sim_config = task.sim.clone();
    if !task.cameras {
        sim_config.camera_every = 0;
    }
    let radius_m = sim_config.radius_m;
    let mut sim = Simulator::new(world.clone(), sim_config, start, task.seed);
    let mut frame: SensorFrame = sim.sense_first();
    let mut truth: Vec<Pose2> = Vec::new();
    // Since the robot has known where in the map it is.
    let mut located: Vec<(Located, Pose2)> = Vec::new();
    let mut joined: Option<[f64; 2]> = None;
    let mut frame_max = Duration::ZERO;
    let mut next_watch_us = 0;
    let mut handover = Handover::new(outbox);
    let ending = loop {
        truth.push(sim.truth());
        let thinking = Instant::now();
        if let Some(fellows) = &mut fellows {
            fellows.exchange(&mut mapper, frame.time_us, handover.acknowledged());
        }
        let step = mapper.step(&frame)?;
        mapper.check()?;
        if mapper.is_placed() {
            joined.get_or_insert_with(|| [frame.time_us as f64 * 1e-6, sim.driven_m()]);
            located.extend(mapper.latest().map(|latest| (*latest, sim.truth())));
        }
        let written = handover.take_from(&mut mapper);
        frame_max = frame_max.max(thinking.elapsed());
        if let Some(recorder) = &mut recorder {
            recorder.record(&frame, &mapper);
        }
        if frame.time_us >= next_watch_us {
            next_watch_us = frame.time_us + 1_000_000;
            let counts = mapper.map().counts();
            watch(Snapshot {
                sim_s: frame.time_us as f64 * 1e-6,
                free_area_m2: mapper.free_area_m2(),
                nodes: counts.main_nodes + counts.support_nodes,
                written,
                acknowledged: handover.acknowledged(),
                placed: mapper.is_placed(),
            });
        }
        if handover.has_ended() {
            break Ending::Interrupted;
        }
        let twist: Twist = match step {
            Step::Drive(_) if task.stop.is_set() => break Ending::Interrupted,
            Step::Drive(twist) if (frame.time_us as f64) * 1e-6 < task.max_sim_s => twist,
            Step::Drive(_) => break Ending::OutOfTime,
            Step::Done(ending) => break ending,
        };
        frame = sim.step(twist);
        wait_for(begin, frame.time_us, task.rate);
    };
    mapper.finish();
    let version = handover.take_from(&mut mapper);
    if let Some(fellows) = &mut fellows {
        fellows.finish(&mapper);
    }
    if let Some(recorder) = recorder {
        recorder.finish(&mapper)?;
    }
    let (free_area_m2, explored_fraction) = explored(world.plan(), mapper.grid(), &world_from_map, radius_m);
    let online: Vec<Pose2> = located.iter().map(|(located, _)| located.map_from_base).collect();
    let corrected: Vec<Pose2> = located.iter().map(|(located, _)| mapper.locate(&located.anchored)).collect();
    let located_truth: Vec<Pose2> = located.iter().map(|(_, truth)| *truth).collect();
    let nodes = main_node_errors(&mapper, &truth, &world_from_map);
    let counts = mapper.map().counts();
    Ok(ExploreReport {
        world: world.name().to_owned(),
        world_from_map: [world_from_map.translation.x, world_from_map.translation.y, world_from_map.rotation.angle()],
        joined,
        ending,
        free_area_m2,
        explored_fraction,
        main_nodes: counts.main_nodes,
        support_nodes: counts.support_nodes,
        edges: counts.edges,
        version,
        digest: mapper.map().digest(),
        map_bytes: 0,
        wire_bytes: 0,
        delivered: false,
        driven_m: sim.driven_m(),
        collisions: sim.collisions(),
        trajectory_error: trajectory_error(&online, &located_truth, &world_from_map),
        corrected_trajectory_error: trajectory_error(&corrected, &located_truth, &world_from_map),
        main_nodes_within_5cm: nodes.iter().filter(|error_m| **error_m < 0.05).count() as f64
            / nodes.len().max(1) as f64,
        main_node_error_max_m: nodes.into_iter().fold(0.0, f64::max),
        closures: [mapper.closures().near, mapper.closures().far],
        frame_max_ms: frame_max.as_secs_f64() * 1e3,
        sim_s: frame.time_us as f64 * 1e-6,
        wall_s: begin.elapsed().as_secs_f64(),
    })
}
