//! The rules for packages, on a small workspace.

use super::packages::Packages;
use super::policy::Policy;
use super::{banned, features, licences, reasons, sources};

fn packages() -> Packages {
    let metadata = r#"{
        "packages": [
            { "id": "0", "name": "ours", "version": "0.1.0" },
            { "id": "1", "name": "free", "version": "1.0.0", "license": "LGPL-2.1 OR MIT", "source": "registry+https://a" },
            { "id": "2", "name": "bound", "version": "1.0.0", "license": "GPL-3.0-only", "source": "registry+https://a" },
            { "id": "3", "name": "both", "version": "1.0.0", "license": "MIT AND MPL-2.0", "source": "git+https://a" },
            { "id": "4", "name": "old", "version": "0.4.1", "license": "MIT/Zlib", "source": "registry+https://b" }
        ],
        "resolve": { "nodes": [
            { "id": "0", "features": [], "deps": [
                { "pkg": "1", "dep_kinds": [{ "kind": null }] }, { "pkg": "4", "dep_kinds": [{ "kind": "dev" }] } ] },
            { "id": "1", "features": ["std", "fast"], "deps": [{ "pkg": "4", "dep_kinds": [{ "kind": "build" }] }] },
            { "id": "2", "features": [], "deps": [] },
            { "id": "3", "features": [], "deps": [] },
            { "id": "4", "features": [], "deps": [] }
        ] }
    }"#;
    Packages::parse(metadata, "package = []")
}

fn policy(bans: &str) -> Policy {
    let text = format!(
        "[licenses]\nallow = ['MIT', 'ISC']\nexceptions = [{{ crate = 'both', allow = ['MPL-2.0'] }}]\n{bans}\n\
         [sources]\nallow-registry = ['https://a']\n[advisories]\nignore = [{{ id = 'RUSTSEC-1' }}]\n"
    );
    Policy::parse(&text).expect("a policy")
}

fn with_ban(ban: &str) -> Vec<String> {
    banned(&policy(&format!("[bans]\ndeny = [{ban}]")).bans.deny[0], &packages())
}

#[test]
fn a_licence_that_is_not_allowed_is_found_and_one_that_nobody_needs() {
    let found = licences(&policy("[bans]\ndeny = []"), &packages());
    assert_eq!(
        found,
        [
            "bound 1.0.0 is under GPL-3.0-only, which deny.toml does not allow",
            "ISC is allowed in deny.toml, and nothing is under it",
        ]
    );
}

#[test]
fn packages_come_from_the_registry_and_from_nowhere_else() {
    let found = sources(&policy("[bans]\ndeny = []"), &packages());
    assert_eq!(found, ["both 1.0.0 comes from git+https://a", "old 0.4.1 comes from registry+https://b"]);
}

#[test]
fn a_banned_package_is_used_by_those_that_are_named_and_no_others() {
    assert_eq!(with_ban("{ crate = 'old', reason = 'why' }"), ["old 0.4.1 is banned: why"]);
    assert_eq!(with_ban("{ crate = 'old@9.0.0', reason = 'why' }"), [""; 0]);
    assert_eq!(with_ban("{ crate = 'old@0.4.1', wrappers = ['free', 'ours'], reason = 'why' }"), [""; 0]);
    assert_eq!(
        with_ban("{ crate = 'old', wrappers = ['free'], reason = 'why' }"),
        ["ours needs old, which is banned: why"]
    );
    assert_eq!(
        with_ban("{ crate = 'old', wrappers = ['free', 'ours', 'bound'], reason = 'why' }"),
        ["bound may use old by deny.toml, and does not"]
    );
    assert_eq!(
        with_ban("{ crate = 'gone', wrappers = ['free'], reason = 'why' }"),
        ["gone is banned but for some in deny.toml, and nobody needs it"]
    );
}

#[test]
fn a_feature_that_is_denied_and_a_missing_reason_are_found() {
    let policy = policy(
        "[bans]\ndeny = [{ crate = 'old' }]\nfeatures = [{ crate = 'free', deny = ['fast', 'safe'], reason = 'why' }]",
    );
    assert_eq!(features(&policy, &packages()), ["free 1.0.0 has the feature fast: why"]);
    assert_eq!(reasons(&policy), ["deny.toml gives no reason for old", "deny.toml gives no reason for RUSTSEC-1"]);
}
