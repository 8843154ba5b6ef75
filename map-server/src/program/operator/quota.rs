//! What writers take of the server's room, and what they may take.

use crate::program::operator::asking::{ask_json, order_all_json};
use crate::program::operator::error::OperatorError;
use clap::{Args, Subcommand};
use fht_proto::api::keys::{AdminAction, Key};
use fht_proto::api::quota::{QuotaReply, QuotaUse, WriterQuotaView};
use fht_proto::{MapName, RobotName};
use zenoh::Session;

/// What an operator can do with quotas.
#[derive(Clone, Debug, Subcommand)]
pub enum QuotaAction {
    /// Show what each writer takes and may take, of this map and of all.
    #[command(after_help = "Examples:
  map-server quota show museum
  map-server quota show museum --json")]
    Show {
        /// The map.
        map: MapName,
    },
    /// Change what one writer may take, until the server starts again. To keep it, write it into
    /// the server's configuration, where quotas are by role ([server.quotas]).
    #[command(after_help = "Examples:
  map-server quota set museum amr-7 --map-share 0.8
  map-server quota set museum amr-7 --increments-per-s 10 --total-share 0.05
  map-server quota set museum amr-7 --of-role              as before")]
    Set {
        /// A map: the quota holds for all of them.
        map: MapName,
        /// The robot or operator.
        writer: RobotName,
        #[command(flatten)]
        change: QuotaArgs,
    },
}

/// What a quota is to be.
#[derive(Clone, Debug, Args)]
#[group(required = true, multiple = true)]
pub struct QuotaArgs {
    /// That of its role again, but for what else is given here.
    #[arg(long)]
    of_role: bool,
    /// Share of a map's bytes, and of its nodes and edges, 0 to 1.
    #[arg(long, value_name = "SHARE")]
    map_share: Option<f64>,
    /// Share of the bytes, and of the nodes and edges, of all maps, and of their number, 0 to 1.
    #[arg(long, value_name = "SHARE")]
    total_share: Option<f64>,
    /// Increments a second, ten times as many in a burst.
    #[arg(long, value_name = "COUNT")]
    increments_per_s: Option<f64>,
    /// Share of others' nodes in a map that it may take away within an hour, 0 to 1.
    #[arg(long, value_name = "SHARE")]
    taken_per_hour_share: Option<f64>,
}

impl QuotaArgs {
    /// As parameters of a query.
    fn parameters(&self, writer: &RobotName) -> String {
        let numbers = [
            ("map_share", self.map_share),
            ("total_share", self.total_share),
            ("increments_per_s", self.increments_per_s),
            ("taken_per_hour_share", self.taken_per_hour_share),
        ];
        let numbers = numbers.into_iter().filter_map(|(name, value)| Some(format!("{name}={}", value?)));
        let of_role = self.of_role.then(|| "of_role=true".to_owned());
        let all: Vec<String> = std::iter::once(format!("writer={writer}")).chain(of_role).chain(numbers).collect();
        all.join(";")
    }
}

impl QuotaAction {
    /// The map.
    pub(super) fn map(&self) -> &MapName {
        match self {
            Self::Show { map } | Self::Set { map, .. } => map,
        }
    }

    /// What everybody takes and may take after it. Of several servers every one is told.
    ///
    /// # Errors
    /// [`OperatorError`].
    pub(super) async fn carry_out(self, session: &Session) -> Result<QuotaReply, OperatorError> {
        let key = Key::Admin { map: self.map().clone(), action: AdminAction::Quota };
        match self {
            Self::Show { .. } => ask_json(session, &key.to_string()).await,
            Self::Set { map, writer, change } => {
                let selector = format!("{key}?{}", change.parameters(&writer));
                order_all_json(session, &selector, &format!("quota show {map}")).await
            }
        }
    }
}

/// A line for each writer.
pub(super) fn in_words(quotas: &QuotaReply) -> String {
    let of = |QuotaUse { used, most }: QuotaUse| format!("{used} of {most}");
    let one = |view: &WriterQuotaView| {
        format!(
            "{} ({}{}): map {}: {} bytes, {} nodes and edges; all maps: {} bytes, {} nodes and edges, {} maps; {} \
             increments/s",
            view.writer,
            view.role,
            if view.is_own { ", set by an operator" } else { "" },
            quotas.map,
            of(view.map_bytes),
            of(view.map_elements),
            of(view.total_bytes),
            of(view.total_elements),
            of(view.maps),
            view.increments_per_s,
        )
    };
    let lines: Vec<String> = quotas.writers.iter().map(one).collect();
    if lines.is_empty() { "nobody may write here".to_owned() } else { lines.join("\n") }
}
