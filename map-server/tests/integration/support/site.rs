//! A server process, a session with it, and operators' commands.

use super::{ANA, Server, ask, bytes, client, free_endpoint, head_when, key, until_up};
use fht_proto::api::reply::{ErrorReply, PathReply};
use serde_json::Value;
use std::process::Command;
use zenoh::Session;

/// A server process, and a session with it.
pub struct Site {
    pub endpoint: String,
    pub session: Session,
    pub dir: tempfile::TempDir,
    pub server: Server,
}

impl Site {
    /// A corridor along the x axis, 2 m wide, with a node a metre.
    pub async fn with(nodes: u64) -> Self {
        let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
        let server = Server::start(&dir.path().join("data"), &endpoint);
        let session = client(&endpoint).await;
        until_up(&session).await;
        let site = Self { endpoint, session, dir, server };
        site.drive(1, nodes).await;
        site
    }

    pub async fn drive(&self, from: u64, to: u64) {
        for number in from..=to {
            self.session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
        }
        head_when(&self.session, |head| head.vector.get(ANA) == to).await;
    }

    /// Runs a command; returns its output, or its error text.
    pub fn try_run(&self, args: &[&str]) -> Result<String, String> {
        let output = Command::new(env!("CARGO_BIN_EXE_map-server"))
            .args(args)
            .args(["--connect", &self.endpoint, "--json"])
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        if output.status.success() { Ok(text(output.stdout)) } else { Err(text(output.stderr)) }
    }

    pub fn run(&self, args: &[&str]) -> Value {
        let printed = self.try_run(args).unwrap_or_else(|complaint| panic!("{args:?}: {complaint}"));
        serde_json::from_str(&printed).unwrap()
    }

    pub fn complaint(&self, args: &[&str]) -> String {
        self.try_run(args).expect_err("a complaint")
    }

    /// The server's answer to `path`.
    pub async fn path(&self, parameters: &str) -> Result<PathReply, ErrorReply> {
        let mut replies = ask(&self.session, &format!("fht/museum/path?{parameters}")).await;
        replies.remove(0).map(|bytes| serde_json::from_slice(&bytes).unwrap())
    }

    pub async fn refused(&self, parameters: &str) -> ErrorReply {
        self.path(parameters).await.expect_err("a refusal")
    }
}
