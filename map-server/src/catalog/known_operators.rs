//! Who is an operator, as far as the server knows: an increment of nodes and edges alone does not
//! show whether an operator wrote it, or a robot that makes maps.

use fht_map::OperatorJournal;
use fht_proto::AuthorId;
use std::fmt;
use std::sync::Arc;

/// Who is known as an operator: by the list of roles, or by its own word. By default nobody is.
#[derive(Clone)]
pub struct KnownOperators(Arc<dyn Fn(AuthorId) -> bool + Send + Sync>);

impl fmt::Debug for KnownOperators {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("KnownOperators")
    }
}

impl Default for KnownOperators {
    fn default() -> Self {
        Self::of(|_| false)
    }
}

impl KnownOperators {
    /// Those of whom `is_operator` says so at the moment.
    #[must_use]
    pub fn of(is_operator: impl Fn(AuthorId) -> bool + Send + Sync + 'static) -> Self {
        Self(Arc::new(is_operator))
    }

    /// From here on `journal` tells of whatever `author` does, if it is known as an operator.
    pub(super) fn tell(&self, journal: &mut Arc<OperatorJournal>, author: AuthorId) {
        if (self.0)(author) {
            OperatorJournal::know_operator(journal, author);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{FixedPose, Increment, NodeId, NodeKind, Op};

    #[test]
    fn what_an_operator_does_to_nodes_alone_is_told_and_what_a_robot_does_is_not() {
        let (desk, amr) = (AuthorId(7), AuthorId(8));
        let operators = KnownOperators::of(move |author| author == desk);
        let mut journal = Arc::default();
        for author in [desk, amr, desk, amr] {
            operators.tell(&mut journal, author);
            let number = 1 + journal.newest_first(None).filter(|(at, _)| at.author == author).count() as u64;
            let id = NodeId { author, number: number as u32 };
            let ops = vec![Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose::default() }];
            OperatorJournal::take(&mut journal, &Increment { author, number, hlc_us: number, ops });
        }
        let told: Vec<_> =
            journal.newest_first(None).map(|(at, change)| (at.author, at.number, change.words.join("; "))).collect();
        assert_eq!(told, [(desk, 2, "1 node is put".to_owned()), (desk, 1, "1 node is put".to_owned())]);
    }
}
