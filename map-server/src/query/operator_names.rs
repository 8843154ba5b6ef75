//! Names of operators that the server has heard: an increment has its author's id, which is made
//! from the name, and does not lead back to it.

use fht_proto::AuthorId;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// What an operator is called who says nothing else.
pub const DEFAULT_OPERATOR: &str = "operator";

/// So many are remembered. More operators than this have certificates and a list of roles.
const MAX_NAMES: usize = 1000;

/// Names by author.
#[derive(Debug)]
pub struct OperatorNames(Mutex<BTreeMap<AuthorId, String>>);

impl Default for OperatorNames {
    /// The one that every command has unless it is told another.
    fn default() -> Self {
        let names = Self(Mutex::default());
        names.learn(DEFAULT_OPERATOR);
        names
    }
}

impl OperatorNames {
    /// An operator called `name` was heard of.
    pub fn learn(&self, name: &str) {
        let mut names = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let author = AuthorId::of_robot(name);
        if names.len() < MAX_NAMES || names.contains_key(&author) {
            names.insert(author, name.to_owned());
        }
    }

    /// What an author is called.
    #[must_use]
    pub fn name(&self, author: AuthorId) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(&author).cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_from_when_they_are_heard_and_not_without_end() {
        let (names, ada) = (OperatorNames::default(), AuthorId::of_robot("ada"));
        assert_eq!(names.name(AuthorId::of_robot("operator")).as_deref(), Some("operator"));
        assert_eq!(names.name(ada), None);
        names.learn("ada");
        (0..2000).for_each(|number| names.learn(&format!("invented-{number}")));
        assert_eq!(names.name(ada).as_deref(), Some("ada"));
        assert_eq!(names.0.lock().unwrap_or_else(PoisonError::into_inner).len(), MAX_NAMES);
    }
}
