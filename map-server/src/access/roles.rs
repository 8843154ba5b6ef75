//! Who has which role.

use fht_map::{WriterRole, WriterRoles};
use fht_proto::AuthorId;
use fht_proto::api::reply::known_names;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The members of a fleet: names as in certificates, whose common names are `ROLE:NAME`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Roles {
    /// Zenoh routers.
    pub routers: Vec<String>,
    /// Map-servers.
    pub servers: Vec<String>,
    /// Robots that write maps.
    pub explorers: Vec<String>,
    /// Robots that only use maps.
    pub clients: Vec<String>,
    /// People's tools: they edit maps and give orders to the server.
    pub operators: Vec<String>,
}

/// Why there is no access control section.
#[derive(Debug, thiserror::Error)]
pub enum AccessError {
    /// The text is not JSON5, or has other fields.
    #[error("not understood (a comma, a bracket or a quote may be missing there, or just before): {0}")]
    Syntax(#[from] json5::Error),
    /// A configuration must be an object.
    #[error("not understood: a configuration begins with a brace")]
    NotAnObject,
    /// The list is empty.
    #[error("the list names nobody, and so nobody could connect")]
    Nobody,
    /// A name that no certificate can have.
    #[error("the name '{0}' is not 1 to 55 letters, digits, '_' or '-'")]
    Name(String),
    /// Two entries for one name. Robots and operators with the same name would be one author.
    #[error("the name '{name}' is listed twice, as {first} and as {second}")]
    Twice {
        /// The name.
        name: String,
        /// Its first role.
        first: &'static str,
        /// Its second role.
        second: &'static str,
    },
    /// Two names with the same author id: one could write as the other.
    #[error("the names '{first}' and '{second}' have the same author id {author}; rename one of the robots")]
    SameAuthor {
        /// One name.
        first: String,
        /// The other.
        second: String,
        /// The id of both.
        author: AuthorId,
    },
    /// A router's own configuration is asked for, but it is none.
    #[error("the list has no router called '{name}'; {}", known_names(routers))]
    NotARouter {
        /// The name.
        name: String,
        /// The routers that it has.
        routers: Vec<String>,
    },
    /// The section cannot be written.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// Reads a list of roles (JSON5).
///
/// # Errors
/// [`AccessError::Syntax`].
pub fn parse(text: &str) -> Result<Roles, AccessError> {
    Ok(json5::from_str(text)?)
}

impl Roles {
    /// Who may write what, for a server that judges increments by it.
    ///
    /// # Errors
    /// [`AccessError`]: invalid names, or names that could be taken for one another.
    pub fn writers(&self) -> Result<WriterRoles, AccessError> {
        check(self)?;
        let of = |role, names: &[String]| names.iter().map(|name| (role, name.clone())).collect::<Vec<_>>();
        let explorers = of(WriterRole::Explorer, &self.explorers);
        let clients = of(WriterRole::Client, &self.clients);
        let operators = of(WriterRole::Operator, &self.operators);
        Ok([explorers, clients, operators].into_iter().flatten().collect())
    }
}

/// All members, with their role's name in certificates.
pub(super) fn members(roles: &Roles) -> impl Iterator<Item = (&'static str, &str)> {
    let lists = [
        ("router", &roles.routers),
        ("server", &roles.servers),
        ("explorer", &roles.explorers),
        ("client", &roles.clients),
        ("operator", &roles.operators),
    ];
    lists.into_iter().flat_map(|(role, names)| names.iter().map(move |name| (role, name.as_str())))
}

/// Checks that no two members can be taken for one another.
pub(super) fn check(roles: &Roles) -> Result<(), AccessError> {
    if members(roles).next().is_none() {
        return Err(AccessError::Nobody);
    }
    let (mut machines, mut robots, mut authors) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (role, name) in members(roles) {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-';
        // A common name has at most 64 characters, the role included.
        if name.is_empty() || name.len() > 55 || !name.bytes().all(is_plain) {
            return Err(AccessError::Name(name.chars().take(80).collect()));
        }
        let is_robot = !matches!(role, "router" | "server");
        let known = if is_robot { &mut robots } else { &mut machines };
        if let Some(first) = known.insert(name, role).filter(|first| is_robot || *first == role) {
            return Err(AccessError::Twice { name: name.to_owned(), first, second: role });
        }
        let author = AuthorId::of_robot(name);
        if is_robot && let Some(first) = authors.insert(author, name) {
            return Err(AccessError::SameAuthor { first: first.to_owned(), second: name.to_owned(), author });
        }
    }
    Ok(())
}
