//! Particles.

/// A pose that the robot may have: metres and radians in the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particle {
    /// x, metres.
    pub x: f64,
    /// y, metres.
    pub y: f64,
    /// Heading, radians.
    pub yaw: f64,
    /// Its share of the whole weight.
    pub weight: f64,
}
