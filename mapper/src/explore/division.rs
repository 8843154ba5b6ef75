//! Several explorers in one building: nobody goes where another one is going (after Burgard et al.,
//! "Coordinated multi-robot exploration", T-RO 2005: each robot discounts what others are about to
//! see).

use super::seen_squares::SeenSquares;
use fht_perception::pose::Point2;
use fht_proto::api::fleet::ExplorerGoal;
use fht_proto::{AuthorId, Square};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How work is divided.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DivisionConfig {
    /// What lies within this of another's goal is about to be seen by it, metres. Default 3.
    pub claim_m: f64,
    /// Unless this robot is nearer to it by this, along its path, metres. Default 1.
    pub nearer_m: f64,
    /// Factor of the utility of what is nearer to another robot, or to where that is going. Default
    /// 0.4.
    pub others_worth: f64,
    /// Factor of the utility of what only another robot has seen so far, while that one goes on.
    /// Default 0.5.
    pub told_worth: f64,
    /// A robot that has nothing left while others go on looks again this often, seconds. Default 3.
    pub look_again_s: f64,
    /// It has finished when none of the others has had a goal for so long, seconds. Default 8.
    pub quiet_s: f64,
}

impl Default for DivisionConfig {
    fn default() -> Self {
        Self { claim_m: 3.0, nearer_m: 1.0, others_worth: 0.4, told_worth: 0.5, look_again_s: 3.0, quiet_s: 8.0 }
    }
}

/// What another explorer is about.
#[derive(Clone, Debug, PartialEq)]
pub struct Teammate {
    /// Who.
    pub author: AuthorId,
    /// Where it is, map frame.
    pub at: Point2,
    /// What it is going to see, map frame.
    pub target: Option<Point2>,
    /// How far that is along its path, metres.
    pub remaining_m: f64,
    /// Whether it has nothing left to see.
    pub is_finished: bool,
    /// Whether it drives no more and is writing the last of its map.
    pub is_finishing: bool,
}

impl Teammate {
    /// What an explorer says of itself.
    #[must_use]
    pub fn new(author: AuthorId, goal: &ExplorerGoal) -> Self {
        let point = |[x, y]: [f64; 2]| Point2::new(x, y);
        Self {
            author,
            at: point(goal.at),
            target: goal.target.map(point),
            remaining_m: goal.remaining_m,
            is_finished: goal.finished,
            is_finishing: goal.finishing,
        }
    }
}

/// The others, and who has told of which part of the building.
#[derive(Clone, Debug, Default)]
pub struct Team {
    /// The other explorers that are there.
    pub mates: Vec<Teammate>,
    /// Where nodes are that others made, and who.
    pub told: Arc<Vec<(Point2, AuthorId)>>,
    /// What the others have seen.
    pub seen: Vec<Arc<SeenSquares>>,
}

/// A place that could be gone to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prospect {
    pub(super) target: Point2,
    /// Along this robot's path, metres.
    pub(super) distance_m: f64,
    /// Whether no scan of this robot's own has shown it.
    pub(super) is_told: bool,
    pub(super) is_gap: bool,
}

/// What a place is worth to this robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Worth {
    /// So much of its utility.
    Share(f64),
    /// Another robot is about to see it, or knows better.
    LeftToOthers,
    /// It was seen by one that has nothing left to see.
    Nothing,
}

impl Team {
    /// What a place is worth, given what the others are about.
    pub(super) fn worth(&self, prospect: &Prospect, config: &DivisionConfig) -> Worth {
        let mut share = 1.0;
        if prospect.is_told {
            match self.teller(prospect.target) {
                // It knows whether there is more to see there.
                Some(mate) if mate.is_finished && self.has_seen(mate.author, prospect.target) => return Worth::Nothing,
                Some(mate) if mate.is_finished => {}
                Some(_) if prospect.is_gap => return Worth::LeftToOthers,
                Some(_) => share *= config.told_worth,
                None => {}
            }
        }
        for mate in self.mates.iter().filter(|mate| !mate.is_finished) {
            let Some(target) = mate.target else { continue };
            let apart_m = (target - prospect.target).norm();
            if apart_m <= config.claim_m && mate.remaining_m <= prospect.distance_m + config.nearer_m {
                return Worth::LeftToOthers;
            }
            if apart_m.min((mate.at - prospect.target).norm()) < prospect.distance_m {
                share *= config.others_worth;
            }
        }
        Worth::Share(share)
    }

    /// Who has told of a place, if that one is there: the maker of the nearest node.
    fn teller(&self, place: Point2) -> Option<&Teammate> {
        let nearest = self.told.iter().min_by(|(a, _), (b, _)| (a - place).norm().total_cmp(&(b - place).norm()))?;
        self.mates.iter().find(|mate| mate.author == nearest.1)
    }

    /// Whether another is about to see `target`, which this robot `is_far` from, and is clearly
    /// nearer.
    pub(super) fn takes_over(&self, target: Point2, remaining_m: f64, config: &DivisionConfig) -> bool {
        self.mates.iter().filter(|mate| !mate.is_finished).any(|mate| {
            let is_same = mate.target.is_some_and(|other| (other - target).norm() <= config.claim_m);
            is_same && mate.remaining_m + config.nearer_m < remaining_m
        })
    }

    /// Whether a robot says that it has seen a place.
    fn has_seen(&self, author: AuthorId, place: Point2) -> bool {
        self.seen.iter().any(|seen| seen.author() == author && seen.square_at(place) != Square::Unseen)
    }

    /// Whether something counts that a robot says of what it has seen.
    pub(super) fn has_word_of(&self, author: AuthorId) -> bool {
        self.seen.iter().any(|seen| seen.author() == author)
    }

    /// Whether an explorer is there that has not finished.
    pub(super) fn is_at_work(&self, author: AuthorId) -> bool {
        self.mates.iter().any(|mate| mate.author == author && !mate.is_finished)
    }

    /// Whether some other explorer is on its way to something, or writes the last of its map.
    pub(super) fn is_busy(&self) -> bool {
        self.mates.iter().any(|mate| !mate.is_finished && (mate.target.is_some() || mate.is_finishing))
    }

    /// Whether some other explorer has not finished.
    pub(super) fn goes_on(&self) -> bool {
        self.mates.iter().any(|mate| !mate.is_finished)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::SeenArea;

    fn mate(author: u32, at: f64, target: Option<f64>, remaining_m: f64) -> Teammate {
        let place = |x: f64| Point2::new(x, 0.0);
        let target = target.map(place);
        Teammate {
            author: AuthorId(author),
            at: place(at),
            target,
            remaining_m,
            is_finished: false,
            is_finishing: false,
        }
    }

    fn prospect(x: f64, distance_m: f64) -> Prospect {
        Prospect { target: Point2::new(x, 0.0), distance_m, is_told: false, is_gap: false }
    }

    #[test]
    fn nobody_goes_where_another_one_is_going_unless_it_is_clearly_nearer() {
        let config = DivisionConfig::default();
        let team = Team { mates: vec![mate(2, 0.0, Some(10.0), 10.0)], ..Team::default() };
        assert_eq!(team.worth(&prospect(11.0, 12.0), &config), Worth::LeftToOthers);
        assert_eq!(team.worth(&prospect(11.0, 10.0), &config), Worth::LeftToOthers, "as near is not nearer");
        assert!(matches!(team.worth(&prospect(11.0, 3.0), &config), Worth::Share(_)));
        assert_eq!(team.worth(&prospect(-20.0, 5.0), &config), Worth::Share(1.0));
        assert_eq!(team.worth(&prospect(-20.0, 50.0), &config), Worth::Share(config.others_worth));
        assert!(team.takes_over(Point2::new(11.0, 0.0), 20.0, &config));
        assert!(!team.takes_over(Point2::new(11.0, 0.0), 10.5, &config));
        assert!(!team.takes_over(Point2::new(30.0, 0.0), 100.0, &config));
    }

    #[test]
    fn what_a_teammate_told_of_is_its_own_until_it_has_finished_or_is_gone() {
        let config = DivisionConfig::default();
        let told = Arc::new(vec![(Point2::new(5.0, 0.0), AuthorId(2)), (Point2::new(50.0, 0.0), AuthorId(3))]);
        let area = SeenArea {
            author: AuthorId(2),
            upto: 1,
            square_mm: 1000,
            west: 0,
            south: 0,
            width: 8,
            runs: SeenArea::runs_of([Square::Free; 8]),
        };
        let seen = vec![Arc::new(SeenSquares::new(&area, 0.05).expect("whole cells"))];
        let mut team = Team { mates: vec![mate(2, 100.0, None, 0.0)], told, seen };
        let place = Prospect { is_told: true, ..prospect(6.0, 3.0) };
        assert_eq!(team.worth(&place, &config), Worth::Share(config.told_worth));
        assert_eq!(team.worth(&Prospect { is_gap: true, ..place }, &config), Worth::LeftToOthers);
        team.mates[0].is_finished = true;
        assert_eq!(team.worth(&place, &config), Worth::Nothing);
        let behind_a_wall = Prospect { is_told: true, ..prospect(9.0, 3.0) };
        assert_eq!(team.worth(&behind_a_wall, &config), Worth::Share(1.0), "it has not seen that");
        let of_one_that_died = Prospect { is_told: true, ..prospect(51.0, 3.0) };
        assert_eq!(team.worth(&of_one_that_died, &config), Worth::Share(1.0));
        assert!(!team.goes_on());
    }
}
