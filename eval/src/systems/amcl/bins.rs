//! Bins of poses, 0.5 m by 0.5 m by 10°, as in the ROS package. The number of occupied bins
//! measures the spread of the particles, and bins that touch form a cluster.

use super::particle::Particle;
use fht_perception::pose::wrap_angle;
use nalgebra::{Matrix2, Vector2};
use std::collections::{BTreeMap, BTreeSet};

/// Side of a bin, metres.
const SIDE_M: f64 = 0.5;
/// Bins of a full turn.
const TURNS: i32 = 36;

/// Column, row and direction.
type Bin = (i32, i32, i32);

/// The weight in each bin that has any.
#[derive(Clone, Debug, Default)]
pub struct Bins {
    weights: BTreeMap<Bin, f64>,
}

/// Particles in bins that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster {
    /// Share of the whole weight.
    pub share: f64,
    /// Mean x and y, metres, and heading, radians.
    pub mean: [f64; 3],
    /// Standard deviation of the position in its worst direction, metres.
    pub sigma_m: f64,
    /// Standard deviation of the heading, radians.
    pub sigma_rad: f64,
}

fn bin_of(particle: &Particle) -> Bin {
    let index = |metres: f64| (metres / SIDE_M).floor() as i32;
    let turn = (wrap_angle(particle.yaw) / std::f64::consts::TAU * f64::from(TURNS)).floor() as i32;
    (index(particle.x), index(particle.y), turn.rem_euclid(TURNS))
}

impl Bins {
    /// Adds a particle.
    pub fn add(&mut self, particle: &Particle) {
        *self.weights.entry(bin_of(particle)).or_default() += particle.weight;
    }

    /// How many bins hold anything.
    #[must_use]
    pub fn occupied(&self) -> usize {
        self.weights.len()
    }

    /// The heaviest cluster of the particles that were added.
    #[must_use]
    pub fn heaviest(&self, particles: &[Particle]) -> Option<Cluster> {
        let mut left: BTreeSet<Bin> = self.weights.keys().copied().collect();
        let mut best: Option<(f64, BTreeSet<Bin>)> = None;
        while let Some(first) = left.pop_first() {
            let mut cluster = BTreeSet::from([first]);
            let mut open = vec![first];
            while let Some((column, row, turn)) = open.pop() {
                for step in 0..27 {
                    let turn = (turn + step / 9 - 1).rem_euclid(TURNS);
                    let near = (column + step % 3 - 1, row + step / 3 % 3 - 1, turn);
                    if left.remove(&near) {
                        cluster.insert(near);
                        open.push(near);
                    }
                }
            }
            let weight: f64 = cluster.iter().filter_map(|bin| self.weights.get(bin)).sum();
            if best.as_ref().is_none_or(|(most, _)| weight > *most) {
                best = Some((weight, cluster));
            }
        }
        let (_, bins) = best?;
        let total: f64 = particles.iter().map(|particle| particle.weight).sum();
        let members: Vec<&Particle> = particles.iter().filter(|particle| bins.contains(&bin_of(particle))).collect();
        moments(&members, total)
    }
}

fn moments(members: &[&Particle], total: f64) -> Option<Cluster> {
    let weight: f64 = members.iter().map(|particle| particle.weight).sum();
    if weight <= 0.0 || total <= 0.0 {
        return None;
    }
    let mean = |value: &dyn Fn(&Particle) -> f64| {
        members.iter().map(|particle| particle.weight * value(particle)).sum::<f64>() / weight
    };
    let centre = Vector2::new(mean(&|particle| particle.x), mean(&|particle| particle.y));
    let (sin, cos) = (mean(&|particle| particle.yaw.sin()), mean(&|particle| particle.yaw.cos()));
    let covariance = members.iter().fold(Matrix2::zeros(), |sum: Matrix2<f64>, particle| {
        let off = Vector2::new(particle.x, particle.y) - centre;
        sum + off * off.transpose() * (particle.weight / weight)
    });
    let length = sin.hypot(cos).clamp(1e-9, 1.0);
    Some(Cluster {
        share: weight / total,
        mean: [centre.x, centre.y, sin.atan2(cos)],
        sigma_m: covariance.symmetric_eigenvalues().max().max(0.0).sqrt(),
        sigma_rad: (-2.0 * length.ln()).max(0.0).sqrt(),
    })
}
