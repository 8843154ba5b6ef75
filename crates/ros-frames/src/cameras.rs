//! Four cameras that make a panorama: their names and frames, their pictures, and how they look.
//!
//! | module | idea |
//! | --- | --- |
//! | `picture` | pixels of a message, and back |
//! | `lens` | what a camera sees of a quarter of the surroundings |
//! | `panorama` | pictures that wait for their scan, four by four |

mod lens;
mod panorama;
mod picture;

pub use self::lens::{Lens, LensRefused};
pub use self::panorama::{PanoramaCameras, PanoramaRefused, PictureMessage};
pub use self::picture::{Compression, PictureRefused, compress, picture_of};

use fht_ros_messages::msg::Quaternion;
use nalgebra::UnitQuaternion;
use std::f64::consts::FRAC_PI_2;

/// The cameras' usual names: ahead, left, behind, right.
pub const CAMERAS: [&str; 4] = ["front", "left", "back", "right"];

/// The direction in which a camera of a panorama looks, radians to the left of ahead.
fn yaw_of_camera(camera: usize) -> f64 {
    camera as f64 * FRAC_PI_2
}

/// The optical frame of a camera that looks in direction `yaw`: z ahead, x to the right, y down
/// (REP-103).
#[must_use]
pub fn optical_rotation(yaw: f64) -> Quaternion {
    let q = optical(yaw);
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

fn optical(yaw: f64) -> UnitQuaternion<f64> {
    let body = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
    body * UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2)
}
