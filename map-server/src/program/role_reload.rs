//! The list of roles, read anew while the server serves, when it is told to (SIGHUP).

use crate::access::{AccessCommandError, RoleList, RoleListWriter, ServerRoles, read_roles};
use crate::config::ServerEndpoints;
use crate::network::own_name;
use fht_map::WriterRoles;
use fht_proto::AuthorId;
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
    /// The server's own name in its certificate, if it shows a server's.
    own_name: Option<String>,
}

impl RoleReload {
    /// The list in `file` as it is now, and what reads it anew.
    ///
    /// # Errors
    /// [`AccessCommandError`], which names the file.
    pub(super) fn of(file: &Path, link: &ServerEndpoints) -> Result<(RoleList, Self), AccessCommandError> {
        let ServerRoles { writers, servers } = read_roles(file)?;
        let (writer, list) = RoleList::replaceable(writers);
        let reload = Self { file: file.to_owned(), list: list.clone(), writer, own_name: own_name(link) };
        reload.warn_of_unlisted(&servers);
        Ok((list, reload))
    }

    /// Warns of a server that the list does not have: routers drop silently what it declares. It
    /// serves all the same, for their list may be a newer one.
    fn warn_of_unlisted(&self, servers: &[String]) {
        if let Some(name) = self.own_name.as_ref().filter(|name| !servers.contains(name)) {
            let servers = if servers.is_empty() { "none".to_owned() } else { servers.join(", ") };
            tracing::warn!(
                "its certificate is of server:{name}, and {} has no server '{name}' (servers: {servers}): routers with \
                 this list let it answer nobody",
                self.file.display()
            );
        }
    }

    fn reload(&self) {
        let (file, before) = (self.file.display(), self.list.now());
        match read_roles(&self.file) {
            Ok(ServerRoles { writers: roles, servers }) => {
                let (count, changed) = (roles.names().count(), changes(&before, &roles));
                tracing::warn!("{file} was read anew: {count} robots and operators have a role{changed}");
                self.warn_of_unlisted(&servers);
                self.writer.replace(roles);
            }
            Err(error) => tracing::error!("the list of roles stays as it was: {error}"),
        }
    }
}

/// So many names of each kind are told.
const TOLD: usize = 20;

/// Who has another role than before, and who has none any more.
fn changes(before: &WriterRoles, now: &WriterRoles) -> String {
    let (mut gone, mut other) = (Vec::new(), Vec::new());
    for name in before.names() {
        let author = AuthorId::of_robot(name);
        match (before.role(author), now.role(author)) {
            (Some(_), None) => gone.push(name.to_owned()),
            (Some(was), Some(is)) if was != is => other.push(format!("{name} ({was}, now {is})")),
            _ => {}
        }
    }
    let told = |what: &str, mut names: Vec<String>| {
        names.sort();
        let more = names.len().saturating_sub(TOLD);
        names.truncate(TOLD);
        match (names.is_empty(), more) {
            (true, _) => String::new(),
            (false, 0) => format!("; {what}: {}", names.join(", ")),
            (false, more) => format!("; {what}: {} and {more} more", names.join(", ")),
        }
    };
    told("another role", other) + &told("not any more", gone)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_map::WriterRole;

    #[test]
    fn who_has_another_role_or_none_is_told() {
        let roles = |of: &[(WriterRole, &str)]| of.iter().map(|(role, name)| (*role, (*name).to_owned())).collect();
        let before: WriterRoles = roles(&[
            (WriterRole::Operator, "desk"),
            (WriterRole::Explorer, "ana"),
            (WriterRole::Client, "tug"),
            (WriterRole::Explorer, "ben"),
        ]);
        let now = roles(&[(WriterRole::Explorer, "desk"), (WriterRole::Explorer, "ana"), (WriterRole::Client, "new")]);
        assert_eq!(changes(&before, &now), "; another role: desk (operator, now explorer); not any more: ben, tug");
        assert_eq!(changes(&now, &now), "");
        let crowd: WriterRoles = (0..30).map(|number| (WriterRole::Client, format!("robot-{number:02}"))).collect();
        assert!(changes(&crowd, &roles(&[])).ends_with("robot-19 and 10 more"));
    }
}
