//! A robot of this name on a map: its session with the server, and its copy of the map.

use super::connection::{ASK_AGAIN, TIMEOUT, connect, wait_for_map, wait_for_name};
use super::error::CliError;
use super::settings::ClientFile;
use fht_client::{LiveReplica, Presence};
use fht_descriptor::DescriptorNet;
use fht_localization::landmarks::check_usable;
use fht_program::{Stop, Waiting};
use fht_proto::api::fleet::RobotRole;
use fht_proto::api::reply::Head;
use zenoh::Session;
use zenoh::liveliness::LivelinessToken;

/// What a robot has once it is on its map. It is there as long as `alive` lives.
pub(super) struct OnMap {
    pub(super) session: Session,
    pub(super) presence: Presence,
    pub(super) alive: LivelinessToken,
    pub(super) replica: LiveReplica,
}

impl OnMap {
    /// Waits for the server, for the name and for the map, and copies the map. Pictures of the
    /// robot's cameras are described by `net`.
    pub(super) fn join(
        file: &ClientFile,
        net: Option<&DescriptorNet>,
        waiting: &Waiting,
        stop: &Stop,
    ) -> Result<Self, CliError> {
        let map = file.map();
        let session = connect(&file.connect, waiting, stop)?;
        let presence = Presence::new(&session, &map, file.name(), RobotRole::Client)?;
        wait_for_name(&presence, waiting, stop)?;
        let alive = presence.declare()?;
        let head = wait_for_map(&session, &map, waiting, stop)?;
        let replica = copy_of_map(&session, file, net, &head, waiting)?;
        Ok(Self { session, presence, alive, replica })
    }
}

/// A copy of the map that is complete and of use.
fn copy_of_map(
    session: &Session,
    file: &ClientFile,
    net: Option<&DescriptorNet>,
    head: &Head,
    waiting: &Waiting,
) -> Result<LiveReplica, CliError> {
    let map = file.map();
    let replica = LiveReplica::start(session, &map, file.name(), file.client.replica.clone())?;
    if !replica.wait_for(&head.vector, TIMEOUT) {
        tracing::warn!("the copy of the map is not complete yet");
    }
    // An explorer may just have begun it.
    let mut content = waiting.for_content();
    while replica.running().counts().main_nodes == 0 {
        let empty = CliError::EmptyMap(map.clone());
        if !content.goes_on(&empty) {
            return Err(empty);
        }
        std::thread::sleep(ASK_AGAIN);
    }
    let Some(net) = net.filter(|_| file.robot.cameras) else {
        tracing::info!("without cameras: the place is found by the scanner alone");
        return Ok(replica);
    };
    if let Err(reason) = check_usable(&replica.running(), net.model()) {
        tracing::warn!(%reason, "pictures are of no use on this map: the place is found by the scanner alone");
    }
    Ok(replica)
}
