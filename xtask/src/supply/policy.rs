//! `deny.toml`, as far as it is checked here.

use crate::source::{SourceError, read};
use serde::Deserialize;
use std::path::Path;

const FILE: &str = "deny.toml";

#[derive(Debug, Deserialize)]
pub(super) struct Policy {
    pub(super) licenses: Licenses,
    pub(super) bans: Bans,
    pub(super) sources: Sources,
    pub(super) advisories: Advisories,
}

#[derive(Debug, Deserialize)]
pub(super) struct Licenses {
    pub(super) allow: Vec<String>,
    #[serde(default)]
    pub(super) exceptions: Vec<Exception>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Exception {
    #[serde(rename = "crate")]
    pub(super) name: String,
    pub(super) allow: Vec<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Bans {
    pub(super) deny: Vec<Ban>,
    #[serde(default)]
    pub(super) features: Vec<FeatureBan>,
}

/// A package that is not to be used, but by its wrappers.
#[derive(Debug, Deserialize)]
pub(super) struct Ban {
    #[serde(rename = "crate")]
    pub(super) name: String,
    #[serde(default)]
    pub(super) wrappers: Vec<String>,
    pub(super) reason: Option<String>,
}

impl Ban {
    /// Name and version, if one is given.
    pub(super) fn package(&self) -> (&str, Option<&str>) {
        self.name.split_once('@').map_or((&self.name, None), |(name, version)| (name, Some(version)))
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct FeatureBan {
    #[serde(rename = "crate")]
    pub(super) name: String,
    pub(super) deny: Vec<String>,
    pub(super) reason: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sources {
    #[serde(rename = "allow-registry")]
    pub(super) allow_registry: Vec<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Advisories {
    #[serde(default)]
    pub(super) ignore: Vec<Ignored>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Ignored {
    pub(super) id: String,
    pub(super) reason: Option<String>,
}

impl Policy {
    pub(super) fn read(root: &Path) -> Result<Self, SourceError> {
        let path = root.join(FILE);
        Self::parse(&read(&path)?).map_err(|reason| SourceError::Policy { path, reason })
    }

    pub(super) fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| error.to_string())
    }
}
