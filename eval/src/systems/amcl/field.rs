//! The likelihood field: how likely a beam ends at a place, by the distance to the nearest
//! obstacle.

use super::particle::Particle;
use fht_navigation::planning::{PlanConfig, Traversable, UnknownCells};
use fht_perception::grid::{CellBounds, OccupancyGrid};
use fht_perception::pose::Point2;

/// Parameters of the likelihood.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldConfig {
    /// Weight of beams that end at an obstacle. Default 0.5.
    pub z_hit: f64,
    /// Weight of beams that end anywhere. Default 0.5.
    pub z_rand: f64,
    /// Standard deviation of a beam's end, metres. Default 0.2.
    pub sigma_hit: f64,
    /// Search radius for obstacles, metres. Default 2.
    pub max_dist: f64,
    /// The scanner's range, metres. Default 7.
    pub range_max_m: f64,
}

impl Default for FieldConfig {
    fn default() -> Self {
        Self { z_hit: 0.5, z_rand: 0.5, sigma_hit: 0.2, max_dist: 2.0, range_max_m: 7.0 }
    }
}

/// The field of a map.
pub struct LikelihoodField {
    resolution_m: f64,
    bounds: CellBounds,
    /// Cube of the likelihood of each cell.
    cubes: Vec<f32>,
    /// The same, far from all obstacles.
    far: f32,
}

impl LikelihoodField {
    /// From a grid.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, config: &FieldConfig) -> Self {
        let distances = PlanConfig {
            robot_radius_m: 0.0,
            comfort_clearance_m: config.max_dist,
            comfort_weight: 0.0,
            unknown: UnknownCells::Forbidden,
        };
        let space = Traversable::new(grid, &distances);
        let cube = |distance_m: f64| {
            let hit = config.z_hit * (-0.5 * (distance_m / config.sigma_hit).powi(2)).exp();
            (hit + config.z_rand / config.range_max_m).powi(3) as f32
        };
        let bounds = grid.bounds();
        let cells = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
        let cubes = cells.map(|cell| cube(space.clearance_m(cell).min(config.max_dist))).collect();
        Self { resolution_m: grid.resolution_m(), bounds, cubes, far: cube(config.max_dist) }
    }

    /// Weight of a particle by a scan's end points in the robot's frame.
    #[must_use]
    pub fn weight(&self, particle: &Particle, beams: &[Point2]) -> f64 {
        let (sin, cos) = particle.yaw.sin_cos();
        let (width, height) = (self.bounds.width() as i64, self.bounds.height() as i64);
        let mut sum = 1.0;
        for beam in beams {
            let x = particle.x + beam.x * cos - beam.y * sin;
            let y = particle.y + beam.x * sin + beam.y * cos;
            let i = (x / self.resolution_m).floor() as i64 - i64::from(self.bounds.min.i);
            let j = (y / self.resolution_m).floor() as i64 - i64::from(self.bounds.min.j);
            let is_inside = (0..width).contains(&i) && (0..height).contains(&j);
            sum += f64::from(if is_inside { self.cubes[(j * width + i) as usize] } else { self.far });
        }
        sum
    }
}
