//! The simulator behind the port for robots.

use crate::simulator::Simulator;
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::robot::{Robot, RobotError, Sensors};

/// The first call senses where the robot stands. Each later call drives for one LiDAR period with
/// the current command, then senses. Every future is ready at once, so a simulated run repeats
/// exactly.
impl Sensors for Simulator {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        Ok(self.next_frame())
    }
}

/// Sets the command for the frames to come.
impl Robot for Simulator {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        self.set_command(command);
        Ok(())
    }
}
