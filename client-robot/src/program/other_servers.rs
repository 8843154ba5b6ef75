//! Whether somebody else on the robot's graph serves an action.

use fht_ros::{EndpointKind, RosError, RosNode};
use std::time::Duration;

/// How long the graph may take to say who is there.
const ROLL_CALL: Duration = Duration::from_secs(2);

/// The node that serves `action`, if there is one.
///
/// # Errors
/// [`RosError`] when the session is closed.
pub(super) async fn other_server(node: &RosNode, action: &str) -> Result<Option<String>, RosError> {
    let asking = node.resolve(&format!("{action}/_action/send_goal"))?;
    let there = node.others(ROLL_CALL).await?;
    let server = there.into_iter().find(|end| end.kind == EndpointKind::Server && end.name == asking);
    Ok(server.map(|end| end.node))
}
