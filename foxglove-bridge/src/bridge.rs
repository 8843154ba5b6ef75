//! The bridge from its start to its end.

use crate::arguments::BridgeArgs;
use crate::link::{Origins, Services, Viewers};
use crate::outlook::{Outlook, Progress};
use crate::recording::{RecordError, Recording};
use crate::site::LiveSite;
use fht_client::{AskError, LiveReplica, ReplicaConfig, ReplicaError, RobotEvents, WatchError, ask_head_async};
use fht_door::{Door, DoorError, DoorLimits};
use fht_program::{Stop, Waiting, print_line};
use fht_proto::MapName;
use fht_proto::api::reply::ErrorCode;
use fht_session::{SessionError, open_within};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tokio::sync::watch;
use tokio::task::block_in_place;
use zenoh::Session;

/// How long a handshake of TLS may take, and how long a viewer may take nothing of what it is told.
const PATIENCE: Duration = Duration::from_secs(20);
/// Between two questions for what is not there yet.
const ASK_AGAIN: Duration = Duration::from_millis(200);

/// Why the bridge ends.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// The system gives no threads.
    #[error("no runtime: {0}")]
    Runtime(std::io::Error),
    /// It cannot listen.
    #[error("{}", with_flags(.0))]
    Door(#[from] DoorError),
    /// There is no way to the server.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The server has no such map, or does not answer.
    #[error(transparent)]
    Map(AskError),
    /// There is no copy of the map.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The robots cannot be heard.
    #[error(transparent)]
    Watch(#[from] WatchError),
    /// Nothing more can be recorded.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Zenoh has closed the session.
    #[error("the session with the server was closed")]
    Closed,
}

/// What is wrong, by the flags that say it.
fn with_flags(error: &DoorError) -> String {
    match error {
        DoorError::Exposed { .. } => format!(
            "--listen {error}. Give certificates (--certificate, --key, --authority), or an address on this machine \
             such as 127.0.0.1:8765"
        ),
        DoorError::Listen { .. } => format!("--listen {error}"),
        DoorError::File { what, file, reason } => format!("--{what} {} is of no use: {reason}", file.display()),
        DoorError::Tls(_) => error.to_string(),
    }
}

impl BridgeError {
    /// Whether what was given is wrong.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Door(error) => error.is_input(),
            Self::Session(error) => error.is_input(),
            Self::Map(AskError::Refused(reply)) => reply.code == ErrorCode::UnknownMap,
            Self::Record(RecordError::Create { .. }) => true,
            _ => false,
        }
    }
}

/// Shows a map until it is asked to end.
///
/// # Errors
/// [`BridgeError`].
pub(crate) fn bridge(args: &BridgeArgs, waiting: &Waiting, stop: &Stop) -> Result<(), BridgeError> {
    let limits = DoorLimits { connections: args.max_viewers, handshake: PATIENCE, writing: PATIENCE };
    let door = Door::bind(args.listen, args.certificates().as_ref(), &args.name, limits)?;
    let runtime = fht_program::runtime(2).map_err(BridgeError::Runtime)?;
    runtime.block_on(async {
        let map = args.map.clone();
        let link = args.server.over(&fht_session::SessionConfig::default());
        stop.doing(format!("waiting for a server at {}", link.places()));
        let session = open_within(&link, waiting.for_session()).await?;
        stop.doing(format!("asking the server about map '{map}'"));
        wait_for_map(&session, &map, waiting).await.map_err(BridgeError::Map)?;
        let recording = args.record.as_deref().map(Recording::create).transpose()?;
        let _order = stop.in_order();
        let shown = show(args, &door, &session, map, recording, stop).await;
        // What it has yet to say is nothing.
        let _ = session.close().await;
        shown
    })
}

/// A client session connects in the background, and the map may be made later: asks until the
/// server answers with it, for as long as that is waited for.
async fn wait_for_map(session: &Session, map: &MapName, waiting: &Waiting) -> Result<(), AskError> {
    let (mut answer, mut content) = (waiting.for_answer(), waiting.for_content());
    loop {
        match ask_head_async(session, map, Duration::from_secs(1)).await {
            Ok(_) => return Ok(()),
            Err(AskError::Silent) if answer.goes_on("a map-server to answer") => {}
            Err(AskError::Refused(reply))
                if reply.code == ErrorCode::UnknownMap
                    && content.goes_on(format!("map '{map}': {}", reply.message)) => {}
            Err(error) => return Err(error),
        }
        tokio::time::sleep(ASK_AGAIN).await;
    }
}

async fn show(
    args: &BridgeArgs,
    door: &Door,
    session: &Session,
    map: MapName,
    recording: Option<Recording>,
    stop: &Stop,
) -> Result<(), BridgeError> {
    let site = LiveSite::new(LiveReplica::start(session, &map, "", ReplicaConfig::default())?);
    let events = RobotEvents::watch(session, &map).await?;
    let run = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis().to_string();
    let viewers = Viewers::new(
        map.as_str(),
        &run,
        Origins::new(Arc::clone(door.hosts()), args.origin.clone()),
        Services::new(session.clone(), map.clone(), site.outlook().clone()),
        site.outlook().subscribe(),
        site.wishes().clone(),
    );
    let scheme = if door.is_secure() { "wss" } else { "ws" };
    print_line!("map '{map}' at {scheme}://{}", door.address());
    // The recorder wants everything.
    let _wish = recording.is_some().then(|| site.wishes().wish());
    let seen = site.outlook().subscribe();
    tokio::select! {
        () = site.follow(events) => Err(BridgeError::Closed),
        () = site.draw_floor() => Err(BridgeError::Closed),
        served = door.take_all(Arc::new(()), move |stream, caller| viewers.clone().serve(stream, caller)) => {
            served.map_err(BridgeError::Door)
        }
        recorded = record(recording, seen, stop) => recorded,
    }
}

/// Records until the program is asked to end, and puts the file in order.
async fn record(
    recording: Option<Recording>,
    mut outlook: watch::Receiver<Arc<Outlook>>,
    stop: &Stop,
) -> Result<(), BridgeError> {
    let Some(mut recording) = recording else {
        stop.requested().await;
        return Ok(());
    };
    let mut progress = Progress::of_everything();
    loop {
        let now = Arc::clone(&outlook.borrow_and_update());
        while let Some(message) = progress.next(&now) {
            block_in_place(|| recording.write(&message))?;
        }
        drop(now);
        tokio::select! {
            () = stop.requested() => return Ok(block_in_place(|| recording.finish())?),
            changed = outlook.changed() => if changed.is_err() { return Err(BridgeError::Closed) },
        }
    }
}
