//! From text to a configuration: syntax, keys, types, ranges, in this order.

use super::bounds;
use super::contract::{ConfigError, Configuration, Problem, SECTIONS};
use super::schema::{KeySchema, schema_of};
use serde_json::{Map, Value};
use std::path::Path;
use toml::de::{DeInteger, DeTable, DeValue};

/// How much alike a key of the same section must be to be the one that was meant; else other
/// sections are looked at.
const ALIKE: f64 = 0.6;
/// How much alike a key anywhere must be to be named at all.
const HARDLY_ALIKE: f64 = 0.4;
/// How much alike a key is of which the name is a word.
const ALIKE_BY_WORD: f64 = 0.7;

pub(super) fn read<T: Configuration>(defaults: &T, text: &str, file: &Path) -> Result<T, ConfigError> {
    let line_of = |at: usize| 1 + text.as_bytes().iter().take(at).filter(|byte| **byte == b'\n').count();
    let parsed = DeTable::parse(text).map_err(|error| ConfigError::Syntax {
        file: file.to_owned(),
        line: line_of(error.span().map_or(0, |span| span.start)),
        reason: error.message().to_owned(),
    })?;
    let refused = |problems| ConfigError::Refused { file: file.to_owned(), problems };
    let in_defaults = |error: serde_json::Error| {
        refused(vec![Problem { line: 1, key: "the default".to_owned(), reason: format!("is refused: {error}") }])
    };
    let schema = schema_of::<T>();
    let defaults = serde_json::to_value(defaults).map_err(in_defaults)?;
    let mut reader = Reader { root: KeySchema(&schema), line_of: &line_of, problems: Vec::new(), values: Vec::new() };
    reader.read_table(parsed.get_ref(), KeySchema(&schema), Some(&defaults), &[]);
    let Reader { mut problems, values, .. } = reader;
    let mut all = defaults.clone();
    for set in &values {
        set.put_into(&mut all);
    }
    match serde_json::from_value(all) {
        Ok(config) if problems.is_empty() => return Ok(config),
        Ok(_) => {}
        Err(error) => problems.extend(culprits::<T>(&defaults, &values, &error)),
    }
    problems.sort_by_key(|problem| problem.line);
    Err(refused(problems))
}

/// Types with rules of their own refuse values that the schema allows. Each value is tried alone to
/// find those; else `error` is all that is known.
fn culprits<T: Configuration>(defaults: &Value, values: &[Setting], error: &serde_json::Error) -> Vec<Problem> {
    let mut found = Vec::new();
    for set in values {
        let mut one = defaults.clone();
        set.put_into(&mut one);
        if let Err(error) = serde_json::from_value::<T>(one) {
            found.push(Problem { line: set.line, key: set.path.join("."), reason: format!("is refused: {error}") });
        }
    }
    if found.is_empty() {
        found.push(Problem { line: 1, key: "the file".to_owned(), reason: format!("is refused: {error}") });
    }
    found
}

/// A value that the file sets.
struct Setting {
    path: Vec<String>,
    line: usize,
    value: Value,
}

impl Setting {
    fn put_into(&self, config: &mut Value) {
        let Some((name, tables)) = self.path.split_last() else { return };
        let mut at = config;
        for table in tables {
            if !at.is_object() {
                *at = Value::Object(Map::new());
            }
            at = &mut at[table.as_str()];
        }
        at[name.as_str()] = self.value.clone();
    }
}

struct Reader<'a> {
    root: KeySchema<'a>,
    line_of: &'a dyn Fn(usize) -> usize,
    problems: Vec<Problem>,
    values: Vec<Setting>,
}

impl Reader<'_> {
    fn read_table(&mut self, table: &DeTable<'_>, schema: KeySchema<'_>, defaults: Option<&Value>, path: &[String]) {
        for (name, value) in table {
            let mut path = path.to_vec();
            path.push(name.get_ref().to_string());
            let line = (self.line_of)(name.span().start);
            let default = defaults.and_then(|defaults| defaults.get(name.get_ref().as_ref()));
            match (schema.key(name.get_ref()), value.get_ref()) {
                (None, _) if path.len() == 1 && SECTIONS.contains(&name.get_ref().as_ref()) => {}
                (None, _) => {
                    let hint = match self.nearest(schema, &path) {
                        Some(nearest) => format!("did you mean {nearest}?"),
                        None => format!("there is: {}", names_in(schema)),
                    };
                    self.refuse(line, &path, format!("is not known; {hint}"));
                }
                (Some(key), DeValue::Table(inner)) if key.keys().is_some() => {
                    self.read_table(inner, key, default, &path);
                }
                (Some(key), value) => match plain(name.get_ref(), value, key, default) {
                    Ok(value) => self.values.push(Setting { path, line, value }),
                    Err(reason) => self.refuse(line, &path, reason),
                },
            }
        }
    }

    fn refuse(&mut self, line: usize, path: &[String], reason: String) {
        self.problems.push(Problem { line, key: path.join("."), reason });
    }

    /// The known key that is most like the last of `path`: in its section, else anywhere. None if
    /// nothing is like it.
    fn nearest(&self, section: KeySchema<'_>, path: &[String]) -> Option<String> {
        let (name, tables) = path.split_last()?;
        let likeness = |other: &str| {
            let alike = strsim::normalized_damerau_levenshtein(name, other);
            // `seed` is more like `light_seed` than like `see_m`.
            if other.split('_').any(|word| word == name) { alike.max(ALIKE_BY_WORD) } else { alike }
        };
        let most_alike = |one: &(f64, String), other: &(f64, String)| {
            // Of keys equally alike the one with the shortest path.
            one.0.total_cmp(&other.0).then(other.1.len().cmp(&one.1.len()))
        };
        let in_section = section.keys().into_iter().flatten().map(|(key, _)| {
            let path: Vec<&str> = tables.iter().map(String::as_str).chain([key.as_str()]).collect();
            (likeness(key), path.join("."))
        });
        if let Some((_, key)) = in_section.filter(|(alike, _)| *alike >= ALIKE).max_by(most_alike) {
            return Some(key);
        }
        let mut all = Vec::new();
        collect_keys(self.root, "", &mut all);
        let all = all.into_iter().map(|key| (likeness(key.rsplit('.').next().unwrap_or_default()), key));
        all.filter(|(alike, _)| *alike >= HARDLY_ALIKE).max_by(most_alike).map(|(_, key)| key)
    }
}

/// The keys of a section.
fn names_in(section: KeySchema<'_>) -> String {
    let names: Vec<&str> = section.keys().into_iter().flatten().map(|(name, _)| name.as_str()).collect();
    names.join(", ")
}

fn collect_keys(schema: KeySchema<'_>, above: &str, keys: &mut Vec<String>) {
    for (name, inner) in schema.keys().into_iter().flatten() {
        let path = if above.is_empty() { name.clone() } else { format!("{above}.{name}") };
        collect_keys(KeySchema(inner), &path, keys);
        keys.push(path);
    }
}

/// The value as JSON, if `schema` allows it; else what is wrong with it.
fn plain(key: &str, value: &DeValue<'_>, schema: KeySchema<'_>, default: Option<&Value>) -> Result<Value, String> {
    let mismatch = |found: String| Err(format!("is {found}; it must be {}", schema.expected()));
    match value {
        DeValue::Boolean(flag) if schema.allows("boolean") => Ok(Value::from(*flag)),
        DeValue::Boolean(flag) => mismatch(flag.to_string()),
        DeValue::String(text) if schema.is_choice() && !schema.choices().contains(&text.as_ref()) => {
            mismatch(format!("{text:?}"))
        }
        DeValue::String(text) if schema.allows("string") => Ok(Value::from(text.as_ref())),
        DeValue::String(text) => mismatch(format!("the text {text:?}")),
        DeValue::Integer(number) => integer(key, number, schema, default),
        DeValue::Float(number) => {
            let parsed: f64 = number.as_str().parse().map_err(|error| format!("is no number: {error}"))?;
            if !schema.allows("number") {
                return mismatch(parsed.to_string());
            }
            bounds::refusal(key, parsed, schema, default).map_or_else(|| Ok(Value::from(parsed)), Err)
        }
        DeValue::Array(_) if !schema.allows("array") => mismatch("a list".to_owned()),
        DeValue::Array(items) => {
            let (least, most) = (schema.number("minItems"), schema.number("maxItems"));
            let count = items.len() as f64;
            if least.is_some_and(|least| count < least) || most.is_some_and(|most| count > most) {
                let wanted = if least == most { least } else { most.or(least) };
                return Err(format!("has {count} entries; it must have {}", wanted.unwrap_or_default()));
            }
            let item = |(index, item): (usize, &toml::Spanned<DeValue<'_>>)| {
                let schema = schema.item(index).unwrap_or(KeySchema(&Value::Bool(true)));
                plain(key, item.get_ref(), schema, default.and_then(|default| default.get(index)))
            };
            items.iter().enumerate().map(item).collect::<Result<Vec<_>, _>>().map(Value::Array)
        }
        DeValue::Table(_) if schema.is_scalar() => mismatch("a section".to_owned()),
        DeValue::Table(table) => {
            let inner = |(name, value): (&toml::Spanned<_>, &toml::Spanned<DeValue<'_>>)| {
                let name: &std::borrow::Cow<'_, str> = name.get_ref();
                let default = default.and_then(|default| default.get(name.as_ref()));
                plain(name, value.get_ref(), KeySchema(&Value::Bool(true)), default)
                    .map(|value| (name.to_string(), value))
            };
            table.iter().map(inner).collect::<Result<Map<_, _>, _>>().map(Value::Object)
        }
        DeValue::Datetime(time) => mismatch(format!("the date {time}")),
    }
}

fn integer(key: &str, number: &DeInteger<'_>, schema: KeySchema<'_>, default: Option<&Value>) -> Result<Value, String> {
    let parsed = i64::from_str_radix(number.as_str(), number.radix());
    let parsed = parsed.map_err(|_| format!("is {number}, which is too great or too small a number"))?;
    if !schema.allows("integer") && !schema.allows("number") {
        return Err(format!("is {number}; it must be {}", schema.expected()));
    }
    bounds::refusal(key, parsed as f64, schema, default).map_or_else(|| Ok(Value::from(parsed)), Err)
}
