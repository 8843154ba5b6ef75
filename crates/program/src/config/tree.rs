//! A configuration as a tree whose keys stand in the order of the structure's fields.

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::Value;
use std::fmt;

/// A table of keys, or a value.
#[derive(Clone, Debug)]
pub(super) enum Tree {
    /// In the order of the fields.
    Table(Vec<(String, Tree)>),
    /// Anything else.
    Leaf(Value),
}

impl Tree {
    /// What `config` holds.
    pub fn of(config: &impl serde::Serialize) -> serde_json::Result<Self> {
        // The text has the order of the fields, but its numbers are not read back to the last bit;
        // the values are exact.
        let mut tree: Self = serde_json::from_str(&serde_json::to_string(config)?)?;
        tree.fill(serde_json::to_value(config)?);
        Ok(tree)
    }

    fn fill(&mut self, exact: Value) {
        match (self, exact) {
            (Self::Table(keys), Value::Object(mut values)) => {
                for (key, tree) in keys {
                    tree.fill(values.remove(key).unwrap_or_default());
                }
            }
            (leaf, value) => *leaf = Self::Leaf(value),
        }
    }

    /// The keys of a table.
    pub fn keys(&self) -> Option<&[(String, Self)]> {
        match self {
            Self::Table(keys) => Some(keys),
            Self::Leaf(_) => None,
        }
    }

    /// As plain JSON.
    pub fn into_value(self) -> Value {
        match self {
            Self::Table(keys) => Value::Object(keys.into_iter().map(|(key, tree)| (key, tree.into_value())).collect()),
            Self::Leaf(value) => value,
        }
    }
}

impl<'de> Deserialize<'de> for Tree {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(TreeVisitor)
    }
}

struct TreeVisitor;

/// Each scalar becomes a leaf of the same value.
macro_rules! leaf {
    ($($visit:ident($kind:ty)),*) => {
        $(fn $visit<E>(self, value: $kind) -> Result<Tree, E> {
            Ok(Tree::Leaf(Value::from(value)))
        })*
    };
}

impl<'de> Visitor<'de> for TreeVisitor {
    type Value = Tree;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("a configuration")
    }

    leaf!(visit_bool(bool), visit_i64(i64), visit_u64(u64), visit_f64(f64), visit_str(&str));

    fn visit_unit<E>(self) -> Result<Tree, E> {
        Ok(Tree::Leaf(Value::Null))
    }

    fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut items: A) -> Result<Tree, A::Error> {
        let mut values = Vec::new();
        while let Some(item) = items.next_element::<Tree>()? {
            values.push(item.into_value());
        }
        Ok(Tree::Leaf(Value::Array(values)))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Tree, A::Error> {
        let mut keys = Vec::new();
        while let Some(entry) = map.next_entry()? {
            keys.push(entry);
        }
        Ok(Tree::Table(keys))
    }
}
