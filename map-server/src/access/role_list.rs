//! Who has which role now, for a server that runs: the list may be read anew while it serves.

use fht_map::WriterRoles;
use std::sync::Arc;
use tokio::sync::watch;

/// Who has which role now. Copies are one list.
#[derive(Clone, Debug)]
pub struct RoleList(watch::Receiver<Arc<WriterRoles>>);

/// Puts another list in a [`RoleList`]'s place.
#[derive(Debug)]
pub struct RoleListWriter(watch::Sender<Arc<WriterRoles>>);

impl RoleList {
    /// A list that may be replaced, and what replaces it.
    #[must_use]
    pub fn replaceable(roles: WriterRoles) -> (RoleListWriter, Self) {
        let (writer, list) = watch::channel(Arc::new(roles));
        (RoleListWriter(writer), Self(list))
    }

    /// The list as it is now.
    #[must_use]
    pub fn now(&self) -> Arc<WriterRoles> {
        Arc::clone(&self.0.borrow())
    }
}

impl From<WriterRoles> for RoleList {
    /// A list that stays as it is.
    fn from(roles: WriterRoles) -> Self {
        Self::replaceable(roles).1
    }
}

impl RoleListWriter {
    /// Puts `roles` in place of the list.
    pub fn replace(&self, roles: WriterRoles) {
        // Whoever read it before has gone: then nobody judges by it.
        let _ = self.0.send(Arc::new(roles));
    }
}
