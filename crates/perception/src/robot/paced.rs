//! A simulated or recorded robot at a rate, instead of as fast as it can.

use super::{Robot, RobotError, Sensors};
use crate::frame::{SensorFrame, Twist};
use std::time::Duration;
use tokio::time::Instant;

/// Gives each frame when it is due. Needs a Tokio runtime with its clock enabled.
pub struct Paced<S> {
    source: S,
    /// Seconds of the sensors' clock a second; none: as fast as possible.
    rate: Option<f64>,
    /// When the first frame was given, and its time, microseconds.
    first: Option<(Instant, u64)>,
    /// A frame that is not due yet.
    waiting: Option<SensorFrame>,
}

impl<S> Paced<S> {
    /// `source` at `rate` seconds a second; none: as fast as it can.
    #[must_use]
    pub fn new(source: S, rate: Option<f64>) -> Self {
        Self { source, rate: rate.filter(|rate| *rate > 0.0), first: None, waiting: None }
    }

    /// The source, at its own rate.
    #[must_use]
    pub fn into_inner(self) -> S {
        self.source
    }
}

impl<S: Sensors + Send> Sensors for Paced<S> {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        let frame = match self.waiting.take() {
            Some(frame) => frame,
            None => self.source.sense().await?,
        };
        let Some(rate) = self.rate else { return Ok(frame) };
        let (began, first_us) = *self.first.get_or_insert_with(|| (Instant::now(), frame.time_us));
        let elapsed_s = frame.time_us.saturating_sub(first_us) as f64 * 1e-6 / rate;
        let due = began.checked_add(Duration::try_from_secs_f64(elapsed_s).unwrap_or(Duration::MAX));
        // Dropped while it waits, the frame comes with the next call.
        self.waiting = Some(frame);
        match due {
            Some(due) => tokio::time::sleep_until(due).await,
            None => std::future::pending().await,
        }
        self.waiting.take().ok_or(RobotError::Ended)
    }
}

impl<R: Robot + Send> Robot for Paced<R> {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        self.source.drive(command).await
    }
}
