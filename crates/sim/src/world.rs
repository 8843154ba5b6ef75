//! A world: what rays meet, and the true plan.
//!
//! | module | idea |
//! | --- | --- |
//! | `building`, `draw` | the built-in buildings, and the drawings on their walls |
//! | `nav2`, `gazebo` | worlds from files: maps of the ROS 2 map server, Gazebo worlds |
//! | `changes` | a world some time later: some of its movable things gone, shifted or added |

mod building;
mod changes;
mod draw;
mod gazebo;
mod nav2;

pub use changes::Changes;
pub use draw::photographs::PhotographError;
pub use gazebo::SdfError;
pub use nav2::MapError;

use crate::plan::{FloorPlan, Mask};
use crate::scene::Scene;
use building::layout::Layout;
use building::style::Style;
use building::{dress, extrude, museum, office, rearrange};
use draw::photographs;
use fht_perception::pose::{Point2, Pose2, pose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};

/// Preferred clearance at the start in a map, metres.
const START_CLEARANCE_M: f64 = 0.35;
/// How many separate parts of a map are tried for a start.
const START_TRIES: usize = 8;
/// Free floor for each of the people in a world, square metres. Where it is less they stand in each
/// other's way, and in the robot's.
const M2_PER_PERSON: f64 = 2.0;
/// What a map lacks all of whose cells are occupied or unknown.
const NO_FREE_FLOOR: &str =
    "free floor: are `negate`, `free_thresh` or `occupied_thresh` of its map.yaml the wrong way round?";

/// Why a world cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// No built-in world has this name, and it is not the path of a map or a Gazebo world.
    #[error("unknown world '{0}': expected museum, office, or the path of a Nav2 map.yaml or a Gazebo .world")]
    Unknown(String),
    /// The path is of something else.
    #[error("'{0}' is neither a Nav2 map.yaml nor a Gazebo .world")]
    OtherFile(String),
    /// The world's file is not there.
    #[error("there is no world '{0}': the file is missing")]
    Missing(String),
    /// The world has no wall or no place to stand.
    #[error("world '{0}' has no {1}")]
    Empty(String, &'static str),
    /// More people are to be in the world than could stand and walk in it.
    #[error(
        "{people} people are too many for world '{world}': its {free_m2:.0} m² of free floor have room for {most} (one on \
         each {} m²)",
        M2_PER_PERSON
    )]
    Crowded {
        /// The world.
        world: String,
        /// How many there were to be.
        people: usize,
        /// Area of the free floor, square metres.
        free_m2: f64,
        /// How many there may be.
        most: usize,
    },
    /// There are pictures for the walls of a world that brings its own looks.
    #[error("'{0}' has looks of its own: only the walls of a Nav2 map take a folder of textures")]
    Textures(String),
    /// A map cannot be loaded.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A Gazebo world cannot be loaded.
    #[error("cannot load {path}: {source}")]
    Gazebo {
        /// The world's file.
        path: PathBuf,
        /// Why.
        source: SdfError,
    },
    /// The pictures cannot be loaded.
    #[error(transparent)]
    Photographs(#[from] PhotographError),
}

/// Triangles with textures, and the true floor plan. Shared, read-only, by any number of
/// simulators.
pub struct World {
    name: String,
    scene: Scene,
    plan: FloorPlan,
    start: Pose2,
    warnings: Vec<String>,
    changes: usize,
}

impl std::fmt::Debug for World {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("World")
            .field("name", &self.name)
            .field("triangles", &self.triangle_count())
            .field("start", &self.start)
            .finish_non_exhaustive()
    }
}

/// Height at which a robot's body touches things, metres.
pub(crate) const BODY_HEIGHT_M: f64 = 0.1;
/// Radius of the disc that must be able to travel from the start to a random pose, metres.
const REACH_RADIUS_M: f64 = 0.2;

impl World {
    /// Name: `museum`, `office`, or the file stem of a map or a Gazebo world.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The true floor plan, for scoring only.
    #[must_use]
    pub fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Default start of an explorer, world frame, well clear of walls.
    #[must_use]
    pub fn start(&self) -> Pose2 {
        self.start
    }

    /// A pose drawn uniformly from the free places that have at least `clearance_m` (metres) of
    /// clearance and can be reached from [`start`](Self::start), with a random heading. Returns the
    /// start itself if there is no such place.
    #[must_use]
    pub fn random_free_pose(&self, seed: u64, clearance_m: f64) -> Pose2 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let from = Point2::from(self.start.translation.vector);
        let reachable = self.plan.reachable(from, REACH_RADIUS_M.min(clearance_m));
        let width = self.plan.width();
        let roomy = |index: &usize| {
            reachable.cells()[*index]
                && self.plan.clearance_m(self.plan.centre_of(index % width, index / width)) >= clearance_m
        };
        let places: Vec<usize> = (0..reachable.cells().len()).filter(roomy).collect();
        let yaw = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
        if places.is_empty() {
            return self.start;
        }
        let index = places[rng.random_range(0..places.len())];
        let centre = self.plan.centre_of(index % width, index / width);
        pose(centre.x, centre.y, yaw)
    }

    /// Whether a disc of `radius_m` (metres) can go straight from one place to another without
    /// touching anything that the simulator's bumper would hit. World frame. For scoring only.
    #[must_use]
    pub fn is_clear(&self, from: Point2, to: Point2, radius_m: f64) -> bool {
        /// Shortest step along the way, metres: nothing thicker than a chord of this length is
        /// missed.
        const LEAST_STEP_M: f64 = 0.005;
        let length = (to - from).norm();
        let mut at = 0.0;
        loop {
            let point = if length > 0.0 { from + (to - from) * (at / length) } else { from };
            let (_, distance) = self.scene.nearest(point, BODY_HEIGHT_M);
            if distance < radius_m {
                return false;
            }
            if at >= length {
                return true;
            }
            at = (at + (distance - radius_m).max(LEAST_STEP_M)).min(length);
        }
    }

    /// Checks that so many people have room: 2 m² of free floor for each.
    ///
    /// # Errors
    /// [`WorldError::Crowded`].
    pub(crate) fn check_people(&self, people: usize) -> Result<(), WorldError> {
        let free_m2 = self.plan.free_area_m2();
        let most = (free_m2 / M2_PER_PERSON) as usize;
        if people <= most {
            return Ok(());
        }
        Err(WorldError::Crowded { world: self.name.clone(), people, free_m2, most })
    }

    /// Distance from a place to the nearest thing that a robot's body would touch, metres.
    pub(crate) fn body_clearance_m(&self, place: Point2) -> f64 {
        self.scene.nearest(place, BODY_HEIGHT_M).1
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.scene.triangle_count()
    }

    /// What a Gazebo world's files lack or get wrong, one sentence for each kind of flaw.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// How many things were removed, shifted or added ([`load_with`]).
    #[must_use]
    pub fn changes(&self) -> usize {
        self.changes
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    fn from_layout(
        name: &str,
        mut layout: Layout<Style>,
        seed: u64,
        changes: Option<&Changes>,
    ) -> Result<Self, WorldError> {
        let mut plan = layout.plan();
        let count = changes.map_or(0, |changes| rearrange::furniture(&mut layout, &plan, changes));
        if count > 0 {
            plan = layout.plan();
        }
        let scene =
            dress::dress(&layout, &plan, &[], seed).ok_or_else(|| WorldError::Empty(name.to_owned(), "walls"))?;
        let start = Pose2::identity();
        Ok(Self { name: name.to_owned(), scene, plan, start, warnings: Vec::new(), changes: count })
    }

    fn from_nav2(
        path: &Path,
        textures: Option<&Path>,
        seed: u64,
        changes: Option<&Changes>,
    ) -> Result<Self, WorldError> {
        let name = name_of(path);
        let photographs = textures.map_or_else(|| Ok(Vec::new()), photographs::load)?;
        let mut plan = nav2::load(path)?;
        if plan.free_area_m2() == 0.0 {
            return Err(WorldError::Empty(name, NO_FREE_FLOOR));
        }
        let mut layout = extrude::layout(&plan, seed);
        let mut count = 0;
        if let Some(changes) = changes {
            (plan, count) = rearrange::pieces(&mut layout, &plan, changes);
        }
        let scene =
            dress::dress(&layout, &plan, &photographs, seed).ok_or_else(|| WorldError::Empty(name.clone(), "walls"))?;
        let start = start_near_origin(&plan).ok_or_else(|| WorldError::Empty(name.clone(), "place to stand"))?;
        Ok(Self { name, scene, plan, start, warnings: Vec::new(), changes: count })
    }

    fn from_gazebo(path: &Path, changes: Option<&Changes>) -> Result<Self, WorldError> {
        let name = name_of(path);
        let gazebo =
            gazebo::load(path, changes).map_err(|source| WorldError::Gazebo { path: path.to_owned(), source })?;
        let scene = gazebo.scene.ok_or_else(|| WorldError::Empty(name.clone(), "surfaces"))?;
        let empty = || WorldError::Empty(name.clone(), "place to stand");
        let plan = gazebo.plan.ok_or_else(empty)?;
        let start = start_near_origin(&plan).ok_or_else(empty)?;
        Ok(Self { name, scene, plan, start, warnings: gazebo.warnings, changes: gazebo.changes })
    }
}

/// The name of a world, from its own or from its file's.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(|| "map".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// The files that a world is read from, as far as they are known before: its own, and the picture
/// of a map.
pub(crate) fn files_of(spec: &str) -> Vec<PathBuf> {
    let path = PathBuf::from(spec);
    match path.extension().and_then(std::ffi::OsStr::to_str) {
        Some("yaml" | "yml") => nav2::picture_of(&path).into_iter().chain([path]).collect(),
        Some(_) => vec![path],
        None => Vec::new(),
    }
}

/// Checks that there is such a world, as far as that shows without loading it.
///
/// # Errors
/// [`WorldError::Unknown`], [`WorldError::OtherFile`], [`WorldError::Missing`].
pub fn check_world(spec: &str) -> Result<(), WorldError> {
    let path = Path::new(spec);
    match path.extension().and_then(std::ffi::OsStr::to_str) {
        _ if ["museum", "office"].contains(&spec) => Ok(()),
        Some("yaml" | "yml" | "world" | "sdf") if path.is_file() => Ok(()),
        Some("yaml" | "yml" | "world" | "sdf") => Err(WorldError::Missing(spec.to_owned())),
        _ => Err(neither(spec)),
    }
}

/// What is wrong with the name of a world that is neither built in nor a file of a known kind.
fn neither(spec: &str) -> WorldError {
    let of = if Path::new(spec).exists() { WorldError::OtherFile } else { WorldError::Unknown };
    of(spec.to_owned())
}

/// Loads a world. `spec` is `museum` or `office`, which are built in and drawn from `seed`; or the
/// path of a Nav2 `map.yaml`, whose walls are decorated by `seed` with pictures from the folder
/// `textures`, or with the crate's own drawings if there is none; or the path of a Gazebo `.world`
/// or `.sdf` file, which brings its own looks.
///
/// # Errors
/// [`WorldError`] when the name is unknown, a file is missing, malformed or shows no free place,
/// something lies over 100 km from the origin, or there are `textures` for another world than a
/// map.
pub fn load(spec: &str, textures: Option<&Path>, seed: u64) -> Result<World, WorldError> {
    load_with(spec, textures, seed, None)
}

/// Loads a world as [`load`] does, but some time later: with `changes` to its movable things. These
/// are drawn furniture, small pieces of a map that stand clear of its walls, and small models of a
/// Gazebo world. The true plan is that of the changed world; everything else looks as before.
///
/// # Errors
/// As [`load`].
pub fn load_with(
    spec: &str,
    textures: Option<&Path>,
    seed: u64,
    changes: Option<&Changes>,
) -> Result<World, WorldError> {
    let has_own_looks = || if textures.is_none() { Ok(()) } else { Err(WorldError::Textures(spec.to_owned())) };
    let built_in = |layout: fn(u64) -> Layout<Style>| {
        has_own_looks().and_then(|()| World::from_layout(spec, layout(seed), seed, changes))
    };
    match spec {
        "museum" => built_in(museum::layout),
        "office" => built_in(office::layout),
        other => {
            let path = Path::new(other);
            match path.extension().and_then(std::ffi::OsStr::to_str) {
                Some("yaml" | "yml") => World::from_nav2(path, textures, seed, changes),
                Some("world" | "sdf") => has_own_looks().and_then(|()| World::from_gazebo(path, changes)),
                _ => Err(neither(other)),
            }
        }
    }
}

/// The origin if there is room, else the nearest roomy place from which at least half of the floor
/// can be reached, else the place among the few tried from which most of the floor can be reached.
fn start_near_origin(plan: &FloorPlan) -> Option<Pose2> {
    let wanted = START_CLEARANCE_M.min(0.9 * plan.max_clearance_m());
    let mut tried: Vec<Mask> = Vec::new();
    let mut best: Option<(f64, Point2)> = None;
    for _ in 0..START_TRIES {
        let Some(place) = nearest_roomy(plan, wanted, &tried) else { break };
        let reachable = plan.reachable(place, wanted.min(REACH_RADIUS_M));
        let area = plan.area_m2(&reachable);
        if best.is_none_or(|(most, _)| area > most) {
            best = Some((area, place));
        }
        if area > 0.5 * plan.free_area_m2() {
            break;
        }
        tried.push(reachable);
    }
    best.map(|(_, place)| pose(place.x, place.y, 0.0))
}

/// The place with at least `clearance_m` (metres) of clearance that is nearest to the origin and in
/// none of the sets `but`.
fn nearest_roomy(plan: &FloorPlan, clearance_m: f64, but: &[Mask]) -> Option<Point2> {
    let is_new = |column: usize, row: usize| !but.iter().any(|mask| mask.contains(column, row));
    let mut best: Option<(f64, Point2)> = None;
    for row in 0..plan.height() {
        for column in 0..plan.width() {
            let centre = plan.centre_of(column, row);
            let squared = centre.coords.norm_squared();
            if best.is_none_or(|(least, _)| squared < least)
                && plan.clearance_m(centre) >= clearance_m
                && !plan.is_occupied(centre.x, centre.y)
                && is_new(column, row)
            {
                best = Some((squared, centre));
            }
        }
    }
    let has_room = plan.clearance_m(Point2::origin()) >= clearance_m;
    let origin = plan.cell_of(Point2::origin()).filter(|&(column, row)| has_room && is_new(column, row));
    origin.map(|_| Point2::origin()).or(best.map(|(_, place)| place))
}
