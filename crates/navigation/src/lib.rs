//! How a robot moves over what it has seen itself: it plans on a grid, follows the path, and stops
//! before what its newest scan shows. Paths through a whole map are not planned here but in
//! `fht-map`; this crate drives along them. Lengths are metres, angles radians, and poses in the
//! frame of the grid.
//!
//! ```text
//!  scan ─→ LocalMap ─→ Traversable ─→ shortest_path ─→ PathFollower ─→ safe_command ─→ Twist
//!                 Wanderer chooses a target ─┘    └── Steersman does all of this ──┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | [`planning`] | where a robot's centre may be, and the cheapest ways between such places |
//! | [`motion`] | following a path, stopping before obstacles, ground on which to be slow |
//! | [`people`] | who walks about, and how to drive among them |
//! | [`local_map`] | the robot's own live grid, in the odometry frame |
//! | [`steering`] | driving to a point on the live grid: plan, follow, notice a dead end |
//! | [`wandering`] | where to go while the robot does not know where it is |
//! | [`disambiguation`] | where to go to find out at which of several places it is |
//! | [`searching`] | both, steering and looking around together |
//!
//! Around a table, from a grid to the end of the path:
//!
//! ```
//! use fht_navigation::{PathFollower, PathFollowerConfig, PlanConfig, Traversable};
//! use fht_perception::{GridConfig, LaserScan, OccupancyGrid, Point2, Pose2, pose};
//!
//! // A square room with walls 3 m away, and a table of 1 m by 2 m in the middle.
//! let room = LaserScan::all_round(720, |cos, sin| 3.0 / cos.abs().max(sin.abs()));
//! let mut grid = OccupancyGrid::new(GridConfig::default());
//! (0..3).for_each(|_| grid.integrate(&Pose2::identity(), &room));
//! grid.suppose_occupied(Point2::new(-0.5, -1.0), Point2::new(0.5, 1.0), |_| true);
//!
//! let space = Traversable::new(&grid, &PlanConfig::default());
//! let (from, to) = (Point2::new(-2.0, 0.0), Point2::new(2.0, 0.0));
//! let path = space.shortest_path(from, to).ok_or("there is no way")?;
//! assert!(path.length_m > 4.5, "straight ahead would be 4 m");
//!
//! let config = PathFollowerConfig::default();
//! let period_s = config.period_s;
//! let mut follower = PathFollower::new(config, space.shorten(&path.points));
//! let mut at = pose(from.x, from.y, 0.0);
//! for _ in 0..200 {
//!     let command = follower.command(&at);
//!     at *= pose(command.linear_mps * period_s, 0.0, command.angular_radps * period_s);
//!     assert!(space.is_passable(space.cell_of(at.translation.vector.into())), "{at}");
//! }
//! assert!(follower.is_done());
//! # Ok::<(), &str>(())
//! ```

pub mod disambiguation;
pub mod local_map;
pub mod motion;
pub mod people;
pub mod planning;
pub mod searching;
pub mod steering;
pub mod wandering;

pub use disambiguation::{Ambiguity, DisambiguationConfig};
pub use local_map::{LocalMap, LocalMapConfig};
pub use motion::{PathFollower, PathFollowerConfig, SafetyConfig, safe_command};
pub use planning::{DistanceField, GridPath, PlanConfig, Traversable, UnknownCells};
pub use searching::Searcher;
pub use steering::{Steering, SteeringConfig, Steersman};
pub use wandering::{Wanderer, WanderingConfig};
