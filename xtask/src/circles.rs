//! No modules of a crate use each other in a circle.
//!
//! A module uses another one if its code, tests apart, names something that is defined there. What
//! a module only passes on (`pub use`) it does not use; who takes it from there uses the module
//! where it is defined.

use crate::Report;
use crate::source::{Source, is_for_tests};
use std::collections::{BTreeMap, BTreeSet};
use syn::visit::{self, Visit};
use syn::{Item, UseTree, Visibility};

type Path = Vec<String>;

/// A module: what it passes on, and what it names.
#[derive(Default)]
struct Module {
    file: String,
    passes_on: BTreeMap<String, Path>,
    names: BTreeSet<Path>,
}

pub(crate) fn check(sources: &[Source]) -> Report {
    let mut crates: BTreeMap<String, BTreeMap<Path, Module>> = BTreeMap::new();
    for source in sources.iter().filter(|source| !source.is_test()) {
        let Some((name, path)) = place(source) else { continue };
        let module = Module { file: source.path.clone(), ..Module::default() };
        crates.entry(name).or_default().insert(path, module);
    }
    for source in sources.iter().filter(|source| !source.is_test()) {
        let Some((name, path)) = place(source) else { continue };
        let Some(modules) = crates.get_mut(&name) else { continue };
        let children: BTreeSet<String> = modules
            .keys()
            .filter(|other| other.len() == path.len() + 1 && other.starts_with(&path))
            .cloned()
            .map(last)
            .collect();
        let mut reader = Reader { here: path.clone(), children, imports: BTreeMap::new(), module: Module::default() };
        reader.read_uses(&source.syntax.items);
        source.syntax.items.iter().for_each(|item| reader.visit_item(item));
        if let Some(module) = modules.get_mut(&path) {
            module.passes_on = reader.module.passes_on;
            module.names = reader.module.names;
        }
    }
    let findings = crates.values().flat_map(circles_of).collect();
    Report { title: "circles of modules", findings, is_rule: true }
}

fn last(path: Path) -> String {
    path.last().cloned().unwrap_or_default()
}

/// The crate (or program of several files) that a file is part of, and its module there.
fn place(source: &Source) -> Option<(String, Path)> {
    let (folder, rest) = source.in_crate()?;
    let mut parts: Path = rest.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    let mut name = folder.to_owned();
    if parts.first().is_some_and(|first| first == "bin") && parts.len() > 1 {
        name = format!("{folder}/bin/{}", parts[1]);
        parts.drain(..2);
    }
    if parts.last().is_some_and(|last| ["lib", "main", "mod"].contains(&last.as_str())) {
        if parts.len() == 1 && parts[0] == "main" {
            name.push_str("/main");
        }
        parts.pop();
    }
    Some((name, parts))
}

/// Collects what a module names.
struct Reader {
    here: Path,
    children: BTreeSet<String>,
    /// Names that stand for modules or items of this crate.
    imports: BTreeMap<String, Path>,
    module: Module,
}

impl Reader {
    fn read_uses(&mut self, items: &[Item]) {
        for item in items {
            let Item::Use(item) = item else { continue };
            if is_for_tests(&item.attrs) {
                continue;
            }
            let mut leaves = Vec::new();
            leaves_of(&item.tree, Vec::new(), &mut leaves);
            for (name, path) in leaves {
                let Some(path) = self.absolute(&path) else { continue };
                if matches!(item.vis, Visibility::Inherited) {
                    self.module.names.insert(path.clone());
                    self.imports.insert(name, path);
                } else {
                    self.module.passes_on.insert(name.clone(), path.clone());
                    self.imports.insert(name, path);
                }
            }
        }
    }

    /// A path from the crate's root; `None` if it leads out of the crate.
    fn absolute(&self, path: &[String]) -> Option<Path> {
        let (first, rest) = path.split_first()?;
        let mut base = match first.as_str() {
            "crate" => Vec::new(),
            "self" => self.here.clone(),
            "super" => self.here[..self.here.len().saturating_sub(1)].to_vec(),
            name if self.imports.contains_key(name) => self.imports.get(name)?.clone(),
            name if self.children.contains(name) => [self.here.clone(), vec![name.to_owned()]].concat(),
            _ => return None,
        };
        for part in rest {
            if part == "super" {
                base.pop();
            } else {
                base.push(part.clone());
            }
        }
        Some(base)
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast Item) {
        let is_skipped = match item {
            Item::Mod(item) => is_for_tests(&item.attrs),
            Item::Fn(item) => is_for_tests(&item.attrs),
            Item::Impl(item) => is_for_tests(&item.attrs),
            Item::Use(_) => true,
            _ => false,
        };
        if !is_skipped {
            visit::visit_item(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Path = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if parts.len() > 1
            && let Some(path) = self.absolute(&parts)
        {
            self.module.names.insert(path);
        }
        visit::visit_path(self, path);
    }
}

fn leaves_of(tree: &UseTree, before: Path, leaves: &mut Vec<(String, Path)>) {
    let with = |name: &syn::Ident| [before.clone(), vec![name.to_string()]].concat();
    match tree {
        UseTree::Path(path) => leaves_of(&path.tree, with(&path.ident), leaves),
        UseTree::Name(name) if name.ident == "self" => leaves.push((last(before.clone()), before)),
        UseTree::Name(name) => leaves.push((name.ident.to_string(), with(&name.ident))),
        UseTree::Rename(name) => leaves.push((name.rename.to_string(), with(&name.ident))),
        UseTree::Glob(_) => leaves.push((String::new(), before)),
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves_of(tree, before.clone(), leaves)),
    }
}

/// The module in which a path's item is defined.
fn definition(modules: &BTreeMap<Path, Module>, path: &[String], depth: usize) -> Option<Path> {
    let module = (0..=path.len()).rev().map(|count| &path[..count]).find(|prefix| modules.contains_key(*prefix))?;
    let item = path.get(module.len());
    match item.and_then(|item| modules[module].passes_on.get(item)) {
        Some(elsewhere) if depth < 8 => definition(modules, elsewhere, depth + 1),
        _ => Some(module.to_vec()),
    }
}

fn circles_of(modules: &BTreeMap<Path, Module>) -> Vec<String> {
    let uses: BTreeMap<&Path, BTreeSet<Path>> = modules
        .iter()
        .map(|(path, module)| {
            let used = module.names.iter().filter_map(|name| definition(modules, name, 0));
            (path, used.filter(|used| used != path).collect())
        })
        .collect();
    let reaches = |from: &Path| {
        let mut seen = BTreeSet::new();
        let mut open = vec![from];
        while let Some(path) = open.pop() {
            for next in &uses[path] {
                if seen.insert(next) {
                    open.push(next);
                }
            }
        }
        seen
    };
    let reach: BTreeMap<&Path, BTreeSet<&Path>> = modules.keys().map(|path| (path, reaches(path))).collect();
    let mut done = BTreeSet::new();
    let mut circles = Vec::new();
    for path in modules.keys().filter(|path| reach[path].contains(path)) {
        if done.contains(path) {
            continue;
        }
        let ring: Vec<&Path> = reach[path].iter().copied().filter(|other| reach[other].contains(path)).collect();
        done.extend(ring.iter().copied());
        let files: Vec<&str> = ring.iter().map(|path| modules[*path].file.as_str()).collect();
        circles.push(files.join(", "));
    }
    circles
}
