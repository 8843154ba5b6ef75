//! What a robot's graph has of what is needed, as a doctor says it. No I/O.

mod cameras;
mod company;
mod finding;

use self::company::{commanded_otherwise, others};
use self::finding::listed;
pub use self::finding::{Finding, Readiness};
use crate::config::RosRobotConfig;
use fht_ros::{Endpoint, EndpointKind, NameError, Qos, resolve};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{ClockMsg, LaserScanMsg, OdometryMsg, PointCloud2, TfMessage, TwistMsg, TwistStamped};

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
    let (sight, _) = config.sight();
    let sight_types = if config.points.is_some() { &[PointCloud2::TYPE][..] } else { &[LaserScanMsg::TYPE][..] };
    let mut needs = vec![need(full(sight)?, sight_types, publisher, sensor)];
    if config.use_sim_time {
        needs.push(need(full(&config.clock)?, &[ClockMsg::TYPE], publisher, sensor));
    }
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
    let mut findings: Vec<Finding> = needs.iter().map(|need| judge(endpoints, need)).collect();
    let commands = full(&config.cmd_vel)?;
    if let Some(last) = findings.last_mut().filter(|finding| finding.readiness == Readiness::Good)
        && let Some((readiness, sentence)) = commanded_otherwise(endpoints, &commands)
    {
        (last.readiness, last.sentence) = (readiness, sentence);
    }
    findings.extend(cameras::cameras(endpoints, config, full)?);
    findings.extend(others(endpoints, config, &commands, &full("map")?, &full(&config.clock)?));
    Ok(findings)
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
            let remedy = remedy(&other.ros_type, need);
            return finding(
                Readiness::Missing,
                format!("{} has {}, not {wanted}: {remedy}", other.node, other.ros_type),
            );
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

/// What to do about a topic of another type.
fn remedy(ros_type: &str, need: &Need) -> String {
    let topic = &need.topic;
    match ros_type {
        PointCloud2::TYPE => format!("say --points {topic}"),
        LaserScanMsg::TYPE => format!("say --scan-topic {topic}"),
        TfMessage::TYPE if need.types.contains(&OdometryMsg::TYPE) => {
            format!("say --odom-topic tf, [ros] tf = {topic}")
        }
        _ => "name the topic that has it, or a node that makes it (see docs/ros2.md)".to_owned(),
    }
}

#[cfg(test)]
mod tests;
