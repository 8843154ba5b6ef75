//! What every robot carries.
//!
//! | module | idea |
//! | --- | --- |
//! | [`pose`] | SE(2) poses, REP-105 names |
//! | [`frame`] | what the sensors said at one instant |
//! | [`bag`] | frames from rosbag2 logs |
//! | [`drift`] | how wrong a pose becomes that is carried along a way |
//! | [`consensus`] | which estimations agree |
//! | [`known_space`] | what is known to be free, and what a scan says for or against a pose in it |
//! | [`walls`] | what all main nodes of a map saw, as one |
//! | [`free_space`] | rectangles of local free space |
//! | [`edges`] | straight lines that a robot can drive |
//! | [`grid`] | occupancy grid with ray-traced free space |
//! | [`matching`] | scan matching: correlative search, point-to-line refinement, covariance |
//! | [`pose_graph`] | sparse pose-graph optimisation, robust to false closures |
//! | [`planning`] | shortest ways over the grid |
//! | [`motion`] | following a path with a differential drive |
//! | [`descriptor`] | a CNN over the panorama, a unit vector |
//! | [`stop`] | ending on Ctrl-C, in order |

#[cfg(feature = "bag")]
pub mod bag;
pub mod consensus;
#[cfg(feature = "descriptor")]
pub mod descriptor;
pub mod drift;
pub mod edges;
pub mod frame;
pub mod free_space;
pub mod grid;
pub mod known_space;
pub mod matching;
pub mod motion;
pub mod planning;
pub mod pose;
pub mod pose_graph;
#[cfg(feature = "program")]
pub mod stop;
pub mod walls;
