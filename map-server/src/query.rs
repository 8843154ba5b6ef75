//! What is answered: typed requests to replies, over the maps, the robots and what is closed.
//!
//! | module | idea |
//! | --- | --- |
//! | `answer` | a request to its replies |
//! | `active_rules` | what is closed now, by operators and by robots |
//! | `fleet` | the robots: what they run, who is late |
//! | `operator_names` | what operators are called |

mod active_rules;
mod answer;
mod fleet;
mod operator_names;

pub use active_rules::{ActiveRules, OtherState};
pub use answer::{Answer, AnswerSources, answer, answer_at_once};
#[cfg(feature = "web")]
pub(crate) use answer::{find_release, node_view, state_of, written_rules};
pub(crate) use answer::{internal, json, unknown_map};
pub use fleet::Fleet;
#[cfg(feature = "program")]
pub(crate) use operator_names::DEFAULT_OPERATOR;
pub use operator_names::OperatorNames;
