//! What answers are made from.

use crate::catalog::Catalog;
use crate::config::AnswerConfig;
use crate::query::active_rules::ActiveRules;
use crate::query::fleet::Fleet;
use crate::store::IncrementLog;
use std::sync::Arc;

/// What answers are made from.
#[derive(Clone, Debug)]
pub struct AnswerSources {
    /// The maps.
    pub catalog: Arc<Catalog>,
    /// All their increments.
    pub log: Arc<dyn IncrementLog>,
    /// What is closed now.
    pub active_rules: Arc<ActiveRules>,
    /// The robots.
    pub fleet: Arc<Fleet>,
    /// How to answer.
    pub config: Arc<AnswerConfig>,
}
