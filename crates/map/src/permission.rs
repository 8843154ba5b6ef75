//! Who may write what. The writer's role decides, and what the operation itself names: not the
//! state of the map, and not the order in which increments arrive. So server and copies judge
//! alike. What is stored already is never judged again: a log adds up to the same map whoever reads
//! it.
//!
//! Explorers write what they see: nodes of their own, edges, rectangles, trust. At others' nodes
//! they may doubt, which takes trust, edges and free space away, and retires a node in the end
//! ([`takes_from_others`] finds that, so that a server can bound it). What people decide is left to
//! operators.
//!
//! ```
//! use fht_map::{WriterRole, may_write};
//! use fht_proto::{AuthorId, NodeId, Op};
//!
//! let (ana, ben) = (AuthorId::of_robot("ana"), AuthorId::of_robot("ben"));
//! let pose = Default::default();
//! let moves = |author| Op::SetPose { id: NodeId { author, number: 0 }, pose };
//! assert!(may_write(WriterRole::Explorer, ana, &moves(ana)).is_ok());
//! let refused = may_write(WriterRole::Explorer, ana, &moves(ben)).unwrap_err();
//! assert_eq!(refused.to_string(), "explorers may not move others' nodes");
//! assert!(may_write(WriterRole::Operator, ana, &moves(ben)).is_ok());
//! ```

use fht_proto::{AuthorId, Increment, NodeId, Op};
use std::collections::BTreeMap;
use std::fmt;

/// What a writer is, as far as writing goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum WriterRole {
    /// A robot that makes maps.
    Explorer,
    /// A robot that only uses maps: it writes nothing.
    Client,
    /// People and their tools.
    Operator,
}

impl WriterRole {
    /// All roles.
    pub const ALL: [Self; 3] = [Self::Explorer, Self::Client, Self::Operator];
}

impl fmt::Display for WriterRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Explorer => "explorer",
            Self::Client => "client",
            Self::Operator => "operator",
        })
    }
}

/// Why an operation is not for a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{role}s may not {what}")]
pub struct NotPermitted {
    /// The role.
    pub role: WriterRole,
    /// What the operation would do.
    pub what: &'static str,
}

/// Whether `author`, who has a role, may write an operation.
///
/// # Errors
/// [`NotPermitted`].
pub fn may_write(role: WriterRole, author: AuthorId, op: &Op) -> Result<(), NotPermitted> {
    let refused = |what| Err(NotPermitted { role, what });
    let own = |id: &NodeId, what| if id.author == author { Ok(()) } else { refused(what) };
    match (role, op) {
        (WriterRole::Operator, _) => Ok(()),
        (WriterRole::Client, _) => refused("write"),
        (WriterRole::Explorer, op) => match op {
            Op::PutNode { id, .. } => own(id, "put nodes under others' names"),
            Op::SetPose { id, .. } => own(id, "move others' nodes"),
            Op::SetSignature { id, .. } => own(id, "say what others' nodes saw"),
            // Doubt (the mapper's `construct::map_change`), and edges to what is there.
            Op::RemoveNode { .. }
            | Op::SetFreeSpace { .. }
            | Op::SetTrust { .. }
            | Op::PutEdge { .. }
            | Op::RemoveEdge { .. }
            | Op::PutModel { .. } => Ok(()),
            Op::SetClosed { .. } => refused("close or open edges"),
            Op::SetPlace { .. } => refused("name, move or remove places"),
            Op::SetZone { .. } => refused("draw, change or remove zones"),
            Op::PutRelease { .. } => refused("make releases"),
            Op::RemoveRelease { .. } => refused("delete releases"),
            Op::Enable { .. } => refused("say which release robots use"),
            Op::SetFloorPlan { .. } => refused("lay a floor plan"),
            Op::SetDatum { .. } => refused("say where on earth the map is"),
        },
    }
}

/// The node of somebody else that an operation takes away, or makes useless by leaving it no free
/// space.
#[must_use]
pub fn takes_from_others(author: AuthorId, op: &Op) -> Option<NodeId> {
    match op {
        Op::RemoveNode { id } | Op::SetFreeSpace { id, rect: None } => Some(*id).filter(|id| id.author != author),
        _ => None,
    }
}

/// Why an increment is not for its author.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RoleViolation {
    /// Nobody of the list has this author's id.
    #[error("author {0} is nobody in the list of roles")]
    Unlisted(AuthorId),
    /// Its role does not allow it.
    #[error("{name}: {reason}")]
    Role {
        /// The author's name.
        name: String,
        /// Why.
        reason: NotPermitted,
    },
}

/// Who has which role, by author.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WriterRoles(BTreeMap<AuthorId, (WriterRole, String)>);

impl<Name: Into<String>> FromIterator<(WriterRole, Name)> for WriterRoles {
    /// From roles and the names of robots and operators.
    fn from_iter<I: IntoIterator<Item = (WriterRole, Name)>>(members: I) -> Self {
        let named = members.into_iter().map(|(role, name)| (role, name.into()));
        Self(named.map(|(role, name)| (AuthorId::of_robot(&name), (role, name))).collect())
    }
}

impl WriterRoles {
    /// An author's role.
    #[must_use]
    pub fn role(&self, author: AuthorId) -> Option<WriterRole> {
        self.0.get(&author).map(|(role, _)| *role)
    }

    /// An author's name.
    #[must_use]
    pub fn name(&self, author: AuthorId) -> Option<&str> {
        self.0.get(&author).map(|(_, name)| name.as_str())
    }

    /// The names of all who have a role.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.values().map(|(_, name)| name.as_str())
    }

    /// Whether `author` may write an operation.
    ///
    /// # Errors
    /// [`RoleViolation`].
    pub fn check_op(&self, author: AuthorId, op: &Op) -> Result<(), RoleViolation> {
        let (role, name) = self.0.get(&author).ok_or(RoleViolation::Unlisted(author))?;
        may_write(*role, author, op).map_err(|reason| RoleViolation::Role { name: name.clone(), reason })
    }

    /// Whether an increment's author may write all of it.
    ///
    /// # Errors
    /// [`RoleViolation`]: the first one.
    pub fn check(&self, increment: &Increment) -> Result<(), RoleViolation> {
        increment.ops.iter().try_for_each(|op| self.check_op(increment.author, op))
    }
}
