//! Access control: from a list of roles to the access control section of a router's configuration.
//!
//! Zenoh's rules know certificates by their common names and have no variables, and the keys of
//! increments hold hashes of names. What is one sentence for people ("an explorer writes under its
//! own name") therefore becomes one rule per robot in the configuration, and a program writes it.
//!
//! Everything that is not allowed is denied, in both directions, as the router sees them: *ingress*
//! is what a session sends, *egress* is what it is sent. Zenoh compares by inclusion: a rule for
//! `fht/*/inc/**` covers a subscription to `fht/museum/inc/**`, but not one to `fht/**`.
//!
//! | role | sends | is sent |
//! | --- | --- | --- |
//! | client | its own `robots/{name}`, questions | increments, heads, robots, replies |
//! | explorer | the same, and its own increments | the same, and its own refusals |
//! | operator | the same as an explorer, and admin orders | everything |
//! | server | heads, refusals, replies, admin notices, questions, what storages keep | everything |
//! | router | everything | everything |
//!
//! What an increment does the routers cannot see: that the server judges, by the same list
//! ([`Roles::writers`], [`fht_map::may_write`]).
//!
//! Routers trust each other: each has checked what it passes on, by the same list. What is between
//! them access control does not see; there a router's fixed id, and who counts as a router, decide
//! ([`router_id`], [`openings`]).

mod backbone;
#[cfg(feature = "program")]
mod command;
#[cfg(feature = "program")]
mod denials;
#[cfg(feature = "program")]
mod door;
mod role_list;
mod roles;
mod router_file;
mod rules;
mod section;
mod site_check;
#[cfg(feature = "program")]
mod site_command;
mod site_roles;

pub use backbone::router_id;
#[cfg(feature = "program")]
pub(crate) use command::{AccessArgs, AccessCommandError, ServerRoles, read_roles};
#[cfg(feature = "program")]
pub(crate) use denials::layer as denials_layer;
#[cfg(feature = "program")]
pub(crate) use door::layer as door_layer;
pub use role_list::{RoleList, RoleListWriter};
pub use roles::{AccessError, Roles, parse};
pub use router_file::RouterFile;
pub use section::{configuration, object};
pub use site_check::openings;
#[cfg(feature = "program")]
pub(crate) use site_command::SiteArgs;
