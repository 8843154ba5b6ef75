//! What a JSON Schema says about a key of the file.

use schemars::generate::SchemaSettings;
use serde_json::{Map, Value};

/// The schema of a whole configuration.
pub(super) fn schema_of<T: schemars::JsonSchema>() -> Value {
    let settings = SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>().to_value()
}

/// The schema of one key.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeySchema<'a>(pub &'a Value);

impl<'a> KeySchema<'a> {
    /// The keys of a table; `None` for a value.
    pub fn keys(self) -> Option<&'a Map<String, Value>> {
        self.0.get("properties")?.as_object()
    }

    pub fn key(self, name: &str) -> Option<Self> {
        self.keys()?.get(name).map(Self)
    }

    /// What the field's documentation says.
    pub fn description(self) -> &'a str {
        self.0.get("description").and_then(Value::as_str).unwrap_or_default()
    }

    /// What the key is where nothing says otherwise, if its type says so.
    pub fn usual(self) -> Option<&'a Value> {
        self.0.get("default")
    }

    /// Whether a value may be of the JSON type `name`. A schema that names no type says nothing
    /// about it.
    pub fn allows(self, name: &str) -> bool {
        self.types().is_none_or(|types| types.contains(&name))
    }

    /// Whether a table is certainly no value of this key.
    pub fn is_scalar(self) -> bool {
        self.types().is_some_and(|types| !types.contains(&"object")) || self.is_choice()
    }

    fn types(self) -> Option<Vec<&'a str>> {
        Some(match self.0.get("type")? {
            Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
            name => name.as_str().into_iter().collect(),
        })
    }

    /// What a value is expected to be, in words.
    pub fn expected(self) -> String {
        let choices = self.choices();
        if !choices.is_empty() {
            return format!("one of {}", choices.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", "));
        }
        let types = self.types().unwrap_or_default();
        let names = types.iter().filter_map(|name| match *name {
            "number" => Some("a number"),
            "integer" => Some("a whole number"),
            "boolean" => Some("true or false"),
            "string" => Some("a text in quotes"),
            "array" => Some("a list"),
            "object" => Some("a section"),
            _ => None,
        });
        let names: Vec<_> = names.collect();
        if names.is_empty() { "another value".to_owned() } else { names.join(" or ") }
    }

    /// The texts that are allowed, where only some are.
    pub fn choices(self) -> Vec<&'a str> {
        let listed = self.0.get("enum").and_then(Value::as_array).into_iter().flatten();
        let described = ["oneOf", "anyOf"].into_iter().filter_map(|name| self.0.get(name)?.as_array()).flatten();
        let described = described.flat_map(|one| {
            let list = one.get("enum").and_then(Value::as_array).into_iter().flatten();
            one.get("const").into_iter().chain(list)
        });
        listed.chain(described).filter_map(Value::as_str).collect()
    }

    /// Whether only the texts of [`Self::choices`] are allowed.
    pub fn is_choice(self) -> bool {
        let Some(described) = self.0.get("oneOf").and_then(Value::as_array) else {
            return self.0.get("enum").is_some();
        };
        described.iter().all(|one| one.get("const").is_some() || one.get("enum").is_some())
    }

    /// Whether a number has 32 bits.
    pub fn is_short(self) -> bool {
        self.0.get("format").is_some_and(|format| format == "float")
    }

    /// The schema of item `index` of a list.
    pub fn item(self, index: usize) -> Option<Self> {
        let fixed = self.0.get("prefixItems").and_then(|items| items.get(index));
        fixed.or_else(|| self.0.get("items")).filter(|schema| schema.is_object()).map(Self)
    }

    /// A number that the schema itself states, such as `minimum` or `maxItems`.
    pub fn number(self, name: &str) -> Option<f64> {
        self.0.get(name)?.as_f64()
    }
}
