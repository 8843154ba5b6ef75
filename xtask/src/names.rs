//! No public type name stands twice: a word means one thing in the whole house.

use crate::Report;
use crate::source::{Source, is_for_tests};
use std::collections::BTreeMap;
use syn::{Item, Visibility};

pub(crate) fn check(sources: &[Source]) -> Report {
    let mut places: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for source in sources.iter().filter(|source| source.in_crate().is_some() && !source.is_test()) {
        for name in source.syntax.items.iter().filter_map(public_type) {
            places.entry(name).or_default().push(&source.path);
        }
    }
    let twice = places.into_iter().filter(|(_, files)| files.len() > 1);
    let findings = twice.map(|(name, files)| format!("{name}: {}", files.join(", "))).collect();
    Report { title: "public type names that stand twice", findings, is_rule: true }
}

fn public_type(item: &Item) -> Option<String> {
    let (visibility, name, attributes) = match item {
        Item::Struct(item) => (&item.vis, &item.ident, &item.attrs),
        Item::Enum(item) => (&item.vis, &item.ident, &item.attrs),
        Item::Trait(item) => (&item.vis, &item.ident, &item.attrs),
        Item::Type(item) => (&item.vis, &item.ident, &item.attrs),
        _ => return None,
    };
    (matches!(visibility, Visibility::Public(_)) && !is_for_tests(attributes)).then(|| name.to_string())
}
