//! What comes from others: that it is what `deny.toml` allows, and a list of it.
//!
//! `cargo deny check` does the same and knows the advisories besides; this needs neither an
//! installation nor the network.
//!
//! | module | what it has |
//! | --- | --- |
//! | [`packages`] | the packages that the workspace is built from, and who needs them |
//! | [`policy`] | `deny.toml` |
//! | [`bill`] | the bill of materials: `cargo xtask sbom` |

pub(crate) mod bill;
mod packages;
mod policy;

use crate::Report;
use crate::source::SourceError;
use packages::{Package, Packages};
use policy::{Ban, Policy};
use spdx::{Expression, ParseMode};
use std::collections::BTreeSet;
use std::path::Path;

pub(crate) fn check(root: &Path) -> Result<Report, SourceError> {
    let policy = Policy::read(root)?;
    let packages = Packages::read(root)?;
    let mut findings = licences(&policy, &packages);
    findings.extend(sources(&policy, &packages));
    findings.extend(policy.bans.deny.iter().flat_map(|ban| banned(ban, &packages)));
    findings.extend(features(&policy, &packages));
    findings.extend(reasons(&policy));
    Ok(Report { title: "packages that deny.toml does not allow", findings, is_rule: true })
}

fn licences(policy: &Policy, packages: &Packages) -> Vec<String> {
    let mut findings = Vec::new();
    let mut used: BTreeSet<&str> = BTreeSet::new();
    for package in packages.foreign() {
        let exception = policy.licenses.exceptions.iter().find(|exception| exception.name == package.name);
        let allowed = policy.licenses.allow.iter().chain(exception.into_iter().flat_map(|exception| &exception.allow));
        let allowed: BTreeSet<&str> = allowed.map(String::as_str).collect();
        match Expression::parse_mode(&package.license, ParseMode::LAX) {
            Err(error) => findings.push(format!("{package}: its licence '{}' is not known: {error}", package.license)),
            Ok(licence) => {
                if licence.evaluate(|requirement| allowed.contains(requirement.to_string().as_str())) {
                    let named = licence.requirements().map(|requirement| requirement.req.to_string());
                    let named: BTreeSet<String> = named.collect();
                    used.extend(allowed.iter().filter(|licence| named.contains(**licence)));
                } else {
                    findings.push(format!("{package} is under {}, which deny.toml does not allow", package.license));
                }
            }
        }
    }
    let exceptions = policy.licenses.exceptions.iter();
    let idle = exceptions.filter(|exception| !packages.all.values().any(|package| package.name == exception.name));
    findings.extend(idle.map(|exception| format!("{} is excepted in deny.toml, and nobody needs it", exception.name)));
    let unused = policy.licenses.allow.iter().filter(|licence| !used.contains(licence.as_str()));
    findings.extend(unused.map(|licence| format!("{licence} is allowed in deny.toml, and nothing is under it")));
    findings
}

fn sources(policy: &Policy, packages: &Packages) -> Vec<String> {
    let is_allowed = |source: &str| {
        source.strip_prefix("registry+").is_some_and(|url| policy.sources.allow_registry.iter().any(|one| one == url))
    };
    let strange = packages.foreign().filter(|package| !package.source.as_deref().is_some_and(is_allowed));
    strange.map(|package| format!("{package} comes from {}", package.source.as_deref().unwrap_or("nowhere"))).collect()
}

fn banned(ban: &Ban, packages: &Packages) -> Vec<String> {
    let (name, version) = ban.package();
    let is_meant =
        |package: &&Package| package.name == name && version.is_none_or(|version| package.version == version);
    let found: Vec<&Package> = packages.all.values().filter(is_meant).collect();
    let reason = ban.reason.as_deref().unwrap_or("no reason is given");
    if ban.wrappers.is_empty() {
        return found.iter().map(|package| format!("{package} is banned: {reason}")).collect();
    }
    if found.is_empty() {
        return vec![format!("{name} is banned but for some in deny.toml, and nobody needs it")];
    }
    let users: BTreeSet<&str> = found.iter().flat_map(|package| packages.users_of(&package.id)).collect();
    let wrappers: BTreeSet<&str> = ban.wrappers.iter().map(String::as_str).collect();
    let new = users.difference(&wrappers).map(|user| format!("{user} needs {name}, which is banned: {reason}"));
    let gone = wrappers.difference(&users).map(|user| format!("{user} may use {name} by deny.toml, and does not"));
    new.chain(gone).collect()
}

fn features(policy: &Policy, packages: &Packages) -> Vec<String> {
    let mut findings = Vec::new();
    for rule in &policy.bans.features {
        for package in packages.all.values().filter(|package| package.name == rule.name) {
            let features = rule.deny.iter().filter(|feature| package.features.contains(*feature));
            findings.extend(features.map(|feature| format!("{package} has the feature {feature}: {}", rule.reason)));
        }
    }
    findings
}

/// What is let through has a reason.
fn reasons(policy: &Policy) -> Vec<String> {
    let lacks = |reason: Option<&String>| reason.is_none_or(|reason| reason.trim().is_empty());
    let bans = policy.bans.deny.iter().filter(|ban| lacks(ban.reason.as_ref())).map(|ban| ban.name.clone());
    let ignored = policy.advisories.ignore.iter().filter(|one| lacks(one.reason.as_ref())).map(|one| one.id.clone());
    bans.chain(ignored).map(|what| format!("deny.toml gives no reason for {what}")).collect()
}

#[cfg(test)]
mod tests;
