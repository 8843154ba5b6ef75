//! The systems that are compared: ours, and the baselines, as strong as their authors made them.
//!
//! | module | system |
//! | --- | --- |
//! | [`ours`] | the FHT-Map's relocalization, with cameras and with the scanner alone |
//! | [`amcl`] | the grid map with adaptive Monte Carlo localization |
//! | [`topo_map`] | MR-TopoMap: nodes that are places by appearance alone |

pub mod amcl;
pub mod ours;
pub mod topo_map;

use fht_perception::frame::SensorFrame;
use fht_perception::pose::Pose2;
use fht_proto::Descriptor;

/// A robot that has to find its place on a map, frame by frame.
pub trait Localizing {
    /// Takes in a frame. `describe` gives the descriptor of the frame's picture, if it has one; it
    /// is asked only when the system wants it. Returns `map_from_base` while the system declares
    /// that it knows.
    fn update(&mut self, frame: &SensorFrame, describe: &mut dyn FnMut() -> Option<Descriptor>) -> Option<Pose2>;

    /// The best guess of `map_from_base`, declared or not. The paper judges this one.
    fn guess(&self) -> Option<Pose2> {
        None
    }
}
