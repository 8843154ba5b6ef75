//! A robot under a deadline: its sensors may fall silent, its driver may hang, and neither may
//! leave it driving.

use super::{Robot, RobotError};
use crate::frame::{SensorFrame, Twist};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// How long a robot's sensors may be silent, or its driver busy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SilenceConfig {
    /// Without a usable frame for this long the robot is told to stop, again and again until one
    /// comes, seconds. Default 1: ten frames at 10 Hz.
    pub stop_after_s: f64,
    /// Without a usable frame for this long the run ends with the reason, seconds. Default 60.
    pub end_after_s: f64,
}

impl Default for SilenceConfig {
    fn default() -> Self {
        Self { stop_after_s: 1.0, end_after_s: 60.0 }
    }
}

impl SilenceConfig {
    /// Waits for ever. For sources that cannot fall silent: the simulator at any rate, a recorded
    /// run.
    #[must_use]
    pub fn patient() -> Self {
        Self { stop_after_s: f64::INFINITY, end_after_s: f64::INFINITY }
    }

    /// When the robot is told to stop.
    #[must_use]
    pub fn stop_after(&self) -> Duration {
        duration(self.stop_after_s)
    }

    /// When the run ends.
    #[must_use]
    pub fn end_after(&self) -> Duration {
        duration(self.end_after_s)
    }
}

fn duration(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
}

/// Senses with a robot and drives it, within the times of a [`SilenceConfig`]. Needs a Tokio
/// runtime with its clock enabled.
///
/// Dropping one of its futures loses no frame, but sends no command either: the robot then drives
/// on until its own driver stops it. End a run through its observer, so that the robot is told to
/// stop.
pub struct Supervised<R> {
    robot: R,
    config: SilenceConfig,
    /// Since when the robot has taken no command in time.
    deaf_since: Option<Instant>,
    /// Time of the newest frame, microseconds.
    last_us: u64,
}

impl<R: Robot> Supervised<R> {
    /// Supervises `robot`.
    pub fn new(robot: R, config: SilenceConfig) -> Self {
        Self { robot, config, deaf_since: None, last_us: 0 }
    }

    /// The next usable frame, none older than the one before. While none comes, the robot is told
    /// to stop; it is told so at once when one comes that cannot be used. When the sensors are back
    /// in time, all goes on.
    ///
    /// # Errors
    /// [`RobotError::Silent`] or [`RobotError::Frame`] after `end_after_s`; what
    /// [`drive`](Self::drive) and the robot's own [`sense`](super::Sensors::sense) say.
    pub async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        let (stop_after, end_after) = (self.config.stop_after(), self.config.end_after());
        let began = Instant::now();
        let (mut is_silent, mut unusable) = (false, None);
        loop {
            let left = end_after.saturating_sub(began.elapsed());
            match timeout(stop_after.min(left), self.robot.sense()).await {
                Ok(sensed) => {
                    let frame = sensed?;
                    match frame.check() {
                        Ok(()) if frame.time_us < self.last_us => {
                            tracing::warn!("a frame is left out: it is older than the one before");
                        }
                        Ok(()) => {
                            self.last_us = frame.time_us;
                            if is_silent {
                                tracing::info!(after_s = began.elapsed().as_secs_f64(), "the sensors are back");
                            }
                            return Ok(frame);
                        }
                        Err(error) => {
                            tracing::warn!("a frame is left out: {error}");
                            unusable = Some(error);
                        }
                    }
                }
                Err(_) => {
                    if !is_silent {
                        tracing::warn!(
                            for_s = began.elapsed().as_secs_f64(),
                            "the sensors are silent: the robot stops"
                        );
                    }
                    is_silent = true;
                }
            }
            self.drive(Twist::default()).await?;
            let waited = began.elapsed();
            if waited >= end_after {
                return Err(unusable.map_or(RobotError::Silent { waited }, RobotError::Frame));
            }
        }
    }

    /// Gives the robot a command. One that it does not take within `stop_after_s` is dropped: the
    /// next frame brings another.
    ///
    /// # Errors
    /// [`RobotError::Unresponsive`] once the robot has taken no command for `end_after_s`; the
    /// robot's own reason.
    pub async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        let began = Instant::now();
        if let Ok(driven) = timeout(self.config.stop_after(), self.robot.drive(command)).await {
            self.deaf_since = None;
            return driven;
        }
        let waited = self.deaf_since.get_or_insert(began).elapsed();
        if waited >= self.config.end_after() {
            return Err(RobotError::Unresponsive { waited });
        }
        tracing::warn!(for_s = waited.as_secs_f64(), "the robot does not take commands");
        Ok(())
    }

    /// Tells the robot to stop, at the end of a run. A robot that cannot be told is logged: nothing
    /// else can be done.
    pub async fn stop(&mut self) {
        if let Err(error) = self.drive(Twist::default()).await {
            tracing::warn!("the robot could not be told to stop: {error}");
        }
    }

    /// The robot, supervised no longer.
    pub fn into_inner(self) -> R {
        self.robot
    }
}

#[cfg(test)]
mod tests {
    use super::super::Sensors;
    use super::*;
    use crate::frame::LaserScan;
    use crate::pose::Pose2;
    use std::collections::VecDeque;

    /// What the sensors do next.
    #[derive(Clone, Copy)]
    enum Next {
        Frame,
        Unusable,
        Silence(Duration),
    }

    #[derive(Default)]
    struct Scripted {
        script: VecDeque<Next>,
        commands: Vec<Twist>,
        is_deaf: bool,
    }

    impl Sensors for Scripted {
        async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
            if let Some(&Next::Silence(time)) = self.script.front() {
                let began = Instant::now();
                // Dropped before it is over, the rest is waited for by the next call.
                while let Some(Next::Silence(left)) = self.script.front_mut() {
                    tokio::time::sleep(Duration::from_millis(5)).await;
                    *left = left.saturating_sub(Duration::from_millis(5));
                    if left.is_zero() || began.elapsed() > time {
                        self.script.pop_front();
                    }
                }
            }
            let is_usable = match self.script.pop_front() {
                Some(Next::Frame) => true,
                Some(Next::Unusable) => false,
                _ => return Err(RobotError::Ended),
            };
            let odom_from_base = if is_usable { Pose2::identity() } else { Pose2::translation(f64::NAN, 0.0) };
            Ok(SensorFrame { time_us: 0, odom_from_base, scan: LaserScan::all_round(8, |_, _| 1.0), panorama: None })
        }
    }

    impl Robot for Scripted {
        async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
            if self.is_deaf {
                std::future::pending::<()>().await;
            }
            self.commands.push(command);
            Ok(())
        }
    }

    const IMPATIENT: SilenceConfig = SilenceConfig { stop_after_s: 0.05, end_after_s: 0.3 };

    fn supervised(script: &[Next], is_deaf: bool) -> Supervised<Scripted> {
        let robot = Scripted { script: script.iter().copied().collect(), commands: Vec::new(), is_deaf };
        Supervised::new(robot, IMPATIENT)
    }

    fn block_on<T>(future: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime").block_on(future)
    }

    #[test]
    fn silent_sensors_stop_the_robot_and_it_goes_on_when_they_are_back() {
        let mut robot = supervised(&[Next::Frame, Next::Silence(Duration::from_millis(150)), Next::Frame], false);
        block_on(async {
            assert!(robot.sense().await.is_ok());
            assert!(robot.robot.commands.is_empty(), "nothing to stop for");
            assert!(robot.sense().await.is_ok());
            assert!(matches!(robot.sense().await, Err(RobotError::Ended)));
        });
        let commands = robot.into_inner().commands;
        assert!(!commands.is_empty() && commands.iter().all(|command| *command == Twist::default()), "{commands:?}");
    }

    #[test]
    fn sensors_that_stay_silent_end_the_run() {
        let mut robot = supervised(&[Next::Silence(Duration::from_secs(60))], false);
        let error = block_on(robot.sense()).expect_err("nothing comes");
        assert!(matches!(error, RobotError::Silent { waited } if waited >= Duration::from_millis(300)), "{error}");
        assert!(robot.into_inner().commands.len() >= 2, "it is told to stop again and again");
    }

    #[test]
    fn an_unusable_frame_stops_the_robot_at_once() {
        let mut robot = supervised(&[Next::Unusable, Next::Frame], false);
        assert!(block_on(robot.sense()).is_ok());
        assert_eq!(robot.into_inner().commands, [Twist::default()]);
    }

    #[test]
    fn a_driver_that_hangs_does_not_hang_the_loop() {
        let mut robot = supervised(&[], true);
        block_on(async {
            assert!(robot.drive(Twist::default()).await.is_ok(), "another command may be taken");
            let mut outcome = Ok(());
            for _ in 0..10 {
                outcome = outcome.and(robot.drive(Twist::default()).await);
            }
            assert!(matches!(outcome, Err(RobotError::Unresponsive { .. })), "{outcome:?}");
        });
    }
}
