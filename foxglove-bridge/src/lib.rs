//! A map and its robots, live in Foxglove and Lichtblick: the program `foxglove-bridge`, a client
//! of the server like any other.
//!
//! ```text
//!            increments, rules                     what has changed        WebSocket
//! server ───────────────────────→ site ─→ Outlook ───────────────→ link ─────────────→ Foxglove
//! robots ── poses, tokens ──────→   │            └───────────────→ recording ─→ FILE.mcap
//!                                 scene                    ←──── services: /path, /places
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `scene` | a map and its robots as scenes, and what of them a receiver has been told |
//! | `channel` | what is told on which channel, with which schema |
//! | `outlook` | what there is to tell now, and a receiver's progress through it |
//! | `site` | the map's replica and the robots, as an outlook |
//! | `link` | viewers: who may connect, Foxglove's protocol, services |
//! | `recording` | all channels as an MCAP file |
//! | `bridge` | all of it, from its start to its end |
//! | `arguments` | the command line |
//!
//! Each receiver has a progress of its own, and is told what has changed since it was told last:
//!
//! ```
//! use foxglove::messages::Timestamp;
//! use foxglove_bridge::{MapProgress, MapScene};
//! use fht_map::MapState;
//! use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op};
//! use std::sync::Arc;
//!
//! let author = AuthorId::of_robot("explorer");
//! let put = |number| {
//!     let (id, pose) = (NodeId { author, number }, FixedPose::default());
//!     let ops = vec![Op::PutNode { id, kind: NodeKind::Support, pose }];
//!     Increment { author, number: u64::from(number) + 1, hlc_us: 1, ops }
//! };
//! let (mut state, at) = (MapState::new(), Timestamp::new(7, 0));
//! let mut progress = MapProgress::default();
//! state.apply(&put(0));
//! let begun = MapScene { state: state.clone(), ..MapScene::default() };
//! let first = progress.next(&Arc::new(begun), at);
//! assert_eq!(first.map(|update| update.entities.len()), Some(1));
//!
//! state.apply(&put(1));
//! let grown = Arc::new(MapScene { state, ..MapScene::default() });
//! let second = progress.next(&grown, at).expect("the map has grown");
//! assert_eq!((second.entities.len(), second.deletions.len()), (1, 0), "not the whole map again");
//! assert_eq!(second.entities[0].id, format!("node {author}.1"));
//! assert!(progress.next(&grown, at).is_none());
//! ```

mod arguments;
mod bridge;
mod channel;
mod link;
mod outlook;
mod recording;
mod scene;
mod site;

pub use bridge::BridgeError;
pub use recording::RecordError;
pub use scene::{EntityKey, MapProgress, MapScene};

use arguments::{Cli, Command};
use fht_program::flags::parse_args;
use fht_program::{ProgramFailure, Stop, Waiting, logging};
use std::ffi::OsString;
use std::process::ExitCode;

/// The program's name.
const NAME: &str = "foxglove-bridge";
/// What it logs: errors, why it waits for a server, and which viewers it refuses.
const LOGS: &str = "error,fht_session=warn,fht_client::notice=warn,foxglove_bridge=warn";

/// The command line, for whoever documents it.
#[must_use]
pub fn command() -> clap::Command {
    <Cli as clap::CommandFactory>::command()
}

/// Runs the program. Exit code 0: it was asked to end; 1: it failed, and said why; 2: wrong usage
/// or bad input.
#[must_use]
pub fn main_with_args(args: Vec<OsString>) -> ExitCode {
    let cli: Cli = match parse_args(args) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    if let Some(Command::Completions(shell)) = cli.command {
        shell.print::<Cli>();
        return ExitCode::SUCCESS;
    }
    let stop = match Stop::on_signal(NAME) {
        Ok(stop) => stop,
        Err(error) => return ProgramFailure::of_run(format!("signals cannot be handled: {error}")).tell(NAME),
    };
    logging::init(LOGS);
    let waiting = Waiting::new(NAME, cli.bridge.server.wait, Some(Waiting::USUAL));
    match bridge::bridge(&cli.bridge, &waiting, &stop) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => ProgramFailure::of(error.is_input(), error).tell(NAME),
    }
}
