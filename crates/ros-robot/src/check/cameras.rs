//! What a graph has of four cameras. Without them robots map and find their places, too.

use super::finding::{Finding, Readiness, listed};
use crate::camera_topics::{CameraTopic, names};
use crate::config::RosRobotConfig;
use fht_ros::{Endpoint, EndpointKind, NameError};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{CompressedImage, Image};
use std::collections::BTreeSet;

const KINDS: [&str; 2] = [Image::TYPE, CompressedImage::TYPE];

fn publishers(endpoints: &[Endpoint]) -> impl Iterator<Item = &Endpoint> {
    endpoints.iter().filter(|end| end.kind == EndpointKind::Publisher)
}

fn has_pictures(end: &Endpoint) -> bool {
    KINDS.contains(&end.ros_type.as_str())
}

/// What is there of the cameras that are named, or of the usual ones.
pub(super) fn cameras(
    endpoints: &[Endpoint],
    config: &RosRobotConfig,
    full: impl Fn(&str) -> Result<String, NameError>,
) -> Result<Vec<Finding>, NameError> {
    let (names, are_named) = names(config, full)?;
    if config.without_cameras {
        return Ok(Vec::new());
    }
    let found = names.each_ref().map(|name| CameraTopic::published(name, endpoints));
    if !are_named && found.iter().all(Option::is_none) {
        return Ok(Vec::from_iter(unused(endpoints)));
    }
    let finding = |topic: &str, readiness, sentence| Finding { topic: topic.to_owned(), readiness, sentence };
    let judged = names.iter().zip(&found).map(|(name, found)| match found {
        Some(CameraTopic { pictures, is_compressed, .. }) => {
            let kind = if *is_compressed { CompressedImage::TYPE } else { Image::TYPE };
            let on_topic = publishers(endpoints).filter(|end| end.name == *pictures && has_pictures(end));
            let nodes: Vec<&str> = on_topic.map(|end| end.node.as_str()).collect();
            match nodes[..] {
                [node] => finding(pictures, Readiness::Good, format!("{node} publishes it ({kind})")),
                _ => finding(
                    pictures,
                    Readiness::Doubtful,
                    format!(
                        "{} publish it: two cameras with the same names? give each a namespace of its own",
                        listed(&nodes)
                    ),
                ),
            }
        }
        None if are_named => finding(name, Readiness::Missing, absent(name, endpoints)),
        None => finding(
            name,
            Readiness::Doubtful,
            "nobody publishes it, and a panorama needs all four cameras: places are known by their walls alone; start \
             its driver, or name the four (--cameras)"
                .to_owned(),
        ),
    });
    Ok(judged.collect())
}

/// What there is in place of a camera's pictures.
fn absent(name: &str, endpoints: &[Endpoint]) -> String {
    let wanted = KINDS.join(" or ");
    if let Some(other) = publishers(endpoints).find(|end| end.name == name) {
        return format!("{} has {}, not {wanted}: name the topic of its pictures", other.node, other.ros_type);
    }
    let elsewhere: BTreeSet<&str> =
        publishers(endpoints).filter(|end| has_pictures(end)).map(|end| end.name.as_str()).collect();
    let elsewhere: Vec<&str> = elsewhere.into_iter().collect();
    let hint = match elsewhere[..] {
        [] => "start the camera's driver, or see whether domain and namespace are right".to_owned(),
        _ => format!("there is {}: is that the topic, or another namespace?", listed(&elsewhere)),
    };
    format!("nobody publishes it ({wanted}); {hint}")
}

/// That a robot has four cameras which are not used.
fn unused(endpoints: &[Endpoint]) -> Option<Finding> {
    let bare = |name: &str| name.strip_suffix("/compressed").unwrap_or(name).to_owned();
    let topics: BTreeSet<String> =
        publishers(endpoints).filter(|end| has_pictures(end)).map(|end| bare(&end.name)).collect();
    let topics: Vec<&str> = topics.iter().map(String::as_str).collect();
    let [first, _, _, _, ..] = topics[..] else { return None };
    let sentence = format!(
        "there are pictures on {}, and none of them are used: if four of them see all round, say --cameras with their \
         topics, ahead, left, behind, right",
        listed(&topics)
    );
    Some(Finding { topic: first.to_owned(), readiness: Readiness::Doubtful, sentence })
}
