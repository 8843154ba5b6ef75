//! How well the descriptor tells places apart: pairs of panoramas of one place on different days, and all others.

use fht_robot::descriptor::{DescribeError, DescriptorNet};
use fht_robot::pose::{Point2, Pose2, pose};
use fht_sim::{SimConfig, Simulator, World};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::sync::Arc;

/// Which pairs are drawn.
#[derive(Clone, Debug)]
pub struct PairConfig {
    /// Places. Default 80.
    pub places: u64,
    /// The second visit is up to this far from the first, metres. Default 1.
    pub apart_m: f64,
    /// Light of the first and of the second day.
    pub light_seeds: (u64, u64),
    /// Places at least this far apart are different, metres. Default 5.
    pub different_m: f64,
    /// Seed of places and headings.
    pub seed: u64,
}

impl Default for PairConfig {
    fn default() -> Self {
        Self { places: 80, apart_m: 1.0, light_seeds: (0, 7), different_m: 5.0, seed: 1 }
    }
}

/// One place, seen twice: where, and the descriptors.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Where the first panorama was taken, world frame.
    pub first: Point2,
    /// Where the second was taken.
    pub second: Point2,
    /// Descriptors of both.
    pub descriptors: (Vec<f32>, Vec<f32>),
}

/// Visits places of a world twice: another day, another heading, up to `apart_m` away within sight.
///
/// # Errors
/// When the network fails.
pub fn visit_twice(
    world: &Arc<World>,
    config: &PairConfig,
    mut describe: impl FnMut(&mut Simulator) -> Result<Vec<f32>, DescribeError>,
) -> Result<Vec<Pair>, DescribeError> {
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut look = |at: Pose2, light_seed: u64, seed: u64| {
        let sim_config = SimConfig { light_seed, ..SimConfig::default() };
        describe(&mut Simulator::new(world.clone(), sim_config, at, seed))
    };
    let mut pairs = Vec::new();
    for place in 0..config.places {
        let first = world.random_free_pose(config.seed * 10_000 + place, 0.3);
        let at = Point2::from(first.translation.vector);
        // A second place nearby that the robot could drive straight to.
        let second = (0..100)
            .map(|_| {
                let (angle, distance) =
                    (rng.random_range(0.0..std::f64::consts::TAU), rng.random_range(0.0..config.apart_m));
                at + nalgebra::Vector2::new(angle.cos(), angle.sin()) * distance
            })
            .find(|there| world.plan().is_clear(at, *there, 0.15))
            .unwrap_or(at);
        let heading = rng.random_range(0.0..std::f64::consts::TAU);
        let descriptors = (
            look(first, config.light_seeds.0, place)?,
            look(pose(second.x, second.y, heading), config.light_seeds.1, place + 1_000_000)?,
        );
        pairs.push(Pair { first: at, second, descriptors });
    }
    Ok(pairs)
}

/// Describes what a simulator's robot sees now.
///
/// # Errors
/// When the network fails or there is no panorama.
pub fn describe_view(net: &mut DescriptorNet, simulator: &mut Simulator) -> Result<Vec<f32>, DescribeError> {
    let frame = simulator.sense_first();
    net.describe(frame.panorama.as_ref().ok_or(DescribeError::Empty)?)
}

/// How well places are told apart.
#[derive(Clone, Debug, Serialize)]
pub struct Separation {
    /// Share of second visits whose most similar first visit is the right one, or within a second visit's distance.
    pub recall_at_1: f64,
    /// Share of second visits whose right first visit is above the threshold.
    pub matched: f64,
    /// Share of pairs of different places above the threshold.
    pub false_matches: f64,
    /// Share of second visits whose most similar first visit is above the threshold and of a different place.
    pub wrong_best: f64,
    /// Mean cosine of one place.
    pub same_mean: f64,
    /// Mean cosine of different places.
    pub different_mean: f64,
    /// The threshold.
    pub threshold: f64,
    /// The threshold at which one pair of different places in a hundred is above.
    pub threshold_at_1_percent: f64,
    /// Share matched at that threshold.
    pub matched_at_1_percent: f64,
}

fn cosine(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// Scores pairs of one world.
#[must_use]
pub fn separation(pairs: &[Pair], config: &PairConfig, threshold: f64) -> Separation {
    let mut same = Vec::new();
    let mut different = Vec::new();
    let (mut right, mut wrong_best) = (0_usize, 0_usize);
    for pair in pairs {
        let query = &pair.descriptors.1;
        same.push(cosine(query, &pair.descriptors.0));
        let scored =
            pairs.iter().map(|other| (cosine(query, &other.descriptors.0), (other.first - pair.second).norm()));
        different.extend(scored.clone().filter(|(_, metres)| *metres >= config.different_m).map(|(score, _)| score));
        if let Some((score, metres)) = scored.max_by(|a, b| a.0.total_cmp(&b.0)) {
            right += usize::from(metres <= config.apart_m);
            wrong_best += usize::from(metres >= config.different_m && score >= threshold);
        }
    }
    different.sort_by(f64::total_cmp);
    let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    let above = |scores: &[f64], threshold: f64| {
        share(scores.iter().filter(|score| **score >= threshold).count(), scores.len())
    };
    let mean = |scores: &[f64]| scores.iter().sum::<f64>() / scores.len().max(1) as f64;
    let at_1_percent = different.get(different.len() * 99 / 100).copied().unwrap_or(1.0);
    Separation {
        recall_at_1: share(right, pairs.len()),
        matched: above(&same, threshold),
        false_matches: above(&different, threshold),
        wrong_best: share(wrong_best, pairs.len()),
        same_mean: mean(&same),
        different_mean: mean(&different),
        threshold,
        threshold_at_1_percent: at_1_percent,
        matched_at_1_percent: above(&same, at_1_percent),
    }
}
