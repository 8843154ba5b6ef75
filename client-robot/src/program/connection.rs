//! The way to the server.

use super::error::CliError;
use fht_client::{AskError, Presence, ask_head};
use fht_program::{Stop, Waiting};
use fht_proto::MapName;
use fht_proto::api::reply::{ErrorCode, Head};
use fht_session::{SessionConfig, open_within};
use std::time::Duration;
use tokio::runtime::Runtime;
use zenoh::Session;

/// How long questions to the server may take.
pub(super) const TIMEOUT: Duration = Duration::from_secs(5);

/// Between two questions for what is not there yet.
pub(super) const ASK_AGAIN: Duration = Duration::from_millis(200);

/// Within this the names of the robots that are there are known.
const ROLL_CALL: Duration = Duration::from_secs(1);

/// Zenoh brings its own threads but wants to be opened, and waited for, from a multi-threaded
/// runtime.
pub(super) fn runtime() -> Result<Runtime, CliError> {
    fht_program::runtime(1).map_err(CliError::Runtime)
}

/// Opens a session.
pub(super) fn connect(config: &SessionConfig, waiting: &Waiting, stop: &Stop) -> Result<Session, CliError> {
    stop.doing(format!("waiting for a server at {}", config.places()));
    Ok(runtime()?.block_on(open_within(config, waiting.for_session()))?)
}

/// Opens a session with a robot's router.
pub(super) async fn connect_graph(endpoint: &str, waiting: &Waiting, stop: &Stop) -> Result<Session, CliError> {
    let graph = SessionConfig::from_options(vec![endpoint.to_owned()], None);
    stop.doing(format!("waiting for the robot's router at {}", graph.places()));
    open_within(&graph, waiting.for_session()).await.map_err(CliError::RobotRouter)
}

/// A client session connects in the background, and the map may be made later: asks until the
/// server answers with it, for as long as that is waited for.
pub(super) fn wait_for_map(session: &Session, map: &MapName, waiting: &Waiting, stop: &Stop) -> Result<Head, AskError> {
    stop.doing(format!("asking the server about map '{map}'"));
    let (mut answer, mut content) = (waiting.for_answer(), waiting.for_content());
    loop {
        match ask_head(session, map, Duration::from_secs(1)) {
            Err(AskError::Silent) if answer.goes_on("a map-server to answer") => {}
            Err(AskError::Refused(reply))
                if reply.code == ErrorCode::UnknownMap
                    && content.goes_on(format!("map '{map}': {}", reply.message)) => {}
            outcome => return outcome,
        }
        std::thread::sleep(ASK_AGAIN);
    }
}

/// Two robots of one name would both drive where one is sent.
pub(super) fn wait_for_name(presence: &Presence, waiting: &Waiting, stop: &Stop) -> Result<(), CliError> {
    stop.doing("asking whether a robot of this name is there already");
    let mut content = waiting.for_content();
    while presence.is_taken(ROLL_CALL)? {
        let taken = CliError::NameTaken(presence.robot().to_owned());
        if !content.goes_on(&taken) {
            return Err(taken);
        }
        std::thread::sleep(ASK_AGAIN);
    }
    Ok(())
}
