//! The simulator behind the port for robots.

use crate::simulator::Simulator;
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::robot::{Robot, RobotError, Sensors};

/// The first call senses where the robot stands. Each later call drives for one LiDAR period with
/// the current command, then senses. Every future is ready at once, so a simulated run repeats
/// exactly; only in a shared world it waits for the other robots.
impl Sensors for Simulator {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        self.next_frame().await
    }
}

/// Sets the command for the frames to come.
impl Robot for Simulator {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        self.set_command(command);
        Ok(())
    }
}
