//! Finding out where the robot is without a guess (paper, section III-C-1).
//!
//! What the robot sees is looked for in the whole map at once, where the scans of all main nodes
//! are one; nodes that look alike favour the places around them. What is found becomes hypotheses,
//! which are carried along the odometry and weighed by everything seen on the way. One is declared
//! when it is nearly certain, rests on more than one place, and the single estimations from these
//! places agree. Otherwise the robot says that it does not know.

mod ambiguity;
mod config;
mod pointing;

pub use config::RelocalizationConfig;

use self::ambiguity::{not_told_apart, odds_of_others, probabilities, sigmas_ahead};
use self::pointing::best_around;
use crate::distinction::{Grounds, PictureWord};
use crate::hypotheses::{Hypothesis, SensedView, held, odometry_poses, points_seen};
use crate::landmarks::Landmarks;
use crate::place_evidence::{Judged, PlaceEvidence};
use crate::pose_fix::{Fix, fix_pose};
use crate::votes::{Votes, least};
use crate::wall_squares::WallSquares;
use fht_perception::candidate::{Candidate, PossiblePlace};
use fht_perception::evidence_grid::Beams;
use fht_perception::frame::LaserScan;
use fht_perception::matching::{Favour, MatchConfig};
use fht_perception::pose::{Point2, Pose2};
use fht_perception::scan_odometry::Odometry;
use fht_proto::Descriptor;

/// What the robot senses at one place.
#[derive(Clone, Copy, Debug)]
pub struct Sensed<'a> {
    /// Where odometry says it is.
    pub odometry: Odometry,
    /// Its scan.
    pub scan: &'a LaserScan,
    /// End points of the scan, base frame.
    pub points: &'a [Point2],
    /// The descriptor of what it sees, if there are cameras and light.
    pub descriptor: Option<&'a Descriptor>,
}

/// What the robot knows of where it is.
#[derive(Clone, Debug)]
pub enum Belief {
    /// Nothing fits.
    NotLocalized,
    /// Something fits, but too little or too ambiguously.
    Candidates {
        /// Places where the robot may be.
        hypotheses: usize,
        /// Probability of the likeliest.
        confidence: f64,
    },
    /// It knows.
    Localized(Fix),
}

/// What is thought of the likeliest place, and how sure a robot must be to stand by it.
#[derive(Clone, Copy, Debug)]
struct Judgement {
    for_it: PlaceEvidence,
    confidence: f64,
    /// Share of what was seen that cannot be.
    contradicted: f64,
    /// The least confidence that suffices.
    least: f64,
}

/// Keeps hypotheses, and weighs them by views.
pub struct Relocalizer {
    config: RelocalizationConfig,
    views: Vec<SensedView>,
    /// Heaviest first.
    hypotheses: Vec<Hypothesis>,
    evidence: Option<PlaceEvidence>,
    ambiguity: Vec<Candidate>,
    /// Odds of the hypotheses after the first, as many as are told, as of the last look.
    others_odds: Vec<f64>,
    /// Where somebody says that the odometry frame is on the map, until it was looked there.
    pointed_at: Option<Pose2>,
    /// How many have walked by of late.
    walkers: usize,
}

impl Relocalizer {
    /// Knows nothing.
    #[must_use]
    pub fn new(config: RelocalizationConfig) -> Self {
        Self {
            config,
            views: Vec::new(),
            hypotheses: Vec::new(),
            evidence: None,
            ambiguity: Vec::new(),
            others_odds: Vec::new(),
            pointed_at: None,
            walkers: 0,
        }
    }

    /// The configuration.
    #[must_use]
    pub fn config(&self) -> &RelocalizationConfig {
        &self.config
    }

    /// Where the robot may be, likeliest first.
    #[must_use]
    pub fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses
    }

    /// What speaks for the likeliest place, as of the last look.
    #[must_use]
    pub fn evidence(&self) -> Option<&PlaceEvidence> {
        self.evidence.as_ref()
    }

    /// The likeliest places of the robot now that odometry says `odom_from_base`, likeliest first,
    /// when the first one is right with `confidence`.
    #[must_use]
    pub fn candidates(&self, odom_from_base: &Pose2, confidence: f64) -> Vec<PossiblePlace> {
        let Some(last) = self.views.last() else { return Vec::new() };
        let since = last.odometry.odom_from_base.inverse() * odom_from_base;
        let places = self.hypotheses.iter().map(|hypothesis| hypothesis.map_from_base() * since);
        let possible = |(map_from_base, probability)| PossiblePlace { map_from_base, probability };
        places.zip(probabilities(confidence, &self.others_odds)).map(possible).collect()
    }

    /// The places that all that was seen does not tell apart, as of the last look, most probable
    /// first. A single one has no rival.
    #[must_use]
    pub fn ambiguity(&self) -> &[Candidate] {
        &self.ambiguity
    }

    /// Forgets everything, as after being carried off.
    pub fn clear(&mut self) {
        self.ambiguity.clear();
        self.others_odds.clear();
        self.views.clear();
        self.hypotheses.clear();
        self.evidence = None;
    }

    /// Somebody says that the odometry frame lies at `map_from_odom`, rightly or not: with the next
    /// view it is looked around there, too. What fits is one more hypothesis, weighed as all are.
    pub fn point_at(&mut self, map_from_odom: Pose2) {
        self.pointed_at = Some(map_from_odom);
    }

    /// So many people have walked by of late: some may stand, where the map is free.
    pub fn expect_people(&mut self, walkers: usize) {
        self.walkers = walkers;
    }

    /// Takes in what the robot senses now and says what it knows then.
    pub fn observe(&mut self, landmarks: &Landmarks, observation: &Sensed<'_>) -> Belief {
        if landmarks.is_empty() {
            self.clear();
            return Belief::NotLocalized;
        }
        let view = self.view(landmarks, observation);
        self.carry(landmarks, view);
        if let Some(map_from_odom) = self.pointed_at.take() {
            self.look_at(&(map_from_odom * observation.odometry.odom_from_base), landmarks);
        }
        let points = points_seen(&self.views, &odometry_poses(&self.views), self.config.search_memory_m);
        self.find_more(&points, landmarks);
        self.sort();
        for hypothesis in &mut self.hypotheses {
            hypothesis.hold_earlier(&self.views, landmarks, &self.config.matching, &self.config.weigh);
        }
        self.sort();
        let squares = WallSquares::of(&self.views, self.config.square_m);
        let mut votes: Vec<Votes> = self.hypotheses.iter().map(|place| squares.votes(&place.verdicts)).collect();
        self.put_clearest_first(&mut votes);
        let odom_from_base = &observation.odometry.odom_from_base;
        self.ambiguity = not_told_apart(&self.hypotheses, &votes, odom_from_base, &self.config);
        self.others_odds = odds_of_others(&self.hypotheses, &votes, &self.config);
        self.evidence = self.hypotheses.first().map(|best| self.weigh(best, &votes, &squares, landmarks));
        self.judge(&points, &squares, landmarks)
    }

    /// Looks around a place that somebody pointed at.
    fn look_at(&mut self, map_from_base: &Pose2, landmarks: &Landmarks) {
        let config = &self.config;
        let (x, y) = (map_from_base.translation.x, map_from_base.translation.y);
        match best_around(map_from_base, &self.views, landmarks, &config.matching, &config.weigh) {
            None => tracing::warn!(x, y, "what the scanner sees does not fit the place that was pointed at"),
            Some(found) => {
                let at = found.map_from_base();
                tracing::info!(
                    x = at.translation.x,
                    y = at.translation.y,
                    "the place that was pointed at is looked at"
                );
                if !self.hypotheses.iter().any(|known| known.is_near(&at, config.same_m, config.same_rad)) {
                    self.hypotheses.push(found);
                }
            }
        }
    }

    fn view(&self, landmarks: &Landmarks, observation: &Sensed<'_>) -> SensedView {
        let model = observation.descriptor.map(|descriptor| descriptor.model);
        let of_model = || landmarks.match_threshold(model?);
        let match_threshold = self.config.min_similarity.or_else(of_model).unwrap_or(0.0);
        let alike = observation.descriptor.map_or_else(Vec::new, |descriptor| {
            let similarities = landmarks.similarities(descriptor);
            similarities.into_iter().map(|(id, similarity)| (id, similarity - match_threshold)).collect()
        });
        SensedView {
            odometry: observation.odometry,
            points: observation.points.to_vec(),
            beams: Beams::of(observation.scan, &self.config.weigh.evidence),
            alike,
            match_threshold,
        }
    }

    /// Takes the hypotheses to a new view, and makes room for it: views are apart, but for the
    /// newest.
    fn carry(&mut self, landmarks: &Landmarks, view: SensedView) {
        let config = &self.config;
        let (spacing_m, most) = (config.view_spacing_m, config.views.max(2));
        if let Some(before) = self.views.last().map(|last| last.odometry) {
            for (rank, hypothesis) in self.hypotheses.iter_mut().enumerate() {
                let matching = MatchConfig {
                    // No fit is good enough for those that only follow the odometry.
                    min_score: if rank < config.held { config.matching.min_score } else { f64::INFINITY },
                    ..config.matching.clone()
                };
                hypothesis.carry(&before, &view, landmarks, &matching, &config.weigh);
            }
        }
        self.views.push(view);
        let place = |view: &SensedView| view.odometry.odom_from_base.translation.vector;
        let crowded = match self.views.as_slice() {
            [.., before, middle, _] => (place(before) - place(middle)).norm() < spacing_m,
            _ => false,
        };
        if crowded {
            self.forget(self.views.len() - 2);
        }
        while self.views.len() > most {
            self.forget(0);
        }
    }

    fn forget(&mut self, index: usize) {
        self.views.remove(index);
        self.hypotheses.iter_mut().for_each(|hypothesis| hypothesis.forget(index));
    }

    /// Looks for what was seen lately in the whole map.
    fn find_more(&mut self, points: &[Point2], landmarks: &Landmarks) {
        let config = &self.config;
        let Some((last, Some(pyramid))) = self.views.last().map(|last| (last, &landmarks.walls().pyramid)) else {
            return;
        };
        // A cell or half a step off, the true place looks worse than it is, but not as bad as this.
        let hopeless = 2.0 * config.weigh.beams_per_view * config.weigh.nowhere_cost;
        let alignments = pyramid.find(points, &self.favours(landmarks, last));
        for alignment in alignments {
            let known = |at: &Pose2| {
                self.hypotheses.iter().any(|hypothesis| hypothesis.is_near(at, config.same_m, config.same_rad))
            };
            let rough = &alignment.map_from_scan;
            if known(rough) || !Hypothesis::is_worth_a_look(rough, last, landmarks, hopeless, &config.weigh) {
                continue;
            }
            let Some(at) = held(&alignment.map_from_scan, &last.points, landmarks, &config.matching) else { continue };
            if known(&at) {
                continue;
            }
            self.hypotheses.push(Hypothesis::new(&at, &self.views, landmarks, &config.weigh));
        }
    }

    /// The places around nodes that look like what the robot sees.
    fn favours(&self, landmarks: &Landmarks, view: &SensedView) -> Vec<Favour> {
        let config = &self.config;
        let span = config.weigh.look_span as f32;
        let mut alike: Vec<(Point2, f64)> = view
            .alike
            .iter()
            .filter(|(_, above)| *above > -span)
            .filter_map(|(id, above)| {
                let node = landmarks.get(*id)?;
                let share = f64::from((above + span) / (2.0 * span)).min(1.0);
                Some((Point2::from(node.map_from_node.translation.vector), share))
            })
            .collect();
        alike.sort_by(|a, b| b.1.total_cmp(&a.1));
        alike.truncate(config.favoured);
        let favour =
            |(centre, share)| Favour { centre, radius_m: config.favour_radius_m, bonus: config.favour * share };
        alike.into_iter().map(favour).collect()
    }

    fn sort(&mut self) {
        let config = &self.config;
        let weight = |hypothesis: &Hypothesis| hypothesis.weight(&config.weigh);
        self.hypotheses.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        let mut kept: Vec<Hypothesis> = Vec::new();
        for hypothesis in self.hypotheses.drain(..) {
            let at = hypothesis.map_from_base();
            let is_light = kept.first().is_some_and(|best| weight(&hypothesis) < weight(best) - config.drop_below);
            let is_double = kept.iter().any(|other| other.is_near(&at, 0.5 * config.same_m, 0.5 * config.same_rad));
            if !is_light && !is_double && kept.len() < config.hypotheses {
                kept.push(hypothesis);
            }
        }
        self.hypotheses = kept;
    }

    /// The order is by what contradicts a place, which favours places at the edge of the map, where
    /// little can. A place is likelier for which clearly more pieces of wall vote.
    fn put_clearest_first(&mut self, votes: &mut [Votes]) {
        let Some(first) = votes.first() else { return };
        let ahead: Vec<f64> = votes.iter().map(|other| other.sigmas_over(first)).collect();
        // Among equals the first.
        let clearest = (0..ahead.len()).rev().max_by(|a, b| ahead[*a].total_cmp(&ahead[*b]));
        let Some(clearest) = clearest else { return };
        if ahead[clearest] >= self.config.confidence.distinct_sigmas {
            self.hypotheses[..=clearest].rotate_right(1);
            votes[..=clearest].rotate_right(1);
        }
    }

    /// What speaks for the first hypothesis, `best`, by the votes of all. Their order is by all
    /// that was seen, this by walls.
    fn weigh(&self, best: &Hypothesis, votes: &[Votes], squares: &WallSquares, landmarks: &Landmarks) -> PlaceEvidence {
        let judged = Judged { views: &self.views, squares, landmarks, evidence: &self.config.weigh.evidence };
        let rivals = self.hypotheses.iter().zip(votes).filter(|(other, _)| self.is_elsewhere(other, best));
        let ahead = rivals.map(|rival| sigmas_ahead((best, &votes[0]), rival, &self.config));
        judged.place(best, &votes[0], least(ahead), self.spread_m())
    }

    /// Hypotheses of other places than this.
    fn rivals<'a>(&'a self, place: &'a Hypothesis) -> impl Iterator<Item = &'a Hypothesis> {
        self.hypotheses.iter().filter(move |other| self.is_elsewhere(other, place))
    }

    fn is_elsewhere(&self, one: &Hypothesis, other: &Hypothesis) -> bool {
        !one.is_near(&other.map_from_base(), self.config.same_m, self.config.same_rad)
    }

    fn judge(&self, points: &[Point2], squares: &WallSquares, landmarks: &Landmarks) -> Belief {
        let config = &self.config;
        let Some((best, for_it)) = self.hypotheses.first().zip(self.evidence) else { return Belief::NotLocalized };
        let RelocalizationConfig { matching, weigh, same_m, same_rad, .. } = config;
        let same = (*same_m, *same_rad);
        let grounds = Grounds { views: &self.views, landmarks, matching, weigh, same };
        let pictures = grounds.pictures(best, &config.distinction);
        let sure = |for_it| self.confidence(for_it, best, self.rivals(best), pictures, squares, &grounds);
        let contradicted = best.evidence().contradicted_share();
        let first = Judgement { for_it, confidence: sure(for_it), contradicted, least: config.min_confidence };
        let candidates = Belief::Candidates { hypotheses: self.hypotheses.len(), confidence: first.confidence };
        tracing::debug!(
            hypotheses = self.hypotheses.len(),
            views = self.views.len(),
            walkers = self.walkers,
            ?first,
            ?pictures,
            "likeliest place"
        );
        // What may be people speaks against a place, unless nothing else does.
        let among_people = || {
            let for_it = for_it.among_people(config.pieces_per_walker * self.walkers as f64);
            let least = config.min_confidence_among_people.max(config.min_confidence);
            Judgement { for_it, confidence: sure(for_it), contradicted: for_it.contradicted(), least }
        };
        let is_enough = |it: &Judgement| it.confidence >= it.least && it.contradicted <= config.max_contradicted;
        let second = || (self.walkers > 0).then(among_people).filter(is_enough);
        let Some(judged) = Some(first).filter(is_enough).or_else(second) else { return candidates };
        if pictures == PictureWord::Refuses {
            return candidates;
        }
        let challengers = grounds.challengers(best, points, &config.distinction);
        let is_told = if pictures == PictureWord::Tells {
            self.confidence(judged.for_it, best, challengers.iter(), pictures, squares, &grounds) >= judged.least
        } else {
            grounds.walls_tell(best, self.rivals(best), &config.distinction)
                && grounds.walls_tell(best, challengers.iter(), &config.distinction)
        };
        if !is_told {
            return candidates;
        }
        match fix_pose(best, &self.views, landmarks, judged.confidence, &config.matching, &config.pose_fix) {
            Some(fix) if fix.sigma_m() <= config.max_sigma_m => Belief::Localized(fix),
            _ => candidates,
        }
    }

    /// How probable `best` is against `rivals`. Pictures that tell it from other places tell it
    /// from those rivals that they look less like, whatever the walls say.
    fn confidence<'a>(
        &self,
        for_it: PlaceEvidence,
        best: &Hypothesis,
        rivals: impl Iterator<Item = &'a Hypothesis>,
        pictures: PictureWord,
        squares: &WallSquares,
        grounds: &Grounds<'_>,
    ) -> f64 {
        let config = &self.config;
        let over_rivals_sigmas = if pictures == PictureWord::Tells {
            let votes = squares.votes(&best.verdicts);
            let alike = rivals.filter(|rival| !grounds.pictures_tell_from(best, rival, &config.distinction));
            let ahead =
                |rival: &Hypothesis| sigmas_ahead((best, &votes), (rival, &squares.votes(&rival.verdicts)), config);
            least(alike.map(ahead))
        } else {
            for_it.over_rivals_sigmas
        };
        config.confidence.probability(&PlaceEvidence { over_rivals_sigmas, ..for_it })
    }

    /// How far apart the views are.
    fn spread_m(&self) -> f64 {
        let places = || self.views.iter().map(|view| view.odometry.odom_from_base.translation.vector);
        places().flat_map(|a| places().map(move |b| (a - b).norm())).fold(0.0, f64::max)
    }
}
