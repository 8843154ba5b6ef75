//! A robot in a world: it drives, bumps, and senses.

mod company;
mod robot;

use crate::chassis::{Chassis, SUBSTEPS};
use crate::commons::{RobotContacts, SharedWorld, Turn};
use crate::people::crowd::Crowd;
use crate::people::{Body, BodyKind, Contacts, PeopleConfig};
use crate::scene::light::Light;
use crate::scoring::truth::{Truth, TruthNow};
use crate::sensing::camera::{self, CameraConfig};
use crate::sensing::lidar::{self, LidarConfig};
use crate::sensing::wheels::{WheelConfig, Wheels};
use crate::world::World;
use company::{ALONE, Company};
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::{Point2, Pose2};
use fht_perception::robot::RobotError;
use fht_proto::Footprint;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Height of the robot's body, metres; a scanner that is mounted higher makes it higher.
const ROBOT_HEIGHT_M: f64 = 0.19;
/// What stands above a scanner's beams, metres.
const SCANNER_TOP_M: f64 = 0.02;

/// The robot and its sensors; defaults are the paper's robot, with wheels that drift.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SimConfig {
    /// LiDAR beams in a full turn, the first straight ahead, counter-clockwise. 360.
    #[cfg_attr(feature = "schema", schemars(range(min = 8, max = 100000)))]
    pub lidar_beams: usize,
    /// Shortest LiDAR range, metres. 0.12.
    pub lidar_range_min_m: f64,
    /// Longest LiDAR range, metres. 7.
    pub lidar_range_max_m: f64,
    /// Standard deviation of the LiDAR's range noise, metres. 0.01.
    pub lidar_noise_m: f64,
    /// LiDAR mount on the base: forward, left, up, metres. (-0.032, 0, 0.182).
    #[cfg_attr(feature = "schema", schemars(inner(range(min = -10.0, max = 10.0))))]
    pub lidar_mount_m: [f64; 3],
    /// Time between scans, microseconds. One [`Simulator::step`] lasts this long. 200,000 (5 Hz).
    #[cfg_attr(feature = "schema", schemars(range(min = 1000, max = 10000000)))]
    pub lidar_period_us: u64,
    /// Height of the four cameras' common centre above the floor, over the base's origin, metres.
    /// 1.01.
    pub camera_height_m: f64,
    /// Side of each of the four square views, pixels. 160.
    #[cfg_attr(feature = "schema", schemars(range(min = 8, max = 4096)))]
    pub view_pixels: u32,
    /// The first frame and every frame whose number is a multiple of this have a panorama; 0: none
    /// has. 5 (1 Hz).
    pub camera_every: u64,
    /// Standard deviation of the pixel noise, grey levels of 255. 2.
    pub camera_noise_levels: f32,
    /// Seed of the light in the building and of the cameras' gain: each value stands for another
    /// day. 0.
    pub light_seed: u64,
    /// Fastest drive, forwards or backwards, metres per second; commands are limited to it. 0.5.
    pub max_speed_mps: f64,
    /// Fastest turn, radians per second; commands are limited to it. 1.5.
    pub max_turn_radps: f64,
    /// Radius of the body, a disc around the base's origin, metres. 0.105.
    pub radius_m: f64,
    /// Standard deviation of the wheels' scale error in distance, a fraction, constant over a run.
    /// 0.02.
    pub wheel_distance_scale_sigma: f64,
    /// Standard deviation of the wheels' scale error in rotation, a fraction, constant over a run.
    /// 0.02.
    pub wheel_rotation_scale_sigma: f64,
    /// Standard deviation of the odometry's heading random walk, degrees per √metre. 0.5.
    pub wheel_heading_walk_deg_per_sqrt_m: f64,
    /// Multiplies all three wheel errors: 0 is perfect odometry, 2 is twice as bad. 1.
    pub drift_factor: f64,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self {
            lidar_beams: 360,
            lidar_range_min_m: 0.12,
            lidar_range_max_m: 7.0,
            lidar_noise_m: 0.01,
            lidar_mount_m: [-0.032, 0.0, 0.182],
            lidar_period_us: 200_000,
            camera_height_m: 1.01,
            view_pixels: 160,
            camera_every: 5,
            camera_noise_levels: 2.0,
            light_seed: 0,
            max_speed_mps: 0.5,
            max_turn_radps: 1.5,
            radius_m: Footprint::default().circumscribed_radius_m(),
            wheel_distance_scale_sigma: 0.02,
            wheel_rotation_scale_sigma: 0.02,
            wheel_heading_walk_deg_per_sqrt_m: 0.5,
            drift_factor: 1.0,
        }
    }
}

impl SimConfig {
    fn lidar(&self) -> LidarConfig {
        LidarConfig {
            beams: self.lidar_beams,
            range_min_m: self.lidar_range_min_m,
            range_max_m: self.lidar_range_max_m,
            noise_m: self.lidar_noise_m,
            mount_m: self.lidar_mount_m,
        }
    }

    /// The robot's body as others see it: an upright cylinder of this height, metres.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        ROBOT_HEIGHT_M.max(self.lidar_mount_m[2] + SCANNER_TOP_M)
    }

    pub(crate) fn camera(&self) -> CameraConfig {
        CameraConfig {
            height_m: self.camera_height_m,
            pixels: self.view_pixels.max(1),
            noise_levels: self.camera_noise_levels,
        }
    }

    fn wheels(&self) -> WheelConfig {
        WheelConfig {
            distance_scale_sigma: self.wheel_distance_scale_sigma * self.drift_factor,
            rotation_scale_sigma: self.wheel_rotation_scale_sigma * self.drift_factor,
            heading_walk_rad_per_sqrt_m: self.wheel_heading_walk_deg_per_sqrt_m.to_radians() * self.drift_factor,
        }
    }
}

/// One robot in a world. The same world, config, start, seed and commands give the same data, bit
/// for bit. Scanner, wheels and cameras draw from separate random streams, so changing one leaves
/// the noise of the others as it was.
pub struct Simulator {
    world: Arc<World>,
    config: SimConfig,
    light: Light,
    lidar_noise: ChaCha8Rng,
    wheel_noise: ChaCha8Rng,
    camera_noise: ChaCha8Rng,
    wheels: Wheels,
    chassis: Chassis,
    steps: u64,
    /// Whether the first frame has been sensed.
    has_sensed: bool,
    /// The latest command.
    command: Twist,
    /// A shared copy of what is true, for scoring.
    truth: Truth,
    company: Company,
}

impl Simulator {
    /// A robot at `start` (`world_from_base`), odometry at the identity, time 0.
    #[must_use]
    pub fn new(world: Arc<World>, config: SimConfig, start: Pose2, seed: u64) -> Self {
        let stream = |number: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(number);
            rng
        };
        let mut wheel_noise = stream(2);
        let wheels = Wheels::new(&config.wheels(), &mut wheel_noise);
        Self {
            light: Light::from_seed(config.light_seed),
            lidar_noise: stream(1),
            wheel_noise,
            camera_noise: stream(3),
            wheels,
            chassis: Chassis::at(start, config.radius_m),
            steps: 0,
            has_sensed: false,
            command: Twist::default(),
            truth: Truth::at(start),
            company: Company::Nobody,
            world,
            config,
        }
    }

    /// The same robot among people. With nobody nothing differs, to the last bit.
    #[must_use]
    pub fn among(mut self, people: PeopleConfig) -> Self {
        if people.count > 0 {
            let place = |pose: &Pose2| Point2::from(pose.translation.vector);
            let (start, here) = (place(&self.world.start()), self.chassis.position());
            self.company = Company::Own(Box::new(Crowd::new(self.world.plan(), start, here, people)));
        }
        self.tell_truth();
        self
    }

    /// The same robot in a world that it shares with others: it enters when it senses first, and
    /// time goes on for all of them together. It is driven through the port for robots then.
    #[must_use]
    pub fn sharing(mut self, world: Box<dyn SharedWorld>) -> Self {
        let now = Turn { world_from_base: self.chassis.world_from_base, ..Turn::default() };
        self.company = Company::Shared { world, now };
        self
    }

    /// Where people are now. For scoring and for pictures taken later.
    #[must_use]
    pub fn people(&self) -> Vec<Body> {
        self.company.people()
    }

    /// Where the other robots of a shared world are now. For scoring and for pictures taken later.
    #[must_use]
    pub fn robots(&self) -> Vec<Body> {
        self.company.robots()
    }

    /// How often people and the robot have touched.
    #[must_use]
    pub fn contacts(&self) -> Contacts {
        self.company.contacts()
    }

    /// How often other robots and this one have touched.
    #[must_use]
    pub fn robot_contacts(&self) -> RobotContacts {
        self.company.robot_contacts()
    }

    fn tell_truth(&self) {
        let places = |bodies: Vec<Body>| bodies.iter().map(|body| (body.position, body.radius_m)).collect();
        self.truth.set(TruthNow {
            world_from_base: self.chassis.world_from_base,
            driven_m: self.chassis.driven_m,
            collisions: self.chassis.collisions,
            people: places(self.people()),
            robots: places(self.robots()),
            contacts: self.contacts(),
            robot_contacts: self.robot_contacts(),
        });
    }

    /// The frame at the start, with a panorama unless `camera_every` is 0. Call it once before the
    /// first [`step`](Self::step).
    pub fn sense_first(&mut self) -> SensorFrame {
        self.has_sensed = true;
        self.sense(self.config.camera_every > 0)
    }

    /// Drives for one LiDAR period, then senses. At walls the robot slides along or stops. A
    /// command that is not finite counts as a stop.
    pub fn step(&mut self, command: Twist) -> SensorFrame {
        let Twist { linear_mps: speed, angular_radps: turn } = self.limited(command);
        let period_s = self.config.lidar_period_us as f64 * 1e-6 / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            self.advance(speed * period_s, turn * period_s, period_s);
        }
        self.sense_next()
    }

    fn sense_next(&mut self) -> SensorFrame {
        self.steps += 1;
        self.has_sensed = true;
        self.tell_truth();
        let takes_picture = self.config.camera_every > 0 && self.steps.is_multiple_of(self.config.camera_every);
        self.sense(takes_picture)
    }

    /// What the robot can do of a command.
    fn limited(&self, command: Twist) -> Twist {
        let limited =
            |value: f64, limit: f64| if value.is_finite() { value.clamp(-limit.abs(), limit.abs()) } else { 0.0 };
        Twist {
            linear_mps: limited(command.linear_mps, self.config.max_speed_mps),
            angular_radps: limited(command.angular_radps, self.config.max_turn_radps),
        }
    }

    /// The first frame, or the one after a LiDAR period with the current command. In a shared world
    /// it comes when all robots have told theirs. Dropped before, it comes with the next call.
    pub(crate) async fn next_frame(&mut self) -> Result<SensorFrame, RobotError> {
        let (command, has_sensed) = (self.limited(self.command), self.has_sensed);
        let turn = match &mut self.company {
            Company::Shared { world, .. } if has_sensed => world.go_on(command).await?,
            Company::Shared { world, .. } => world.enter().await?,
            Company::Nobody | Company::Own(_) if has_sensed => return Ok(self.step(self.command)),
            Company::Nobody | Company::Own(_) => return Ok(self.sense_first()),
        };
        self.take(turn);
        Ok(if has_sensed { self.sense_next() } else { self.sense_first() })
    }

    /// The robot is where the shared world says.
    fn take(&mut self, turn: Turn) {
        for (forward_m, turn_rad) in &turn.rolls {
            self.wheels.roll(*forward_m, *turn_rad, &mut self.wheel_noise);
        }
        self.chassis.world_from_base = turn.world_from_base;
        (self.chassis.driven_m, self.chassis.collisions) = (turn.driven_m, turn.collisions);
        if let Company::Shared { now, .. } = &mut self.company {
            *now = turn;
        }
        self.tell_truth();
    }

    /// Sets the current command.
    pub(crate) fn set_command(&mut self, command: Twist) {
        self.command = command;
    }

    /// The truth about this robot, for an observer that scores it while others drive it.
    #[must_use]
    pub fn watch_truth(&self) -> Truth {
        self.truth.clone()
    }

    /// The true `world_from_base`. For scoring only.
    #[must_use]
    pub fn truth(&self) -> Pose2 {
        self.chassis.world_from_base
    }

    /// How many times the body has hit something so far.
    #[must_use]
    pub fn collisions(&self) -> u64 {
        self.chassis.collisions
    }

    /// Distance truly driven so far, metres.
    #[must_use]
    pub fn driven_m(&self) -> f64 {
        self.chassis.driven_m
    }

    /// The world the robot is in.
    #[must_use]
    pub fn world(&self) -> &Arc<World> {
        &self.world
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &SimConfig {
        &self.config
    }

    fn sense(&mut self, takes_picture: bool) -> SensorFrame {
        let (scene, mut bodies) = (self.world.scene(), self.people());
        bodies.extend(self.robots());
        let here = self.chassis.world_from_base;
        let met = lidar::Met { scene, bodies: &bodies };
        let scan = lidar::scan(met, &self.config.lidar(), &here, &mut self.lidar_noise);
        let panorama = takes_picture.then(|| {
            let seen = camera::Seen { scene, bodies: &bodies, light: &self.light };
            camera::panorama(seen, &self.config.camera(), &here, &mut self.camera_noise)
        });
        SensorFrame {
            time_us: self.steps * self.config.lidar_period_us,
            odom_from_base: self.wheels.odom_from_base(),
            scan,
            panorama,
        }
    }

    /// Moves along a small arc, alone or among people of its own.
    fn advance(&mut self, forward_m: f64, turn_rad: f64, period_s: f64) {
        let mut step = self.chassis.step(&self.world, forward_m, turn_rad);
        if let Company::Own(crowd) = &mut self.company {
            step.to = crowd.stop_robot(ALONE, step.from, step.to, self.config.radius_m);
        }
        let (moved, roll) = self.chassis.take(&step);
        self.wheels.roll(roll.0, roll.1, &mut self.wheel_noise);
        if let Company::Own(crowd) = &mut self.company {
            let robot = Body {
                position: step.to,
                velocity: moved / period_s,
                radius_m: self.config.radius_m,
                height_m: ROBOT_HEIGHT_M,
                kind: BodyKind::Robot,
            };
            crowd.step(self.world.plan(), &[(ALONE, robot)], period_s);
        }
    }
}
