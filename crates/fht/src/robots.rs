//! The other robots, as they come, go and say where they are.

use crate::map::Map;
use fht_client::{RobotEvents, WatchError};

impl Map {
    /// What robots say of themselves from now on, from robot to robot, without the server. Those
    /// that are there already come first.
    ///
    /// # Errors
    /// When Zenoh refuses.
    pub async fn watch_robots(&self) -> Result<RobotEvents, WatchError> {
        RobotEvents::watch(&self.inner.session, &self.inner.name).await
    }
}
