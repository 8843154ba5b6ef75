//! Keys of Zenoh: where messages and requests go, and which tokens say that somebody is there.

use crate::names::{dds_type, demangle, mangle, ros_type};
use crate::qos::Qos;

/// Which of the two mappings of ROS 2 to Zenoh the graph has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KeyForm {
    /// That of `rmw_zenoh`, with which nodes speak Zenoh themselves:
    /// `0/scan/sensor_msgs::msg::dds_::LaserScan_/RIHS01_…`.
    #[default]
    Rmw,
    /// That of `zenoh-bridge-ros2dds` beside nodes that speak DDS: `scan`, or `r1/scan` if the
    /// bridge has the namespace `r1`.
    Bridge,
}

/// A name of no key form.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} is not a form of keys: rmw (nodes with rmw_zenoh) or bridge (zenoh-bridge-ros2dds)")]
pub struct UnknownKeyForm(String);

impl std::str::FromStr for KeyForm {
    type Err = UnknownKeyForm;

    fn from_str(text: &str) -> Result<Self, UnknownKeyForm> {
        match text {
            "rmw" => Ok(Self::Rmw),
            "bridge" => Ok(Self::Bridge),
            _ => Err(UnknownKeyForm(text.to_owned())),
        }
    }
}

/// Where the messages of a topic, or the requests to a service, with this full name go.
#[must_use]
pub fn data_key(form: KeyForm, domain: u32, name: &str, ros_type: &str, hash: &str) -> String {
    let name = name.trim_matches('/');
    match form {
        KeyForm::Rmw => format!("{domain}/{name}/{}/{hash}", dds_type(ros_type)),
        KeyForm::Bridge => name.to_owned(),
    }
}

/// A node, as its token names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// Its session's Zenoh id.
    pub zid: String,
    /// Counts the nodes of a session.
    pub node_id: u64,
    /// Its namespace: `/` or `/r1`.
    pub namespace: String,
    /// Its name.
    pub name: String,
}

/// What an endpoint does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum EndpointKind {
    /// Publishes a topic.
    Publisher,
    /// Subscribes to a topic.
    Subscription,
    /// Answers a service.
    Server,
    /// Asks a service.
    Client,
}

impl EndpointKind {
    fn letters(self) -> &'static str {
        match self {
            Self::Publisher => "MP",
            Self::Subscription => "MS",
            Self::Server => "SS",
            Self::Client => "SC",
        }
    }

    fn from_letters(letters: &str) -> Option<Self> {
        [Self::Publisher, Self::Subscription, Self::Server, Self::Client]
            .into_iter()
            .find(|kind| kind.letters() == letters)
    }
}

/// A publisher, subscription, server or client on the graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Endpoint {
    /// What it does.
    pub kind: EndpointKind,
    /// The full name of its topic or service.
    pub name: String,
    /// Its type, such as `sensor_msgs/msg/LaserScan`.
    pub ros_type: String,
    /// The type's hash; empty where the bridge does not say it.
    pub hash: String,
    /// What it offers or asks for.
    pub qos: Qos,
    /// Its node: where and what, `/r1/slam_toolbox`; of a bridge, its Zenoh id.
    pub node: String,
}

/// The token of a node.
#[must_use]
pub fn node_token(node: &NodeIdentity) -> String {
    let NodeIdentity { domain, zid, node_id, namespace, name } = node;
    format!("@ros2_lv/{domain}/{zid}/{node_id}/{node_id}/NN/%/{}/{name}", mangle(namespace))
}

/// The token of an endpoint of `node`, the `endpoint_id`-th thing of its session.
#[must_use]
pub fn endpoint_token(node: &NodeIdentity, endpoint_id: u64, endpoint: &Endpoint) -> String {
    let NodeIdentity { domain, zid, node_id, namespace, name } = node;
    let Endpoint { kind, name: topic, ros_type, hash, qos, .. } = endpoint;
    format!(
        "@ros2_lv/{domain}/{zid}/{node_id}/{endpoint_id}/{}/%/{}/{name}/{}/{}/{hash}/{}",
        kind.letters(),
        mangle(namespace),
        mangle(topic),
        dds_type(ros_type),
        qos.to_rmw()
    )
}

/// All tokens of endpoints on a domain.
#[must_use]
pub fn endpoint_tokens(form: KeyForm, domain: u32) -> String {
    match form {
        KeyForm::Rmw => format!("@ros2_lv/{domain}/*/*/*/*/*/*/*/**"),
        KeyForm::Bridge => "@/*/@ros2_lv/**".to_owned(),
    }
}

/// The Zenoh id of the session that has declared a token.
pub(crate) fn session_of(token: &str) -> Option<&str> {
    let mut parts = token.split('/');
    match parts.next()? {
        "@ros2_lv" => parts.nth(1),
        "@" => parts.next(),
        _ => None,
    }
}

/// The endpoint that a token names. `None`: it is another token, such as a node's.
#[must_use]
pub fn parse_token(token: &str) -> Option<Endpoint> {
    let parts: Vec<&str> = token.split('/').collect();
    match parts[..] {
        ["@ros2_lv", _, _, _, _, kind, _, namespace, node, name, dds, hash, qos] => Some(Endpoint {
            kind: EndpointKind::from_letters(kind)?,
            name: demangle(name),
            ros_type: ros_type(dds),
            hash: hash.to_owned(),
            qos: Qos::from_rmw(qos)?,
            node: format!("{}/{node}", demangle(namespace).trim_end_matches('/')),
        }),
        ["@", zid, "@ros2_lv", kind, key, ros_type, ref rest @ ..] => {
            let hash = rest.first().and_then(|qos| qos.split_once("typehash=")).map_or("", |(_, hash)| hash);
            // Of an action a bridge tells as a whole; who sends goals looks for the service of
            // goals.
            let (kind, action) = match kind {
                "AS" => (EndpointKind::Server, true),
                "AC" => (EndpointKind::Client, true),
                other => (EndpointKind::from_letters(other)?, false),
            };
            let [of_name, of_type] = if action { ["/_action/send_goal", "_SendGoal"] } else { ["", ""] };
            Some(Endpoint {
                kind,
                name: format!("/{}{of_name}", key.replace('§', "/")),
                ros_type: format!("{}{of_type}", ros_type.replace('§', "/")),
                hash: hash.split(';').next().unwrap_or_default().to_owned(),
                qos: rest.first().map_or(Some(Qos::default()), |qos| Qos::from_bridge(qos))?,
                node: zid.to_owned(),
            })
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn talker() -> NodeIdentity {
        NodeIdentity {
            domain: 0,
            zid: "a1b2".to_owned(),
            node_id: 3,
            namespace: "/".to_owned(),
            name: "talker".to_owned(),
        }
    }

    fn chatter() -> Endpoint {
        Endpoint {
            kind: EndpointKind::Publisher,
            name: "/chatter".to_owned(),
            ros_type: "std_msgs/msg/String".to_owned(),
            hash: HASH.to_owned(),
            qos: Qos::default(),
            node: "/talker".to_owned(),
        }
    }

    #[test]
    fn keys_and_tokens_are_those_of_rmw_zenoh() {
        let key = data_key(KeyForm::Rmw, 0, "/chatter", "std_msgs/msg/String", HASH);
        assert_eq!(key, format!("0/chatter/std_msgs::msg::dds_::String_/{HASH}"));
        assert_eq!(node_token(&talker()), "@ros2_lv/0/a1b2/3/3/NN/%/%/talker");
        let token = endpoint_token(&talker(), 4, &chatter());
        let wanted = "@ros2_lv/0/a1b2/3/4/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/";
        assert_eq!(token, format!("{wanted}{HASH}/::,10:,:,:,,"));
        assert_eq!(parse_token(&token), Some(chatter()));

        let node = NodeIdentity { domain: 7, namespace: "/r1".to_owned(), ..talker() };
        let endpoint = Endpoint { name: "/r1/front/scan".to_owned(), node: "/r1/talker".to_owned(), ..chatter() };
        let token = endpoint_token(&node, 4, &endpoint);
        assert!(token.starts_with("@ros2_lv/7/a1b2/3/4/MP/%/%r1/talker/%r1%front%scan/"), "{token}");
        assert_eq!(parse_token(&token), Some(endpoint));
    }

    #[test]
    fn keys_of_the_bridge_are_names() {
        assert_eq!(data_key(KeyForm::Bridge, 5, "/r1/scan", "sensor_msgs/msg/LaserScan", "*"), "r1/scan");
        let token = format!("@/c0ffee/@ros2_lv/MP/r1§scan/sensor_msgs§msg§LaserScan/:0:0:0,5:typehash={HASH};");
        let endpoint = parse_token(&token).expect("a publisher");
        assert_eq!((endpoint.name.as_str(), endpoint.node.as_str()), ("/r1/scan", "c0ffee"));
        assert_eq!((endpoint.ros_type.as_str(), endpoint.hash.as_str()), ("sensor_msgs/msg/LaserScan", HASH));
        assert_eq!(endpoint.qos, Qos::sensor_data());
        let service = parse_token("@/c0ffee/@ros2_lv/SS/set/std_srvs§srv§SetBool").expect("a server");
        assert_eq!((service.kind, service.name.as_str()), (EndpointKind::Server, "/set"));
        let action = parse_token("@/c0ffee/@ros2_lv/AS/r1§navigate_to_pose/nav2_msgs§action§NavigateToPose");
        let action = action.expect("a server");
        assert_eq!(
            (action.kind, action.name.as_str()),
            (EndpointKind::Server, "/r1/navigate_to_pose/_action/send_goal")
        );
        assert_eq!(action.ros_type, "nav2_msgs/action/NavigateToPose_SendGoal");
    }

    #[test]
    fn other_tokens_are_none() {
        for token in ["@ros2_lv/0/a1b2/3/3/NN/%/%/talker", "@/c0ffee/@ros2_lv", "@/c0ffee/@ros2_lv/AX/a/b", "fht/x", ""]
        {
            assert_eq!(parse_token(token), None, "{token}");
        }
    }

    proptest! {
        #[test]
        fn any_token_is_read_or_left(token in "(@ros2_lv|@)(/[a-zA-Z0-9%§@:,_]{0,8}){0,14}") {
            let _ = parse_token(&token);
        }
    }
}
