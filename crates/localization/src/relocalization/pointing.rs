//! Where somebody says that the robot is: people point about right, or quite wrong. What fits the
//! scan around there is a candidate like all others, with no more weight than what is seen gives
//! it.

use crate::hypotheses::{Hypothesis, SensedView, WeighConfig, held};
use crate::landmarks::Landmarks;
use fht_perception::matching::MatchConfig;
use fht_perception::pose::{Pose2, pose};

/// How far from the place that was pointed at it is looked, metres along x and y. A fit corrects
/// half a metre.
const ASIDE_M: [f64; 3] = [0.0, -0.6, 0.6];
/// How far from the heading, radians. A fit corrects 0.2.
const TURNED_RAD: [f64; 5] = [0.0, -0.3, 0.3, -0.6, 0.6];
/// Fits nearer to each other than this are one, metres and radians.
const SAME: (f64, f64) = (0.1, 0.05);

/// The place around `map_from_base` that the newest view fits best, and all views say most for;
/// `None` if it fits nowhere there.
pub(super) fn best_around(
    map_from_base: &Pose2,
    views: &[SensedView],
    landmarks: &Landmarks,
    matching: &MatchConfig,
    config: &WeighConfig,
) -> Option<Hypothesis> {
    let last = views.last()?;
    let (at, yaw) = (map_from_base.translation, map_from_base.rotation.angle());
    let mut found: Vec<Hypothesis> = Vec::new();
    for (dx, dy) in ASIDE_M.iter().flat_map(|dx| ASIDE_M.map(|dy| (dx, dy))) {
        for turn in TURNED_RAD {
            let guess = pose(at.x + dx, at.y + dy, yaw + turn);
            let Some(fit) = held(&guess, &last.points, landmarks, matching) else { continue };
            if !found.iter().any(|known| known.is_near(&fit, SAME.0, SAME.1)) {
                found.push(Hypothesis::new(&fit, views, landmarks, config));
            }
        }
    }
    found.into_iter().max_by(|a, b| a.weight(config).total_cmp(&b.weight(config)))
}
