//! Who is on the other end of a connection, and what that one may do.

use crate::port::MapPort;
use crate::rights::{MemberRole, Rights};
use fht_proto::RobotName;

/// Who is on the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Visitor {
    /// Somebody on this machine; with a name, if that one may change maps.
    Local(Option<RobotName>),
    /// Somebody with a certificate of the site's authority.
    Member(MemberRole, RobotName),
    /// Somebody without a certificate, or with one that names nobody.
    Stranger,
}

impl Visitor {
    /// Whom a certificate (DER) names: its common name is `ROLE:NAME`.
    pub(crate) fn of_certificate(der: &[u8]) -> Self {
        let named = || {
            let (_, certificate) = x509_parser::parse_x509_certificate(der).ok()?;
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

    /// What it is called.
    pub(crate) fn name(&self) -> Option<&RobotName> {
        match self {
            Self::Local(name) => name.as_ref(),
            Self::Member(_, name) => Some(name),
            Self::Stranger => None,
        }
    }

    /// Its role, if it is known.
    pub(crate) fn role(&self) -> Option<MemberRole> {
        match self {
            Self::Local(name) => name.as_ref().map(|_| MemberRole::Operator),
            Self::Member(role, _) => Some(*role),
            Self::Stranger => None,
        }
    }

    /// What it may do now.
    pub(crate) fn rights(&self, port: &dyn MapPort) -> Rights {
        match self {
            // Whoever is on this machine may look.
            Self::Local(name) => {
                name.as_ref().map_or(Rights::Look, |name| port.rights(MemberRole::Operator, name)).max(Rights::Look)
            }
            Self::Member(role, name) => port.rights(*role, name),
            Self::Stranger => Rights::Nothing,
        }
    }
}
