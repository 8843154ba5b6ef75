//! What every robot carries.
//!
//! | module | idea |
//! | --- | --- |
//! | [`pose`] | SE(2) poses, REP-105 names |
//! | [`frame`] | what the sensors said at one instant |
//! | [`bag`] | frames from rosbag2 logs |
//! | [`grid`] | occupancy grid with ray-traced free space |
//! | [`matching`] | scan matching: correlative search, point-to-line refinement, covariance |
//! | [`pose_graph`] | sparse pose-graph optimisation, robust to false closures |
//! | [`planning`] | shortest ways over the grid |
//! | [`motion`] | following a path with a differential drive |
//! | [`descriptor`] | a CNN over the panorama, a unit vector |
//! | [`stop`] | ending on Ctrl-C, in order |

pub mod bag;
pub mod descriptor;
pub mod frame;
pub mod grid;
pub mod matching;
pub mod motion;
pub mod planning;
pub mod pose;
pub mod pose_graph;
pub mod stop;
