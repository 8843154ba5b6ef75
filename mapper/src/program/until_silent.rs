//! Sensors that have ended when they have been silent for long, or when nothing more can come of
//! them: a live robot, or a bag that is played as one, does not say that it ends.

use fht_perception::frame::SensorFrame;
use fht_perception::robot::{RobotError, Sensors};
use std::time::Duration;
use tokio::time::timeout;

/// Ends after `patience` without a frame, and when the source fails, once the first has come.
pub(super) struct UntilSilent<S> {
    source: S,
    patience: Duration,
    has_begun: bool,
}

impl<S> UntilSilent<S> {
    pub(super) fn new(source: S, patience: Duration) -> Self {
        Self { source, patience, has_begun: false }
    }

    pub(super) fn into_inner(self) -> S {
        self.source
    }
}

impl<S: Sensors + Send> Sensors for UntilSilent<S> {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        let sensed = match self.has_begun {
            true => match timeout(self.patience, self.source.sense()).await {
                Ok(Err(RobotError::Driver(why))) => {
                    tracing::warn!("the sensors have ended: {why}");
                    Err(RobotError::Ended)
                }
                Ok(sensed) => sensed,
                Err(_) => Err(RobotError::Ended),
            },
            false => self.source.sense().await,
        };
        self.has_begun |= sensed.is_ok();
        sensed
    }
}
