//! The demo: a server, explorers and a client as processes of their own, talking over Zenoh on loopback.

mod explorers;

pub use explorers::{Crew, ExplorerFigures};

use crate::picture::{PictureConfig, PictureError, Scene, save};
use crate::process::{Process, ProcessError, Role};
use client_robot::replica::{LiveReplica, ReplicaConfig, ReplicaError};
use explorers::Explored;
use fht_link::{LinkConfig, LinkError};
use fht_proto::MapName;
use fht_robot::pose::{Point2, pose};
use fht_sim::WorldError;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use zenoh::Wait;

/// What to show.
#[derive(Clone, Debug)]
pub struct HandoffConfig {
    /// The executable with the roles.
    pub executable: PathBuf,
    /// `museum`, `office` or the path of a Nav2 `map.yaml` or a Gazebo `.world`.
    pub world: String,
    /// Pictures for the walls of a Nav2 map.
    pub textures: Option<PathBuf>,
    /// Seed of everything: drawing, noise, light, start and goal.
    pub seed: u64,
    /// Who explores.
    pub crew: Crew,
    /// Where the server listens.
    pub endpoint: String,
    /// Folder for the server's data and the reports of the programs.
    pub folder: PathBuf,
    /// Where the picture goes.
    pub picture: PathBuf,
    /// Whether progress is shown.
    pub progress: bool,
}

/// What happened, in figures.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct HandoffReport {
    /// The world.
    pub world: String,
    /// The seed.
    pub seed: u64,
    /// Reachable free area, square metres.
    pub free_area_m2: f64,
    /// Share of it that was explored.
    pub explored_fraction: f64,
    /// Main nodes of the map.
    pub main_nodes: usize,
    /// Support nodes of the map.
    pub support_nodes: usize,
    /// Edges of the map.
    pub edges: usize,
    /// Bytes of all increments.
    pub map_bytes: u64,
    /// Bytes that the explorer put on the wire.
    pub wire_bytes: u64,
    /// Mean error of the explorer's estimated positions, metres.
    pub mapping_error_m: f64,
    /// Distance that the explorers drove, metres.
    pub explorer_driven_m: f64,
    /// Each explorer.
    pub explorers: Vec<ExplorerFigures>,
    /// Robot time from the first explorer's beginning to the last one's end, seconds.
    pub explore_sim_s: f64,
    /// Whether the digests of explorer and server agree; of several explorers, those of the server and of a copy.
    pub digests_agree: bool,
    /// Whether the client found its place.
    pub localized: bool,
    /// Error of the client's first fix, metres.
    pub relocalization_error_m: Option<f64>,
    /// Error of its heading, degrees.
    pub relocalization_error_deg: Option<f64>,
    /// Distance driven until the first fix, metres.
    pub relocalization_distance_m: Option<f64>,
    /// Where the client truly was at the end of its drive, `[x, y]` in the map frame.
    pub end_true: Option<[f64; 2]>,
    /// Where it thought it was.
    pub end_estimated: Option<[f64; 2]>,
    /// Error of its estimate at the end, metres.
    pub final_error_m: Option<f64>,
    /// Driven from the fix to the goal, metres.
    pub path_length_m: Option<f64>,
    /// The shortest that was possible, metres.
    pub shortest_length_m: Option<f64>,
    /// Whether the client arrived: it says so, and it is truly within half a metre of the goal.
    pub arrived: bool,
    /// True distance to the goal at the end, metres.
    pub goal_distance_m: Option<f64>,
    /// Times that either robot touched something.
    pub collisions: u64,
    /// Why the client failed, if it did.
    pub failure: Option<String>,
    /// Seconds of the exploration.
    pub explore_wall_s: f64,
    /// Seconds of the whole demo.
    pub wall_s: f64,
}

impl HandoffReport {
    /// Whether the demo shows what it should: server and explorer have the same map, and the client arrived.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.digests_agree && self.arrived
    }
}

/// The part of the client's report that the demo shows.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct ClientReport {
    start: [f64; 3],
    goal: Option<[f64; 2]>,
    localized: bool,
    relocalization_distance_m: Option<f64>,
    relocalization_error_m: Option<f64>,
    relocalization_error_deg: Option<f64>,
    final_error_m: Option<f64>,
    arrived: bool,
    goal_distance_m: Option<f64>,
    failure: Option<String>,
    path_length_m: Option<f64>,
    shortest_length_m: Option<f64>,
    collisions: u64,
    trajectory: Vec<[f64; 2]>,
    true_trajectory: Vec<[f64; 2]>,
}

/// Why the demo ended early.
#[derive(Debug, thiserror::Error)]
pub enum HandoffError {
    /// A program failed.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A file of a program cannot be read.
    #[error("{path}: {reason}", path = path.display())]
    Report {
        /// Which file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The session cannot be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The map cannot be fetched.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The server does not answer.
    #[error("the server does not tell its head: {0}")]
    Head(#[from] client_robot::replica::AskError),
    /// The server's map did not arrive.
    #[error("the map did not arrive within {0} s")]
    Incomplete(u64),
    /// The world cannot be loaded.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The picture cannot be made.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// Zenoh failed.
    #[error("zenoh: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// A thread that followed an explorer failed: a defect.
    #[error("an explorer was not followed to its end")]
    Thread,
    /// No runtime.
    #[error("no runtime: {0}")]
    Runtime(#[from] std::io::Error),
    /// The name of the world is no map name.
    #[error(transparent)]
    MapName(#[from] fht_proto::ids::ParseIdError),
}

/// The map's name for a world: the file's name without its ending.
///
/// # Errors
/// When that is no map name.
pub fn map_name(world: &str) -> Result<MapName, HandoffError> {
    let stem = Path::new(world).file_stem().map_or_else(|| world.into(), |stem| stem.to_string_lossy());
    Ok(stem.parse()?)
}

/// How long the server may take to answer and to hand over a finished map.
const PATIENCE: Duration = Duration::from_secs(20);

/// Runs the demo. The returned process is the server, which still runs.
///
/// # Errors
/// [`HandoffError`]; a client that does not arrive is no error but a result.
pub fn run(config: &HandoffConfig) -> Result<(HandoffReport, Process), HandoffError> {
    let begin = Instant::now();
    let map = map_name(&config.world)?;
    let data = config.folder.join("data");
    let server = Process::map_server(&config.executable, &data, &config.endpoint, PATIENCE)?;

    let explored = explorers::explore(config, &map)?;
    let explore_wall_s = begin.elapsed().as_secs_f64();
    let client = client(config, &map, &explored)?;
    let digests_agree = draw(config, &map, &explored, &client)?;

    let end = |trajectory: &[[f64; 2]]| trajectory.last().copied();
    let report = HandoffReport {
        world: config.world.clone(),
        seed: config.seed,
        free_area_m2: explored.free_area_m2,
        explored_fraction: explored.explored_fraction,
        main_nodes: explored.main_nodes,
        support_nodes: explored.support_nodes,
        edges: explored.edges,
        map_bytes: explored.map_bytes,
        wire_bytes: explored.wire_bytes,
        mapping_error_m: explored.error_mean_m,
        explorer_driven_m: explored.driven_m,
        explore_sim_s: explored.sim_s,
        explorers: explored.explorers,
        digests_agree,
        localized: client.localized,
        relocalization_error_m: client.relocalization_error_m,
        relocalization_error_deg: client.relocalization_error_deg,
        relocalization_distance_m: client.relocalization_distance_m,
        end_true: end(&client.true_trajectory),
        end_estimated: end(&client.trajectory),
        final_error_m: client.final_error_m,
        path_length_m: client.path_length_m,
        shortest_length_m: client.shortest_length_m,
        arrived: client.arrived && client.goal_distance_m.is_some_and(|metres| metres < 0.5),
        goal_distance_m: client.goal_distance_m,
        collisions: explored.collisions + client.collisions,
        failure: client.failure,
        explore_wall_s,
        wall_s: begin.elapsed().as_secs_f64(),
    };
    Ok((report, server))
}

fn bar(config: &HandoffConfig, prefix: &'static str) -> ProgressBar {
    if !config.progress {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {prefix:<10} {elapsed:>4}  {msg}");
    let bar = ProgressBar::new_spinner().with_prefix(prefix);
    bar.enable_steady_tick(Duration::from_millis(120));
    match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

fn read_report<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, HandoffError> {
    let report_error = |reason: String| HandoffError::Report { path: path.to_owned(), reason };
    let text = std::fs::read_to_string(path).map_err(|error| report_error(error.to_string()))?;
    serde_json::from_str(&text).map_err(|error| report_error(error.to_string()))
}

/// The arguments that explorer and client share.
fn world_args(config: &HandoffConfig, map: &MapName, report: &Path) -> Vec<std::ffi::OsString> {
    let mut args: Vec<std::ffi::OsString> = Vec::new();
    let mut add = |name: &str, value: &std::ffi::OsStr| args.extend([name.into(), value.to_owned()]);
    add("--world", config.world.as_ref());
    add("--map", map.as_str().as_ref());
    add("--connect", config.endpoint.as_ref());
    add("--world-seed", config.seed.to_string().as_ref());
    add("--report", report.as_os_str());
    if let Some(textures) = &config.textures {
        add("--textures", textures.as_os_str());
    }
    args
}

fn client(config: &HandoffConfig, map: &MapName, explored: &Explored) -> Result<ClientReport, HandoffError> {
    let report = config.folder.join("client.json");
    let mut args = vec!["go".into()];
    args.extend(world_args(config, map, &report));
    let [x, y, yaw] = explored.world_from_map;
    // Another day: other noise, other wheels, other light.
    let (seed, light) = ((1000 + config.seed).to_string(), (1 + config.seed).to_string());
    let origin = format!("{x},{y},{yaw}");
    args.extend(["--seed", &seed, "--light-seed", &light, "--map-origin", &origin].map(Into::into));
    args.extend(["--to", "random", "--quiet"].map(Into::into));
    let bar = bar(config, "client");
    bar.set_message("dropped somewhere; finding out where, then driving to its goal");
    let ended = Process::start(&config.executable, Role::ClientRobot, args)?.follow(|_| ());
    // A client that did not arrive says so in its report and by its exit code.
    match ended {
        Err(ProcessError::Failed { .. }) if report.exists() => bar.finish_with_message("failed"),
        other => {
            other?;
            bar.finish_with_message("done");
        }
    }
    read_report(&report)
}

/// Fetches the map from the server as any robot would, and draws it. Returns whether its digest is the explorer's.
fn draw(
    config: &HandoffConfig,
    map: &MapName,
    explored: &Explored,
    client: &ClientReport,
) -> Result<bool, HandoffError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let session = runtime.block_on(fht_link::open(&LinkConfig::from_options(vec![config.endpoint.clone()], None)))?;
    let replica = LiveReplica::start(&session, map, "witness", ReplicaConfig::default())?;
    let head = client_robot::replica::ask_head(&session, map, PATIENCE)?;
    if !replica.wait_for(&head.vector, PATIENCE) {
        return Err(HandoffError::Incomplete(PATIENCE.as_secs()));
    }
    let world = fht_sim::load(&config.world, config.textures.as_deref(), config.seed)?;
    let [x, y, yaw] = explored.world_from_map;
    let point = |[x, y]: [f64; 2]| Point2::new(x, y);
    let driven: Vec<Point2> = client.true_trajectory.iter().copied().map(point).collect();
    let agree = {
        let replica = replica.read();
        let scene = Scene {
            plan: world.plan(),
            world_from_map: pose(x, y, yaw),
            map: replica.state(),
            driven: &driven,
            ends: client.goal.map(|goal| (Point2::new(client.start[0], client.start[1]), point(goal))),
        };
        save(&scene, &PictureConfig::default(), &config.picture)?;
        // The last of several explorers may have ended before what another one wrote last was there.
        replica.state().digest() == explored.digest.unwrap_or(head.digest)
    };
    drop(replica);
    session.close().wait()?;
    Ok(agree)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_fails_unless_the_maps_agree_and_the_client_arrives() {
        for (digests_agree, arrived, is_success) in
            [(true, true, true), (false, true, false), (true, false, false), (false, false, false)]
        {
            let report = HandoffReport { digests_agree, arrived, ..HandoffReport::default() };
            assert_eq!(report.is_success(), is_success, "{digests_agree} {arrived}");
        }
    }
}
