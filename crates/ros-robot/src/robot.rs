//! The robot behind the port: its topics as [`Sensors`] and [`Robot`].

use crate::camera_topics::chosen;
use crate::check::{Finding, Readiness, check};
use crate::commands::{Commands, ROLL_CALL};
use crate::config::RosRobotConfig;
use crate::intake::{Intake, IntakeReport};
use crate::picture_topics::PictureTopics;
use crate::pictures::Pictures;
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::robot::{Robot, RobotError, Sensors, SilenceConfig};
use fht_ros::{Endpoint, NodeConfig, Qos, Received, RosError, RosNode, Subscription, resolve};
use fht_ros_frames::frame_name;
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{
    ClockMsg, HeaderMsg, LaserScanMsg, OdometryMsg, PointCloud2, TfMessage, TwistMsg, Vector3,
};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Most kinds of doubts that are told.
const DOUBTS: usize = 32;
/// How often waiting scans are looked at while nothing arrives.
const TICK: Duration = Duration::from_millis(50);

/// The frame that the odometry starts from. A robot's `nav_msgs/Odometry` says it, once it has
/// come.
#[derive(Clone, Debug)]
pub struct OdomFrame {
    said: Arc<OnceLock<String>>,
    usual: String,
}

impl OdomFrame {
    /// Its name.
    #[must_use]
    pub fn name(&self) -> String {
        self.said.get().unwrap_or(&self.usual).clone()
    }

    fn hear(&self, frame: &str) {
        if !frame.is_empty() {
            // The first word holds.
            self.said.get_or_init(|| frame.to_owned());
        }
    }
}

/// What the robot sees.
enum Sights {
    Scans(Subscription<LaserScanMsg>),
    Points(Subscription<PointCloud2<'static>>),
}

impl Sights {
    async fn subscribe(node: &RosNode, config: &RosRobotConfig) -> Result<Self, RosError> {
        let sensor = Qos::sensor_data();
        Ok(match &config.points {
            // They are large.
            Some(points) => Self::Points(node.subscribe(points, Qos { depth: 2, ..sensor }).await?),
            None => Self::Scans(node.subscribe(&config.scan, deep(sensor, config.backlog)).await?),
        })
    }

    fn topic(&self) -> &str {
        match self {
            Self::Scans(scans) => scans.topic(),
            Self::Points(points) => points.topic(),
        }
    }

    fn take_raw(&self) -> Option<Received> {
        match self {
            Self::Scans(scans) => scans.take_raw(),
            Self::Points(points) => points.take_raw(),
        }
    }

    async fn next_raw(&self) -> Received {
        match self {
            Self::Scans(scans) => scans.next_raw().await,
            Self::Points(points) => points.next_raw().await,
        }
    }

    fn dropped(&self) -> u64 {
        match self {
            Self::Scans(scans) => scans.dropped(),
            Self::Points(points) => points.dropped(),
        }
    }

    fn missed(&self) -> u64 {
        match self {
            Self::Scans(scans) => scans.missed(),
            Self::Points(points) => points.missed(),
        }
    }
}

/// With a queue of `depth` at least.
fn deep(qos: Qos, depth: usize) -> Qos {
    Qos { depth: qos.depth.max(depth), ..qos }
}

/// A live robot is told to stop when no frame has come for so long, seconds: it shall stand within
/// half a second.
const STOP_AFTER_S: f64 = 0.4;

/// How long the sensors of a live robot may be silent, where `usual` says when the run ends.
#[must_use]
pub fn live_silence(usual: SilenceConfig) -> SilenceConfig {
    SilenceConfig { stop_after_s: STOP_AFTER_S, ..usual }
}

/// A robot on a ROS 2 graph. Its topics are those of a [`RosRobotConfig`].
pub struct RosRobot {
    intake: Intake,
    sights: Sights,
    odometry: Option<Subscription<OdometryMsg>>,
    transforms: Subscription<TfMessage>,
    fixed_transforms: Subscription<TfMessage>,
    clock: Option<Subscription<ClockMsg>>,
    pictures: Option<PictureTopics>,
    commands: Commands,
    odom_frame: OdomFrame,
    began: Instant,
    /// When the last frame was given.
    last_frame: Instant,
    /// Scans that the queue has dropped so far.
    dropped: u64,
    /// The trouble that was told last.
    told: Option<String>,
    /// What is odd about stamps, as it was told, without numbers: each once.
    doubts: BTreeMap<String, String>,
}

impl RosRobot {
    /// Subscribes to the robot's sensors, and offers it commands: with a stamp if whoever takes
    /// them wants one (`geometry_msgs/TwistStamped`), else without. Its driver may come later.
    ///
    /// # Errors
    /// [`RosError`] when a name cannot be one, or the session is closed.
    pub async fn connect(node: &RosNode, config: RosRobotConfig) -> Result<Self, RosError> {
        let there = node.others(ROLL_CALL).await?;
        tell_findings(node, &there, &config)?;
        let NodeConfig { name: own, namespace, .. } = node.config();
        let cameras = chosen(&config, &there, |name| resolve(name, namespace, own))?;
        let sensor = Qos::sensor_data();
        let sights = Sights::subscribe(node, &config).await?;
        let odometry = match config.has_odometry_in_tf() {
            true => None,
            // It comes several times as often as scans.
            false => Some(
                node.subscribe(&config.odometry, deep(Qos { depth: 50, ..sensor }, config.backlog.saturating_mul(8)))
                    .await?,
            ),
        };
        let transforms = node
            .subscribe(&config.tf, deep(Qos { depth: 100, ..Qos::default() }, config.backlog.saturating_mul(8)))
            .await?;
        let fixed_transforms = node.subscribe(&config.tf_static, Qos::latched(100)).await?;
        let clock = match config.use_sim_time {
            true => Some(node.subscribe(&config.clock, Qos { depth: 1, ..sensor }).await?),
            false => None,
        };
        let clock_topic = node.resolve(&config.clock)?;
        let commands = Commands::find(node, &node.resolve(&config.cmd_vel)?).await?;
        let odometry_topic = node.resolve(&config.odometry)?;
        let odom_frame = OdomFrame { said: Arc::default(), usual: config.odom_frame.clone() };
        let began = Instant::now();
        let mut intake = Intake::new(config, sights.topic(), &odometry_topic, &clock_topic);
        let pictures = match cameras {
            Some(topics) => {
                let subscribed = PictureTopics::subscribe(node, &topics).await?;
                intake = intake.with_pictures(Pictures::new(topics));
                Some(subscribed)
            }
            None => None,
        };
        Ok(Self {
            intake,
            pictures,
            clock,
            sights,
            odometry,
            transforms,
            fixed_transforms,
            commands,
            odom_frame,
            began,
            last_frame: began,
            dropped: 0,
            told: None,
            doubts: BTreeMap::new(),
        })
    }

    /// The frame that the odometry starts from.
    #[must_use]
    pub fn odom_frame(&self) -> OdomFrame {
        self.odom_frame.clone()
    }

    /// Whether pictures of four cameras are read.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        self.pictures.is_some()
    }

    /// What became of the sensors' messages.
    #[must_use]
    pub fn report(&self) -> IntakeReport {
        self.intake.report()
    }

    /// What keeps frames from coming, now: a sentence that names the topic and what to do. None
    /// once [`sense`](Sensors::sense) has failed: its error says it.
    #[must_use]
    pub fn trouble(&self) -> Option<String> {
        if self.intake.ended().is_some() {
            return None;
        }
        self.intake.trouble(self.began.elapsed().as_secs_f64())
    }

    /// What is odd about the stamps so far, each once: sentences that name the topic and what to
    /// do. Frames may come all the same.
    pub fn doubts(&self) -> impl Iterator<Item = &str> {
        self.doubts.values().map(String::as_str)
    }

    /// Takes all that has come, the time first and fixed transforms next. Pictures come last: those
    /// that came before a scan are there when the scan is.
    fn take_all(&mut self) {
        self.take_clock();
        while let Some(received) = self.fixed_transforms.take_raw() {
            self.take_transforms(&received);
        }
        while let Some(received) = self.transforms.take_raw() {
            self.take_transforms(&received);
        }
        while let Some(received) = self.odometry.as_ref().and_then(Subscription::take_raw) {
            self.take_odometry(&received);
        }
        while let Some(received) = self.sights.take_raw() {
            self.take_sight(&received);
        }
        self.take_pictures();
        let dropped = self.sights.dropped();
        self.intake.lose_scans(dropped - self.dropped);
        self.dropped = dropped;
        self.intake.set_missed(self.sights.missed());
    }

    fn take_clock(&mut self) {
        while let Some(received) = self.clock.as_ref().and_then(Subscription::take_raw) {
            let (arrived_s, topic) = (self.arrived_s(&received), self.clock.as_ref().map_or("", Subscription::topic));
            if let Some(message) = read::<ClockMsg>(topic, received.decode()) {
                self.intake.take_clock(&message, arrived_s);
            }
        }
    }

    fn take_pictures(&mut self) {
        let Some(topics) = &self.pictures else { return };
        for (camera, info) in topics.take_infos() {
            self.intake.take_camera_info(camera, info);
        }
        for (camera, received) in topics.take_pictures() {
            let arrived_s = received.arrived.saturating_duration_since(self.began).as_secs_f64();
            let wall_ns = wall_ns(&received);
            self.intake.take_picture(camera, received.bytes, arrived_s, wall_ns);
        }
    }

    fn arrived_s(&self, received: &Received) -> f64 {
        received.arrived.saturating_duration_since(self.began).as_secs_f64()
    }

    fn take_sight(&mut self, received: &Received) {
        let (arrived_s, topic) = (self.arrived_s(received), self.sights.topic());
        match &self.sights {
            Sights::Scans(_) => {
                if let Some(scan) = read(topic, received.decode()) {
                    self.intake.take_scan(scan, arrived_s, wall_ns(received));
                }
            }
            Sights::Points(_) => {
                if let Some(cloud) = read(topic, received.decode()) {
                    self.intake.take_points(&cloud, arrived_s, wall_ns(received));
                }
            }
        }
    }

    fn take_odometry(&mut self, received: &Received) {
        let (arrived_s, topic) = (self.arrived_s(received), self.odometry.as_ref().map_or("", Subscription::topic));
        if let Some(odometry) = read::<OdometryMsg>(topic, received.decode()) {
            self.odom_frame.hear(frame_name(&odometry.header.frame_id));
            self.intake.take_odometry(&odometry, arrived_s, wall_ns(received));
        }
    }

    fn take_transforms(&mut self, received: &Received) {
        let arrived_s = self.arrived_s(received);
        if let Some(transforms) = read(self.transforms.topic(), received.decode()) {
            self.intake.take_transforms(&transforms, arrived_s, wall_ns(received));
        }
    }

    /// Waits until something arrives, for a moment at most.
    async fn arrival(&mut self) {
        let odometry = async {
            match &self.odometry {
                Some(odometry) => odometry.next_raw().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            received = self.sights.next_raw() => {
                // Who tells the time tells it before.
                self.take_clock();
                self.take_sight(&received);
            }
            received = odometry => {
                self.take_clock();
                self.take_odometry(&received);
            }
            received = self.transforms.next_raw() => self.take_transforms(&received),
            received = self.fixed_transforms.next_raw() => self.take_transforms(&received),
            () = tokio::time::sleep(TICK) => {}
        }
    }

    /// Says once what keeps frames from coming, when none has come for a while.
    fn tell_trouble(&mut self, told_after: Duration) {
        if self.last_frame.elapsed() < told_after {
            return;
        }
        if let Some(trouble) = self.trouble()
            && self.told.as_deref().map(without_numbers) != Some(without_numbers(&trouble))
        {
            tracing::warn!("{trouble}");
            self.told = Some(trouble);
        }
    }

    /// Says what is odd about stamps.
    fn tell_doubts(&mut self) {
        for doubt in self.intake.take_doubts() {
            let kind = without_numbers(&doubt);
            if self.doubts.len() < DOUBTS && !self.doubts.contains_key(&kind) {
                tracing::warn!("{doubt}");
                self.doubts.insert(kind, doubt);
            }
        }
    }
}

/// Says who is on the graph that should not be, and what does not fit. What is missing may come.
fn tell_findings(node: &RosNode, there: &[Endpoint], config: &RosRobotConfig) -> Result<(), RosError> {
    for Finding { topic, readiness, sentence } in check(there, config, &node.config().namespace)? {
        if readiness == Readiness::Doubtful {
            tracing::warn!("{topic}: {sentence}");
        }
    }
    Ok(())
}

/// Sentences that differ in a number only are told once.
fn without_numbers(text: &str) -> String {
    text.replace(|letter: char| letter.is_ascii_digit(), "")
}

/// A message, or a word in the log that it is none.
fn read<M>(topic: &str, message: Result<M, cdr::CdrError>) -> Option<M> {
    message.map_err(|error| tracing::warn!("{topic} has a message that cannot be read: {error}")).ok()
}

/// What time it was on this machine when a message came, nanoseconds since the epoch: it may have
/// waited here since.
fn wall_ns(received: &Received) -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let then = now.saturating_sub(received.arrived.elapsed());
    u64::try_from(then.as_nanos()).unwrap_or(u64::MAX)
}

/// When the clock that tells the time begins anew, [`RobotError::Driver`] says so: what comes from
/// there on is of another run.
impl Sensors for RosRobot {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        let told_after = Duration::try_from_secs_f64(self.intake.told_after_s()).unwrap_or(Duration::MAX);
        loop {
            self.take_all();
            self.tell_doubts();
            if let Some(why) = self.intake.ended() {
                return Err(RobotError::driver(why));
            }
            if let Some(frame) = self.intake.frame(self.began.elapsed().as_secs_f64()) {
                self.last_frame = Instant::now();
                if self.told.take().is_some() {
                    tracing::info!("the sensors are complete again");
                }
                return Ok(frame);
            }
            self.tell_trouble(told_after);
            self.arrival().await;
        }
    }
}

impl Robot for RosRobot {
    async fn drive(&mut self, command: Twist) -> Result<(), RobotError> {
        let twist = TwistMsg {
            linear: Vector3 { x: command.linear_mps, ..Vector3::default() },
            angular: Vector3 { z: command.angular_radps, ..Vector3::default() },
        };
        // By the robot's clock, as far as its sensors tell it.
        let header = HeaderMsg { stamp: self.intake.newest(), frame_id: self.intake.base_frame() };
        self.commands.give(twist, header).await.map_err(RobotError::driver)
    }
}
