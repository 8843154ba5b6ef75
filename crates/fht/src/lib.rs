//! Use an FHT-Map from your own robot or program: ask for paths, find out where a robot is, drive
//! it, write to the map.
//!
//! ```no_run
//! use fht::{LocalizerConfig, Map, Pose2, Robot, Twist};
//!
//! async fn find_place(mut robot: impl Robot) -> Result<Pose2, Box<dyn std::error::Error>> {
//!     let map = Map::connect("tcp/localhost:7447", "museum").robot("amr-7").await?;
//!     let path = map.path("dock", (5.0, 3.0)).await?; // else planned on the own copy
//!     println!("{:.1} m", path.length_m);
//!
//!     let mut localizer = map.localizer(LocalizerConfig::default());
//!     let pose = loop {
//!         let frame = robot.sense().await?;
//!         match localizer.update(&frame)?.pose() {
//!             Some(pose) => break pose,
//!             None => robot.drive(localizer.search(&frame)).await?,
//!         }
//!     };
//!     robot.drive(Twist::default()).await?; // it drives on else
//!     Ok(pose)
//! }
//! ```
//!
//! [`Map::go`] does all of it, and drives:
//!
//! ```no_run
//! # use fht::{Map, Robot};
//! # type Outcome = Result<(), Box<dyn std::error::Error>>;
//! # async fn to_the_dock(map: Map, mut robot: impl Robot + Send) -> Outcome {
//! let arrived = map.go(&mut robot, "dock").await?;
//! println!("at ({:.2}, {:.2})", arrived.pose.translation.x, arrived.pose.translation.y);
//! # Ok(())
//! # }
//! ```
//!
//! # What there is
//!
//! | to do | with | example |
//! | --- | --- | --- |
//! | connect, and keep a live copy of a map | [`Map::connect`] | all |
//! | ask for a path | [`Map::path`] → [`Path`] | `01_path` |
//! | follow the map | [`Map::changes`], [`Map::nodes`], [`Map::places`] | `02_follow_a_map` |
//! | see the robots on it | [`Map::watch_robots`] | `02_follow_a_map` |
//! | find out where a robot is | [`Map::localizer`] → [`MapLocalizer`] | `03_relocalize` |
//! | drive a robot to a place | [`Robot`], [`Map::go`] → [`Arrived`] | `04_own_robot` |
//! | name places, draw zones, close edges | [`Map::author`] → [`Author`] | `05_write` |
//! | say what is blocked for a while | [`Map::report_blocked`] | `05_write` |
//!
//! # Twenty minutes
//!
//! 1. In the project's folder, start a server:
//!
//!    ```sh
//!    cargo run --release --bin map-server -- --data /tmp/maps
//!    ```
//! 2. In another terminal, put a small map on it, and ask for a path:
//!
//!    ```sh
//!    cargo run --release -p fht --example 00_toy_room -- tcp/localhost:7447 toy
//!    cargo run --release -p fht --example 01_path -- tcp/localhost:7447 toy 1,1 7,4
//!    ```
//! 3. Make a crate of your own that depends on `fht` (by `path` or `git`) and on `tokio` (features
//!    `macros`, `rt-multi-thread`, `time`), and copy `examples/01_path.rs` to its `src/main.rs`.
//! 4. Let a robot of yours implement [`Sensors`] and [`Robot`]: `examples/04_own_robot.rs` has
//!    one. What a [`SensorFrame`] holds, and in which frames, is below.
//! 5. `map.go(&mut robot, "7,4").await` drives it.
//!
//! # Frames and units
//!
//! Metres, radians, seconds; x ahead, y to the left, angles counter-clockwise (REP-103). Frames are
//! those of REP-105: `map`, `odom`, `base`. A transform `map_from_base` turns coordinates of the
//! frame `base` into those of `map`: it is the robot's pose on the map. A [`SensorFrame`] is one
//! planar scan with the odometry of that instant; odometry may drift, but it must not jump. The
//! scanner should see all round or nearly so, at 5 Hz or faster. Cameras are optional.
//!
//! # What holds
//!
//! * A [`Map`] outlives its server: it connects again by itself, and until then answers from its
//!   own copy.
//! * What the robot runs is the release that an operator has enabled, or else the newest state
//!   ([`Map::release`]).
//! * Paths obey what operators and other robots have closed, and are free for the robot's footprint
//!   ([`Connect::footprint`]).
//! * A localizer that does not know says so; it does not guess.
//! * A drive can be spawned: its future is [`Send`].
//! * What an [`Author`] wrote is stored durably once the call returns.
//! * Zenoh needs a multi-threaded Tokio runtime (`#[tokio::main]` is one).
//!
//! # When a robot does not find its place
//!
//! Look at what [`Drive::watch`] or [`MapLocalizer::update`] tells of each frame, and at the log:
//! the library logs by `tracing`, so a subscriber such as `tracing_subscriber::fmt` shows it.
//!
//! * **It turns on the spot, `CANDIDATES` for ever.** Look at the ranges: a beam that met nothing
//!   is infinity. 0 says that something is too near, and with many of them the robot stands in a
//!   box. Where a scanner says 0 for any failure, give NaN. A finite range of `range_max_m` or more
//!   means that the beam met nothing so far: give NaN if the scanner only failed.
//! * **It drives, and nothing fits.** Beams run counter-clockwise from `angle_min`;
//!   `base_from_sensor` is where the scanner is mounted; odometry turns counter-clockwise, in
//!   radians.
//! * **Nothing fits in some places.** Has the map main nodes there ([`Map::nodes`])? It may be
//!   another building's, or not complete.
//! * **It stops between walls.** Is [`Connect::footprint`] the robot's? Does its scanner see the
//!   robot itself?
//! * **`no path …; these are closed: …`** Look at [`Map::rules`]. What another robot found
//!   blocked opens by itself: drive again then.
//!
//! # Features
//!
//! | feature | what for |
//! | --- | --- |
//! | `bag` | frames from recorded runs, rosbag2 and MCAP: the module `bag` |
//! | `descriptor` | cameras, by ONNX Runtime: `MapLocalizer::with_cameras`, `Drive::cameras` |
//!
//! Other languages need no library: see `docs/protocol.md`.

mod author;
mod connect;
mod drive;
mod localizer;
mod map;
mod path;
mod place;
mod robots;

pub use author::{Author, AuthorError};
pub use connect::{Connect, OpenError};
pub use drive::{Arrived, Drive, DriveError};
pub use localizer::{LocalizerState, MapLocalizer, UpdateError};
pub use map::{Map, Node, ReportError};
pub use path::{Path, PathError, PathRequest};
pub use place::{NamedPlace, Place};

pub use client_robot::pilot::{Failure, PilotConfig, PilotStep};
pub use fht_client::AskError;
pub use fht_client::ReplicaConfig;
pub use fht_client::author::NotWritten;
pub use fht_client::{PathPoint, Planner, RobotEvent, RobotEvents, WatchError};
pub use fht_localization::localizer::{Localization, LocalizerConfig};
pub use fht_map::{MapState, Rules};
pub use fht_perception::frame::{FrameError, LaserScan, SensorFrame, Twist};
pub use fht_perception::pose::{Point2, Pose2, pose, to_fixed};
pub use fht_perception::robot::{Robot, RobotError, Sensors};
pub use fht_proto::api::fleet::{BlockedReport, LocalizationState, RobotPose, RobotView};
pub use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, Obeyed, SpeedLimit};
pub use fht_proto::{Footprint, NodeId, NodeKind, ReleaseId, ZoneRule};

/// What travels: operations, increments and all that they are made of. For authors that write more
/// than places and zones.
pub use fht_proto as wire;

/// Frames from recorded runs: rosbag2 and MCAP.
#[cfg(feature = "bag")]
pub mod bag {
    pub use fht_bag::{BagError, FrameConfig, Frames};
}

/// Cameras: the network that describes a panorama.
#[cfg(feature = "descriptor")]
pub mod cameras {
    pub use fht_descriptor::{DescriptorError, DescriptorNet};
    pub use fht_perception::frame::Panorama;
}
