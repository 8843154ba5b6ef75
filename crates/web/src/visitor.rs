//! Who is on the other end of a connection, and what that one may do.

use crate::port::MapPort;
use crate::rights::Rights;
use fht_door::{Caller, MemberRole};
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
    /// Who calls; `operator` is who changes maps from this machine.
    pub(crate) fn of(caller: Caller, operator: Option<&RobotName>) -> Self {
        match caller {
            Caller::Local => Self::Local(operator.cloned()),
            Caller::Member(role, name) => Self::Member(role, name),
            Caller::Stranger => Self::Stranger,
        }
    }

    /// What it is called.
    pub(crate) fn name(&self) -> Option<&RobotName> {
        match self {
            Self::Local(name) => name.as_ref(),
            Self::Member(_, name) => Some(name),
            Self::Stranger => None,
        }
    }

    /// Its role, if it is known. Who changes maps from this machine is an operator while the list
    /// of roles says so.
    pub(crate) fn role(&self, rights: Rights) -> Option<MemberRole> {
        match self {
            Self::Local(name) => name.as_ref().filter(|_| rights == Rights::Change).map(|_| MemberRole::Operator),
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
