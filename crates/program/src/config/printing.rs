//! From a configuration to text that says what every key means.

use super::contract::{Configuration, PrintError};
use super::schema::{KeySchema, schema_of};
use super::tree::Tree;
use serde_json::Value;
use std::fmt::Write as _;

/// Longest line of a comment.
const COLUMNS: usize = 100;

pub(super) fn print<T: Configuration>(config: &T) -> Result<String, PrintError> {
    let tree = Tree::of(config).map_err(|error| PrintError(error.to_string()))?;
    let usual = Tree::of(&T::default()).map_err(|error| PrintError(error.to_string()))?;
    let schema = schema_of::<T>();
    let mut text = String::new();
    print_comment(&mut text, KeySchema(&schema).description());
    match &tree {
        Tree::Table(keys) => print_table(&mut text, (keys, usual.keys()), KeySchema(&schema), "")?,
        Tree::Leaf(_) => return Err(PrintError("it has no keys".to_owned())),
    }
    Ok(text)
}

/// A table's keys, in the order of the fields.
type Keys = [(String, Tree)];

/// `usual` is what the keys are where nothing says otherwise. Values go first: what follows a
/// section's heading belongs to that section.
fn print_table(
    text: &mut String,
    (keys, usual): (&Keys, Option<&Keys>),
    schema: KeySchema<'_>,
    above: &str,
) -> Result<(), PrintError> {
    let is_section = |name: &str, tree: &Tree| {
        matches!(tree, Tree::Table(_)) && schema.key(name).is_some_and(|schema| schema.keys().is_some())
    };
    for (name, tree) in keys.iter().filter(|(name, tree)| !is_section(name, tree)) {
        let schema = schema.key(name).unwrap_or(KeySchema(&Value::Null));
        let value = tree.clone().into_value();
        // A part may have another default by itself than it has in the whole.
        let (own, whole) = (schema.usual(), usual.and_then(|usual| key_of(usual, name)));
        let is_same = own.zip(whole).is_none_or(|(own, whole)| *own == whole.clone().into_value());
        let description = schema.description();
        print_comment(text, &if is_same { description.to_owned() } else { without_default(description) });
        print_range(text, schema);
        match value {
            Value::Null => {
                let _ = writeln!(text, "# {name} = {}", example(schema));
            }
            value => {
                let _ = writeln!(text, "{name} = {}", toml_of(name, &value, schema)?);
            }
        }
    }
    for (name, tree) in keys.iter().filter(|(name, tree)| is_section(name, tree)) {
        let (Tree::Table(keys), Some(schema)) = (tree, schema.key(name)) else { continue };
        let path = if above.is_empty() { name.clone() } else { format!("{above}.{name}") };
        text.push('\n');
        print_comment(text, schema.description());
        let _ = writeln!(text, "[{path}]");
        let usual = usual.and_then(|usual| key_of(usual, name)).and_then(Tree::keys);
        print_table(text, (keys, usual), schema, &path)?;
    }
    Ok(())
}

fn key_of<'a>(keys: &'a Keys, name: &str) -> Option<&'a Tree> {
    keys.iter().find(|(key, _)| key == name).map(|(_, tree)| tree)
}

/// Ranges that the schema states; those of an integer's type are no news.
fn print_range(text: &mut String, schema: KeySchema<'_>) {
    if schema.0.get("format").is_some_and(|format| format.as_str().is_some_and(|name| name.starts_with("uint")))
        && schema.number("minimum") == Some(0.0)
    {
        return;
    }
    if let (Some(least), Some(most)) = (schema.number("minimum"), schema.number("maximum")) {
        let _ = writeln!(text, "# From {least} to {most}.");
    }
}

/// A description without the sentence that names a default.
fn without_default(description: &str) -> String {
    let Some(at) = description.find("Default ") else { return description.to_owned() };
    let (before, sentence) = description.split_at(at);
    let after = sentence.find(". ").map_or("", |end| &sentence[end + 2..]);
    format!("{before}{after}")
}

/// What a link of the documentation says, without its brackets: `` [`Grid`] ``.
fn without_links(description: &str) -> String {
    description.replace("[`", "`").replace("`]", "`")
}

fn print_comment(text: &mut String, description: &str) {
    let description = without_links(description);
    for paragraph in description.split("\n\n") {
        let mut line = String::from("#");
        for word in paragraph.split_whitespace() {
            if line.chars().count() + 1 + word.chars().count() > COLUMNS {
                let _ = writeln!(text, "{line}");
                line = String::from("#");
            }
            line.push(' ');
            line.push_str(word);
        }
        if line.len() > 1 {
            let _ = writeln!(text, "{line}");
        }
    }
}

/// What a key that is not set could look like.
fn example(schema: KeySchema<'_>) -> String {
    if schema.allows("string") {
        "\"\"".to_owned()
    } else if schema.allows("array") {
        "[]".to_owned()
    } else if schema.allows("boolean") {
        "false".to_owned()
    } else if schema.allows("number") {
        format!("{:?}", schema.number("minimum").unwrap_or_default())
    } else {
        schema.number("minimum").unwrap_or_default().to_string()
    }
}

fn toml_of(name: &str, value: &Value, schema: KeySchema<'_>) -> Result<String, PrintError> {
    Ok(match value {
        Value::Null => return Err(PrintError(format!("{name} has a part without a value"))),
        Value::Bool(flag) => flag.to_string(),
        Value::Number(number) => match number.as_f64() {
            // The shortest decimals that are this number.
            Some(float) if number.is_f64() && schema.is_short() => format!("{:?}", float as f32),
            Some(float) if number.is_f64() => format!("{float:?}"),
            _ => number.to_string(),
        },
        Value::String(text) => toml::Value::from(text.as_str()).to_string(),
        Value::Array(items) => {
            let one = |(index, item)| toml_of(name, item, schema.item(index).unwrap_or(KeySchema(&Value::Null)));
            let items = items.iter().enumerate().map(one).collect::<Result<Vec<_>, _>>()?;
            format!("[{}]", items.join(", "))
        }
        Value::Object(keys) => {
            let one = |(key, value): (&String, &Value)| {
                Ok(format!("{key} = {}", toml_of(name, value, KeySchema(&Value::Null))?))
            };
            let keys = keys.iter().map(one).collect::<Result<Vec<_>, PrintError>>()?;
            format!("{{ {} }}", keys.join(", "))
        }
    })
}
