//! The port for robots: what the programs need of one. Behind it stand the simulator, a recorded
//! run (its sensing half), ROS 2, or a robot of your own. [`Supervised`] keeps the deadlines of a
//! live one.

mod paced;
mod supervised;

pub use paced::Paced;
pub use supervised::{SilenceConfig, Supervised};

use crate::frame::{FrameError, SensorFrame, Twist};
use std::error::Error;
use std::future::Future;
use std::time::Duration;

/// Why a robot cannot be sensed with or driven.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotError {
    /// There are no more frames: a recorded run is over, or the robot was switched off.
    #[error("the sensors have ended")]
    Ended,
    /// No frame came in time.
    #[error("the sensors have been silent for {:.1} s", waited.as_secs_f64())]
    Silent {
        /// How long the caller has waited.
        waited: Duration,
    },
    /// The robot took no command in time.
    #[error("the robot has taken no command for {:.1} s", waited.as_secs_f64())]
    Unresponsive {
        /// How long the caller has tried.
        waited: Duration,
    },
    /// A frame came that cannot be used.
    #[error("the sensor frame is not usable: {0}")]
    Frame(#[from] FrameError),
    /// The robot's driver failed, with its own reason.
    #[error("the robot failed: {0}")]
    Driver(#[source] Box<dyn Error + Send + Sync>),
}

impl RobotError {
    /// A failure of the robot's own driver.
    pub fn driver(reason: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Driver(reason.into())
    }
}

/// The sensing half of the port.
pub trait Sensors {
    /// Waits for the next frame: one for each scan, in the order of their times, in the frames of
    /// REP-105.
    ///
    /// The caller bounds the wait, as [`Supervised`] does. So the returned future must be cancel
    /// safe: when it is dropped before it is ready, the next call still returns the frame. A source
    /// that is faster than its caller keeps the newest frame and drops older ones.
    ///
    /// # Errors
    /// [`RobotError::Ended`] after the last frame, every time; [`RobotError::Driver`] with the
    /// robot's reason.
    fn sense(&mut self) -> impl Future<Output = Result<SensorFrame, RobotError>> + Send;
}

/// A robot that can be driven.
pub trait Robot: Sensors {
    /// Sets the velocity of the base: it holds until the next command. A real robot's driver stops
    /// by itself when no command has come for a few periods.
    ///
    /// # Errors
    /// [`RobotError::Driver`] with the robot's reason.
    fn drive(&mut self, command: Twist) -> impl Future<Output = Result<(), RobotError>> + Send;
}

impl<S: Sensors> Sensors for &mut S {
    fn sense(&mut self) -> impl Future<Output = Result<SensorFrame, RobotError>> + Send {
        (**self).sense()
    }
}

impl<R: Robot> Robot for &mut R {
    fn drive(&mut self, command: Twist) -> impl Future<Output = Result<(), RobotError>> + Send {
        (**self).drive(command)
    }
}
