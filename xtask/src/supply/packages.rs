//! The packages that the workspace is built from, with all features, on all platforms.

use crate::source::{SourceError, output, read};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Formatter};
use std::path::Path;

/// A package, and what it is built with.
#[derive(Debug)]
pub(super) struct Package {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) version: String,
    /// An SPDX expression, or what its authors wrote; empty if they wrote nothing.
    pub(super) license: String,
    /// None: a package of the workspace.
    pub(super) source: Option<String>,
    pub(super) repository: Option<String>,
    pub(super) features: Vec<String>,
    /// Ids of what it needs, but for its tests.
    pub(super) needs: BTreeSet<String>,
    /// Ids of what its tests need.
    needs_for_tests: BTreeSet<String>,
    /// SHA-256 of what the registry serves, from `Cargo.lock`.
    pub(super) checksum: Option<String>,
}

impl Display for Package {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.name, self.version)
    }
}

/// All packages by id.
#[derive(Debug)]
pub(super) struct Packages {
    pub(super) all: BTreeMap<String, Package>,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Described>,
    resolve: Resolve,
}

#[derive(Deserialize)]
struct Described {
    id: String,
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
    repository: Option<String>,
}

#[derive(Deserialize)]
struct Resolve {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    id: String,
    deps: Vec<Dependency>,
    features: Vec<String>,
}

#[derive(Deserialize)]
struct Dependency {
    pkg: String,
    dep_kinds: Vec<Kind>,
}

#[derive(Deserialize)]
struct Kind {
    kind: Option<String>,
}

#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    checksum: Option<String>,
}

impl Packages {
    pub(super) fn read(root: &Path) -> Result<Self, SourceError> {
        let json = output(root, "cargo", &["metadata", "--format-version", "1", "--all-features", "--locked"])?;
        let path = root.join("Cargo.lock");
        let lock = toml::from_str(&read(&path)?);
        let lock: Lock = lock.map_err(|error| SourceError::Policy { path, reason: error.to_string() })?;
        let broken =
            |error: serde_json::Error| SourceError::Command { command: "cargo metadata", reason: error.to_string() };
        Ok(Self::of(serde_json::from_str(&json).map_err(broken)?, lock))
    }

    fn of(metadata: Metadata, lock: Lock) -> Self {
        let checksum = |locked: Locked| Some(((locked.name, locked.version), locked.checksum?));
        let mut checksums: BTreeMap<_, _> = lock.package.into_iter().filter_map(checksum).collect();
        let mut nodes: BTreeMap<String, Node> =
            metadata.resolve.nodes.into_iter().map(|node| (node.id.clone(), node)).collect();
        let mut all = BTreeMap::new();
        for Described { id, name, version, license, source, repository } in metadata.packages {
            let Some(node) = nodes.remove(&id) else { continue };
            let is_for_tests =
                |dependency: &Dependency| dependency.dep_kinds.iter().all(|kind| kind.kind.as_deref() == Some("dev"));
            let (tests, needs): (Vec<_>, Vec<_>) = node.deps.into_iter().partition(is_for_tests);
            let ids = |list: Vec<Dependency>| list.into_iter().map(|dependency| dependency.pkg).collect();
            let package = Package {
                checksum: checksums.remove(&(name.clone(), version.clone())),
                license: license.unwrap_or_default(),
                features: node.features,
                needs: ids(needs),
                needs_for_tests: ids(tests),
                id: id.clone(),
                name,
                version,
                source,
                repository,
            };
            all.insert(id, package);
        }
        Self { all }
    }

    /// The packages that others made.
    pub(super) fn foreign(&self) -> impl Iterator<Item = &Package> {
        self.all.values().filter(|package| package.source.is_some())
    }

    /// The names of the packages that need this one, or whose tests do.
    pub(super) fn users_of(&self, id: &str) -> impl Iterator<Item = &str> {
        let needs = move |package: &&Package| package.needs.contains(id) || package.needs_for_tests.contains(id);
        self.all.values().filter(needs).map(|package| package.name.as_str())
    }

    /// These packages and all that they are built from, by id.
    pub(super) fn built_from(&self, names: &[&str]) -> BTreeMap<&str, &Package> {
        let is_root = |package: &&Package| package.source.is_none() && names.contains(&package.name.as_str());
        let mut open: Vec<&Package> = self.all.values().filter(is_root).collect();
        let mut found = BTreeMap::new();
        while let Some(package) = open.pop() {
            if found.insert(package.id.as_str(), package).is_none() {
                open.extend(package.needs.iter().filter_map(|id| self.all.get(id)));
            }
        }
        found
    }

    #[cfg(test)]
    pub(super) fn parse(metadata: &str, lock: &str) -> Self {
        Self::of(serde_json::from_str(metadata).expect("metadata"), toml::from_str(lock).expect("a lock file"))
    }
}
