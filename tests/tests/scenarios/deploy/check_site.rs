//! `map-server check-site` of the configurations that are made of `deploy/`.

use super::{for_router, guarded, map_server, roles, said};
use crate::site::{in_file, read};
use serde_json::Value;

/// What `map-server check-site` says of these configurations, of the first routers of the list.
fn check_site(texts: &[String]) -> (Option<i32>, String) {
    let dir = tempfile::tempdir().unwrap();
    let files: Vec<String> = (texts.iter().zip(&roles().routers))
        .map(|(text, name)| in_file(dir.path(), name, text).to_str().unwrap().to_owned())
        .collect();
    let words: Vec<&str> = std::iter::once("check-site").chain(files.iter().map(String::as_str)).collect();
    let output = map_server(&words);
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

#[test]
fn a_router_that_gives_others_or_more_than_the_list_says_is_named() {
    let fine: Vec<String> = roles().routers.iter().map(|name| for_router(name, &["router.json5"])).collect();
    assert_eq!(check_site(&fine), (Some(0), "3 router(s): nothing is open\n".to_owned()));
    let robot = &roles().explorers[0];
    let told_of = |change: &dyn Fn(&mut Value)| {
        let mut config: Value = json5::from_str(&fine[1]).unwrap();
        change(&mut config["access_control"]);
        let (code, told) = check_site(&[fine[0].clone(), config.to_string(), fine[2].clone()]);
        assert_eq!(code, Some(1), "{told}");
        told
    };
    let of = |section: &Value, list: &str, id: &str| {
        section[list].as_array().unwrap().iter().position(|item| item["id"] == id).unwrap()
    };

    let told = told_of(&|section| {
        let text = section.to_string().replace(&format!("explorer:{robot}"), "explorer:mallory");
        *section = serde_json::from_str(&text).unwrap();
    });
    assert!(told.contains("have different lists of roles") && told.contains("explorer:mallory"), "{told}");
    assert!(told.contains(&format!("has explorer:{robot};")), "{told}");

    let told = told_of(&|section| {
        let at = of(section, "subjects", "operator:desk");
        section["subjects"][at].as_object_mut().unwrap().remove("cert_common_names");
    });
    assert!(told.contains("'operator:desk' has no cert_common_names: everybody"), "{told}");

    let told = told_of(&|section| {
        let at = of(section, "rules", "robots ask");
        section["rules"][at]["key_exprs"].as_array_mut().unwrap().push("fht/**".into());
    });
    assert!(told.contains("the rule 'robots ask' allows more than access-control writes: fht/**"), "{told}");

    let told = told_of(&|section| {
        let at = of(section, "policies", &format!("explorer:{robot}"));
        section["policies"][at]["rules"].as_array_mut().unwrap().push("operators order".into());
    });
    assert!(told.contains("is given what its role does not have: operators order"), "{told}");

    let told = told_of(&|section| {
        let rule = serde_json::json!({ "id": "mine", "permission": "allow", "messages": ["put"], "key_exprs": ["**"] });
        section["rules"].as_array_mut().unwrap().push(rule);
    });
    assert!(told.contains("the rule 'mine' is none that access-control writes"), "{told}");

    let told = told_of(&|section| {
        let at = of(section, "rules", "robots hear");
        section["rules"].as_array_mut().unwrap().remove(at);
        for policy in section["policies"].as_array_mut().unwrap() {
            policy["rules"].as_array_mut().unwrap().retain(|rule| rule != "robots hear");
        }
    });
    assert!(told.contains("the rule 'robots hear' is missing"), "{told}");
}

#[test]
fn a_site_of_these_files_leaves_nothing_open_and_what_is_open_is_said() {
    let checked = check_site;
    let names: Vec<String> = roles().routers;
    let fine: Vec<String> = names.iter().map(|name| for_router(name, &["router.json5", "storages.json5"])).collect();
    assert_eq!(checked(&fine), (Some(0), "3 router(s): nothing is open\n".to_owned()));
    let alone = guarded(&[], &["server-alone.json5"]);
    assert_eq!(checked(&[alone]).0, Some(0));
    let (code, told) = checked(&fine[..1]);
    assert!(code == Some(1) && told.contains("a.json5: it counts others as routers"), "{told}");
    assert!(!told.contains("nothing is open"), "{told}");

    // The routers of all sites until now.
    let bare: Vec<String> = names.iter().map(|_| read("router.json5")).collect();
    let (code, told) = checked(&bare);
    assert_eq!(code, Some(1));
    for part in ["a.json5: it has no fixed id", "gateway/south does not keep apart", "there is no access control"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let changes = [
        ("\"enable_mtls\": true", "\"enable_mtls\": false", "enable_mtls is not set"),
        ("\"default_permission\": \"deny\"", "\"default_permission\": \"allow\"", "default_permission must be deny"),
        ("\"weight\": 1", "\"weight\": 100", "can draw to itself what goes between them"),
        ("\"negated\": true", "\"negated\": false", "gateway/south does not keep apart"),
        ("\"write\": false", "\"write\": true", "changed over the network"),
        ("\"accept_pending\": 2000", "\"accept_pending\": 100", "accept_pending is 100 and should be at least"),
        ("\"lease\": 6000", "\"lease\": 10000", "lease is 10000 and should be at most 6000"),
        ("tls/[::]:7447", "tcp/[::]:7447", "listens without TLS"),
        ("\"storage_manager\": {", "\"rest\": { \"http_port\": 8000 }, \"storage_manager\": {", "the REST plugin"),
    ];
    for (from, to, expected) in changes {
        assert!(fine[0].contains(from), "{from}");
        let (code, told) = checked(&[fine[0].replace(from, to), fine[1].clone(), fine[2].clone()]);
        assert!(code == Some(1) && told.contains("a.json5: ") && told.contains(expected), "{to}: {told}");
    }
    let (_, told) = checked(&[fine[0].clone(), fine[0].clone(), fine[2].clone()]);
    assert!(told.contains("have the same id") && told.contains("which is none of these"), "{told}");
    let missing = map_server(&["check-site", "nowhere.json5"]);
    assert!(missing.status.code() == Some(2) && said(&missing).contains("nowhere.json5"), "{}", said(&missing));
}
