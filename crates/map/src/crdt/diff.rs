//! What has changed between two states of a map.

use crate::crdt::annotations::Annotations;
use crate::crdt::state::{MapState, NodeRef};
use fht_proto::{EdgeKey, NodeId};
use std::collections::BTreeSet;
use std::fmt;

/// What has to be done to one state to get another. Everything in the order of ids.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diff {
    /// Nodes that are new.
    pub added: Vec<NodeId>,
    /// Nodes that are gone.
    pub removed: Vec<NodeId>,
    /// Nodes that lie elsewhere, and how far from where they were, metres.
    pub moved: Vec<(NodeId, f64)>,
    /// Nodes whose kind, heading, rectangle, signature or trust is another.
    pub changed: Vec<NodeId>,
    /// Edges that are new.
    pub added_edges: Vec<EdgeKey>,
    /// Edges that are gone.
    pub removed_edges: Vec<EdgeKey>,
    /// Edges that an operator has closed since.
    pub closed_edges: Vec<EdgeKey>,
    /// Edges that are open again.
    pub opened_edges: Vec<EdgeKey>,
    /// Annotations that are new, gone or other.
    pub annotations: Vec<AnnotationChange>,
}

/// An annotation that one of two states has, or both have in different ways.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AnnotationChange {
    /// Which: `place dock`, `zone lab`, `release 2026-11-21.1@1a2b3c4d`, `enabled release`.
    pub what: String,
    /// What has become of it.
    pub became: Became,
}

/// What has become of an annotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Became {
    /// Only the later state has it.
    Added,
    /// Only the earlier state has it.
    Removed,
    /// Both have it, in different ways.
    Changed,
}

impl fmt::Display for Became {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Added => "added",
            Self::Removed => "removed",
            Self::Changed => "changed",
        })
    }
}

/// Two ascending sequences joined by key: what one has, what the other has, or what both have.
fn joined<A, B, K: Ord>(
    a: impl Iterator<Item = A>,
    b: impl Iterator<Item = B>,
    key_a: impl Fn(&A) -> K,
    key_b: impl Fn(&B) -> K,
    mut visit: impl FnMut(Option<A>, Option<B>),
) {
    let (mut a, mut b) = (a.peekable(), b.peekable());
    loop {
        let order = match (a.peek(), b.peek()) {
            (None, None) => return,
            (Some(_), None) => std::cmp::Ordering::Less,
            (None, Some(_)) => std::cmp::Ordering::Greater,
            (Some(x), Some(y)) => key_a(x).cmp(&key_b(y)),
        };
        let x = if order.is_le() { a.next() } else { None };
        let y = if order.is_ge() { b.next() } else { None };
        visit(x, y);
    }
}

/// What has changed from `from` to `to`.
#[must_use]
pub fn diff(from: &MapState, to: &MapState) -> Diff {
    let mut diff = Diff::default();
    let id = |node: &NodeRef<'_>| node.id;
    joined(from.nodes(), to.nodes(), id, id, |old, new| match (old, new) {
        (None, Some(new)) => diff.added.push(new.id),
        (Some(old), None) => diff.removed.push(old.id),
        (Some(old), Some(new)) if old != new => {
            let by_m = old.pose.position.distance(new.pose.position);
            if by_m > 0.0 {
                diff.moved.push((new.id, by_m));
            }
            let still = NodeRef { pose: fht_proto::FixedPose { position: new.pose.position, ..old.pose }, ..old };
            if still != new {
                diff.changed.push(new.id);
            }
        }
        _ => {}
    });
    joined(
        from.edges(),
        to.edges(),
        |edge| *edge,
        |edge| *edge,
        |old, new| match (old, new) {
            (None, Some(edge)) => diff.added_edges.push(edge),
            (Some(edge), None) => diff.removed_edges.push(edge),
            _ => {}
        },
    );
    let (closed_before, closed_after): (BTreeSet<EdgeKey>, BTreeSet<EdgeKey>) =
        (from.closed_edges().collect(), to.closed_edges().collect());
    diff.closed_edges = closed_after.difference(&closed_before).copied().collect();
    diff.opened_edges = closed_before.difference(&closed_after).copied().collect();
    diff.annotations = annotations(from.annotations(), to.annotations());
    diff
}

fn annotations(from: &Annotations, to: &Annotations) -> Vec<AnnotationChange> {
    let mut changed = Vec::new();
    let mut note = |is_other: bool, [was, is]: [bool; 2], what: String| {
        if is_other {
            let became = match (was, is) {
                (false, true) => Became::Added,
                (true, false) => Became::Removed,
                _ => Became::Changed,
            };
            changed.push(AnnotationChange { what, became });
        }
    };
    joined(
        from.places(),
        to.places(),
        |it| it.0,
        |it| it.0,
        |old, new| {
            let name = new.or(old).map(|it| it.0.to_string()).unwrap_or_default();
            note(old != new, [old.is_some(), new.is_some()], format!("place {name}"));
        },
    );
    joined(
        from.zones(),
        to.zones(),
        |it| it.0,
        |it| it.0,
        |old, new| {
            let name = new.or(old).map(|it| it.0.to_string()).unwrap_or_default();
            note(old != new, [old.is_some(), new.is_some()], format!("zone {name}"));
        },
    );
    joined(
        from.releases(),
        to.releases(),
        |it| it.id,
        |it| it.id,
        |old, new| {
            let (is_other, there) = (old != new, [old.is_some(), new.is_some()]);
            let id = new.or(old).map(|it| it.id.to_string()).unwrap_or_default();
            note(is_other, there, format!("release {id}"));
        },
    );
    let enabled = |of: &Annotations| of.enabled().map(|release| release.id.clone());
    note(enabled(from) != enabled(to), [true, true], "enabled release".to_owned());
    let plans = [from.floor_plan(), to.floor_plan()];
    note(plans[0] != plans[1], plans.map(|plan| plan.is_some()), "floor plan".to_owned());
    let datums = [from.datum(), to.datum()];
    note(datums[0] != datums[1], datums.map(|datum| datum.is_some()), "place on earth".to_owned());
    changed
}

impl Diff {
    /// Whether nothing has changed that can be seen.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// In a sentence, such as `12 nodes added, 3 moved by up to 0.04 m, 5 edges removed, place dock
    /// changed`.
    #[must_use]
    pub fn in_words(&self) -> String {
        if self.is_empty() {
            return "nothing has changed".to_owned();
        }
        let count = |of: usize, what: &str| (of > 0).then(|| format!("{of} {what}{}", if of == 1 { "" } else { "s" }));
        let farthest_m = self.moved.iter().map(|(_, by_m)| *by_m).fold(0.0, f64::max);
        let parts = [
            count(self.added.len(), "node").map(|text| format!("{text} added")),
            count(self.removed.len(), "node").map(|text| format!("{text} removed")),
            count(self.moved.len(), "node").map(|text| format!("{text} moved by up to {farthest_m:.3} m")),
            count(self.changed.len(), "node").map(|text| format!("{text} changed")),
            count(self.added_edges.len(), "edge").map(|text| format!("{text} added")),
            count(self.removed_edges.len(), "edge").map(|text| format!("{text} removed")),
            count(self.closed_edges.len(), "edge").map(|text| format!("{text} closed")),
            count(self.opened_edges.len(), "edge").map(|text| format!("{text} opened")),
        ];
        let annotations = self.annotations.iter().map(|of| format!("{} {}", of.what, of.became));
        parts.into_iter().flatten().chain(annotations).collect::<Vec<_>>().join(", ")
    }
}
