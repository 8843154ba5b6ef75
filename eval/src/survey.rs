//! Maps for evaluations: a world explored with drifting wheels and our SLAM, never from the truth.
//! An exploration is kept in a folder, so that an evaluation that is run again goes on where the
//! last one ended.

use crate::grid_map::GridMap;
use crate::systems::topo_map::Pass;
use fht_descriptor::{DescriptorError, DescriptorNet};
use fht_map::MapState;
use fht_perception::frame::{FrameError, SensorFrame};
use fht_perception::pose::{Pose2, pose};
use fht_proto::{AuthorId, CodecError, Descriptor, Increment, decode, encode};
use fht_sim::{Changes, PeopleConfig, SimConfig, Simulator, World, WorldError};
use mapper::CameraError;
use mapper::explore::Ending;
use mapper::slam::Anchored;
use mapper::{Mapper, MapperConfig, MapperStep};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is explored, and how.
#[derive(Clone, Debug)]
pub struct SurveyTask {
    /// `museum`, `office`, or a file that [`fht_sim::load`] reads.
    pub world: String,
    /// Pictures for the walls of a floor plan.
    pub textures: Option<PathBuf>,
    /// Seed of what is drawn in it. Usually 1.
    pub world_seed: u64,
    /// Changes in it since it was drawn.
    pub changes: Option<Changes>,
    /// How many people walk about in it meanwhile.
    pub people: usize,
    /// Where the explorer starts, world frame; `None` is the world's own start.
    pub start: Option<Pose2>,
    /// Seed of noise and wheels.
    pub seed: u64,
    /// Whether nodes have pictures.
    pub cameras: bool,
    /// Factor of the wheels' drift.
    pub drift: f64,
    /// The name under which the map is kept: one for each set of parameters.
    pub variant: String,
    /// The mapper's parameters.
    pub mapper: MapperConfig,
}

impl SurveyTask {
    /// The exploration that evaluations share: seed 1, cameras, ordinary drift of the wheels, and
    /// the mapper's defaults.
    #[must_use]
    pub fn usual(world: &str) -> Self {
        Self {
            world: world.to_owned(),
            textures: None,
            world_seed: 1,
            changes: None,
            people: 0,
            start: None,
            cameras: true,
            seed: 1,
            drift: 1.0,
            variant: "ours".to_owned(),
            mapper: MapperConfig::default(),
        }
    }

    /// Where its map is kept. The name depends on the whole task, because two files may have the
    /// same stem, or that of a built-in world.
    fn path(&self, folder: &Path) -> PathBuf {
        let spec = self.world.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        let mut unusual = String::new();
        if self.world_seed != 1 {
            unusual += &format!("-drawn{}", self.world_seed);
        }
        if let Some(Changes { share, seed }) = self.changes {
            unusual += &format!("-changed{share}-{seed}");
        }
        if let Some(start) = self.start {
            let (x, y, yaw) = (start.translation.x, start.translation.y, start.rotation.angle());
            unusual += &format!("-from{x:.3},{y:.3},{yaw:.3}");
        }
        if self.people > 0 {
            unusual += &format!("-people{}", self.people);
        }
        if !self.cameras {
            unusual += "-dark";
        }
        folder.join(format!("{spec}-{}-drift{}-seed{}{unusual}.{FORM}", self.variant, self.drift, self.seed))
    }
}

/// An explored world.
pub struct Survey {
    /// The world.
    pub world: Arc<World>,
    /// Where the map's frame lies in it: where the explorer started.
    pub world_from_map: Pose2,
    /// The map.
    pub map: MapState,
    /// Its encoded increments, as they travel.
    pub increments: Vec<Vec<u8>>,
    /// The explorer's occupancy grid at the end, map frame.
    pub grid: GridMap,
    /// Places along the explorer's way, and their descriptors.
    pub passes: Vec<Pass>,
    /// Identifies this map: a hash of what is kept of it.
    pub identity: String,
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum ExplorationError {
    /// The world cannot be loaded.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The descriptor network cannot be loaded.
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    /// The system gave no thread.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The simulator made a frame that nothing can be made of: a defect.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Panoramas could not be described.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// Nobody explores.
    #[error("a team of nobody")]
    Nobody,
    /// The exploration did not end as it should.
    #[error("the exploration of {world} ended early: {ending}")]
    Incomplete {
        /// The world.
        world: String,
        /// How it ended.
        ending: Ending,
    },
    /// An increment cannot be written or read.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// The grid cannot be written.
    #[error("the grid cannot be deflated: {0}")]
    Grid(std::io::Error),
    /// A kept map cannot be read or written.
    #[error("{path}: {reason}")]
    Kept {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

/// A survey as it is kept.
#[derive(Serialize, Deserialize)]
struct Kept {
    world_from_map: [f64; 3],
    increments: Vec<Vec<u8>>,
    grid: GridMap,
    passes: Vec<Pass>,
}

/// Version of the stored format; worlds stored in another one are explored anew.
const FORM: &str = "survey2";
/// Distance between places whose descriptors are kept, metres.
const PASS_M: f64 = 0.25;
/// Simulated time after which an exploration is given up, microseconds.
const PATIENCE_US: u64 = 4 * 3600 * 1_000_000;

impl Survey {
    /// Whether the map of `task` is in `folder` already.
    #[must_use]
    pub fn is_kept(task: &SurveyTask, folder: &Path) -> bool {
        task.path(folder).is_file()
    }

    /// Takes the map of `task` from `folder`, or explores the world and keeps the map there.
    ///
    /// # Errors
    /// [`ExplorationError`].
    pub fn of(task: &SurveyTask, folder: &Path) -> Result<Self, ExplorationError> {
        let world = fht_sim::load_with(&task.world, task.textures.as_deref(), task.world_seed, task.changes.as_ref())?;
        let world = Arc::new(world);
        let path = task.path(folder);
        let kept_error = |reason: String| ExplorationError::Kept { path: path.clone(), reason };
        if let Ok(bytes) = std::fs::read(&path) {
            let kept: Kept = postcard::from_bytes(&bytes).map_err(|error| kept_error(error.to_string()))?;
            return Self::from_kept(world, kept, &bytes);
        }
        let kept = explore(task, &world)?;
        let bytes = postcard::to_stdvec(&kept).map_err(|error| kept_error(error.to_string()))?;
        // Written under another name first, so that an interrupted program leaves no half map.
        let half = path.with_extension("part");
        let write = || {
            std::fs::create_dir_all(folder)?;
            std::fs::write(&half, &bytes)?;
            std::fs::rename(&half, &path)
        };
        write().map_err(|error| kept_error(error.to_string()))?;
        Self::from_kept(world, kept, &bytes)
    }

    fn from_kept(world: Arc<World>, kept: Kept, bytes: &[u8]) -> Result<Self, ExplorationError> {
        let mut map = MapState::new();
        for bytes in &kept.increments {
            map.apply(&decode::<Increment>(bytes)?);
        }
        let [x, y, yaw] = kept.world_from_map;
        Ok(Self {
            world,
            world_from_map: pose(x, y, yaw),
            map,
            increments: kept.increments,
            grid: kept.grid,
            passes: kept.passes,
            identity: blake3::hash(bytes).to_hex().chars().take(16).collect(),
        })
    }
}

fn explore(task: &SurveyTask, world: &Arc<World>) -> Result<Kept, ExplorationError> {
    let start = task.start.unwrap_or_else(|| world.start());
    let mut sim = SimConfig { drift_factor: task.drift, ..SimConfig::default() };
    if !task.cameras {
        sim.camera_every = 0;
    }
    let people = PeopleConfig::of(task.people, task.seed);
    let mut simulator = Simulator::new(world.clone(), sim, start, task.seed).among(people);
    let net = || task.cameras.then(|| DescriptorNet::load(None)).transpose();
    let mut mapper = Mapper::new(task.mapper.clone(), AuthorId::of_robot("explorer"), net()?)?;
    let mut witness = Witness { net: net()?, seen: Vec::new() };
    let mut frame = simulator.sense_first();
    let ending = loop {
        let step = mapper.step(&frame)?;
        mapper.check()?;
        witness.look(&frame, &mapper);
        match step {
            MapperStep::Drive(_) if frame.time_us > PATIENCE_US => break Ending::OutOfTime,
            MapperStep::Drive(twist) => frame = simulator.step(twist),
            MapperStep::Done(ending) => break ending,
        }
    };
    if ending != Ending::Complete {
        return Err(ExplorationError::Incomplete { world: task.world.clone(), ending });
    }
    mapper.finish();
    let increments = mapper.take_increments().iter().map(encode).collect::<Result<_, _>>()?;
    let grid = GridMap::of(mapper.grid()).map_err(ExplorationError::Grid)?;
    let world_from_map = [start.translation.x, start.translation.y, start.rotation.angle()];
    Ok(Kept { world_from_map, increments, grid, passes: witness.passes(&mapper) })
}

/// Observes what the explorer sees, for maps of other kinds.
struct Witness {
    net: Option<DescriptorNet>,
    seen: Vec<(Anchored, Descriptor)>,
}

impl Witness {
    fn look(&mut self, frame: &SensorFrame, mapper: &Mapper) {
        let (Some(net), Some(panorama), Some(latest)) = (&mut self.net, &frame.panorama, mapper.latest()) else {
            return;
        };
        let is_new = self.seen.last().is_none_or(|(last, _)| {
            let off = mapper.locate(last).translation.vector - latest.map_from_base.translation.vector;
            off.norm() >= PASS_M
        });
        if is_new && let Ok(descriptor) = net.descriptor(panorama) {
            self.seen.push((latest.anchored, descriptor));
        }
    }

    fn passes(self, mapper: &Mapper) -> Vec<Pass> {
        let place = |anchored: &Anchored| {
            let at = mapper.locate(anchored).translation;
            [at.x, at.y]
        };
        self.seen.into_iter().map(|(anchored, descriptor)| Pass { place: place(&anchored), descriptor }).collect()
    }
}
