//! A robot in a world: it drives, bumps, and senses.

mod robot;

use crate::people::crowd::Crowd;
use crate::people::{Body, Contacts, PeopleConfig};
use crate::scene::light::Light;
use crate::scoring::truth::Truth;
use crate::sensing::camera::{self, CameraConfig};
use crate::sensing::lidar::{self, LidarConfig};
use crate::sensing::wheels::{WheelConfig, Wheels};
use crate::world::{BODY_HEIGHT_M, World};
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::{Point2, Pose2, pose};
use fht_proto::Footprint;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Integration steps in one LiDAR period: at 0.5 m/s and 5 Hz the body moves 1 cm in each, less
/// than any wall's width.
const SUBSTEPS: u32 = 10;
/// Height of the robot's body as people see it, metres.
const ROBOT_HEIGHT_M: f64 = 0.19;
/// A push out of an obstacle by less than this is rounding, not contact, metres.
const TOUCH_M: f64 = 1e-4;

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
    world_from_base: Pose2,
    steps: u64,
    /// Whether the first frame has been sensed.
    has_sensed: bool,
    /// The latest command.
    command: Twist,
    /// A shared copy of `world_from_base`, `driven_m` and `collisions`, for scoring.
    truth: Truth,
    touching: bool,
    collisions: u64,
    driven_m: f64,
    /// People, if there are any.
    crowd: Option<Crowd>,
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
            world_from_base: start,
            steps: 0,
            has_sensed: false,
            command: Twist::default(),
            truth: Truth::at(start),
            touching: false,
            collisions: 0,
            driven_m: 0.0,
            crowd: None,
            world,
            config,
        }
    }

    /// The same robot among people. With nobody nothing differs, to the last bit.
    #[must_use]
    pub fn among(mut self, people: PeopleConfig) -> Self {
        if people.count > 0 {
            let place = |pose: &Pose2| Point2::from(pose.translation.vector);
            let (start, here) = (place(&self.world.start()), place(&self.world_from_base));
            self.crowd = Some(Crowd::new(self.world.plan(), start, here, people));
        }
        self.tell_truth();
        self
    }

    /// Where people are now. For scoring and for pictures taken later.
    #[must_use]
    pub fn people(&self) -> Vec<Body> {
        self.crowd.as_ref().map_or_else(Vec::new, Crowd::bodies)
    }

    /// How often people and the robot have touched.
    #[must_use]
    pub fn contacts(&self) -> Contacts {
        self.crowd.as_ref().map_or_else(Contacts::default, Crowd::contacts)
    }

    fn tell_truth(&self) {
        let people = self.people().iter().map(|body| (body.position, body.radius_m)).collect();
        self.truth.set(self.world_from_base, self.driven_m, self.collisions, people, self.contacts());
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
        let limited =
            |value: f64, limit: f64| if value.is_finite() { value.clamp(-limit.abs(), limit.abs()) } else { 0.0 };
        let speed = limited(command.linear_mps, self.config.max_speed_mps);
        let turn = limited(command.angular_radps, self.config.max_turn_radps);
        let period_s = self.config.lidar_period_us as f64 * 1e-6 / f64::from(SUBSTEPS);
        for _ in 0..SUBSTEPS {
            self.advance(speed * period_s, turn * period_s, period_s);
        }
        self.steps += 1;
        self.has_sensed = true;
        self.tell_truth();
        let takes_picture = self.config.camera_every > 0 && self.steps.is_multiple_of(self.config.camera_every);
        self.sense(takes_picture)
    }

    /// The first frame, or the one after a LiDAR period with the current command.
    pub(crate) fn next_frame(&mut self) -> SensorFrame {
        if self.has_sensed { self.step(self.command) } else { self.sense_first() }
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
        self.world_from_base
    }

    /// How many times the body has hit something so far.
    #[must_use]
    pub fn collisions(&self) -> u64 {
        self.collisions
    }

    /// Distance truly driven so far, metres.
    #[must_use]
    pub fn driven_m(&self) -> f64 {
        self.driven_m
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
        let (scene, people) = (self.world.scene(), self.people());
        let met = lidar::Met { scene, bodies: &people };
        let scan = lidar::scan(met, &self.config.lidar(), &self.world_from_base, &mut self.lidar_noise);
        let panorama = takes_picture.then(|| {
            let seen = camera::Seen { scene, bodies: &people, light: &self.light };
            camera::panorama(seen, &self.config.camera(), &self.world_from_base, &mut self.camera_noise)
        });
        SensorFrame {
            time_us: self.steps * self.config.lidar_period_us,
            odom_from_base: self.wheels.odom_from_base(),
            scan,
            panorama,
        }
    }

    /// Moves along a small arc. The wheels measure the distance that the body really moved along
    /// its own x: blocked wheels stall.
    fn advance(&mut self, forward_m: f64, turn_rad: f64, period_s: f64) {
        let before = self.world_from_base;
        let mid_heading = before.rotation.angle() + turn_rad / 2.0;
        let (sin, cos) = mid_heading.sin_cos();
        let from = Point2::from(before.translation.vector);
        let wanted = Point2::new(from.x + forward_m * cos, from.y + forward_m * sin);
        let mut to = self.keep_out(from, wanted);
        if let Some(crowd) = &mut self.crowd {
            to = crowd.stop_robot(from, to, self.config.radius_m);
        }
        let moved = to - from;
        self.world_from_base = pose(to.x, to.y, before.rotation.angle() + turn_rad);
        self.driven_m += moved.norm();
        self.wheels.roll(moved.x * cos + moved.y * sin, turn_rad, &mut self.wheel_noise);
        if let Some(crowd) = &mut self.crowd {
            let radius_m = self.config.radius_m;
            let robot = Body { position: to, velocity: moved / period_s, radius_m, height_m: ROBOT_HEIGHT_M };
            crowd.step(self.world.plan(), &[robot], period_s);
        }
    }

    /// The place nearest to `wanted` where the body touches nothing: pushed off the walls, or
    /// `from` if the corner is too tight for that.
    fn keep_out(&mut self, from: Point2, wanted: Point2) -> Point2 {
        let radius = self.config.radius_m;
        let mut at = wanted;
        let mut touched = false;
        // Two pushes resolve a corner; the third confirms it.
        for _ in 0..3 {
            let (nearest, distance) = self.world.scene().nearest(at, BODY_HEIGHT_M);
            if distance >= radius - TOUCH_M {
                break;
            }
            touched = true;
            let away = at - nearest;
            let length = away.norm();
            if length < 1e-9 {
                at = from;
                break;
            }
            at = nearest + away * (radius / length);
        }
        if touched && self.world.scene().nearest(at, BODY_HEIGHT_M).1 < radius - 10.0 * TOUCH_M {
            at = from;
        }
        if touched && !self.touching {
            self.collisions += 1;
        }
        self.touching = touched;
        at
    }
}
