//! The robot's sensors: what they report at a pose in a scene.
//!
//! | module | idea |
//! | --- | --- |
//! | `lidar` | the ray-cast laser scanner |
//! | `camera` | four cameras that make a panorama |
//! | `wheels` | odometry that drifts |

pub(crate) mod camera;
pub(crate) mod lidar;
pub(crate) mod wheels;
