//! One system on one recorded drive: when it knew where it was, and how well.

use crate::drive::Sight;
use crate::systems::Localizing;
use fht_perception::pose::Pose2;
use fht_sim::scoring::pose_error;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// The paper's test of success.
const RIGHT_M: f64 = 1.0;
/// The same for the heading, degrees.
const RIGHT_DEG: f64 = 5.0;

/// A pose that a system gave.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialFix {
    /// Distance driven until then, metres.
    pub driven_m: f64,
    /// Distance from the truth, metres.
    pub error_m: f64,
    /// Angle to the truth, degrees.
    pub error_deg: f64,
}

impl TrialFix {
    /// Within 1 m and 5°.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.error_m < RIGHT_M && self.error_deg < RIGHT_DEG
    }
}

/// The result of a drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrialOutcome {
    /// The first pose that was declared and right. The drive ends with it.
    pub right: Option<TrialFix>,
    /// How often a wrong pose was declared.
    pub false_fixes: usize,
    /// The first pose that was right, declared or not.
    pub guessed: Option<TrialFix>,
    /// Distance from the start to the map's origin, metres. The paper's ε_t is a share of it.
    pub to_origin_m: f64,
    /// Distance driven altogether, metres.
    pub driven_m: f64,
    /// Time per frame, network included, milliseconds: mean and greatest.
    pub frame_ms: [f64; 2],
}

/// Lets `system` follow a drive until it is right.
pub fn run_trial(system: &mut dyn Localizing, sight: &mut Sight<'_>, world_from_map: &Pose2) -> TrialOutcome {
    let map_from_world = world_from_map.inverse();
    let drive = sight.drive();
    let mut outcome = TrialOutcome::default();
    if let Some(first) = drive.moments.first() {
        outcome.to_origin_m = (map_from_world * first.world_from_base).translation.vector.norm();
    }
    let (mut was_wrong, mut times) = (false, Vec::with_capacity(drive.moments.len()));
    for (index, moment) in drive.moments.iter().enumerate() {
        let (mut looking, mut network) = (Duration::ZERO, Duration::ZERO);
        let begin = Instant::now();
        let declared = system.update(&moment.frame, &mut || {
            // The picture may have been described for another system before, so the network's time
            // is added, and the simulator's is not.
            let begin = Instant::now();
            let (descriptor, took) = sight.describe(index);
            (looking, network) = (looking + begin.elapsed(), network + took);
            descriptor
        });
        times.push((begin.elapsed().saturating_sub(looking) + network).as_secs_f64() * 1e3);
        let truth = map_from_world * moment.world_from_base;
        let judge = |pose: Pose2| {
            let (error_m, error_deg) = pose_error(&pose, &truth);
            TrialFix { driven_m: moment.driven_m, error_m, error_deg }
        };
        outcome.driven_m = moment.driven_m;
        let declared = declared.map(judge);
        outcome.guessed = outcome.guessed.or_else(|| declared.or(system.guess().map(judge)).filter(TrialFix::is_right));
        outcome.right = declared.filter(TrialFix::is_right);
        if outcome.right.is_some() {
            break;
        }
        let is_wrong = declared.is_some();
        outcome.false_fixes += usize::from(is_wrong && !was_wrong);
        was_wrong = is_wrong;
    }
    let mean = times.iter().sum::<f64>() / times.len().max(1) as f64;
    outcome.frame_ms = [mean, times.iter().copied().fold(0.0, f64::max)];
    outcome
}
