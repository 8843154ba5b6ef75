//! JSON Schemas (draft 2020-12) of every reply and of what robots put as JSON, for clients in other
//! languages.

use crate::api::fleet::{BlockedReport, ExplorerGoal, FleetReply, RobotPose, RobotStatus};
use crate::api::goal::GoalStatus;
use crate::api::reply::{
    DiffReply, ErrorReply, Head, JournalReply, MapsReply, NodesReply, PathReply, ReleasesReply, RulesReply, SeriesReply,
};
use crate::model::ids::{AuthorId, MapName};
use crate::model::version::{Digest, VersionVector};
use schemars::generate::SchemaSettings;
use schemars::transform::transform_subschemas;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::Value;
use std::borrow::Cow;

/// A schema for each kind of message, by the name of the topic that it travels under.
#[must_use]
pub fn schemas() -> Vec<(&'static str, Schema)> {
    fn of<T: JsonSchema>() -> Schema {
        // As messages are written: what is always there is required.
        let settings = SchemaSettings::draft2020_12().for_serialize().with_transform(join_lines);
        settings.into_generator().into_root_schema_for::<T>()
    }
    vec![
        ("maps", of::<MapsReply>()),
        ("head", of::<Head>()),
        ("since", of::<SeriesReply>()),
        ("path", of::<PathReply>()),
        ("nodes", of::<NodesReply>()),
        ("releases", of::<ReleasesReply>()),
        ("diff", of::<DiffReply>()),
        ("rules", of::<RulesReply>()),
        ("fleet", of::<FleetReply>()),
        ("journal", of::<JournalReply>()),
        ("error", of::<ErrorReply>()),
        ("robot-pose", of::<RobotPose>()),
        ("robot-status", of::<RobotStatus>()),
        ("robot-blocked", of::<BlockedReport>()),
        ("robot-goal", of::<ExplorerGoal>()),
        ("robot-goal-status", of::<GoalStatus>()),
    ]
}

/// Descriptions are comments; where their lines break says nothing.
fn join_lines(schema: &mut Schema) {
    if let Some(Value::String(text)) = schema.get_mut("description") {
        *text = text.replace("\n\n", "\u{0}").replace('\n', " ").replace('\u{0}', "\n\n");
    }
    transform_subschemas(&mut join_lines, schema);
}

impl JsonSchema for AuthorId {
    fn schema_name() -> Cow<'static, str> {
        "AuthorId".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "A writer of increments: eight hexadecimal digits.",
            "type": "string",
            "pattern": "^[0-9a-f]{8}$",
        })
    }
}

impl JsonSchema for MapName {
    fn schema_name() -> Cow<'static, str> {
        "MapName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The name of a map, one chunk of a key expression.",
            "type": "string",
            "pattern": "^[A-Za-z0-9_-]{1,64}$",
        })
    }
}

impl JsonSchema for Digest {
    fn schema_name() -> Cow<'static, str> {
        "Digest".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "BLAKE3 hash of the canonical form of a map's state. Equal digests mean equal maps.",
            "type": "string",
            "pattern": "^[0-9a-f]{64}$",
        })
    }
}

impl JsonSchema for VersionVector {
    fn schema_name() -> Cow<'static, str> {
        "VersionVector".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "How many increments of each author a state contains. Authors with none are absent.",
            "type": "object",
            "patternProperties": { "^[0-9a-f]{8}$": { "type": "integer", "minimum": 1 } },
            "additionalProperties": false,
        })
    }
}
