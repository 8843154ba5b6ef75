//! The grid map's localization: Monte Carlo localization with KLD sampling and recovery (AMCL), as
//! in "Probabilistic Robotics" (Thrun, Burgard, Fox 2005), tables 5.6 (odometry), 6.3 (likelihood
//! field), 8.3 (augmented MCL) and 8.4 (KLD sampling). The weight of a scan is the sum of cubes
//! that the ROS package uses in place of the product.
//!
//! | module | idea |
//! | --- | --- |
//! | [`field`] | the likelihood of a beam's end, looked up |
//! | [`Particle`] | a pose that the robot may have |
//! | [`bins`] | bins of poses: how spread the cloud is, and where most of it lies |

pub mod bins;
pub mod field;
mod particle;

pub use particle::Particle;

use super::Localizing;
use bins::{Bins, Cluster};
use fht_perception::frame::{LaserScan, SensorFrame};
use fht_perception::grid::{CellState, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, pose, wrap_angle};
use fht_proto::Descriptor;
use field::{FieldConfig, LikelihoodField};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Parameters, named as the ROS packages name them.
#[derive(Clone, Debug, PartialEq)]
pub struct AmclConfig {
    /// Fewest particles.
    pub min_particles: usize,
    /// Most particles.
    pub max_particles: usize,
    /// Greatest error between the true and the sampled distribution.
    pub kld_err: f64,
    /// Quantile of the standard normal distribution for that bound.
    pub kld_z: f64,
    /// Noise of the odometry: rotation by rotation, rotation by translation, translation by
    /// translation, translation by rotation.
    pub alpha: [f64; 4],
    /// Beams of a scan that are used.
    pub laser_max_beams: usize,
    /// The likelihood of a beam.
    pub field: FieldConfig,
    /// The filter is updated after driving this far, metres,
    pub update_min_d: f64,
    /// or turning this much, radians.
    pub update_min_a: f64,
    /// Rates of the slow and the fast average of the weight. When the fast one falls below the slow
    /// one, random particles are added. Both 0: never.
    pub recovery_alpha: [f64; 2],
    /// The place counts as known when the heaviest cluster has this share of the weight, by default
    /// 0.9,
    pub declare_share: f64,
    /// and its position has a standard deviation below this in its worst direction, metres, by
    /// default 1,
    pub declare_sigma_m: f64,
    /// and its heading below this, radians, by default 30° (Nav2: 0.5 m and 15°). With the noise
    /// that the paper's parameters give the odometry, a cloud around the right place stays about
    /// that wide while its mean is right within 0.2 m and 2°. Of 12 pairs of limits these let most
    /// robots know (24 and 17 of 24 drives in the paper's museum) without a false fix.
    pub declare_sigma_rad: f64,
}

impl AmclConfig {
    /// The paper's parameters; no recovery.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            min_particles: 500,
            max_particles: 5000,
            kld_err: 0.05,
            kld_z: 0.99,
            alpha: [0.2, 0.2, 0.8, 0.2],
            laser_max_beams: 30,
            field: FieldConfig::default(),
            update_min_d: 0.2,
            update_min_a: 0.5,
            recovery_alpha: [0.0, 0.0],
            declare_share: 0.9,
            declare_sigma_m: 1.0,
            declare_sigma_rad: 30.0_f64.to_radians(),
        }
    }

    /// The defaults of Nav2 with its suggested recovery rates.
    #[must_use]
    pub fn nav2() -> Self {
        Self {
            max_particles: 2000,
            alpha: [0.2; 4],
            laser_max_beams: 60,
            update_min_d: 0.25,
            update_min_a: 0.2,
            recovery_alpha: [0.001, 0.1],
            declare_sigma_m: 0.5,
            declare_sigma_rad: 15.0_f64.to_radians(),
            ..Self::paper()
        }
    }
}

/// What a filter needs of a grid; computed once for each map.
pub struct AmclMap {
    field: LikelihoodField,
    free: Vec<Point2>,
    cell_m: f64,
}

impl AmclMap {
    /// From a grid.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, config: &FieldConfig) -> Self {
        let bounds = grid.bounds();
        let cells = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
        let free = cells.filter(|&cell| grid.state(cell) == CellState::Free).map(|cell| grid.centre(cell)).collect();
        Self { field: LikelihoodField::new(grid, config), free, cell_m: grid.resolution_m() }
    }

    fn anywhere(&self, rng: &mut impl Rng) -> Particle {
        let centre = match self.free.len() {
            0 => Point2::origin(),
            count => self.free[rng.random_range(0..count)],
        };
        let half = self.cell_m / 2.0;
        Particle {
            x: centre.x + rng.random_range(-half..half),
            y: centre.y + rng.random_range(-half..half),
            yaw: rng.random_range(-std::f64::consts::PI..std::f64::consts::PI),
            weight: 1.0,
        }
    }
}

/// The particle filter on its own.
pub struct ParticleFilter<'a> {
    config: AmclConfig,
    map: &'a AmclMap,
    particles: Vec<Particle>,
    /// Slow and fast average of the weight, after the first scan.
    average: Option<[f64; 2]>,
}

impl<'a> ParticleFilter<'a> {
    /// Particles anywhere on the map's free floor.
    #[must_use]
    pub fn anywhere(config: AmclConfig, map: &'a AmclMap, rng: &mut impl Rng) -> Self {
        let count = config.max_particles.max(1);
        let mut particles: Vec<Particle> = (0..count).map(|_| map.anywhere(rng)).collect();
        particles.iter_mut().for_each(|particle| particle.weight = 1.0 / count as f64);
        Self { config, map, particles, average: None }
    }

    /// The particles.
    #[must_use]
    pub fn particles(&self) -> &[Particle] {
        &self.particles
    }

    /// The robot moved by `moved` in its own frame: turn, way, turn, each with noise.
    pub fn predict(&mut self, moved: &Pose2, rng: &mut impl Rng) {
        let way = moved.translation.vector.norm();
        // The direction of a tiny motion is noise.
        let first = if way < 0.01 { 0.0 } else { moved.translation.y.atan2(moved.translation.x) };
        let second = wrap_angle(moved.rotation.angle() - first);
        // Driving backwards is not a turn by 180° and back.
        let least = |turn: f64| turn.abs().min(std::f64::consts::PI - turn.abs());
        let [rr, rt, tt, tr] = self.config.alpha;
        let of_turn = |turn: f64| (rr * least(turn).powi(2) + rt * way * way).sqrt();
        let of_way = (tt * way * way + tr * (least(first).powi(2) + least(second).powi(2))).sqrt();
        let (of_first, of_second) = (of_turn(first), of_turn(second));
        for particle in &mut self.particles {
            let mut noise = |sigma: f64| -> f64 { sigma * Distribution::<f64>::sample(&StandardNormal, rng) };
            let heading = particle.yaw + first + noise(of_first);
            let length = way + noise(of_way);
            particle.x += length * heading.cos();
            particle.y += length * heading.sin();
            particle.yaw = wrap_angle(heading + second + noise(of_second));
        }
    }

    /// Weighs the particles by a scan.
    pub fn weigh(&mut self, scan: &LaserScan) {
        let points = scan.points_in_base();
        let step = (points.len() / self.config.laser_max_beams.max(1)).max(1);
        let beams: Vec<Point2> = points.into_iter().step_by(step).take(self.config.laser_max_beams).collect();
        let mut total = 0.0;
        for particle in &mut self.particles {
            particle.weight *= self.map.field.weight(particle, &beams);
            total += particle.weight;
        }
        // The particles' weights were 1/n each: their sum is the average likelihood.
        let [slow_rate, fast_rate] = self.config.recovery_alpha;
        let [slow, fast] = self.average.unwrap_or([total; 2]);
        self.average = Some([slow + slow_rate * (total - slow), fast + fast_rate * (total - fast)]);
        let count = self.particles.len() as f64;
        for particle in &mut self.particles {
            particle.weight = if total > 0.0 { particle.weight / total } else { 1.0 / count };
        }
    }

    /// Resamples the particles by weight: as many as their spread requires (KLD sampling), and some
    /// anywhere if the scans fit worse than they used to.
    pub fn resample(&mut self, rng: &mut impl Rng) {
        let lost = self.average.map_or(0.0, |[slow, fast]| if slow > 0.0 { (1.0 - fast / slow).max(0.0) } else { 0.0 });
        if lost > 0.0 {
            // As the ROS packages do; else the cloud would keep dissolving.
            self.average = None;
        }
        let mut sum = 0.0;
        let cumulative: Vec<f64> = self
            .particles
            .iter()
            .map(|particle| {
                sum += particle.weight;
                sum
            })
            .collect();
        let mut drawn: Vec<Particle> = Vec::with_capacity(self.config.max_particles);
        let mut bins = Bins::default();
        let mut wanted = self.config.max_particles;
        while drawn.len() < wanted.min(self.config.max_particles) {
            let particle = if lost > 0.0 && rng.random_range(0.0..1.0) < lost {
                self.map.anywhere(rng)
            } else {
                let at = rng.random_range(0.0..1.0) * sum;
                self.particles[cumulative.partition_point(|&below| below <= at).min(cumulative.len() - 1)]
            };
            bins.add(&Particle { weight: 1.0, ..particle });
            drawn.push(particle);
            wanted = needed(bins.occupied(), &self.config);
        }
        let weight = 1.0 / drawn.len() as f64;
        drawn.iter_mut().for_each(|particle| particle.weight = weight);
        self.particles = drawn;
    }

    /// The heaviest cluster of particles.
    #[must_use]
    pub fn heaviest(&self) -> Option<Cluster> {
        let mut bins = Bins::default();
        self.particles.iter().for_each(|particle| bins.add(particle));
        bins.heaviest(&self.particles)
    }

    /// Whether a cluster is tight and heavy enough to declare its pose.
    #[must_use]
    pub fn is_known(&self, cluster: &Cluster) -> bool {
        let config = &self.config;
        cluster.share >= config.declare_share
            && cluster.sigma_m <= config.declare_sigma_m
            && cluster.sigma_rad <= config.declare_sigma_rad
    }
}

/// Particles required for this many occupied bins (Fox 2003, equation 7).
#[must_use]
pub fn needed(bins: usize, config: &AmclConfig) -> usize {
    if bins <= 1 {
        return config.min_particles.max(1);
    }
    let k = (bins - 1) as f64;
    let b = 2.0 / (9.0 * k);
    let count = k / (2.0 * config.kld_err) * (1.0 - b + b.sqrt() * config.kld_z).powi(3);
    (count.ceil() as usize).clamp(config.min_particles.max(1), config.max_particles.max(1))
}

/// AMCL as a robot runs it: on wheel odometry, starting anywhere.
pub struct Amcl<'a> {
    filter: ParticleFilter<'a>,
    rng: ChaCha8Rng,
    /// Wheel odometry at the last update of the filter, and the heaviest cluster then.
    updated: Option<(Pose2, Option<Cluster>)>,
    map_from_base: Option<Pose2>,
}

impl<'a> Amcl<'a> {
    /// Before the first frame.
    #[must_use]
    pub fn new(config: AmclConfig, map: &'a AmclMap, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Self { filter: ParticleFilter::anywhere(config, map, &mut rng), rng, updated: None, map_from_base: None }
    }

    /// The heaviest cluster at the last update of the filter.
    #[must_use]
    pub fn belief(&self) -> Option<&Cluster> {
        self.updated.as_ref()?.1.as_ref()
    }
}

impl Localizing for Amcl<'_> {
    fn update(&mut self, frame: &SensorFrame, _describe: &mut dyn FnMut() -> Option<Descriptor>) -> Option<Pose2> {
        let moved = self.updated.map(|(then, _)| then.inverse() * frame.odom_from_base);
        let config = &self.filter.config;
        let is_due = moved.is_none_or(|moved| {
            moved.translation.vector.norm() >= config.update_min_d
                || moved.rotation.angle().abs() >= config.update_min_a
        });
        if is_due {
            if let Some(moved) = moved {
                self.filter.predict(&moved, &mut self.rng);
            }
            self.filter.weigh(&frame.scan);
            self.filter.resample(&mut self.rng);
            self.updated = Some((frame.odom_from_base, self.filter.heaviest()));
        }
        let (then, cluster) = self.updated?;
        let cluster = cluster?;
        let [x, y, yaw] = cluster.mean;
        self.map_from_base = Some(pose(x, y, yaw) * (then.inverse() * frame.odom_from_base));
        self.map_from_base.filter(|_| self.filter.is_known(&cluster))
    }

    fn guess(&self) -> Option<Pose2> {
        self.map_from_base
    }
}

#[cfg(test)]
mod tests;
