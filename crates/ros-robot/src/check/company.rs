//! Who else is on a robot's graph: other drivers, other maps, other clocks, other distributions.

use super::finding::{Finding, Readiness, listed};
use crate::config::RosRobotConfig;
use fht_ros::{Endpoint, EndpointKind};
use fht_ros_messages::msg::{ClockMsg, OccupancyGridMsg, TwistMsg, TwistStamped};
use fht_ros_messages::{Distribution, RosMessage, type_hash};

/// What is odd about who takes commands on `topic`.
pub(super) fn commanded_otherwise(endpoints: &[Endpoint], topic: &str) -> Option<(Readiness, String)> {
    let takers: Vec<&Endpoint> =
        endpoints.iter().filter(|end| end.kind == EndpointKind::Subscription && end.name == topic).collect();
    if let Some(other) = takers.iter().find_map(|end| other_distribution(end)) {
        return Some((Readiness::Missing, other));
    }
    let [stamped, plain] = [TwistStamped::TYPE, TwistMsg::TYPE]
        .map(|ros_type| takers.iter().find(|end| end.ros_type == ros_type).map(|end| end.node.as_str()));
    let sentence = format!(
        "{} takes {}, {} takes {}, and only the first gets commands: set enable_stamped_cmd_vel alike",
        stamped?,
        TwistStamped::TYPE,
        plain?,
        TwistMsg::TYPE
    );
    Some((Readiness::Doubtful, sentence))
}

/// That a node's types have the hashes of another distribution: what is published for it does not
/// reach it.
fn other_distribution(end: &Endpoint) -> Option<String> {
    let known = [Distribution::Humble, Distribution::Jazzy, Distribution::Kilted];
    let hashes = known.map(|distribution| type_hash(&end.ros_type, distribution));
    if !end.hash.starts_with("RIHS01_") || hashes.iter().flatten().any(|hash| *hash == end.hash) {
        return None;
    }
    Some(format!(
        "{} takes a {} of another definition (its hash is {}): which distribution is it? (--distribution)",
        end.node, end.ros_type, end.hash
    ))
}

/// Who does what we are about to do.
pub(super) fn others(
    endpoints: &[Endpoint],
    config: &RosRobotConfig,
    commands: &str,
    map: &str,
    clock: &str,
) -> Vec<Finding> {
    let publishers = |topic: &str, types: &[&str]| -> Vec<&str> {
        let on_topic = endpoints.iter().filter(|end| {
            end.kind == EndpointKind::Publisher && end.name == topic && types.contains(&end.ros_type.as_str())
        });
        on_topic.map(|end| end.node.as_str()).collect()
    };
    let doubt =
        |topic: &str, sentence: String| Finding { topic: topic.to_owned(), readiness: Readiness::Doubtful, sentence };
    let mut found = Vec::new();
    let drivers = publishers(commands, &[TwistMsg::TYPE, TwistStamped::TYPE]);
    if !drivers.is_empty() && !config.others_drive {
        let sentence =
            format!("{} may drive as well: end it, or let it drive (--drive nav2, or others)", listed(&drivers));
        found.push(doubt(commands, sentence));
    }
    let mappers = publishers(map, &[OccupancyGridMsg::TYPE]);
    if !mappers.is_empty() {
        let sentence = format!(
            "{} publishes it already, and map → odom perhaps, too: end it (slam_toolbox, AMCL, map_server), or robots \
             will jump between two maps",
            listed(&mappers)
        );
        found.push(doubt(map, sentence));
    }
    let clocks = publishers(clock, &[ClockMsg::TYPE]);
    if !clocks.is_empty() && !config.use_sim_time {
        let sentence = format!("{} tells a simulated time: say --use-sim-time", listed(&clocks));
        found.push(doubt(clock, sentence));
    }
    found
}
