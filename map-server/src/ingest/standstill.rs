//! While the disk takes nothing, or a map cannot be read: what is refused, and how the writer goes
//! on from what is stored.

use crate::ingest::check::{Checked, Refusal};
use crate::ingest::intake::Intake;
use crate::ingest::pending_maps::PendingMaps;
use crate::ingest::pipeline::Ingest;
use crate::store::StoreError;
use fht_proto::api::reply::ErrorReply;

impl Ingest {
    /// Lets an increment through that can be stored, or is stored already: then its writer has
    /// missed a head. `fault` says why nothing can be stored.
    pub(super) fn check_open(&self, checked: Checked, fault: Option<&str>) -> Result<Checked, Refusal> {
        let (map, increment) = (&checked.map, &checked.increment);
        if let Some(damage) = self.catalog.damage(map) {
            return Err(Refusal::Damaged(damage));
        }
        let is_stored = || {
            let stored = self.maps.get(map).map(|intake| intake.sequence.vector().get(increment.author));
            stored.is_some_and(|stored| increment.number <= stored)
        };
        match fault {
            Some(reason) if !is_stored() => Err(Refusal::ReadOnly(reason.to_owned())),
            _ => Ok(checked),
        }
    }

    /// What an operator is told whose order cannot be carried out; none while the disk works.
    #[must_use]
    pub fn refusal_at_present(&self) -> Option<ErrorReply> {
        self.log.fault().map(|reason| Refusal::ReadOnly(reason).reply())
    }

    /// Forgets everything that was taken in and not stored: the log has refused it. What it takes
    /// up still counts for its authors, until [`go_on`](Self::go_on).
    pub fn stand_still(&mut self) {
        let before = std::mem::take(&mut self.maps);
        self.pending = PendingMaps::new(self.limits.early.clone(), self.limits.max_pending_bytes);
        for view in self.catalog.views() {
            let mut intake = Intake::of(&view, &self.limits.early);
            intake.by_author = before.get(&view.head.map).map(|before| before.by_author.clone()).unwrap_or_default();
            self.maps.insert(view.head.map.clone(), intake);
        }
    }

    /// Goes on from what is stored, when the log takes something again.
    ///
    /// # Errors
    /// [`StoreError`] when it cannot be read.
    pub fn go_on(&mut self) -> Result<(), StoreError> {
        self.catalog.reconcile(self.log.as_ref())?;
        self.stand_still();
        self.count_all()
    }
}
