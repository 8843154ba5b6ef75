//! From the state that is to the state that was, element by element.

use crate::crdt::inverse::element::{Element, InverseError};
use crate::crdt::state::{FULL_TRUST, MapState, NodeRef};
use fht_proto::{AuthorId, NodeId, Op, ReleaseId, ReleaseName};
use std::collections::{BTreeMap, BTreeSet};

/// From what is to what was.
pub(super) struct WayBack {
    author: AuthorId,
    before: MapState,
    now: MapState,
    /// Every release that was ever made or deleted.
    releases: BTreeSet<ReleaseId>,
    /// Deleted releases, and the names under which they are put back.
    replaced: BTreeMap<ReleaseId, ReleaseId>,
    /// Nodes taken away, put back and changed back; edges taken away and put back.
    counts: [usize; 5],
    ops: Vec<Op>,
    words: Vec<String>,
}

impl WayBack {
    pub(super) fn new(author: AuthorId, before: MapState, now: MapState, releases: BTreeSet<ReleaseId>) -> Self {
        let (replaced, counts) = (BTreeMap::new(), [0; 5]);
        Self { author, before, now, releases, replaced, counts, ops: Vec::new(), words: Vec::new() }
    }

    /// All of it, and what it does.
    pub(super) fn end(mut self) -> Result<(Vec<Op>, Vec<String>), InverseError> {
        self.check_enabled()?;
        self.count();
        Ok((self.ops, self.words))
    }

    fn say(&mut self, op: Op, words: String) {
        self.ops.push(op);
        self.words.push(words);
    }

    /// `newest` is what was written last, `was` what others wrote last.
    pub(super) fn take_back(&mut self, element: &Element, newest: &Op, was: Option<&Op>) -> Result<(), InverseError> {
        match element {
            Element::Node(id) => self.node(*id, newest),
            Element::Edge(edge) => {
                let is_put = |op: Option<&Op>| matches!(op, Some(Op::PutEdge { .. }));
                match (is_put(was), is_put(Some(newest))) {
                    (false, true) => {
                        self.counts[3] += 1;
                        self.ops.push(Op::RemoveEdge { edge: *edge });
                    }
                    (true, false) => {
                        self.counts[4] += 1;
                        self.ops.push(Op::PutEdge { edge: *edge });
                    }
                    _ => {}
                }
            }
            Element::Closure(edge) => {
                let is_closed = |op: Option<&Op>| matches!(op, Some(Op::SetClosed { closed: true, .. }));
                let closed = is_closed(was);
                if closed != is_closed(Some(newest)) {
                    let state = if closed { "closed" } else { "open" };
                    let words = format!("the edge {} {} is {state} again", edge.low(), edge.high());
                    self.say(Op::SetClosed { edge: *edge, closed }, words);
                }
            }
            // A description more does no harm.
            Element::Model(_) => {}
            Element::Place(name) => {
                let pose = self.before.annotations().place(name);
                if pose != self.now.annotations().place(name) {
                    let words = match pose {
                        None => format!("place {name} is taken away again"),
                        Some(pose) => {
                            let (x, y) = (pose.position.x(), pose.position.y());
                            format!("place {name} is at {x:.2},{y:.2}, {:.0}° again", pose.yaw().to_degrees())
                        }
                    };
                    self.say(Op::SetPlace { name: name.clone(), pose }, words);
                }
            }
            Element::Zone(name) => {
                let find =
                    |state: &MapState| state.annotations().zones().find(|it| it.0 == name).map(|it| it.1.clone());
                let zone = find(&self.before);
                if zone != find(&self.now) {
                    let state = if zone.is_some() { "is as it was" } else { "is taken away again" };
                    self.say(Op::SetZone { name: name.clone(), zone }, format!("zone {name} {state}"));
                }
            }
            Element::Release(id) => self.release(id),
            Element::Enabled => self.enabled(newest, was)?,
            Element::FloorPlan => {
                let plan = self.before.annotations().floor_plan().cloned();
                if plan.as_ref() != self.now.annotations().floor_plan() {
                    let state = if plan.is_some() { "lies as it did" } else { "is taken away again" };
                    self.say(Op::SetFloorPlan { plan }, format!("the floor plan {state}"));
                }
            }
            Element::Datum => {
                let datum = self.before.annotations().datum();
                if datum != self.now.annotations().datum() {
                    let state = if datum.is_some() { "is as it was" } else { "is taken away again" };
                    self.say(Op::SetDatum { datum }, format!("the place of the map on earth {state}"));
                }
            }
        }
        Ok(())
    }

    fn node(&mut self, id: NodeId, newest: &Op) {
        let (before, now) = (self.before.node(id), self.now.node(id));
        match (before, now) {
            (None, Some(_)) => {
                self.ops.push(Op::RemoveNode { id });
                self.counts[0] += 1;
            }
            (Some(was), None) => {
                // What was written to it after its removal would be seen with it.
                self.ops.extend((!matches!(newest, Op::RemoveNode { .. })).then_some(Op::RemoveNode { id }));
                put_node(&was, &mut self.ops);
                self.counts[1] += 1;
            }
            (Some(was), Some(is)) if was != is => {
                change_node(&was, &is, &mut self.ops);
                self.counts[2] += 1;
            }
            _ => {}
        }
    }

    fn release(&mut self, id: &ReleaseId) {
        let state_of = |map: &MapState| map.annotations().release(id).map(|release| release.release.clone());
        match (state_of(&self.before), state_of(&self.now)) {
            (None, Some(_)) => {
                self.say(Op::RemoveRelease { id: id.clone() }, format!("release {id} is deleted again"));
            }
            (Some(release), None) => {
                let new = self.free_name(&id.name);
                let words =
                    format!("release {id} is there again, as {new}: the name of a deleted release never comes back");
                self.say(Op::PutRelease { name: new.name.clone(), release }, words);
                self.replaced.insert(id.clone(), new);
            }
            _ => {}
        }
    }

    /// A name that the author has never given to a release, like `name`.
    fn free_name(&mut self, name: &ReleaseName) -> ReleaseId {
        /// Room for a number.
        const LONGEST: usize = 58;
        let author = self.author;
        let short: String = name.as_str().chars().take(LONGEST).collect();
        let others = (2_u32..).filter_map(|number| format!("{short}-{number}").parse().ok());
        let names = std::iter::once(name.clone()).chain(others).map(|name| ReleaseId { author, name });
        let free = names.into_iter().find(|id| !self.releases.contains(id));
        let free = free.unwrap_or_else(|| ReleaseId { author, name: name.clone() }); // there are enough numbers
        self.releases.insert(free.clone());
        free
    }

    fn enabled(&mut self, newest: &Op, was: Option<&Op>) -> Result<(), InverseError> {
        let of = |op: Option<&Op>| match op {
            Some(Op::Enable { release }) => release.clone(),
            _ => None,
        };
        let (was, is) = (of(was), of(Some(newest)));
        let release = match was.clone() {
            None => None,
            Some(id) => match self.replaced.get(&id) {
                Some(new) => Some(new.clone()),
                None if self.now.annotations().release(&id).is_some() => Some(id),
                None => return Err(InverseError::Deleted { release: id }),
            },
        };
        if release != is {
            let words = match &release {
                Some(id) => format!("robots use release {id} again"),
                None => "robots use the newest state again".to_owned(),
            };
            self.say(Op::Enable { release }, words);
        }
        Ok(())
    }

    /// Nothing that robots use in the end is deleted.
    fn check_enabled(&self) -> Result<(), InverseError> {
        let mut used = self.now.annotations().enabled().map(|release| release.id.clone());
        for op in &self.ops {
            if let Op::Enable { release } = op {
                used.clone_from(release);
            }
        }
        let is_deleted = |op: &Op| matches!(op, Op::RemoveRelease { id } if used.as_ref() == Some(id));
        match &used {
            Some(release) if self.ops.iter().any(is_deleted) => Err(InverseError::InUse { release: release.clone() }),
            _ => Ok(()),
        }
    }

    fn count(&mut self) {
        let whats = [
            ("node", "taken away again"),
            ("node", "there again"),
            ("node", "as before"),
            ("edge", "taken away again"),
            ("edge", "there again"),
        ];
        for (count, (what, state)) in self.counts.into_iter().zip(whats) {
            match count {
                0 => {}
                1 => self.words.push(format!("1 {what} is {state}")),
                _ => self.words.push(format!("{count} {what}s are {state}")),
            }
        }
    }
}

/// All of a node that is not shown.
fn put_node(was: &NodeRef<'_>, ops: &mut Vec<Op>) {
    let id = was.id;
    ops.push(Op::PutNode { id, kind: was.kind, pose: was.pose });
    if was.free_space.is_some() {
        ops.push(Op::SetFreeSpace { id, rect: was.free_space });
    }
    ops.extend(was.signature.map(|signature| Op::SetSignature { id, signature: signature.clone() }));
    if was.trust != FULL_TRUST {
        ops.push(Op::SetTrust { id, percent: was.trust });
    }
}

/// What differs of a node.
fn change_node(was: &NodeRef<'_>, is: &NodeRef<'_>, ops: &mut Vec<Op>) {
    let id = was.id;
    if was.signature.is_none() && is.signature.is_some() {
        // Nothing takes a signature away but a removal.
        ops.push(Op::RemoveNode { id });
        put_node(was, ops);
        return;
    }
    if was.kind != is.kind {
        ops.push(Op::PutNode { id, kind: was.kind, pose: was.pose });
    } else if was.pose != is.pose {
        ops.push(Op::SetPose { id, pose: was.pose });
    }
    if was.free_space != is.free_space {
        ops.push(Op::SetFreeSpace { id, rect: was.free_space });
    }
    if let Some(signature) = was.signature.filter(|_| was.signature != is.signature) {
        ops.push(Op::SetSignature { id, signature: signature.clone() });
    }
    if was.trust != is.trust {
        ops.push(Op::SetTrust { id, percent: was.trust });
    }
}
