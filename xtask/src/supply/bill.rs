//! The bill of materials: what the programs that are shipped are made of, as CycloneDX 1.5.
//!
//! The same tree gives the same file, so it has neither a date nor a serial number.

use super::packages::{Package, Packages};
use crate::source::{SourceError, read};
use serde_json::{Value, json};
use spdx::{Expression, ParseMode};
use std::path::Path;

/// The programs that are shipped, and the library for integrators.
const SHIPPED: [&str; 5] = ["client-robot", "fht", "fht-demo", "map-server", "mapper"];
/// Where the version and the hash of the wheel are stated that is fetched when a program runs.
const WHEEL: &str = "crates/descriptor/src/runtime/wheel.rs";

/// The bill, as JSON.
pub(crate) fn of_materials(root: &Path) -> Result<String, SourceError> {
    let wheel = fetched(root)?;
    let mut bill = bill(&Packages::read(root)?);
    if let Some(components) = bill["components"].as_array_mut() {
        components.push(wheel);
    }
    Ok(format!("{bill:#}\n"))
}

fn bill(packages: &Packages) -> Value {
    let built_from = packages.built_from(&SHIPPED);
    let version = built_from.values().find(|package| package.source.is_none()).map_or("", |package| &package.version);
    let components: Vec<Value> = built_from.values().map(|package| component(package)).collect();
    let needs = |package: &Package| -> Vec<String> {
        package.needs.iter().filter_map(|id| built_from.get(id.as_str())).map(|needed| url(needed)).collect()
    };
    let dependencies: Vec<Value> =
        built_from.values().map(|package| json!({ "ref": url(package), "dependsOn": needs(package) })).collect();
    json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": { "type": "application", "bom-ref": "fht-map", "name": "fht-map", "version": version } },
        "components": components,
        "dependencies": dependencies,
    })
}

/// The package's URL, by which others know it.
fn url(package: &Package) -> String {
    format!("pkg:cargo/{}@{}", package.name, package.version)
}

fn component(package: &Package) -> Value {
    let mut component = json!({
        "type": "library",
        "bom-ref": url(package),
        "name": package.name,
        "version": package.version,
        "purl": url(package),
    });
    if let Ok(licence) = Expression::canonicalize(&package.license).map(|it| it.unwrap_or(package.license.clone()))
        && Expression::parse_mode(&licence, ParseMode::STRICT).is_ok()
    {
        component["licenses"] = json!([{ "expression": licence }]);
    }
    if let Some(checksum) = &package.checksum {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": checksum }]);
    }
    if let Some(repository) = &package.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": repository }]);
    }
    component
}

/// The ONNX Runtime, which `mapper` and `client-robot` load and may fetch.
fn fetched(root: &Path) -> Result<Value, SourceError> {
    let path = root.join(WHEEL);
    let text = read(&path)?;
    let version = text.lines().find_map(|line| line.split_once("const VERSION: &str = \"")?.1.strip_suffix("\";"));
    let version = version.ok_or(SourceError::Lacks { path, what: "version of the ONNX Runtime" })?;
    let url = format!("pkg:pypi/onnxruntime@{version}");
    Ok(json!({
        "type": "library",
        "bom-ref": url,
        "name": "onnxruntime",
        "version": version,
        "purl": url,
        "licenses": [{ "expression": "MIT" }],
        "scope": "optional",
    }))
}

#[cfg(test)]
mod tests {
    use super::{bill, fetched};
    use crate::supply::packages::Packages;
    use std::path::Path;

    #[test]
    fn the_bill_has_what_programs_are_built_from_and_not_what_tests_are() {
        let metadata = r#"{
            "packages": [
                { "id": "1", "name": "mapper", "version": "0.1.0", "license": "MIT OR Apache-2.0" },
                { "id": "2", "name": "used", "version": "1.2.3", "license": "MIT/Apache-2.0", "source": "registry+x" },
                { "id": "3", "name": "tested-with", "version": "1.0.0", "license": "MIT", "source": "registry+x" },
                { "id": "4", "name": "fht-tests", "version": "0.1.0" }
            ],
            "resolve": { "nodes": [
                { "id": "1", "features": [], "deps": [
                    { "pkg": "2", "dep_kinds": [{ "kind": null }] }, { "pkg": "3", "dep_kinds": [{ "kind": "dev" }] } ] },
                { "id": "2", "features": [], "deps": [] },
                { "id": "3", "features": [], "deps": [] },
                { "id": "4", "features": [], "deps": [] }
            ] }
        }"#;
        let lock = "[[package]]\nname = 'used'\nversion = '1.2.3'\nchecksum = 'abc'\n";
        let bill = bill(&Packages::parse(metadata, lock));
        let names: Vec<_> = bill["components"].as_array().into_iter().flatten().map(|one| &one["name"]).collect();
        assert_eq!(names, ["mapper", "used"]);
        let used = &bill["components"][1];
        assert_eq!(used["licenses"][0]["expression"], "MIT OR Apache-2.0");
        assert_eq!((&used["hashes"][0]["content"], &used["purl"]), (&"abc".into(), &"pkg:cargo/used@1.2.3".into()));
        assert_eq!(bill["dependencies"][0]["dependsOn"][0], "pkg:cargo/used@1.2.3");
    }

    #[test]
    fn the_library_that_is_fetched_is_on_the_bill() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let wheel = fetched(&root).expect("the version is stated");
        assert!(wheel["purl"].as_str().is_some_and(|url| url.starts_with("pkg:pypi/onnxruntime@1.")), "{wheel}");
    }
}
