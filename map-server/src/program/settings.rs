//! What `map-server` reads from the configuration file.

use crate::config::{AnswerConfig, FleetConfig, GapFillConfig, Limits, MIN_FREE_BYTES, Quotas};
#[cfg(feature = "web")]
use crate::program::web_arguments::WebSection;
use fht_map::plan::blocked::ReportLimits;
use fht_merge::MergeConfig;
use fht_session::SessionConfig;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The configuration of `map-server`. What is not in the file has the value that stands here; flags
/// go before both. The file may hold sections of other programs (`[mapper]`, `[client]`): each
/// program reads its own.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ServerFile {
    /// How operators' commands reach a server. The server itself reads `[server]`.
    pub(crate) connect: SessionConfig,
    /// How maps are kept and queries answered.
    pub(crate) server: ServerSection,
    /// How `map-server merge` brings two maps together.
    pub(crate) merge: MergeConfig,
}

/// How maps are kept and queries answered.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct ServerSection {
    /// Directory that keeps the maps (`--data`); made if absent. One server at a time. Default
    /// `fht-data`.
    pub(crate) data: PathBuf,
    /// Replicated Zenoh storages that keep the maps in place of the directory (`--storages`), each
    /// in a router of its own. Any number of servers may stand on the same ones. It needs `connect`
    /// or `zenoh_config`, with all routers. Default none.
    #[schemars(range(min = 1, max = 99))]
    pub(crate) storages: Option<u8>,
    /// Storages that must hold an increment before it counts as acknowledged (`--confirm`).
    /// Default: more than half.
    #[schemars(range(min = 1, max = 99))]
    pub(crate) confirm: Option<u8>,
    /// Where to listen for robots and tools (`--listen`), such as `tcp/0.0.0.0:7447`. Default
    /// `tcp/127.0.0.1:7447`, unless `connect` or `zenoh_config` is given.
    pub(crate) listen: Vec<String>,
    /// Zenoh routers to connect to (`--connect`). A server that does not listen is their client.
    /// Default none.
    pub(crate) connect: Vec<String>,
    /// A Zenoh configuration file (`--zenoh-config`, JSON5): endpoints, TLS, access control.
    /// `listen` and `connect` go before what it says. Default none.
    pub(crate) zenoh_config: Option<PathBuf>,
    /// The list of roles (`--roles`, JSON5): who may write what. Default none: everybody may write
    /// everything.
    pub(crate) roles: Option<PathBuf>,
    /// Strangers are meant to reach this server (`--open`): it does not warn of it. Default false.
    pub(crate) open: bool,
    /// With less room left on the disk of `data` the server warns, in its log and in `map-server
    /// health`, bytes. Default 256 MiB. When the disk is full it goes on answering and takes
    /// nothing in.
    pub(crate) min_free_bytes: u64,
    /// What writers may do.
    pub(crate) limits: Limits,
    /// How much room one writer may take, where the roles are known.
    pub(crate) quotas: Quotas,
    /// How queries are answered.
    pub(crate) answers: AnswerConfig,
    /// How much robots may close by what they report blocked.
    pub(crate) reports: ReportLimits,
    /// When robots count as late.
    pub(crate) fleet: FleetConfig,
    /// How a server that stands on storages fetches what it lacks.
    pub(crate) gaps: GapFillConfig,
    /// The operators' page.
    #[cfg(feature = "web")]
    pub(crate) web: WebSection,
}

impl Default for ServerSection {
    fn default() -> Self {
        Self {
            data: "fht-data".into(),
            storages: None,
            confirm: None,
            listen: Vec::new(),
            connect: Vec::new(),
            zenoh_config: None,
            roles: None,
            open: false,
            min_free_bytes: MIN_FREE_BYTES,
            limits: Limits::default(),
            quotas: Quotas::default(),
            answers: AnswerConfig::default(),
            reports: ReportLimits::default(),
            fleet: FleetConfig::default(),
            gaps: GapFillConfig::default(),
            #[cfg(feature = "web")]
            web: WebSection::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn parse(text: &str) -> Result<ServerFile, String> {
        fht_program::parse(text, Path::new("robot.toml")).map_err(|error| error.to_string())
    }

    #[test]
    fn the_printed_defaults_load_to_the_same() {
        let text = fht_program::print(&ServerFile::default()).unwrap();
        let read = parse(&text).unwrap();
        assert_eq!(serde_json::to_value(read).unwrap(), serde_json::to_value(ServerFile::default()).unwrap());
        assert!(text.contains("\n[merge.decide]\n") && text.contains("\n[server.gaps]\n"), "{text}");
        assert!(text.contains("\ndata = \"fht-data\"\n") && text.contains("\n# storages = 1\n"), "{text}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, expected) in [
            (
                "[server.limits]\nmax_map = 5",
                "robot.toml:2: server.limits.max_map is not known; did you mean server.limits.max_maps?",
            ),
            ("[server]\nstorages = 300", "robot.toml:2: server.storages is 300; it must be from 1 to 99"),
            ("[server]\nlisten = 'tcp/x:1'", "robot.toml:2: server.listen is the text \"tcp/x:1\"; it must be a list"),
            ("[server.answers]\nthreads = 0", "robot.toml:2: server.answers.threads is 0; it must be from 1 to 1024"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.starts_with(expected), "{text}\n{error}");
        }
    }

    #[test]
    fn the_example_loads() {
        let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../deploy/robot.toml");
        let file: ServerFile = fht_program::load(Path::new(example)).unwrap();
        assert_eq!(file.server.listen, ["tcp/0.0.0.0:7447"]);
    }
}
