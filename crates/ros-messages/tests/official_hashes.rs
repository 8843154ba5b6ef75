//! Type hashes are those that ROS 2 has: of the official packages, and of a running Nav2.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_ros_messages::msg::{CancelGoal, MarkerArray, OccupancyGridUpdate, SetBool};
use fht_ros_messages::nav2::{ComputePathToPose, ComputeRoute, NavigateToPose};
use fht_ros_messages::{Distribution, RosAction, RosMessage, RosService, definition_hash, type_hash};

/// Name, hash in Jazzy, hash in Kilted.
const OFFICIAL: &str = include_str!("official_hashes.txt");

#[test]
fn hashes_are_those_of_the_official_packages() {
    let mut count = 0;
    for line in OFFICIAL.lines().filter(|line| !line.starts_with('#')) {
        let [name, jazzy, kilted] = line.split_whitespace().collect::<Vec<_>>()[..] else { panic!("{line}") };
        assert_eq!(type_hash(name, Distribution::Jazzy).as_deref(), Some(jazzy), "{name}");
        assert_eq!(type_hash(name, Distribution::Kilted).as_deref(), Some(kilted), "{name}");
        count += 1;
    }
    assert!(count > 40, "{count}");
}

/// Of a running Nav2 (Kilted).
#[test]
fn hashes_of_actions_are_those_that_nav2_writes() {
    for (name, hash) in [
        ("SendGoal", "a4fcb3bee1bf32e21a0e541a943b221aa0826996e2c98f079b47022b256f48b5"),
        ("GetResult", "c407920357d566771e8882b4ef4d1f1a84ee922d609920ccd57faa6d6e391dc5"),
    ] {
        let found = type_hash(&format!("nav2_msgs/action/NavigateToPose_{name}"), Distribution::Kilted);
        assert_eq!(found, Some(format!("RIHS01_{hash}")), "{name}");
    }
    let found = type_hash("tf2_msgs/msg/TFMessage", Distribution::Jazzy);
    let wanted = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
    assert_eq!(found.as_deref(), Some(wanted));
}

#[test]
fn every_message_service_and_action_has_a_hash() {
    for name in [MarkerArray::TYPE, OccupancyGridUpdate::TYPE, CancelGoal::TYPE, SetBool::TYPE] {
        assert!(type_hash(name, Distribution::Jazzy).is_some(), "{name}");
    }
    for action in [NavigateToPose::TYPE, ComputePathToPose::TYPE, ComputeRoute::TYPE] {
        for part in ["SendGoal", "GetResult", "FeedbackMessage"] {
            let name = format!("{action}_{part}");
            assert!(type_hash(&name, Distribution::Kilted).is_some(), "{name}");
        }
    }
    assert_eq!(type_hash("turtlesim/msg/Pose", Distribution::Jazzy), None);
}

/// Since Kilted the result of a route has a reason in words.
#[test]
fn a_type_that_changed_has_another_hash() {
    let hash = |part: &str, distribution| type_hash(&format!("{}_{part}", ComputeRoute::TYPE), distribution);
    let both = |part| [Distribution::Jazzy, Distribution::Kilted].map(|distribution| hash(part, distribution));
    let ([jazzy, kilted], [goal, same]) = (both("GetResult"), both("SendGoal"));
    assert!(jazzy.is_some() && kilted.is_some() && jazzy != kilted);
    assert!(goal.is_some() && goal == same);
}

#[test]
fn a_message_of_ones_own_is_hashed_by_its_definition() {
    let hash = definition_hash("std_msgs/msg/String", "string data\n");
    assert_eq!(hash, type_hash("std_msgs/msg/String", Distribution::Jazzy));
    assert_eq!(definition_hash("my_msgs/msg/Track", "turtlesim/Pose[] poses\n"), None);
}
