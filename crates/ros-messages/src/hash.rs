//! Type hashes: how two ROS 2 nodes know that they mean the same by a type's name (REP-2011,
//! `RIHS01`). The hash is the SHA-256 of a description of the type and of all types in it.

use crate::definitions;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;

/// A distribution of ROS 2: which hashes its nodes write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Distribution {
    /// May 2022. It has no type hashes, and its Zenoh nodes write a placeholder.
    Humble,
    /// May 2024.
    #[default]
    Jazzy,
    /// May 2025.
    Kilted,
}

/// A name of no distribution that is known here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} is not a ROS 2 distribution that is known here: humble, jazzy or kilted")]
pub struct UnknownDistribution(String);

impl std::str::FromStr for Distribution {
    type Err = UnknownDistribution;

    fn from_str(text: &str) -> Result<Self, UnknownDistribution> {
        match text.to_ascii_lowercase().as_str() {
            "humble" => Ok(Self::Humble),
            "jazzy" => Ok(Self::Jazzy),
            "kilted" => Ok(Self::Kilted),
            _ => Err(UnknownDistribution(text.to_owned())),
        }
    }
}

/// What Humble's nodes write for a hash.
const NO_HASH: &str = "TypeHashNotSupported";

/// The hash of a type that is defined here: a message, a service, or what ROS makes of an action
/// (`nav2_msgs/action/NavigateToPose_SendGoal`). `None` for other types.
#[must_use]
pub fn type_hash(type_name: &str, distribution: Distribution) -> Option<String> {
    let hash = hash_of(type_name, &BTreeMap::new(), distribution)?;
    Some(if distribution == Distribution::Humble { NO_HASH.to_owned() } else { hash })
}

/// The hash of a message type of one's own, by its definition (the text of its `.msg` file, without
/// comments; types of other packages with the package's name). `None` if it contains a type that is
/// not defined here.
#[must_use]
pub fn definition_hash(type_name: &str, definition: &str) -> Option<String> {
    hash_of(type_name, &BTreeMap::from([(type_name.to_owned(), definition.to_owned())]), Distribution::default())
}

fn hash_of(type_name: &str, own: &BTreeMap<String, String>, distribution: Distribution) -> Option<String> {
    let mut described = BTreeMap::new();
    let text_of = |name: &str| own.get(name).cloned().or_else(|| fields_of(name, distribution));
    describe(type_name, &text_of, &mut described)?;
    let root = described.remove(type_name)?;
    let referenced: Vec<String> = described.into_values().collect();
    let text =
        format!("{{\"type_description\": {root}, \"referenced_type_descriptions\": [{}]}}", referenced.join(", "));
    let mut hash = "RIHS01_".to_owned();
    for byte in Sha256::digest(text.as_bytes()) {
        write!(hash, "{byte:02x}").ok()?;
    }
    Some(hash)
}

/// Adds the description of a type, and of all types in it, as JSON, by full names.
fn describe(
    name: &str,
    text_of: &impl Fn(&str) -> Option<String>,
    described: &mut BTreeMap<String, String>,
) -> Option<()> {
    if described.contains_key(name) {
        return Some(());
    }
    described.insert(name.to_owned(), String::new());
    let text = text_of(name)?;
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.contains('='));
    let mut fields: Vec<&str> = lines.collect();
    if fields.is_empty() {
        fields.push("uint8 structure_needs_at_least_one_member");
    }
    let mut json = Vec::new();
    for field in fields {
        let (kind, field_name) = field.split_once(' ')?;
        let Kind { id, capacity, nested } = kind_of(kind.trim())?;
        let nested_name = nested.clone().unwrap_or_default();
        json.push(format!(
            "{{\"name\": \"{}\", \"type\": {{\"type_id\": {id}, \"capacity\": {capacity}, \"string_capacity\": 0, \
             \"nested_type_name\": \"{nested_name}\"}}}}",
            field_name.trim()
        ));
        if let Some(nested) = nested {
            describe(&nested, text_of, described)?;
        }
    }
    described.insert(name.to_owned(), format!("{{\"type_name\": \"{name}\", \"fields\": [{}]}}", json.join(", ")));
    Some(())
}

/// The fields of a type by its full name, also of those that ROS makes of services and actions.
fn fields_of(name: &str, distribution: Distribution) -> Option<String> {
    let short = name.replacen("/msg/", "/", 1);
    let kilted = definitions::kilted_fields(&short).filter(|_| distribution == Distribution::Kilted);
    if let Some(fields) = kilted.or_else(|| definitions::fields(&short)) {
        return Some(fields.to_owned());
    }
    const GOAL_ID: &str = "unique_identifier_msgs/UUID goal_id\n";
    let is_action = name.contains("/action/");
    if let Some(base) = name.strip_suffix("_Event") {
        return Some(format!(
            "service_msgs/ServiceEventInfo info\n{base}_Request[<1] request\n{base}_Response[<1] response\n"
        ));
    }
    match name.rsplit_once('_') {
        Some((base, "Request")) if is_action => match base.rsplit_once('_')? {
            (action, "SendGoal") => Some(format!("{GOAL_ID}{action}_Goal goal\n")),
            (_, "GetResult") => Some(GOAL_ID.to_owned()),
            _ => None,
        },
        Some((base, "Response")) if is_action => match base.rsplit_once('_')? {
            (_, "SendGoal") => Some("bool accepted\nbuiltin_interfaces/Time stamp\n".to_owned()),
            (action, "GetResult") => Some(format!("int8 status\n{action}_Result result\n")),
            _ => None,
        },
        Some((action, "FeedbackMessage")) if is_action => Some(format!("{GOAL_ID}{action}_Feedback feedback\n")),
        Some((_, "SendGoal" | "GetResult")) if is_action => Some(service(name)),
        _ if name.contains("/srv/") && definitions::fields(&format!("{name}_Request")).is_some() => Some(service(name)),
        _ => None,
    }
}

/// A service as a type: its request, its response, and the event that introspection publishes.
fn service(name: &str) -> String {
    format!("{name}_Request request_message\n{name}_Response response_message\n{name}_Event event_message\n")
}

/// A field's type in the numbers of `type_description_interfaces/msg/FieldType`.
struct Kind {
    id: u8,
    capacity: u64,
    /// The full name, if it is no plain type.
    nested: Option<String>,
}

/// Reads `float64`, `uint8[16]`, `string[]`, `geometry_msgs/Pose[<5]` and the like (`<=` stands as
/// `<`, since lines with `=` are constants).
fn kind_of(text: &str) -> Option<Kind> {
    let (base, capacity, offset) = match text.strip_suffix(']').map(|text| text.split_once('[')) {
        None => (text, 0, 0),
        Some(None) => return None,
        Some(Some((base, ""))) => (base, 0, 144),
        Some(Some((base, size))) => match size.strip_prefix('<') {
            Some(limit) => (base, limit.parse().ok()?, 96),
            None => (base, size.parse().ok()?, 48),
        },
    };
    let plain = match base {
        "int8" => 2,
        "uint8" => 3,
        "int16" => 4,
        "uint16" => 5,
        "int32" => 6,
        "uint32" => 7,
        "int64" => 8,
        "uint64" => 9,
        "float32" => 10,
        "float64" => 11,
        "bool" => 15,
        "byte" => 16,
        "string" => 17,
        _ => 1,
    };
    let nested = (plain == 1).then(|| match base.split('/').collect::<Vec<_>>()[..] {
        [package, name] => Some(format!("{package}/msg/{name}")),
        [_, _, _] => Some(base.to_owned()),
        _ => None,
    });
    let nested = match nested {
        Some(None) => return None,
        Some(name) => name,
        None => None,
    };
    Some(Kind { id: plain + offset, capacity, nested })
}
