//! What the demo came to, in figures.

use fht_ros_robot::IntakeReport;
use fht_sim::{Contacts, RobotContacts};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};
use std::ops::Add;

/// One explorer, in figures.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExplorerFigures {
    /// Its name.
    pub robot: String,
    /// How it ended, `killed`, or how it failed.
    pub ending: String,
    /// Seconds and metres after which it knew its place in the map, if it joined one.
    pub joined: Option<[f64; 2]>,
    /// Driven, metres; unknown if it was killed or failed.
    pub driven_m: Option<f64>,
    /// Robot time from its start to its end, seconds; unknown if it failed.
    pub sim_s: Option<f64>,
}

/// What became of the sensors' messages, if the robots spoke ROS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RosFigures {
    /// Frames that explorer and client made of scans.
    pub frames: u64,
    /// Scans whose odometry did not come in time.
    pub frames_late: u64,
    /// Scans that were lost: newer ones came before they were used, or they made no sense.
    pub frames_lost: u64,
    /// Processor time of the simulated robots and their routers, seconds.
    pub ros_cpu_s: f64,
}

impl RosFigures {
    pub(super) fn of(intake: &IntakeReport, ros_cpu_s: f64) -> Self {
        let IntakeReport { frames, frames_late, frames_lost, .. } = *intake;
        Self { frames, frames_late, frames_lost, ros_cpu_s }
    }
}

impl Add for RosFigures {
    type Output = Self;

    fn add(self, more: Self) -> Self {
        Self {
            frames: self.frames + more.frames,
            frames_late: self.frames_late + more.frames_late,
            frames_lost: self.frames_lost + more.frames_lost,
            ros_cpu_s: self.ros_cpu_s + more.ros_cpu_s,
        }
    }
}

/// How often robots touched people and each other, all robots together. Each counts for itself: by
/// the robot if it moved towards the other at that moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ContactFigures {
    /// Robots moved towards people.
    pub people_by_robots: u64,
    /// People walked into robots.
    pub robots_by_people: u64,
    /// Robots moved towards robots.
    pub robots_by_robots: u64,
}

impl ContactFigures {
    pub(super) fn of(people: Contacts, robots: RobotContacts) -> Self {
        Self {
            people_by_robots: people.by_robot,
            robots_by_people: people.by_people,
            robots_by_robots: robots.by_robot,
        }
    }
}

impl Add for ContactFigures {
    type Output = Self;

    fn add(self, more: Self) -> Self {
        Self {
            people_by_robots: self.people_by_robots + more.people_by_robots,
            robots_by_people: self.robots_by_people + more.robots_by_people,
            robots_by_robots: self.robots_by_robots + more.robots_by_robots,
        }
    }
}

/// What happened, in figures.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct HandoffReport {
    /// The world.
    pub world: String,
    /// The seed.
    pub seed: u64,
    /// Reachable free area, square metres.
    pub free_area_m2: f64,
    /// Share of it that was explored.
    pub explored_fraction: f64,
    /// Main nodes of the map.
    pub main_nodes: usize,
    /// Support nodes of the map.
    pub support_nodes: usize,
    /// Edges of the map.
    pub edges: usize,
    /// Bytes of all increments.
    pub map_bytes: u64,
    /// Bytes that the explorer put on the wire.
    pub wire_bytes: u64,
    /// Mean error of the explorer's estimated positions, metres.
    pub mapping_error_m: f64,
    /// Distance that the explorers drove, metres.
    pub explorer_driven_m: f64,
    /// Each explorer.
    pub explorers: Vec<ExplorerFigures>,
    /// Robot time from the first explorer's start to the last one's end, seconds.
    pub explore_sim_s: f64,
    /// Whether the digests of explorer and server agree. With several explorers, those of the
    /// server and of a copy.
    pub digests_agree: bool,
    /// Whether the client found its place.
    pub localized: bool,
    /// Error of the client's first fix, metres.
    pub relocalization_error_m: Option<f64>,
    /// Error of its heading, degrees.
    pub relocalization_error_deg: Option<f64>,
    /// Distance driven until the first fix, metres.
    pub relocalization_distance_m: Option<f64>,
    /// Where the client truly was at the end of its drive, `[x, y]` in the map frame.
    pub end_true: Option<[f64; 2]>,
    /// Where it thought it was.
    pub end_estimated: Option<[f64; 2]>,
    /// Error of its estimate at the end, metres.
    pub final_error_m: Option<f64>,
    /// Driven from the fix to the goal, metres.
    pub path_length_m: Option<f64>,
    /// The shortest that was possible, metres.
    pub shortest_length_m: Option<f64>,
    /// Whether the client arrived: it says so, and it is truly within half a metre of the goal.
    pub arrived: bool,
    /// True distance to the goal at the end, metres.
    pub goal_distance_m: Option<f64>,
    /// Times that either robot touched something.
    pub collisions: u64,
    /// How many people there were.
    #[serde(default)]
    pub people: u16,
    /// Contacts with people and between robots, if the robots shared a world.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contacts: Option<ContactFigures>,
    /// Why the client failed, if it did.
    pub failure: Option<String>,
    /// Why there is no picture of the map, if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_failure: Option<String>,
    /// Robot time of the client from its start to its end, seconds.
    #[serde(default)]
    pub client_sim_s: f64,
    /// What became of the sensors' messages, if the robots spoke ROS.
    #[serde(flatten)]
    pub ros: Option<RosFigures>,
    /// Seconds of the exploration on the clock.
    pub explore_wall_s: f64,
    /// Seconds of the client's mission on the clock.
    #[serde(default)]
    pub client_wall_s: f64,
    /// Seconds of the whole demo on the clock.
    pub wall_s: f64,
}

impl HandoffReport {
    /// Whether the demo succeeded: server and explorer have the same map, and the client arrived.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.digests_agree && self.arrived
    }
}

/// The figures in words, a line each.
impl Display for HandoffReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "world         {} (seed {})", self.world, self.seed)?;
        self.write_exploration(f)?;
        self.write_client(f)?;
        if let Some(contacts) = self.contacts {
            writeln!(
                f,
                "contacts      {} people in one world with the robots: robots ran into people {} times and into each other {} \
                 times, people into robots {} times; {} collisions with things",
                self.people,
                contacts.people_by_robots,
                contacts.robots_by_robots,
                contacts.robots_by_people,
                self.collisions
            )?;
        }
        if let Some(ros) = self.ros {
            writeln!(
                f,
                "ros           {} frames, {} late, {} lost; robots and routers took {:.1} s of processor time",
                ros.frames, ros.frames_late, ros.frames_lost, ros.ros_cpu_s
            )?;
        }
        writeln!(
            f,
            "time          {:.0} s: {:.0} s exploring ({:.0} s of robot time), {:.0} s relocalizing and driving \
             ({:.0} s of robot time)",
            self.wall_s, self.explore_wall_s, self.explore_sim_s, self.client_wall_s, self.client_sim_s
        )
    }
}

impl HandoffReport {
    fn write_exploration(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "explored      {:.1} % of {:.0} m² in {:.0} m of driving, {:.3} m mean pose error",
            self.explored_fraction * 100.0,
            self.free_area_m2,
            self.explorer_driven_m,
            self.mapping_error_m
        )?;
        for explorer in self.explorers.iter().filter(|_| self.explorers.len() > 1) {
            let joined = explorer.joined.filter(|[seconds, _]| *seconds > 0.0);
            writeln!(
                f,
                "  {:<12}{}{}{}{}",
                explorer.robot,
                joined.map_or_else(String::new, |[s, m]| format!("joined the map after {s:.0} s and {m:.1} m, ")),
                explorer.driven_m.map_or_else(String::new, |metres| format!("{metres:.0} m, ")),
                explorer.sim_s.map_or_else(String::new, |s| format!("{s:.0} s of robot time: ")),
                explorer.ending
            )?;
        }
        writeln!(
            f,
            "map           {} main nodes, {} support nodes, {} edges",
            self.main_nodes, self.support_nodes, self.edges
        )?;
        writeln!(
            f,
            "bytes         {:.1} KB of map, {:.1} KB put on the wire; digests {}",
            self.map_bytes as f64 / 1000.0,
            self.wire_bytes as f64 / 1000.0,
            if self.digests_agree { "agree" } else { "DIFFER" }
        )
    }

    fn write_client(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let metres = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2} m"));
        let place =
            |value: Option<[f64; 2]>| value.map_or_else(|| "-".to_owned(), |[x, y]| format!("({x:.2}, {y:.2})"));
        if self.localized {
            writeln!(
                f,
                "relocalized   after {} of driving, off by {} and {:.2}°",
                metres(self.relocalization_distance_m),
                metres(self.relocalization_error_m),
                self.relocalization_error_deg.unwrap_or(f64::NAN)
            )?;
        } else {
            writeln!(f, "relocalized   no")?;
        }
        writeln!(
            f,
            "client        truly at {}, thought {}, goal {} away: {}",
            place(self.end_true),
            place(self.end_estimated),
            metres(self.goal_distance_m),
            match (&self.failure, self.arrived) {
                (_, true) => "arrived".to_owned(),
                (Some(reason), false) => format!("did not arrive: {reason}"),
                (None, false) => "did not arrive".to_owned(),
            }
        )?;
        writeln!(
            f,
            "path          {} driven, {} was the shortest possible",
            metres(self.path_length_m),
            metres(self.shortest_length_m)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_demo_fails_unless_the_maps_agree_and_the_client_arrives() {
        for (digests_agree, arrived, is_success) in
            [(true, true, true), (false, true, false), (true, false, false), (false, false, false)]
        {
            let report = HandoffReport { digests_agree, arrived, ..HandoffReport::default() };
            assert_eq!(report.is_success(), is_success, "{digests_agree} {arrived}");
        }
    }

    #[test]
    fn robot_time_stands_beside_the_time_on_the_clock() {
        let report = HandoffReport {
            wall_s: 12.0,
            explore_wall_s: 9.0,
            explore_sim_s: 400.0,
            client_wall_s: 2.0,
            client_sim_s: 70.0,
            ..HandoffReport::default()
        };
        let text = report.to_string();
        let expected = "time          12 s: 9 s exploring (400 s of robot time), 2 s relocalizing and driving \
                        (70 s of robot time)";
        assert_eq!(text.lines().last(), Some(expected), "{text}");
    }
}
