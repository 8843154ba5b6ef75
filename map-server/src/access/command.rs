//! `map-server access-control`: the list of roles on the command line.

use crate::access::roles::{AccessError, parse};
use crate::access::section::{configuration, object};
use clap::Args;
use fht_map::WriterRoles;
use serde_json::Map;
use std::path::{Path, PathBuf};

/// Writes the access control section of a Zenoh router's configuration from a list of who has which
/// role.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct AccessArgs {
    /// Who has which role (JSON5): routers, servers, explorers, clients, operators, each a list of
    /// names as in the certificates.
    #[arg(value_name = "ROLES.json5")]
    roles: PathBuf,
    /// A router's configuration (JSON5) to put the section into, in place of one that it has; its
    /// comments are lost. Without it the section is written alone. Repeatable: sections of later
    /// files, such as storages, are put into the first.
    #[arg(long, value_name = "FILE")]
    into: Vec<PathBuf>,
    /// Write the configuration of this router, a name of the list: with a fixed id, and with what
    /// keeps everybody else from between the routers. Every router of a site that has several needs
    /// its own.
    #[arg(long, value_name = "NAME")]
    router: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  map-server access-control roles.json5 --router hall --into router.json5 > zenohd-hall.json5
      what the router called hall needs: make one for each router, of the same list
  map-server access-control roles.json5 --router hall --into router.json5 --into storages.json5
      the same with storages, for map-servers that keep nothing themselves
  map-server access-control roles.json5 --into server-alone.json5 > alone.json5
      what a map-server needs that is the only router

A list of roles:
  {
    routers: ['hall', 'stairs'], servers: ['maps'],
    explorers: ['ana'], clients: ['tug-1', 'tug-2'], operators: ['desk'],
  }

Everything that a role does not need is denied. Routers read this at their start only. Give the
same list to the servers (map-server --roles): they also judge what an increment does.";

/// Why a list of roles, or a configuration, is not taken.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AccessCommandError {
    /// A file cannot be read.
    #[error("{} cannot be read: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not understood.
    #[error("{}: {source}", file.display())]
    Access {
        /// The file.
        file: PathBuf,
        /// Why.
        source: AccessError,
    },
}

fn read(file: &Path) -> Result<String, AccessCommandError> {
    std::fs::read_to_string(file).map_err(|source| AccessCommandError::Read { file: file.to_owned(), source })
}

/// What a server takes of a list of roles.
pub(crate) struct ServerRoles {
    /// Who may write what.
    pub(crate) writers: WriterRoles,
    /// Who may serve.
    pub(crate) servers: Vec<String>,
}

/// Reads a list of roles for a server.
///
/// # Errors
/// [`AccessCommandError`], which names the file.
pub(crate) fn read_roles(file: &Path) -> Result<ServerRoles, AccessCommandError> {
    let in_file = |source| AccessCommandError::Access { file: file.to_owned(), source };
    let roles = parse(&read(file)?).map_err(in_file)?;
    Ok(ServerRoles { writers: roles.writers().map_err(in_file)?, servers: roles.servers })
}

impl AccessArgs {
    /// The configuration's text.
    ///
    /// # Errors
    /// [`AccessCommandError`], which names the file.
    pub(crate) fn run(&self) -> Result<String, AccessCommandError> {
        let roles_in = |source| AccessCommandError::Access { file: self.roles.clone(), source };
        let roles = parse(&read(&self.roles)?).map_err(roles_in)?;
        let mut whole = Map::new();
        for file in &self.into {
            let in_file = |source| AccessCommandError::Access { file: file.clone(), source };
            whole.extend(object(&read(file)?).map_err(in_file)?);
        }
        configuration(whole, &roles, self.router.as_deref()).map_err(roles_in)
    }
}
