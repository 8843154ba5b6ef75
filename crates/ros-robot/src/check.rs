//! What a robot's graph has of what is needed, as a doctor says it. No I/O.

use crate::config::RosRobotConfig;
use fht_ros::{Endpoint, EndpointKind, NameError, Qos, resolve};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{LaserScanMsg, OdometryMsg, TfMessage, TwistMsg, TwistStamped};
use serde::{Deserialize, Serialize};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Readiness {
    /// All is well.
    Good,
    /// It works, but not as it should.
    Doubtful,
    /// It cannot work.
    Missing,
}

/// What was found about one topic.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// The topic's full name.
    pub topic: String,
    /// How bad it is.
    pub readiness: Readiness,
    /// What it is, and what to do.
    pub sentence: String,
}

/// A topic that is needed.
struct Need {
    topic: String,
    types: &'static [&'static str],
    /// Who must be there.
    other: EndpointKind,
    qos: Qos,
}

/// Compares the endpoints of a graph with what `config` needs, for a robot in `namespace`. The own
/// node's endpoints must not be among them.
///
/// # Errors
/// [`NameError`] when a topic cannot be one.
pub fn check(endpoints: &[Endpoint], config: &RosRobotConfig, namespace: &str) -> Result<Vec<Finding>, NameError> {
    let full = |name: &str| resolve(name, namespace, "mapper");
    let sensor = Qos::sensor_data();
    let need = |topic: String, types, other, qos| Need { topic, types, other, qos };
    let publisher = EndpointKind::Publisher;
    let mut needs = vec![need(full(&config.scan)?, &[LaserScanMsg::TYPE][..], publisher, sensor)];
    if !config.has_odometry_in_tf() {
        needs.push(need(full(&config.odometry)?, &[OdometryMsg::TYPE], publisher, sensor));
    }
    let takes = &[TwistMsg::TYPE, TwistStamped::TYPE];
    let tf = full(&config.tf)?;
    // A robot whose frames are all fixed has no moving transforms.
    if config.has_odometry_in_tf() || endpoints.iter().any(|end| end.kind == publisher && end.name == tf) {
        needs.push(need(tf, &[TfMessage::TYPE], publisher, Qos::default()));
    }
    needs.push(need(full(&config.tf_static)?, &[TfMessage::TYPE], publisher, Qos::latched(1)));
    needs.push(need(full(&config.cmd_vel)?, takes, EndpointKind::Subscription, Qos::default()));
    Ok(needs.iter().map(|need| judge(endpoints, need)).collect())
}

fn judge(endpoints: &[Endpoint], need: &Need) -> Finding {
    let finding = |readiness, sentence| Finding { topic: need.topic.clone(), readiness, sentence };
    let does = if need.other == EndpointKind::Publisher { "publishes" } else { "subscribes to" };
    let wanted = need.types.join(" or ");
    let on_topic: Vec<&Endpoint> =
        endpoints.iter().filter(|end| end.kind == need.other && end.name == need.topic).collect();
    let fitting: Vec<&Endpoint> =
        on_topic.iter().copied().filter(|end| need.types.contains(&end.ros_type.as_str())).collect();
    let Some(first) = fitting.first() else {
        if let Some(other) = on_topic.first() {
            return finding(Readiness::Missing, format!("{} has {}, not {wanted}", other.node, other.ros_type));
        }
        let elsewhere: Vec<&str> = endpoints
            .iter()
            .filter(|end| end.kind == need.other && need.types.contains(&end.ros_type.as_str()))
            .map(|end| end.name.as_str())
            .collect();
        let hint = match elsewhere[..] {
            [] => format!("start what {does} it, or see whether domain and namespace are right"),
            _ => format!("there is {}: is that the topic, or another namespace?", listed(&elsewhere)),
        };
        return finding(Readiness::Missing, format!("nobody {does} it ({wanted}); {hint}"));
    };
    // Several nodes publish transforms; two that publish scans or odometry are two robots.
    let is_shared = need.types.contains(&TfMessage::TYPE) || need.other == EndpointKind::Subscription;
    if fitting.len() > 1 && !is_shared {
        let nodes: Vec<&str> = fitting.iter().map(|end| end.node.as_str()).collect();
        let sentence = format!(
            "{} publish it: two robots with the same names? give each a namespace, or a router",
            listed(&nodes)
        );
        return finding(Readiness::Doubtful, sentence);
    }
    let mismatch = match need.other {
        EndpointKind::Publisher => need.qos.mismatch(&first.qos),
        _ => first.qos.mismatch(&need.qos),
    };
    match mismatch {
        Some(mismatch) => finding(Readiness::Doubtful, format!("of {}: {mismatch}", first.node)),
        None => finding(Readiness::Good, format!("{} {does} it ({})", first.node, first.ros_type)),
    }
}

/// At most four of them, each once.
fn listed(names: &[&str]) -> String {
    let mut names = names.to_vec();
    names.dedup();
    let more = if names.len() > 4 { " …" } else { "" };
    names.truncate(4);
    format!("{}{more}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn endpoint(kind: EndpointKind, name: &str, ros_type: &str, qos: Qos) -> Endpoint {
        let node = format!("/r1/driver{}", name.replace('/', "_"));
        Endpoint { kind, name: name.to_owned(), ros_type: ros_type.to_owned(), hash: String::new(), qos, node }
    }

    /// A robot that has all that is needed.
    fn robot() -> Vec<Endpoint> {
        use EndpointKind::{Publisher, Subscription};
        vec![
            endpoint(Publisher, "/r1/scan", LaserScanMsg::TYPE, Qos::sensor_data()),
            endpoint(Publisher, "/r1/odom", OdometryMsg::TYPE, Qos::default()),
            endpoint(Publisher, "/r1/tf", TfMessage::TYPE, Qos::default()),
            endpoint(Publisher, "/r1/tf_static", TfMessage::TYPE, Qos::latched(1)),
            endpoint(Subscription, "/r1/cmd_vel", TwistStamped::TYPE, Qos::default()),
        ]
    }

    fn said(change: impl FnOnce(&mut Vec<Endpoint>), topic: &str) -> (Readiness, String) {
        let mut endpoints = robot();
        change(&mut endpoints);
        let findings = check(&endpoints, &RosRobotConfig::default(), "r1").expect("names");
        let found = findings.into_iter().find(|finding| finding.topic == topic).expect("the topic");
        (found.readiness, found.sentence)
    }

    #[test]
    fn a_robot_that_has_all_is_well() {
        let findings = check(&robot(), &RosRobotConfig::default(), "r1").expect("names");
        assert!(
            findings.len() == 5 && findings.iter().all(|finding| finding.readiness == Readiness::Good),
            "{findings:?}"
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_what_to_do() {
        use Readiness::{Doubtful, Missing};
        type Change = fn(&mut Vec<Endpoint>);
        let cases: [(Change, &str, Readiness, &str); 10] = [
            (
                |all| all.clear(),
                "/r1/scan",
                Missing,
                "nobody publishes it (sensor_msgs/msg/LaserScan); start what publishes it",
            ),
            (|all| all.clear(), "/r1/cmd_vel", Missing, "nobody subscribes to it (geometry_msgs/msg/Twist or"),
            (
                |all| all[0].name = "/scan".to_owned(),
                "/r1/scan",
                Missing,
                "there is /scan: is that the topic, or another namespace?",
            ),
            (|all| all[1].name = "/r1/wheel_odom".to_owned(), "/r1/odom", Missing, "there is /r1/wheel_odom"),
            (
                |all| all[0].ros_type = "sensor_msgs/msg/PointCloud2".to_owned(),
                "/r1/scan",
                Missing,
                "has sensor_msgs/msg/PointCloud2, not sensor_msgs/msg/LaserScan",
            ),
            (
                |all| {
                    let mut second = all[0].clone();
                    second.node = "/other".to_owned();
                    all.push(second);
                },
                "/r1/scan",
                Doubtful,
                "/other publish it: two robots with the same names?",
            ),
            (
                |all| all[3].qos = Qos::default(),
                "/r1/tf_static",
                Doubtful,
                "published volatile and asked for transient-local",
            ),
            (|all| all[2].qos = Qos::sensor_data(), "/r1/tf", Doubtful, "published best-effort and asked for reliably"),
            (|all| all[4].kind = EndpointKind::Publisher, "/r1/cmd_vel", Missing, "nobody subscribes to it"),
            (
                |all| {
                    all.remove(3);
                },
                "/r1/tf_static",
                Missing,
                "there is /r1/tf: is that the topic",
            ),
        ];
        for (change, topic, readiness, words) in cases {
            let (found, sentence) = said(change, topic);
            assert_eq!(found, readiness, "{sentence}");
            assert!(sentence.contains(words), "'{sentence}' should say '{words}'");
        }
    }

    #[test]
    fn a_robot_with_odometry_in_transforms_needs_no_other() {
        let config = RosRobotConfig { odometry: "/tf".to_owned(), ..RosRobotConfig::default() };
        let findings = check(&robot(), &config, "r1").expect("names");
        assert!(findings.iter().all(|finding| finding.topic != "/r1/odom"));
        let config = RosRobotConfig { scan: "2d".to_owned(), ..config };
        assert!(check(&robot(), &config, "r1").is_err());
    }
}
