//! What answers are made from.

use crate::access::RoleList;
use crate::catalog::Catalog;
use crate::config::AnswerConfig;
use crate::query::active_rules::ActiveRules;
use crate::query::fleet::Fleet;
use crate::query::operator_names::OperatorNames;
use crate::store::IncrementLog;
use fht_map::WriterRole;
use fht_map::plan::blocked::Reporter;
use fht_proto::{AuthorId, MapName};
use std::sync::Arc;

/// What answers are made from.
#[derive(Clone, Debug)]
pub struct AnswerSources {
    /// The maps.
    pub catalog: Arc<Catalog>,
    /// All their increments.
    pub log: Arc<dyn IncrementLog>,
    /// Who has which role; none: that is not known.
    pub writers: Option<RoleList>,
    /// What is closed now.
    pub active_rules: Arc<ActiveRules>,
    /// The robots.
    pub fleet: Arc<Fleet>,
    /// What operators are called.
    pub operators: Arc<OperatorNames>,
    /// How to answer.
    pub config: Arc<AnswerConfig>,
}

impl AnswerSources {
    /// What somebody of this name is who reports something blocked.
    #[must_use]
    pub fn reporter(&self, map: &MapName, robot: &str) -> Reporter {
        let role = self.writers.as_ref().and_then(|writers| writers.now().role(AuthorId::of_robot(robot)));
        match role {
            Some(WriterRole::Operator) => Reporter::Trusted,
            _ => Reporter::Robot { has_token: self.fleet.is_alive(map, robot) },
        }
    }
}
