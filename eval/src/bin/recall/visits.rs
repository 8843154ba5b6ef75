//! Places of a simulated world, each visited again on another day, slightly displaced and with
//! another heading.

use crate::pictures::cosine;
use crate::score::{PlaceRelation, Row};
use fht_descriptor::{DescribeError, DescriptorNet};
use fht_perception::frame::Panorama;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_sim::{FloorPlan, SimConfig, Simulator, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// How visits are drawn and judged.
#[derive(Clone, Debug)]
pub struct VisitConfig {
    /// Most places. Default 60.
    pub places: usize,
    /// Later visits to each. Default 3.
    pub visits: usize,
    /// Least distance between places, metres: about that of main nodes. Default 2.5.
    pub spacing_m: f64,
    /// Greatest distance of a later visit from its place, in sight of it, metres. Default 1.
    pub same_m: f64,
    /// Places at least this far apart, or out of sight, are different, metres. Default 5.
    pub different_m: f64,
    /// Clearance of all positions, metres. Default 0.3.
    pub clearance_m: f64,
    /// Seed of positions, headings and light. Default 1.
    pub seed: u64,
}

impl Default for VisitConfig {
    fn default() -> Self {
        Self { places: 60, visits: 3, spacing_m: 2.5, same_m: 1.0, different_m: 5.0, clearance_m: 0.3, seed: 1 }
    }
}

/// Where panoramas are taken: `places[i]` is visited again at `later[i]`.
#[derive(Clone, Debug)]
pub struct Visits {
    /// One pose for each place.
    pub places: Vec<Pose2>,
    /// The later poses, for each place.
    pub later: Vec<Vec<Pose2>>,
}

impl Visits {
    /// Draws places that a robot can reach, and visits to them.
    pub fn draw(world: &World, config: &VisitConfig) -> Self {
        const TRIES: usize = 4000;
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        let plan = world.plan();
        let start = Point2::from(world.start().translation.vector);
        let reachable = plan.reachable(start, config.clearance_m);
        let cells: Vec<usize> = (0..reachable.cells().len()).filter(|&cell| reachable.cells()[cell]).collect();
        let mut visits = Self { places: Vec::new(), later: Vec::new() };
        if cells.is_empty() {
            return visits;
        }
        for _ in 0..TRIES {
            if visits.places.len() >= config.places {
                break;
            }
            let cell = cells[rng.random_range(0..cells.len())];
            let here = plan.centre_of(cell % plan.width(), cell / plan.width());
            let apart = |other: &Pose2| (here - Point2::from(other.translation.vector)).norm() >= config.spacing_m;
            if visits.places.iter().all(apart) {
                visits.places.push(pose(here.x, here.y, rng.random_range(-PI..PI)));
            }
        }
        for place in &visits.places {
            let centre = Point2::from(place.translation.vector);
            let mut later = Vec::new();
            for _ in 0..TRIES {
                if later.len() >= config.visits {
                    break;
                }
                let (distance, bearing) =
                    (config.same_m * rng.random_range(0.0_f64..1.0).sqrt(), rng.random_range(0.0..TAU));
                let here = centre + nalgebra::Vector2::new(bearing.cos(), bearing.sin()) * distance;
                if plan.clearance_m(here) >= config.clearance_m && plan.is_clear(centre, here, 0.0) {
                    later.push(pose(here.x, here.y, rng.random_range(-PI..PI)));
                }
            }
            visits.later.push(later);
        }
        visits
    }

    /// Describes places in one light and later visits in another, and relates them.
    pub fn rows(
        &self,
        world: &Arc<World>,
        net: &mut DescriptorNet,
        config: &VisitConfig,
    ) -> Result<Vec<Row>, DescribeError> {
        let mut describe =
            |pose: &Pose2, light_seed: u64| net.descriptor(&panorama(world, *pose, light_seed, config.seed));
        let [first_day, later_day] = days(config.seed);
        let places = self.places.iter().map(|pose| describe(pose, first_day)).collect::<Result<Vec<_>, _>>()?;
        let mut rows = Vec::new();
        for visit in self.later.iter().flatten() {
            let seen = describe(visit, later_day)?;
            let relation = |place: &Pose2| relation(world.plan(), visit, place, config);
            rows.push(
                self.places.iter().zip(&places).map(|(pose, phi)| (cosine(&seen, phi), relation(pose))).collect(),
            );
        }
        Ok(rows)
    }

    /// Least and mean cosine of a place's descriptor to those at the same position with other
    /// headings, in one light.
    pub fn heading_invariance(
        &self,
        world: &Arc<World>,
        net: &mut DescriptorNet,
        config: &VisitConfig,
    ) -> Result<[f64; 2], DescribeError> {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed + 1);
        let [day, _] = days(config.seed);
        let (mut least, mut sum) = (f64::INFINITY, 0.0);
        for place in &self.places {
            let first = net.descriptor(&panorama(world, *place, day, config.seed))?;
            let turned = *place * pose(0.0, 0.0, rng.random_range(-PI..PI));
            let again = net.descriptor(&panorama(world, turned, day, config.seed + 1))?;
            let cosine = f64::from(cosine(&first, &again));
            least = least.min(cosine);
            sum += cosine;
        }
        Ok([least, sum / self.places.len().max(1) as f64])
    }
}

/// Light seeds of the mapping day and of a later day.
pub fn days(seed: u64) -> [u64; 2] {
    [2 * seed, 2 * seed + 1]
}

/// What the cameras see at a pose.
pub fn panorama(world: &Arc<World>, pose: Pose2, light_seed: u64, noise_seed: u64) -> Panorama {
    let config = SimConfig { light_seed, camera_every: 1, ..SimConfig::default() };
    let frame = Simulator::new(Arc::clone(world), config, pose, noise_seed).sense_first();
    frame.panorama.unwrap_or_else(|| Panorama { views: Default::default() })
}

fn relation(plan: &FloorPlan, visit: &Pose2, place: &Pose2, config: &VisitConfig) -> PlaceRelation {
    let (a, b) = (Point2::from(visit.translation.vector), Point2::from(place.translation.vector));
    let distance = (a - b).norm();
    if distance >= config.different_m || !plan.is_clear(a, b, 0.0) {
        PlaceRelation::Different
    } else if distance <= config.same_m {
        PlaceRelation::Same
    } else {
        PlaceRelation::Near
    }
}
