//! The simulated robot's topics, and its life on the graph.

use crate::cameras::SimCameras;
use crate::config::{CommandType, SimRobotConfig};
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::Pose2;
use fht_perception::robot::{Robot, RobotError, Sensors};
use fht_ros::{Publisher, Qos, Received, RosError, RosNode, Subscription};
use fht_ros_frames::{OdometryMessages, header_message, pose_message, scan_message};
use fht_ros_messages::msg::{
    ClockMsg, LaserScanMsg, OdometryMsg, PoseWithCovariance, TfMessage, Time, TransformStamped, TwistMsg, TwistStamped,
    TwistWithCovariance, Vector3,
};
use fht_sim::{Contacts, RobotContacts, Truth};
use serde::{Deserialize, Serialize};
use std::future::Future;
use std::time::Duration;

/// Why a simulated robot's life ended early.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The graph cannot be used.
    #[error(transparent)]
    Graph(#[from] RosError),
    /// The simulator failed: a defect, or the world that it shares is gone.
    #[error(transparent)]
    Robot(#[from] RobotError),
}

/// What truly happened.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SimRobotReport {
    /// Time of the robot's clock from the first frame to the last, seconds.
    pub sim_s: f64,
    /// Frames published.
    pub frames: u64,
    /// Commands that came.
    pub commands: u64,
    /// How often the robot was stopped because no command came.
    pub watchdog_stops: u64,
    /// Distance truly driven, metres.
    pub driven_m: f64,
    /// Times that the robot touched a wall or a thing.
    pub collisions: u64,
    /// Contacts with people.
    pub people: Contacts,
    /// Contacts with other robots of a shared world.
    pub robots: RobotContacts,
    /// Where it truly is at the end, in the world frame: `[x, y, yaw]`, metres and radians.
    pub world_from_base: [f64; 3],
}

enum Commands {
    Stamped(Subscription<TwistStamped>),
    Plain(Subscription<TwistMsg>),
}

/// The topics of a simulated robot.
pub struct SimRobot {
    config: SimRobotConfig,
    scans: Publisher<LaserScanMsg>,
    odometry: Publisher<OdometryMsg>,
    odometry_messages: OdometryMessages,
    transforms: Publisher<TfMessage>,
    clock: Option<Publisher<ClockMsg>>,
    cameras: Option<SimCameras>,
    truth: Publisher<OdometryMsg>,
    /// Kept for who comes later.
    _mount: Publisher<TfMessage>,
    commands: Commands,
    /// The newest command, and when it came, microseconds of the robot's clock.
    command: Option<(Twist, u64)>,
    first_us: Option<u64>,
    report: SimRobotReport,
}

impl SimRobot {
    /// Puts the robot's topics on the graph. Its scanner stands at `base_from_laser`, `up_m` metres
    /// over the base.
    ///
    /// # Errors
    /// [`RosError`] when a name cannot be one, or the session is closed.
    pub async fn join(
        node: &RosNode,
        config: SimRobotConfig,
        base_from_laser: &Pose2,
        up_m: f64,
    ) -> Result<Self, RosError> {
        let fixed = node.publisher("tf_static", Qos::latched(1)).await?;
        let mut mount = TransformStamped {
            header: header_message(config.begin_us, &config.base_frame),
            child_frame_id: config.laser_frame.clone(),
            transform: pose_message(base_from_laser),
        };
        mount.transform.position.z = up_m;
        let mut mounts = vec![mount];
        let cameras = match config.pictures {
            Some(kind) => {
                mounts.extend(SimCameras::mounts(&config));
                Some(SimCameras::join(node, kind).await?)
            }
            None => None,
        };
        fixed.publish(&TfMessage { transforms: mounts })?;
        let last = Qos { depth: 1, ..Qos::default() };
        let commands = match config.command_type {
            CommandType::Stamped => Commands::Stamped(node.subscribe(&config.cmd_vel, last).await?),
            CommandType::Plain => Commands::Plain(node.subscribe(&config.cmd_vel, last).await?),
        };
        let clock = match config.has_clock {
            true => Some(node.publisher("/clock", Qos { depth: 1, ..Qos::sensor_data() }).await?),
            false => None,
        };
        Ok(Self {
            scans: node.publisher(&config.scan, Qos::sensor_data()).await?,
            odometry: node.publisher(&config.odometry, Qos::sensor_data()).await?,
            transforms: node.publisher("tf", Qos { depth: 100, ..Qos::default() }).await?,
            truth: node.publisher("ground_truth", Qos::sensor_data()).await?,
            odometry_messages: OdometryMessages::in_frames(&config.odom_frame, &config.base_frame),
            clock,
            cameras,
            _mount: fixed,
            commands,
            command: None,
            first_us: None,
            report: SimRobotReport::default(),
            config,
        })
    }

    /// Whether somebody listens to the scans.
    ///
    /// # Errors
    /// [`RosError::Zenoh`].
    pub async fn is_heard(&self) -> Result<bool, RosError> {
        self.scans.is_heard().await
    }

    /// Says what the sensors say, and where the robot truly is in the world, if anybody knows.
    ///
    /// # Errors
    /// [`RosError`] when the session is closed.
    pub fn publish(&mut self, frame: &SensorFrame, world_from_base: Option<&Pose2>) -> Result<(), RosError> {
        let config = &self.config;
        let time_us = config.begin_us + frame.time_us;
        if let Some(clock) = &self.clock {
            clock.publish(&ClockMsg { clock: Time::from_us(time_us) })?;
        }
        // Before the scan, so that whoever waits for that has them.
        if let Some((cameras, panorama)) = self.cameras.as_ref().zip(frame.panorama.as_ref()) {
            cameras.publish(time_us, panorama)?;
        }
        let command = self.command.map(|(command, _)| command).unwrap_or_default();
        // Exact, so without a covariance.
        let truth = |at: &Pose2| OdometryMsg {
            header: header_message(time_us, "world"),
            child_frame_id: config.base_frame.clone(),
            pose: PoseWithCovariance { pose: pose_message(at), ..PoseWithCovariance::default() },
            twist: TwistWithCovariance {
                linear: Vector3 { x: command.linear_mps, ..Vector3::default() },
                angular: Vector3 { z: command.angular_radps, ..Vector3::default() },
                ..TwistWithCovariance::default()
            },
        };
        let odom_from_base = TransformStamped {
            header: header_message(time_us, &config.odom_frame),
            child_frame_id: config.base_frame.clone(),
            transform: pose_message(&frame.odom_from_base),
        };
        if let Some(world_from_base) = world_from_base {
            self.truth.publish(&truth(world_from_base))?;
        }
        self.transforms.publish(&TfMessage { transforms: vec![odom_from_base] })?;
        self.odometry.publish(&self.odometry_messages.next(time_us, &frame.odom_from_base))?;
        self.scans.publish(&scan_message(&frame.scan, header_message(time_us, &config.laser_frame), 0.0))?;
        self.report.frames += 1;
        let first_us = *self.first_us.get_or_insert(frame.time_us);
        self.report.sim_s = frame.time_us.saturating_sub(first_us) as f64 * 1e-6;
        Ok(())
    }

    /// What the robot does at `time_us` of its clock: as it was told last, unless that was too long
    /// ago. Messages that are no commands are passed over.
    pub fn command(&mut self, time_us: u64) -> Twist {
        while let Some(received) = self.take_command() {
            self.obey(&received, time_us);
        }
        let limit_us = (self.config.watchdog_s * 1e6) as u64;
        if let Some((command, _)) = self.command.filter(|(_, came_us)| time_us.saturating_sub(*came_us) > limit_us) {
            self.report.watchdog_stops += u64::from(command != Twist::default());
            self.command = None;
        }
        self.command.map(|(command, _)| command).unwrap_or_default()
    }

    fn take_command(&self) -> Option<Received> {
        match &self.commands {
            Commands::Stamped(commands) => commands.take_raw(),
            Commands::Plain(commands) => commands.take_raw(),
        }
    }

    /// Waits for a command, at most so long.
    async fn wait_for_command(&mut self, time_us: u64, patience: Duration) {
        let next = async {
            match &self.commands {
                Commands::Stamped(commands) => commands.next_raw().await,
                Commands::Plain(commands) => commands.next_raw().await,
            }
        };
        if let Ok(received) = tokio::time::timeout(patience, next).await {
            self.obey(&received, time_us);
        }
    }

    fn obey(&mut self, received: &Received, time_us: u64) {
        match self.twist_of(received) {
            Some(twist) => {
                self.report.commands += 1;
                let (linear_mps, angular_radps) = (twist.linear.x, twist.angular.z);
                self.command = Some((Twist { linear_mps, angular_radps }, time_us));
            }
            None => tracing::warn!("{} has a message that cannot be read", self.config.cmd_vel),
        }
    }

    fn twist_of(&self, received: &Received) -> Option<TwistMsg> {
        match &self.commands {
            Commands::Stamped(_) => received.decode::<TwistStamped>().ok().map(|stamped| stamped.twist),
            Commands::Plain(_) => received.decode().ok(),
        }
    }
}

/// Lives as `robot` on the graph until `end`: publishes what it senses, and obeys. Without
/// `in_step` a [paced](fht_perception::robot::Paced) robot goes on whether somebody drives it or
/// not. With it, time waits after each frame for a command, so long at most: it goes on as fast as
/// whoever drives.
///
/// # Errors
/// [`LiveError`].
pub async fn live<R: Robot>(
    mut topics: SimRobot,
    mut robot: R,
    truth: &Truth,
    in_step: Option<Duration>,
    end: impl Future<Output = ()>,
) -> Result<SimRobotReport, LiveError> {
    tokio::pin!(end);
    loop {
        let frame = tokio::select! {
            frame = robot.sense() => frame?,
            () = &mut end => break,
        };
        topics.publish(&frame, Some(&truth.world_from_base()))?;
        if let Some(patience) = in_step {
            topics.wait_for_command(frame.time_us, patience).await;
        }
        robot.drive(topics.command(frame.time_us)).await?;
    }
    robot.drive(Twist::default()).await?;
    let at = truth.world_from_base();
    Ok(SimRobotReport {
        driven_m: truth.driven_m(),
        collisions: truth.collisions(),
        people: truth.contacts(),
        robots: truth.robot_contacts(),
        world_from_base: [at.translation.x, at.translation.y, at.rotation.angle()],
        ..topics.report
    })
}

/// Plays recorded frames as a live robot that obeys nobody, until they are over or `end`. Returns
/// how many there were.
///
/// # Errors
/// [`LiveError`].
pub async fn play<S: Sensors>(
    topics: &mut SimRobot,
    mut frames: S,
    end: impl Future<Output = ()>,
) -> Result<u64, LiveError> {
    tokio::pin!(end);
    loop {
        let frame = tokio::select! {
            frame = frames.sense() => frame,
            () = &mut end => break,
        };
        match frame {
            Ok(frame) => topics.publish(&frame, None)?,
            Err(RobotError::Ended) => break,
            Err(error) => return Err(error.into()),
        }
    }
    Ok(topics.report.frames)
}
