//! The list of roles, read anew while the server serves, when it is told to (SIGHUP).

use crate::access::{AccessCommandError, RoleList, RoleListWriter, ServerRoles, read_roles};
use crate::config::ServerEndpoints;
use crate::network::own_name;
use std::path::{Path, PathBuf};
use tokio::signal::unix::{SignalKind, signal};

/// Follows the signal, for as long as the server runs; `reload` reads the list, if there is one. A
/// server without one goes on as it is: who sends the signal does not want it to end.
///
/// # Errors
/// When the system gives no signal handler.
pub(super) async fn follow(reload: Option<RoleReload>) -> std::io::Result<()> {
    let mut asked = signal(SignalKind::hangup())?;
    while asked.recv().await.is_some() {
        match &reload {
            Some(reload) => reload.reload(),
            None => tracing::warn!("SIGHUP reads the list of roles anew, and this server has none (--roles)"),
        }
    }
    Ok(())
}

/// Reads the list of roles of a server anew.
pub(super) struct RoleReload {
    file: PathBuf,
    list: RoleList,
    writer: RoleListWriter,
    servers: Vec<String>,
}

impl RoleReload {
    /// The list in `file` as it is now, and what reads it anew.
    ///
    /// # Errors
    /// [`AccessCommandError`], which names the file.
    pub(super) fn of(file: &Path) -> Result<(RoleList, Self), AccessCommandError> {
        let ServerRoles { writers, servers } = read_roles(file)?;
        let (writer, list) = RoleList::replaceable(writers);
        Ok((list.clone(), Self { file: file.to_owned(), list, writer, servers }))
    }

    /// Warns of a server that the list does not have: routers drop silently what it declares. It may
    /// serve all the same, for theirs may be a newer one.
    pub(super) fn warn_of_unlisted(&self, link: &ServerEndpoints) {
        let Some(name) = own_name(link) else { return };
        if !self.servers.contains(&name) {
            let (file, servers) = (self.file.display(), self.servers.join(", "));
            tracing::warn!(
                "its certificate is of server:{name}, and {file} has no server '{name}' (servers: {servers}): routers with \
                 this list let it answer nobody"
            );
        }
    }

    fn reload(&self) {
        let (file, before) = (self.file.display(), self.list.now());
        match read_roles(&self.file) {
            Ok(ServerRoles { writers: roles, .. }) => {
                let revoked: Vec<&str> = before.names().filter(|name| !roles.names().any(|now| now == *name)).collect();
                let (count, gone) = (roles.names().count(), revoked.join(", "));
                let gone = if gone.is_empty() { String::new() } else { format!("; not any more: {gone}") };
                tracing::warn!("{file} was read anew: {count} robots and operators have a role{gone}");
                self.writer.replace(roles);
            }
            Err(error) => tracing::error!("the list of roles stays as it was: {error}"),
        }
    }
}
