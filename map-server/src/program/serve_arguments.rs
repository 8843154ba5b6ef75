//! The flags for serving.

use crate::config::Limits;
#[cfg(feature = "web")]
use crate::program::web_arguments::WebArgs;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub(super) struct ServeArgs {
    /// Directory that keeps the maps; made if absent. One server at a time [default: fht-data].
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Keep nothing here: the maps are in so many replicated Zenoh storages (fht/*/kept/**), each
    /// in a router of its own.
    ///
    /// Any number of servers may stand on the same storages. Each has the maps in memory and reads
    /// them at its start; the nearest answers. It needs --connect or --zenoh-config, with all
    /// routers.
    #[arg(long, value_name = "COUNT", conflicts_with = "data", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub(super) storages: Option<u8>,
    /// Storages that must hold an increment before it counts as acknowledged [default: more than
    /// half of them].
    #[arg(long, value_name = "COUNT", requires = "storages", value_parser = clap::value_parser!(u8).range(1..=99))]
    pub(super) confirm: Option<u8>,
    /// Listen here for robots and tools (repeatable) [default: tcp/127.0.0.1:7447, unless --connect
    /// or --zenoh-config is given].
    ///
    /// The server then is a Zenoh router: whoever connects sees everyone else. Use tcp/0.0.0.0:7447
    /// to be reached from other machines. Without access control and --roles every stranger who
    /// reaches it may write and delete maps.
    #[arg(long, value_name = "ENDPOINT")]
    pub(super) listen: Vec<String>,
    /// Who has which role (JSON5), as for access-control: explorers write what they see, operators
    /// everything, and nobody else anything. Without it everybody may write everything.
    #[arg(long, value_name = "ROLES.json5")]
    pub(super) roles: Option<PathBuf>,
    /// Strangers are meant to reach this server: do not warn of it.
    #[arg(long)]
    pub(super) open: bool,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
    #[cfg(feature = "web")]
    #[command(flatten)]
    pub(super) web: WebArgs,
    /// Say more: once for what is asked and stored, and which robots come and go; twice for
    /// everything. RUST_LOG is obeyed, too.
    #[arg(short, long, action = clap::ArgAction::Count)]
    pub(super) verbose: u8,
}

/// Limits on what explorers may store. A writer that exceeds one is told so; nothing else happens.
#[derive(Debug, clap::Args)]
pub(super) struct LimitArgs {
    /// Nodes and edges of one map, removed ones included: some 0.7 KB of memory for each [default:
    /// 500000].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    max_map_elements: Option<u64>,
    /// Nodes and edges of all maps together [default: 2000000, or as many as one map may have].
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    max_total_elements: Option<u64>,
    /// What the increments of one map may take up on the disk, MiB [default: 1024].
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..=1 << 30))]
    max_map_mib: Option<u64>,
    /// What those of all maps may take up together, MiB [default: 4096, or as much as one map].
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..=1 << 30))]
    max_total_mib: Option<u64>,
}

impl LimitArgs {
    fn is_given(&self) -> bool {
        let Self { max_map_elements, max_total_elements, max_map_mib, max_total_mib } = self;
        [max_map_elements, max_total_elements, max_map_mib, max_total_mib].iter().any(|limit| limit.is_some())
    }

    /// These flags over `usual`.
    pub(super) fn over(&self, usual: Limits) -> Limits {
        let bytes = |mib: Option<u64>, otherwise: u64| mib.map_or(otherwise, |mib| mib << 20);
        let elements = |count: Option<u64>, otherwise| {
            count.map_or(otherwise, |count| usize::try_from(count).unwrap_or(usize::MAX))
        };
        let max_map_elements = elements(self.max_map_elements, usual.max_map_elements);
        let max_map_bytes = bytes(self.max_map_mib, usual.max_map_bytes);
        Limits {
            max_map_elements,
            max_total_elements: elements(self.max_total_elements, usual.max_total_elements.max(max_map_elements)),
            max_map_bytes,
            max_total_bytes: bytes(self.max_total_mib, usual.max_total_bytes.max(max_map_bytes)),
            ..usual
        }
    }
}

impl ServeArgs {
    /// Whether any of them is given that only a server obeys.
    pub(super) fn is_for_serving(&self) -> bool {
        let Self { data, storages, confirm, listen, roles, open, limits, .. } = self;
        #[cfg(feature = "web")]
        if self.web.is_given() {
            return true;
        }
        let is_path_given = data.is_some() || roles.is_some();
        is_path_given || storages.is_some() || confirm.is_some() || !listen.is_empty() || *open || limits.is_given()
    }
}
