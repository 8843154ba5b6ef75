//! A foreign ROS 2 node: keys, tokens, attachments, CDR, services and actions are hiroz's.
//!
//! usage: hiroz-peer ENDPOINT HASHES ROLE
//!
//! HASHES is JSON: type hashes by name. Roles:
//!
//! * `path`, `route`, `go` and `cancel` send goals: one for each line of standard input, in JSON.
//!   They print `result {…}` for each (how it ended and what came of it), and `feedback {…}`
//!   before it.
//! * `nav2` serves navigate_to_pose: it drives straight ahead, prints `goal X Y` for each goal, and
//!   ends with its standard input.

mod messages;
mod nav2;

use hiroz::action::ZAction;
use hiroz::context::ZContextBuilder;
use hiroz::node::ZNode;
use hiroz::{Builder, Result};
use messages::{ComputePath, ComputeRoute, HASHES, Navigate};
use std::io::BufRead;
use std::time::Duration;

/// How long a server may take to come, and a word of how it goes.
const PATIENCE: Duration = Duration::from_secs(60);
/// Feedback may come after the result.
const LATE: Duration = Duration::from_secs(5);

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [endpoint, hashes, role] = &args[..] else { return Err("usage: hiroz-peer ENDPOINT HASHES ROLE".into()) };
    HASHES.set(serde_json::from_str(hashes)?).expect("it is set once");
    let context = ZContextBuilder::default()
        .with_domain_id(0)
        .with_mode("client")
        .with_connect_endpoints([endpoint.as_str()])
        .disable_multicast_scouting()
        .build()?;
    let node = context.create_node("foreign_node").build()?;
    match role.as_str() {
        "path" => ask::<ComputePath>(&node, "compute_path_to_pose", false).await,
        "route" => ask::<ComputeRoute>(&node, "compute_route", false).await,
        "go" => ask::<Navigate>(&node, "navigate_to_pose", false).await,
        "cancel" => ask::<Navigate>(&node, "navigate_to_pose", true).await,
        "nav2" => nav2::serve(&node).await,
        other => Err(format!("no role is called {other}").into()),
    }
}

/// Sends goals, one after the other; with `takes_back` each is taken back once something is heard
/// of it.
async fn ask<A: ZAction>(node: &ZNode, action: &str, takes_back: bool) -> Result<()> {
    let client = node.create_action_client::<A>(action).build()?;
    if !client.wait_for_server(PATIENCE).await {
        return Err(format!("nobody serves {action}").into());
    }
    println!("ready");
    let (lines, mut goals) = tokio::sync::mpsc::channel(16);
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(std::io::Result::ok) {
            if lines.blocking_send(line).is_err() {
                return;
            }
        }
    });
    while let Some(line) = goals.recv().await {
        let goal: A::Goal = serde_json::from_str(&line)?;
        let mut sent = client.send_goal(goal).await?;
        let mut status = sent.status_watch().ok_or("no status")?;
        let mut feedback = sent.feedback().ok_or("no feedback")?;
        if takes_back {
            feedback.recv().await.ok_or("nothing is heard of the goal")?;
            let answer = sent.cancel().await?;
            println!("cancelled {}", answer.goals_canceling.len());
        }
        // hiroz forgets a goal with its result: its status is asked before.
        let ended = tokio::time::timeout(10 * PATIENCE, status.wait_for(|status| status.is_terminal())).await;
        let ended = ended.map_or(0, |status| status.map_or(0, |status| *status as i8));
        let result = sent.result_with_timeout(PATIENCE).await?;
        // What is heard of a goal may come after its end; a goal that was taken back has had its
        // word.
        while !takes_back && let Ok(Some(heard)) = tokio::time::timeout(LATE, feedback.recv()).await {
            println!("feedback {}", serde_json::to_string(&heard)?);
            if feedback.is_empty() {
                break;
            }
        }
        println!("result {}", serde_json::json!({"status": ended, "result": result}));
    }
    Ok(())
}
