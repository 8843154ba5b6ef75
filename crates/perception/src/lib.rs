//! What a robot senses, and what it can conclude from that without a map: frames of sensors, poses
//! in the plane, an occupancy grid, and where one scan was taken relative to another. The port for
//! robots lies here too, because its frames do. All is plain computation in metres and radians;
//! only [`robot`] waits for anything.
//!
//! ```text
//!  Robot ─→ SensorFrame ─→ scan_odometry ─→ Odometry
//!             │ scan ─────→ grid ─────────→ free_rectangle, drivable_line
//!             └───────────→ matching ─────→ consensus, pose_graph
//!                             ↑ reference_map, evidence_grid: what a whole map saw
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | [`robot`] | the port for robots: sense, drive, and deadlines for both |
//! | [`frame`] | what the sensors said at one instant: scan, odometry, panorama |
//! | [`mod@pose`] | SE(2) poses, and how they travel |
//! | [`grid`] | occupancy grid with ray-traced free space |
//! | [`free_rectangle`], [`drivable_line`] | rectangles and straight lines of free space |
//! | [`matching`] | where a scan was taken: correlative search, line ICP, branch and bound |
//! | [`scan_odometry`] | wheels corrected by scans |
//! | [`drift`] | how wrong a pose becomes that is carried along a way |
//! | [`consensus`] | which estimations agree: the heaviest clique |
//! | [`pose_graph`] | the most likely poses under constraints, some of which may be wrong |
//! | [`segments`] | returns of a scan that hang together |
//! | [`mod@standing_alone`] | those of narrow things that stand alone, which may be somebody |
//! | [`shared_view`] | whether two scans can both be right |
//! | [`evidence_grid`] | what a scan says for or against a pose |
//! | [`candidate`] | a place where a robot may be |
//! | [`reference_map`] | what all main nodes of a map saw, as one |
//! | [`mod@square`] | the squares of a plane in which points lie |
//!
//! Two scans of a room, and where the second was taken in the frame of the first:
//!
//! ```
//! use fht_perception::matching::{NoMatch, SearchWindow, search};
//! use fht_perception::{LaserScan, MatchConfig, Pose2, ReferenceCloud, pose};
//! use std::f64::consts::PI;
//!
//! /// A room with a slanted corner: of each wall its normal, and how far it is from the origin.
//! const WALLS: [(f64, f64, f64); 5] =
//!     [(1.0, 0.0, 4.0), (-1.0, 0.0, 1.0), (0.0, 1.0, 2.0), (0.0, -1.0, 1.0), (0.6, 0.8, 3.0)];
//!
//! fn seen_from(x: f64, y: f64) -> LaserScan {
//!     LaserScan::all_round(360, |cos, sin| {
//!         let to_wall = |(nx, ny, d)| (d - nx * x - ny * y) / (nx * cos + ny * sin);
//!         let ranges = WALLS.map(to_wall).into_iter().filter(|range| *range > 0.0);
//!         ranges.fold(f64::INFINITY, f64::min)
//!     })
//! }
//!
//! let reference = ReferenceCloud::from_scan(&seen_from(0.0, 0.0).points_in_base());
//! let mut scan = seen_from(0.6, 0.3);
//! scan.angle_min = -2.0; // The robot has turned by 2 rad.
//!
//! let centre = Pose2::identity();
//! let anywhere = SearchWindow { centre, half_x_m: 2.0, half_y_m: 2.0, half_yaw_rad: PI };
//! let found = search(&reference, &scan.points_in_base(), &anywhere, &MatchConfig::default())?;
//! let error = pose(0.6, 0.3, 2.0).inverse() * found.reference_from_moving;
//! assert!(error.translation.vector.norm() < 0.02 && error.rotation.angle().abs() < 0.01);
//! # Ok::<(), NoMatch>(())
//! ```

pub mod candidate;
pub mod consensus;
pub mod drift;
pub mod drivable_line;
pub mod evidence_grid;
pub mod frame;
pub mod free_rectangle;
pub mod grid;
pub mod matching;
pub mod pose;
pub mod pose_graph;
pub mod reference_map;
pub mod robot;
pub mod scan_odometry;
pub mod segments;
pub mod shared_view;
pub mod square;
pub mod standing_alone;

pub use candidate::Candidate;
pub use frame::{FrameError, LaserScan, Panorama, SensorFrame, Twist};
pub use grid::{Cell, CellState, GridConfig, OccupancyGrid};
pub use matching::{MatchConfig, ReferenceCloud, ScanMatch};
pub use pose::{Point2, Pose2, pose, wrap_angle};
pub use robot::{Robot, RobotError, Sensors, Supervised};
pub use scan_odometry::{Odometry, ScanOdometry};
