//! How many people there are, and how they walk.

use serde::{Deserialize, Serialize};

/// People in a building. The defaults of the forces are those of Helbing and Molnár (1995),
/// section III, but for the walls: theirs keep everybody in the middle of a street, and a
/// building's passages are narrower.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PeopleConfig {
    /// How many. Default 0: nobody, and nothing differs from a building without people.
    pub count: usize,
    /// Seed of where they are and what they do. Default 1.
    pub seed: u64,
    /// Radius of somebody's body, a disc, metres. Default 0.2: legs and feet of somebody who
    /// stands.
    pub radius_m: f64,
    /// Mean of the speed that people like to walk at, metres per second. Default 1.34.
    pub speed_mps: f64,
    /// Standard deviation of that speed, metres per second. Default 0.26.
    pub speed_sigma_mps: f64,
    /// Nobody walks faster than so many times the speed that he likes. Default 1.3.
    pub hurry: f64,
    /// Time in which somebody gets to the speed that he likes, seconds. Default 0.5.
    pub relaxation_s: f64,
    /// Strength of the repulsion between two people, square metres per second squared. Default 2.1.
    pub repulsion_m2ps2: f64,
    /// Range of that repulsion, metres. Default 0.3.
    pub repulsion_range_m: f64,
    /// People look so far ahead at where others will be, seconds. Default 2.
    pub foresight_s: f64,
    /// Half of the angle that people see, radians. Default 100°.
    pub sight_rad: f64,
    /// What is behind somebody counts by this factor. Default 0.5.
    pub behind: f64,
    /// Strength of the repulsion of walls, square metres per second squared. Default 2 (of
    /// Helbing's 10).
    pub wall_m2ps2: f64,
    /// Range of that repulsion, metres. Default 0.2.
    pub wall_range_m: f64,
    /// How long somebody stands where he meets others, least and greatest, seconds. Default 5 to
    /// 40.
    pub stay_s: (f64, f64),
    /// Share of the stays that are long. Default 0.1.
    pub linger_share: f64,
    /// How long such a stay is, least and greatest, seconds. Default 120 to 300.
    pub linger_s: (f64, f64),
    /// One place to meet for so much floor, square metres. Default 25, but at least 6 places and at
    /// most 32.
    pub place_m2: f64,
    /// Room that such a place has, metres: whoever stands there leaves a passage. Default 0.9.
    pub place_room_m: f64,
    /// Nobody is nearer than this to the robot when it starts, metres. Default 1.5.
    pub start_apart_m: f64,
}

impl Default for PeopleConfig {
    fn default() -> Self {
        Self {
            count: 0,
            seed: 1,
            radius_m: 0.2,
            speed_mps: 1.34,
            speed_sigma_mps: 0.26,
            hurry: 1.3,
            relaxation_s: 0.5,
            repulsion_m2ps2: 2.1,
            repulsion_range_m: 0.3,
            foresight_s: 2.0,
            sight_rad: 100.0_f64.to_radians(),
            behind: 0.5,
            wall_m2ps2: 2.0,
            wall_range_m: 0.2,
            stay_s: (5.0, 40.0),
            linger_share: 0.1,
            linger_s: (120.0, 300.0),
            place_m2: 25.0,
            place_room_m: 0.9,
            start_apart_m: 1.5,
        }
    }
}

impl PeopleConfig {
    /// So many people, who do what `seed` says.
    #[must_use]
    pub fn of(count: usize, seed: u64) -> Self {
        Self { count, seed, ..Self::default() }
    }

    /// Whether people can walk by it: all numbers are what they stand for.
    pub(crate) fn is_sound(&self) -> bool {
        let positive = [
            self.radius_m,
            self.speed_mps,
            self.relaxation_s,
            self.repulsion_range_m,
            self.wall_range_m,
            self.place_m2,
            self.place_room_m,
        ];
        let spans = [self.stay_s, self.linger_s];
        let others = [self.speed_sigma_mps, self.hurry, self.repulsion_m2ps2, self.foresight_s, self.sight_rad];
        let others = others.into_iter().chain([self.behind, self.wall_m2ps2, self.linger_share, self.start_apart_m]);
        self.count <= usize::from(u16::MAX)
            && positive.into_iter().all(|value| (1e-3..1e6).contains(&value))
            && spans.into_iter().all(|(least, most)| 0.0 <= least && least < most && most < 1e9)
            && others.into_iter().all(|value| (0.0..1e6).contains(&value))
    }
}
