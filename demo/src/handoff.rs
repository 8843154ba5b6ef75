//! The demo: a server, explorers and a client as processes of their own that talk over Zenoh on
//! loopback.

mod agreement;
mod client;
mod config;
mod explorers;
mod judge;
mod programs;
mod report;
mod ros;

pub use config::{Crew, HandoffConfig, HandoffError, shared_world};
pub use report::{ContactFigures, ExplorerFigures, HandoffReport, RosFigures};

use crate::process::Process;
use crate::true_floor::TrueFloor;
use client::ClientReport;
use explorers::Explored;
use fht_client::{LiveReplica, ReplicaConfig};
use fht_perception::pose::{Point2, pose};
use fht_picture::{MapPicture, Mark, PictureConfig, PictureError};
use fht_proto::MapName;
use fht_shared_world::Keeper;
use fht_sim::SimSetup;
use programs::{Bars, session};
use std::time::{Duration, Instant};
use zenoh::Wait;

/// How long the server may take to answer, and to hand over a finished map.
const PATIENCE: Duration = Duration::from_secs(20);

/// Runs the demo. The returned process is the server, which is still running.
///
/// # Errors
/// [`HandoffError`]; a client that does not arrive is a result, not an error.
pub fn hand_off(config: &HandoffConfig) -> Result<(HandoffReport, Process), HandoffError> {
    let begin = Instant::now();
    let map = SimSetup::of(&config.world).map_name()?;
    let data = config.folder.join("data");
    let server = Process::map_server(&config.executable, &data, &config.endpoint, PATIENCE)?;

    let bars = Bars::new(config);
    // The client meets the people whom the explorers met.
    let shared = config.shared_world()?;
    let keeper = shared.as_ref().map(Keeper::of).transpose()?;
    let (explored, explorers_ros) = match config.ros {
        true => ros::explore(config, &map, &bars, shared.as_ref()).map(|(explored, ros)| (explored, Some(ros)))?,
        false => (explorers::explore(config, &map, &bars, shared.as_ref())?, None),
    };
    let explore_wall_s = begin.elapsed().as_secs_f64();
    let client_begin = Instant::now();
    let (client, clients_ros) = match config.ros {
        true => {
            ros::client(config, &map, &explored, &bars, shared.as_ref()).map(|(client, ros)| (client, Some(ros)))?
        }
        false => (client::client(config, &map, &explored, &bars, shared.as_ref())?, None),
    };
    let client_wall_s = client_begin.elapsed().as_secs_f64();
    drop(keeper);
    let Witness { digests_agree, picture } = draw(config, &map, &explored, &client)?;

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
        arrived: client.arrived,
        goal_distance_m: client.goal_distance_m,
        collisions: explored.collisions + client.collisions,
        people: config.people,
        contacts: shared.map(|_| explored.contacts + ContactFigures::of(client.contacts, client.robot_contacts)),
        failure: client.failure,
        picture_failure: picture.err().map(|error| error.to_string()),
        ros: explorers_ros.zip(clients_ros).map(|(explorers, clients)| explorers + clients),
        explore_wall_s,
        client_wall_s,
        client_sim_s: client.sim_s,
        wall_s: begin.elapsed().as_secs_f64(),
    };
    Ok((report, server))
}

/// What a copy of the map shows.
struct Witness {
    /// Whether the copy and the explorer's own map are the server's.
    digests_agree: bool,
    /// Whether it was drawn: the demo's figures do not depend on that.
    picture: Result<(), PictureError>,
}

/// Fetches the map from the server as any robot would, and draws it.
fn draw(
    config: &HandoffConfig,
    map: &MapName,
    explored: &Explored,
    client: &ClientReport,
) -> Result<Witness, HandoffError> {
    let (_runtime, session) = session(config)?;
    let replica = LiveReplica::start(&session, map, "witness", ReplicaConfig::default())?;
    let head = fht_client::ask_head(&session, map, PATIENCE)?;
    if !replica.wait_for(&head.vector, PATIENCE) {
        return Err(HandoffError::Incomplete(PATIENCE.as_secs()));
    }
    let world = fht_sim::load(&config.world, config.textures.as_deref(), config.seed)?;
    let [x, y, yaw] = explored.world_from_map;
    let point = |[x, y]: [f64; 2]| Point2::new(x, y);
    let driven: Vec<Point2> = client.true_trajectory.iter().copied().map(point).collect();
    let (picture, vector, digest) = {
        let replica = replica.read();
        let start = Some((Mark::Start, Point2::new(client.start[0], client.start[1])));
        let goal = client.goal.map(|goal| (Mark::Goal, point(goal)));
        let marks: Vec<(Mark, Point2)> = start.into_iter().chain(goal).collect();
        let picture = MapPicture {
            title: format!("handoff: {map}, seed {}", config.seed),
            floor: &TrueFloor::new(world.plan(), pose(x, y, yaw)),
            map: replica.state(),
            driven: &driven,
            marks: &marks,
        };
        let drawn = picture.save(&PictureConfig::default(), &config.picture);
        (drawn, replica.vector().clone(), replica.state().digest())
    };
    let is_servers = |vector, digest| agreement::is_servers(&session, map, vector, digest, PATIENCE);
    let mut agree = is_servers(&vector, digest)?;
    if let Some((vector, digest)) = &explored.state {
        agree &= is_servers(vector, *digest)?;
    }
    drop(replica);
    session.close().wait()?;
    Ok(Witness { digests_agree: agree, picture })
}
