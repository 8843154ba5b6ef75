//! From an endpoint and a name to a map.

use crate::map::{Inner, Map};
use fht_client::{AskError, FreeSpaceCache, LiveReplica, Presence, ReplicaConfig, ReplicaError, ask_head_async};
use fht_proto::api::fleet::RobotRole;
use fht_proto::api::reply::{ErrorCode, Head};
use fht_proto::{Footprint, MapName, ParseIdError, RobotName};
use fht_session::{SessionConfig, SessionError, in_words, open_within};
use std::future::{Future, IntoFuture};
use std::path::PathBuf;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::runtime::{Handle, RuntimeFlavor};
use zenoh::Session;

/// Pause before a server that is not there yet is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(100);
/// Between two messages of the robot about itself.
const SPEAK_EVERY: Duration = Duration::from_secs(1);

impl Map {
    /// Connects to the map called `map` by way of `endpoint`, such as `tcp/localhost:7447`: a
    /// map-server's, or a Zenoh router's. Await what this returns, after setting what should differ
    /// from the defaults:
    ///
    /// ```no_run
    /// # async fn connect() -> Result<(), fht::OpenError> {
    /// let map = fht::Map::connect("tls/hall:7447", "museum")
    ///     .zenoh_config("client.json5") // certificates
    ///     .robot("amr-7")
    ///     .await?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// Once connected, the map outlives the server: it connects again by itself, and answers from
    /// its own copy meanwhile.
    pub fn connect(endpoint: &str, map: &str) -> Connect {
        Connect {
            map: map.to_owned(),
            endpoints: (!endpoint.is_empty()).then(|| endpoint.to_owned()).into_iter().collect(),
            zenoh_config: None,
            robot: None,
            footprint: Footprint::default(),
            may_begin: false,
            timeout: Duration::from_secs(5),
            replica: ReplicaConfig::default(),
        }
    }
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The text is not the name of a map.
    #[error("{0}")]
    MapName(String),
    /// The text is not the name of a robot.
    #[error(transparent)]
    RobotName(#[from] ParseIdError),
    /// The runtime has one thread only, which Zenoh would block.
    #[error("Zenoh needs a multi-threaded Tokio runtime: #[tokio::main(flavor = \"multi_thread\")]")]
    Runtime,
    /// There is no session with a server or router.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// There is a session, but no map-server answers.
    #[error("no map-server answered within {} s", waited.as_secs_f64())]
    Silent {
        /// How long was waited.
        waited: Duration,
    },
    /// The server has no such map.
    #[error("{reason}")]
    UnknownMap {
        /// The name that was asked for.
        map: String,
        /// The server's words, with the maps that it has.
        reason: String,
    },
    /// The server has the map, and its answer is of no use.
    #[error(transparent)]
    Head(AskError),
    /// There is no copy of the map.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The copy did not become complete.
    #[error("the copy of map '{map}' was not complete within {} s", waited.as_secs_f64())]
    Incomplete {
        /// The map.
        map: String,
        /// How long was waited.
        waited: Duration,
    },
    /// Zenoh refused.
    #[error("Zenoh refuses: {}", in_words(.0))]
    Zenoh(#[from] zenoh::Error),
}

/// How to reach a map; made by [`Map::connect`]. Await it to connect.
#[derive(Clone, Debug)]
#[must_use = "nothing happens before it is awaited"]
pub struct Connect {
    map: String,
    endpoints: Vec<String>,
    zenoh_config: Option<PathBuf>,
    robot: Option<String>,
    footprint: Footprint,
    may_begin: bool,
    timeout: Duration,
    replica: ReplicaConfig,
}

impl Connect {
    /// Connects as the robot of this name: 1 to 64 of `a-z A-Z 0-9 _ -`, and no other robot's. The
    /// others see that it is there for as long as the [`Map`] lives; once a second it publishes
    /// where it is and which state of the map it has. Nothing refuses a second program of the same
    /// name: the others then see one robot that jumps between two places.
    pub fn robot(mut self, name: impl Into<String>) -> Self {
        self.robot = Some(name.into());
        self
    }

    /// The robot's outline on the ground, by which paths are planned and driven. Default: the
    /// explorers', a disc of 0.105 m radius.
    pub fn footprint(mut self, footprint: Footprint) -> Self {
        self.footprint = footprint;
        self
    }

    /// The map need not exist yet: the first increment of an [`Author`](crate::Author) begins it.
    /// Without this a map that the server does not have is an error.
    pub fn create(mut self) -> Self {
        self.may_begin = true;
        self
    }

    /// One more endpoint, tried when the others do not answer.
    pub fn endpoint(mut self, endpoint: impl Into<String>) -> Self {
        self.endpoints.push(endpoint.into());
        self
    }

    /// A Zenoh configuration file (JSON5) to start from: TLS, credentials, endpoints. Endpoints
    /// given here go before the file's.
    pub fn zenoh_config(mut self, file: impl Into<PathBuf>) -> Self {
        self.zenoh_config = Some(file.into());
        self
    }

    /// How long the connection, and later each answer of the server, may take. Default 5 s.
    pub fn timeout(mut self, timeout: Duration) -> Self {
        self.timeout = timeout;
        self
    }

    /// How the own copy of the map keeps up with the server's.
    pub fn config(mut self, config: ReplicaConfig) -> Self {
        self.replica = config;
        self
    }

    async fn open(self) -> Result<Map, OpenError> {
        if Handle::current().runtime_flavor() == RuntimeFlavor::CurrentThread {
            return Err(OpenError::Runtime);
        }
        let name: MapName = self.map.parse().map_err(|error| OpenError::MapName(format!("{error}")))?;
        if let Some(robot) = &self.robot {
            robot.parse::<RobotName>()?;
        }
        let deadline = Instant::now() + self.timeout;
        let link = SessionConfig::from_options(self.endpoints, self.zenoh_config);
        let session = open_within(&link, Some(self.timeout)).await?;
        let robot = self.robot.as_deref();
        let replica = LiveReplica::start(&session, &name, robot.unwrap_or_default(), self.replica)?;
        match find_head(&session, &name, deadline, self.timeout).await {
            Err(OpenError::UnknownMap { .. }) if self.may_begin => {}
            head => {
                let incomplete = |()| OpenError::Incomplete { map: self.map, waited: self.timeout };
                wait_for(&replica, &head?, deadline).await.map_err(incomplete)?;
            }
        }
        let presence = robot.map(|robot| Presence::new(&session, &name, robot, RobotRole::Client)).transpose()?;
        let token = presence.as_ref().map(Presence::declare).transpose()?;
        let inner = Arc::new(Inner {
            session,
            name,
            footprint: self.footprint.clone(),
            may_begin: self.may_begin,
            timeout: self.timeout,
            replica,
            presence,
            _token: token,
            pose: Mutex::default(),
            free_space: Mutex::new(FreeSpaceCache::default().for_footprint(self.footprint)),
        });
        if inner.presence.is_some() {
            tokio::spawn(speak(Arc::downgrade(&inner)));
        }
        Ok(Map { inner })
    }
}

impl IntoFuture for Connect {
    type Output = Result<Map, OpenError>;
    type IntoFuture = Pin<Box<dyn Future<Output = Self::Output> + Send>>;

    fn into_future(self) -> Self::IntoFuture {
        Box::pin(self.open())
    }
}

/// A client session is open before the server knows its questions: asks until there is an answer.
async fn find_head(session: &Session, map: &MapName, deadline: Instant, waited: Duration) -> Result<Head, OpenError> {
    loop {
        match ask_head_async(session, map, Duration::from_secs(1).min(waited)).await {
            Ok(head) => return Ok(head),
            Err(AskError::Silent) if Instant::now() < deadline => tokio::time::sleep(ASK_AGAIN).await,
            Err(AskError::Silent) => return Err(OpenError::Silent { waited }),
            Err(AskError::Refused(reply)) if reply.code == ErrorCode::UnknownMap => {
                return Err(OpenError::UnknownMap { map: map.to_string(), reason: reply.message });
            }
            Err(error) => return Err(OpenError::Head(error)),
        }
    }
}

/// Waits until the copy has all that the head tells of.
async fn wait_for(replica: &LiveReplica, head: &Head, deadline: Instant) -> Result<(), ()> {
    let mut changes = replica.watch_changes();
    while !replica.read().vector().covers(&head.vector) {
        tokio::time::timeout_at(deadline.into(), changes.changed()).await.map_err(|_| ())?.map_err(|_| ())?;
    }
    Ok(())
}

/// Says once a second where the robot is and what it has, until the map is dropped.
async fn speak(map: std::sync::Weak<Inner>) {
    let mut ticks = tokio::time::interval(SPEAK_EVERY);
    loop {
        ticks.tick().await;
        let Some(inner) = map.upgrade() else { return };
        inner.publish_pose();
    }
}
