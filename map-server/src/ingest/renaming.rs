//! A map goes on under another name: everything of it is copied in the commit that notes that the
//! old one will be deleted. So there is no half of a map under either name, whatever is killed.

use crate::ingest::check::Refusal;
use crate::ingest::deletion::deletion_at;
use crate::ingest::intake::Intake;
use crate::ingest::pipeline::Ingest;
use crate::store::{DeletionRecord, StoreError};
use fht_map::crdt::reorder_buffer::ReorderBuffer;
use fht_proto::api::deletion::DeletionOrder;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head};
use fht_proto::api::request::bad_request;
use fht_proto::{AuthorId, MapName};
use std::sync::Arc;

/// Room is asked for a whole map, and not for one author.
const NOBODY: AuthorId = AuthorId(0);

impl Ingest {
    /// Has a map go on as `new`, and deletes it as `order` says. Given once more for the same two
    /// names it changes when and why the old one is deleted. Returns the old map's head; `None` if
    /// there is no such map.
    ///
    /// # Errors
    /// [`StoreError`]: nothing has changed. The inner error says why it cannot have that name.
    pub fn rename(
        &mut self,
        old: &MapName,
        new: &MapName,
        order: DeletionOrder,
        now_us: u64,
    ) -> Result<Result<Option<Arc<Head>>, ErrorReply>, StoreError> {
        let Some(view) = self.catalog.view(old) else { return Ok(Ok(None)) };
        let moved_to = self.catalog.deletion(old).and_then(|record| record.deletion.moved_to);
        if moved_to.as_ref() == Some(new) {
            return self.delete(old, order, now_us).map(Ok);
        }
        if let Err(refusal) = self.check_name(old, new, moved_to) {
            return Ok(Err(refusal));
        }
        let record = DeletionRecord { deletion: deletion_at(&order, now_us), last: None };
        self.log.move_map(old, new, &view.head.vector, &record)?;
        // What came early under the new name belongs to another map.
        drop(self.pending.take_map(new));
        self.catalog.set_deletion(new, None);
        self.catalog.add_copy(old, new);
        if let Some(intake) = self.maps.get(old) {
            let Intake { bytes, elements, by_author, .. } = intake;
            let sequence = ReorderBuffer::starting_at(view.head.vector.clone(), self.limits.early.clone());
            let copy = Intake { sequence, bytes: *bytes, elements: *elements, by_author: by_author.clone() };
            self.maps.insert(new.clone(), copy);
        }
        tracing::warn!("{}", record.deletion.sentence(old));
        self.catalog.set_deletion(old, Some(record));
        if order.grace_s == 0 {
            return self.delete(old, order, now_us).map(Ok);
        }
        Ok(Ok(self.catalog.view(old).map(|view| view.head)))
    }

    fn check_name(&self, old: &MapName, new: &MapName, moved_to: Option<MapName>) -> Result<(), ErrorReply> {
        if old == new {
            return Err(bad_request(format!("{old} is its name already")));
        }
        let conflict = |text: String| Err(ErrorReply::new(ErrorCode::Conflict, &text));
        if let Some(elsewhere) = moved_to {
            return conflict(format!(
                "{old} has moved to {elsewhere} already: rename {elsewhere}, or keep {old} with \
                 `map-server undelete {old}` first"
            ));
        }
        if let Some(damage) = self.catalog.damage(old) {
            return Err(Refusal::Damaged(damage).reply());
        }
        if self.catalog.view(new).is_some() || self.catalog.damage(new).is_some() {
            return conflict(format!("there is a map {new} already: choose another name, or merge them"));
        }
        let Some(intake) = self.maps.get(old) else { return Ok(()) };
        // Both are there until the grace period is over.
        self.check_room(new, NOBODY, intake.bytes, intake.elements).map_err(|refusal| refusal.reply())
    }
}
