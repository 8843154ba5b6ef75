//! Who is on the other end of a connection.

use fht_proto::RobotName;
use serde::Serialize;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use x509_parser::certificate::X509Certificate;

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
    fn of(text: &str) -> Option<Self> {
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

/// Who is on the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Caller {
    /// Somebody on this machine.
    Local,
    /// Somebody with a certificate of the site's authority.
    Member(MemberRole, RobotName),
    /// Somebody without a certificate, or with one that names nobody.
    Stranger,
}

impl Caller {
    /// Who shows a certificate (DER), and how much longer it holds. One that cannot be read names
    /// nobody and does not hold.
    pub(crate) fn of_certificate(der: &[u8], now: SystemTime) -> (Self, Duration) {
        match x509_parser::parse_x509_certificate(der) {
            Ok((_, certificate)) => (Self::named_in(&certificate), holds_for(&certificate, now)),
            Err(_) => (Self::Stranger, Duration::ZERO),
        }
    }

    /// The common name is `ROLE:NAME`.
    fn named_in(certificate: &X509Certificate<'_>) -> Self {
        let named = || {
            let mut names = certificate.subject().iter_common_name();
            let name = names.next()?.as_str().ok()?.to_owned();
            // Of two names nobody knows which one counts.
            if names.next().is_some() {
                return None;
            }
            let (role, name) = name.split_once(':')?;
            Some(Self::Member(MemberRole::of(role)?, name.parse().ok()?))
        };
        named().unwrap_or(Self::Stranger)
    }
}

fn holds_for(certificate: &X509Certificate<'_>, now: SystemTime) -> Duration {
    let ends_s = certificate.validity().not_after.timestamp();
    let now_s = now.duration_since(UNIX_EPOCH).unwrap_or_default();
    Duration::from_secs(ends_s.try_into().unwrap_or(0)).saturating_sub(now_s)
}
