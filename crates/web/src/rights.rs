//! What somebody is, and what that one may do.

use serde::Serialize;

/// What a member of the site is, by its certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MemberRole {
    /// A Zenoh router.
    Router,
    /// A map-server.
    Server,
    /// A robot that writes maps.
    Explorer,
    /// A robot, or a person's tool, that only uses maps.
    Client,
    /// A person who edits maps.
    Operator,
}

impl MemberRole {
    /// The role that a certificate calls so.
    pub(crate) fn of(text: &str) -> Option<Self> {
        Some(match text {
            "router" => Self::Router,
            "server" => Self::Server,
            "explorer" => Self::Explorer,
            "client" => Self::Client,
            "operator" => Self::Operator,
            _ => return None,
        })
    }
}

/// What somebody may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rights {
    /// Nothing at all.
    Nothing,
    /// Look, and ask.
    Look,
    /// Change maps, too.
    Change,
}
