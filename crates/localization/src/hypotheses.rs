//! Where the robot may be: a handful of places, carried along the odometry and weighed by all that
//! was seen on the way.
//!
//! Each hypothesis is one place of the odometry frame on the map. Every view counts for or against
//! it: beams that the map explains or contradicts, and pictures that look like those of the nodes
//! there or do not. A corridor that looks like another is two hypotheses of nearly the same weight,
//! until something tells them apart.

use crate::landmarks::Landmarks;
use fht_perception::evidence_grid::{BeamVerdict, Beams, Evidence, EvidenceConfig};
use fht_perception::matching::{MatchConfig, refine};
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use fht_perception::scan_odometry::Odometry;
use fht_perception::square::one_per_square;
use fht_proto::NodeId;
use serde::{Deserialize, Serialize};

/// How hypotheses are weighed.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WeighConfig {
    /// Independent beams that one view counts as: neighbouring beams see the same wall. Default 12.
    pub beams_per_view: f64,
    /// Cost of a beam that cannot be, natural logarithm of a likelihood ratio. Default 4.
    pub contradiction_cost: f64,
    /// Cost of a beam that ends where nobody looked. Default 0.2: there may be anything.
    pub silence_cost: f64,
    /// Cost of a beam if the robot is nowhere on the map. Default 0.7: as much as one in seven that
    /// cannot be.
    pub nowhere_cost: f64,
    /// A view that looks like a node near, or like none, counts this much at most, natural
    /// logarithm. Default 1.5.
    pub look_weight: f64,
    /// All views together count this much at most: what they see is much the same. Default 3.
    pub looks_weight: f64,
    /// It counts that much when the cosine is this far above the model's threshold, or below.
    /// Default 0.1.
    pub look_span: f64,
    /// Nodes within this distance should look like what the robot sees, metres. Default 3.5.
    pub look_radius_m: f64,
    /// How beams are counted.
    pub evidence: EvidenceConfig,
}

impl Default for WeighConfig {
    fn default() -> Self {
        Self {
            beams_per_view: 12.0,
            contradiction_cost: 4.0,
            silence_cost: 0.2,
            nowhere_cost: 0.7,
            look_weight: 1.5,
            looks_weight: 3.0,
            look_span: 0.1,
            look_radius_m: 3.5,
            evidence: EvidenceConfig::default(),
        }
    }
}

/// What the robot saw at one place.
pub struct SensedView {
    /// Where odometry said it was.
    pub odometry: Odometry,
    /// End points of its scan, base frame.
    pub points: Vec<Point2>,
    /// The same scan by direction.
    pub beams: Beams,
    /// How much the nodes look like what it saw, above the model's threshold (below: negative);
    /// none without a picture.
    pub alike: Vec<(NodeId, f32)>,
    /// The model's threshold: the cosine from which two pictures are of one place.
    pub match_threshold: f32,
}

/// Where the odometry says that views were taken, odometry frame.
pub(crate) fn odometry_poses(views: &[SensedView]) -> Vec<Pose2> {
    views.iter().map(|view| view.odometry.odom_from_base).collect()
}

/// End points of the scans of the last `metres`, evenly spread, in the frame of the last view.
/// `poses` say where each of `views` was taken, in any one frame.
pub(crate) fn points_seen(views: &[SensedView], poses: &[Pose2], metres: f64) -> Vec<Point2> {
    /// Side of the squares of which one point each is kept, metres.
    const SQUARE_M: f64 = 0.25;
    let Some((last, now)) = views.last().zip(poses.last()) else { return Vec::new() };
    let now_from_frame = now.inverse();
    let is_near = |(view, _): &(&SensedView, &Pose2)| last.odometry.odometer_m - view.odometry.odometer_m <= metres;
    let newest_first = views.iter().zip(poses).rev().take_while(is_near);
    let points = newest_first.flat_map(|(view, pose)| {
        let now_from_view = now_from_frame * pose;
        view.points.iter().map(move |point| now_from_view * point)
    });
    one_per_square(points, SQUARE_M)
}

/// What says where a view was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hold {
    /// The walls that it sees.
    Walls,
    /// The odometry alone.
    Odometry,
    /// The odometry alone: the walls around the place that a later view tells did not hold it.
    Nothing,
}

/// A place where the robot may be.
#[derive(Clone, Debug, Default)]
pub struct Hypothesis {
    /// Where each of the views was taken, map frame, oldest first.
    pub at: Vec<Pose2>,
    /// What each beam of each view says.
    pub verdicts: Vec<Vec<Option<BeamVerdict>>>,
    /// The same, summed up.
    evidence: Vec<Evidence>,
    /// What each view looks like: for it or against it.
    looks: Vec<f64>,
    /// What says where each of the views was taken.
    holds: Vec<Hold>,
    /// Whether the walls held the newest view there.
    pub is_held: bool,
}

impl Hypothesis {
    /// The robot at `map_from_base` when the last of `views` was taken; before, where the odometry
    /// says.
    #[must_use]
    pub fn new(map_from_base: &Pose2, views: &[SensedView], landmarks: &Landmarks, config: &WeighConfig) -> Self {
        let Some(last) = views.last() else { return Self::default() };
        let map_from_odom = map_from_base * last.odometry.odom_from_base.inverse();
        let poses = views.iter().map(|view| map_from_odom * view.odometry.odom_from_base);
        let mut hypothesis = Self::along(poses, views, landmarks, config);
        hypothesis.holds = vec![Hold::Odometry; views.len() - 1];
        hypothesis.holds.push(Hold::Walls);
        hypothesis
    }

    /// The robot at `map_from_base` when the last of `views` was taken; before, where the odometry
    /// says, held to the walls at each view.
    #[must_use]
    pub fn traced_back(
        map_from_base: &Pose2,
        views: &[SensedView],
        landmarks: &Landmarks,
        matching: &MatchConfig,
        config: &WeighConfig,
    ) -> Self {
        let (mut here, mut later) = (*map_from_base, None::<&SensedView>);
        let mut at: Vec<Pose2> = Vec::with_capacity(views.len());
        for view in views.iter().rev() {
            if let Some(later) = later {
                let back = later.odometry.odom_from_base.inverse() * view.odometry.odom_from_base;
                here = held(&(here * back), &view.points, landmarks, matching).unwrap_or(here * back);
            }
            at.push(here);
            later = Some(view);
        }
        Self::along(at.into_iter().rev(), views, landmarks, config)
    }

    /// The robot at `map_from_base` when the last of `views` was taken; before, along the way of
    /// `other`, moved so that it ends there.
    #[must_use]
    pub fn driven_as(
        map_from_base: &Pose2,
        other: &Self,
        views: &[SensedView],
        landmarks: &Landmarks,
        config: &WeighConfig,
    ) -> Self {
        let moved = map_from_base * other.map_from_base().inverse();
        Self::along(other.at.iter().map(|at| moved * at), views, landmarks, config)
    }

    /// The robot at `poses` when `views` were taken.
    fn along(
        poses: impl Iterator<Item = Pose2>,
        views: &[SensedView],
        landmarks: &Landmarks,
        config: &WeighConfig,
    ) -> Self {
        let mut hypothesis = Self { is_held: true, ..Self::default() };
        poses.zip(views).for_each(|(at, view)| hypothesis.add((at, Hold::Nothing), view, landmarks, config));
        hypothesis
    }

    fn add(&mut self, (at, hold): (Pose2, Hold), view: &SensedView, landmarks: &Landmarks, config: &WeighConfig) {
        let verdicts = landmarks.walls().known.judge(&view.beams, &at, &config.evidence);
        self.at.push(at);
        self.evidence.push(Evidence::of(&verdicts));
        self.verdicts.push(verdicts);
        self.looks.push(look_weight(&at, view, landmarks, config));
        self.holds.push(hold);
    }

    /// Holds views to the walls that only the odometry has placed so far, from the newest back: the
    /// odometry drifts and slips, and a place that was found late would look wrong where the robot
    /// came from. Each view is tried once, and moved only if it then says more for the place.
    pub fn hold_earlier(
        &mut self,
        views: &[SensedView],
        landmarks: &Landmarks,
        matching: &MatchConfig,
        config: &WeighConfig,
    ) {
        for index in (0..self.at.len().saturating_sub(1)).rev() {
            let (Hold::Odometry, Hold::Walls | Hold::Nothing) = (self.holds[index], self.holds[index + 1]) else {
                continue;
            };
            let (view, later) = (&views[index], &views[index + 1]);
            let back = later.odometry.odom_from_base.inverse() * view.odometry.odom_from_base;
            let guess = self.at[index + 1] * back;
            let found = held(&guess, &view.points, landmarks, matching);
            self.holds[index] = if found.is_some() { Hold::Walls } else { Hold::Nothing };
            let at = found.unwrap_or(guess);
            let verdicts = landmarks.walls().known.judge(&view.beams, &at, &config.evidence);
            let evidence = Evidence::of(&verdicts);
            if beam_weight(&evidence, config) > beam_weight(&self.evidence[index], config) {
                self.at[index] = at;
                self.evidence[index] = evidence;
                self.verdicts[index] = verdicts;
                self.looks[index] = look_weight(&at, view, landmarks, config);
            }
        }
    }

    /// Carries it to a further view, where it is held to the walls again.
    pub fn carry(
        &mut self,
        from: &Odometry,
        view: &SensedView,
        landmarks: &Landmarks,
        matching: &MatchConfig,
        config: &WeighConfig,
    ) {
        let Some(before) = self.at.last() else { return };
        let predicted = before * (from.odom_from_base.inverse() * view.odometry.odom_from_base);
        let at = held(&predicted, &view.points, landmarks, matching);
        self.is_held = at.is_some();
        let hold = if self.is_held { Hold::Walls } else { Hold::Odometry };
        self.add((at.unwrap_or(predicted), hold), view, landmarks, config);
    }

    /// Forgets the view of this index.
    pub fn forget(&mut self, index: usize) {
        self.at.remove(index);
        self.verdicts.remove(index);
        self.evidence.remove(index);
        self.looks.remove(index);
        self.holds.remove(index);
    }

    /// Whether the last view alone makes it less than `most` (natural logarithm) likely.
    #[must_use]
    pub fn is_worth_a_look(
        at: &Pose2,
        view: &SensedView,
        landmarks: &Landmarks,
        most: f64,
        config: &WeighConfig,
    ) -> bool {
        let evidence = landmarks.walls().known.weigh(&view.beams, at, &config.evidence);
        beam_weight(&evidence, config) > -most
    }

    /// What all views say: natural logarithm of a likelihood, up to a constant.
    #[must_use]
    pub fn weight(&self, config: &WeighConfig) -> f64 {
        let looks: f64 = self.looks.iter().sum();
        let walls: f64 = self.evidence.iter().map(|evidence| beam_weight(evidence, config)).sum();
        walls + looks.clamp(-config.looks_weight, config.looks_weight)
    }

    /// How much more of what all views saw this place explains than `other`, as the natural
    /// logarithm of a likelihood ratio. Of each view's difference, `alike_share` of the beams do
    /// not count.
    #[must_use]
    pub fn wall_margin(&self, other: &Self, alike_share: f64, config: &WeighConfig) -> f64 {
        let views = self.evidence.iter().zip(&other.evidence);
        let more = views.map(|(here, there)| here.explained_share() - there.explained_share());
        let counted: f64 = more.map(|more| more - more.clamp(-alike_share, alike_share)).sum();
        config.beams_per_view * config.contradiction_cost * counted
    }

    /// What the beams of all views say.
    #[must_use]
    pub fn evidence(&self) -> Evidence {
        let mut sum = Evidence::default();
        self.evidence.iter().for_each(|evidence| sum.add(*evidence));
        sum
    }

    /// The robot in the map frame when the last view was taken.
    #[must_use]
    pub fn map_from_base(&self) -> Pose2 {
        self.at.last().copied().unwrap_or_else(Pose2::identity)
    }

    /// Whether both say nearly the same place.
    #[must_use]
    pub fn is_near(&self, map_from_base: &Pose2, metres: f64, radians: f64) -> bool {
        is_near(&self.map_from_base(), map_from_base, metres, radians)
    }
}

/// Whether two poses are nearer than this.
pub fn is_near(one: &Pose2, other: &Pose2, metres: f64, radians: f64) -> bool {
    let apart = one.translation.vector - other.translation.vector;
    let turn = wrap_angle(one.rotation.angle() - other.rotation.angle());
    apart.norm() < metres && turn.abs() < radians
}

/// A correction of more than this is another place, metres.
const MOST_CORRECTION_M: f64 = 0.5;
/// The same for headings, radians.
const MOST_CORRECTION_RAD: f64 = 0.2;

/// `guess`, held to the walls by `points` that were seen, base frame; `None` where too few fit.
#[must_use]
pub fn held(guess: &Pose2, points: &[Point2], landmarks: &Landmarks, matching: &MatchConfig) -> Option<Pose2> {
    // Half of the points say nearly as much as all of them.
    let points: Vec<Point2> = points.iter().step_by(2).copied().collect();
    let found = refine(&landmarks.walls().cloud, &points, guess, matching)?;
    let at = found.reference_from_moving;
    let is_same_place = is_near(&at, guess, MOST_CORRECTION_M, MOST_CORRECTION_RAD);
    (is_same_place && found.score >= matching.min_score).then_some(at)
}

fn beam_weight(evidence: &Evidence, config: &WeighConfig) -> f64 {
    let cost =
        config.contradiction_cost * evidence.contradicted_share() + config.silence_cost * evidence.silent_share();
    -config.beams_per_view * cost
}

/// How much a view looks like the nodes around `at`: for it or against it; nothing where there is
/// none.
fn look_weight(at: &Pose2, view: &SensedView, landmarks: &Landmarks, config: &WeighConfig) -> f64 {
    let near = view.alike.iter().filter(|(id, _)| {
        landmarks.get(*id).is_some_and(|node| {
            (node.map_from_node.translation.vector - at.translation.vector).norm() <= config.look_radius_m
        })
    });
    let best = near.map(|(_, above)| f64::from(*above)).max_by(f64::total_cmp);
    best.map_or(0.0, |best| config.look_weight * (best / config.look_span).clamp(-1.0, 1.0))
}
