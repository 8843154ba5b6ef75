//! Where a robot is in a map: found without a guess, kept while it drives, and given up when what
//! the robot senses no longer fits (the paper's section III-C-1). A robot that is not sure says so;
//! it declares a pose only when it is nearly certain. Poses are in the map frame, metres and
//! radians; `map_from_odom` is the paper's T^map_odom and REP-105's `map → odom`.
//!
//! ```text
//!  map ─→ Landmarks ──────────────┐
//!                                 ├─→ relocalization ─→ hypotheses ─→ pose_fix ─→ Fix
//!  SensorFrame ─→ scan odometry ──┤                                                ↓
//!                                 └──────────────────────────────────────────→ tracking
//!  └─────────────────────────── all of it: Localizer ─────────────────────────────┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | [`localizer`] | all of it, frame by frame: a [`Localizer`] |
//! | [`landmarks`] | a map's main nodes: what they look like, and what they saw |
//! | [`preparation`] | what they saw put together in a thread, as the map changes |
//! | [`live_landmarks`] | the landmarks of a map that changes, or becomes another one |
//! | [`relocalization`] | looking for a place in the whole map, and when to believe it |
//! | `hypotheses` | places where a robot may be, weighed by all that it sees on its way |
//! | `wall_squares` | what was seen, as pieces of wall that count once |
//! | `votes` | which of two places more of these pieces speak for |
//! | `place_evidence` | what speaks for a place: [`PlaceEvidence`] |
//! | `confidence` | how probable that makes it: [`ConfidenceConfig`] |
//! | `distinction` | whether pictures or walls tell it from places that the map does not have |
//! | `estimate` | one estimation of the place: a scan fitted there (equation 9) |
//! | `agreement` | which estimations agree, as a graph |
//! | `pose_fix` | the optimum over those that agree (equation 10): a [`Fix`] |
//! | `tracking` | a Kalman filter from there on |
//!
//! A robot that drives in a map of a single main node, and finds out where it is:
//!
//! ```
//! use fht_localization::{Landmarks, Localizer, LocalizerConfig};
//! use fht_map::MapState;
//! use fht_perception::{LaserScan, SensorFrame, pose};
//! use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op, Signature};
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
//! let author = AuthorId::of_robot("explorer");
//! let id = NodeId { author, number: 0 };
//! let signature = Signature { descriptor: None, scan: seen_from(0.0, 0.0).to_record() };
//! let ops = vec![
//!     Op::PutNode { id, kind: NodeKind::Main, pose: FixedPose::default() },
//!     Op::SetSignature { id, signature },
//! ];
//! let mut map = MapState::new();
//! map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
//!
//! let mut landmarks = Landmarks::default();
//! landmarks.refresh(&map);
//! let mut localizer = Localizer::new(LocalizerConfig::default());
//! for step in 0..20_u32 {
//!     // Odometry begins at (0.2, -0.4) of the map; the robot does not know that.
//!     let driven_m = 0.1 * f64::from(step);
//!     let frame = SensorFrame {
//!         time_us: 200_000 * u64::from(step),
//!         odom_from_base: pose(driven_m, 0.0, 0.0),
//!         scan: seen_from(0.2 + driven_m, -0.4),
//!         panorama: None,
//!     };
//!     localizer.update(&landmarks, &frame, || None);
//! }
//! let map_from_odom = localizer.current().map_from_odom.ok_or("it does not know where it is")?;
//! let error = map_from_odom.inverse() * pose(0.2, -0.4, 0.0);
//! assert!(error.translation.vector.norm() < 0.05 && error.rotation.angle().abs() < 0.02);
//! # Ok::<(), &str>(())
//! ```

mod agreement;
mod confidence;
mod distinction;
mod estimate;
mod hypotheses;
pub mod landmarks;
pub mod live_landmarks;
pub mod localizer;
mod place_evidence;
mod pose_fix;
pub mod preparation;
pub mod relocalization;
mod tracking;
mod votes;
mod wall_squares;

pub use confidence::ConfidenceConfig;
pub use hypotheses::{Hypothesis, WeighConfig};
pub use landmarks::{Landmark, Landmarks, UnusableDescriptors, check_usable};
pub use live_landmarks::LiveLandmarks;
pub use localizer::{Localization, Localizer, LocalizerConfig};
pub use place_evidence::PlaceEvidence;
pub use pose_fix::{Fix, PoseFixConfig};
pub use preparation::Preparation;
pub use relocalization::{Belief, RelocalizationConfig, Relocalizer, Sensed};
pub use tracking::{LostReason, TrackingConfig};
pub use votes::RivalConfig;
