//! `map-server undo` against a server process: every kind of change is taken back, and an undo like
//! any other; what others have changed since is not overwritten.

use crate::support::site::Site;
use serde_json::Value;

/// What holds on the map, without the version.
fn rules(site: &Site) -> Value {
    let mut rules = site.run(&["rules", "museum"]);
    rules.as_object_mut().unwrap().remove("version");
    rules
}

/// The first word of what was taken back.
fn undo(site: &Site, more: &[&str]) -> String {
    let done = site.run(&[&["undo", "museum"], more].concat());
    done["words"][0].as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn places_zones_and_closures_are_taken_back_and_the_undo_too() {
    let site = Site::with(12).await;
    let (a, b) = ("0000000a.5", "0000000a.6");
    let begin = rules(&site);
    let changes: [(&[&str], &str); 9] = [
        (&["place", "museum", "dock", "9,0,180"], "place dock is taken away again"),
        (&["place", "museum", "dock", "8,0"], "place dock is at 9.00,0.00, 180° again"),
        (&["place", "museum", "dock", "--remove"], "place dock is at 8.00,0.00, 0° again"),
        (&["zone", "museum", "wet", "3,-1.5 4,-1.5 4,0.3 3,0.3"], "zone wet is taken away again"),
        (&["zone", "museum", "wet", "3,-1.5 4,-1.5 4,1.5 3,1.5"], "zone wet is as it was"),
        (&["zone", "museum", "wet", "--remove"], "zone wet is as it was"),
        (&["close", "museum", a, b], "the edge 0000000a.5 0000000a.6 is open again"),
        (&["open", "museum", a, b], "the edge 0000000a.5 0000000a.6 is closed again"),
        (&["place", "museum", "quay", "7,0"], "place quay is taken away again"),
    ];
    for (change, words) in changes {
        let before = rules(&site);
        site.run(change);
        let after = rules(&site);
        assert_ne!(before, after, "{change:?}");
        assert_eq!(undo(&site, &[]), words, "{change:?}");
        assert_eq!(rules(&site), before, "{change:?}");
        undo(&site, &[]);
        assert_eq!(rules(&site), after, "the undo of {change:?} taken back");
    }
    // Each change, its undo and the undo of that.
    undo(&site, &["--last", "27"]);
    assert_eq!(rules(&site), begin);
    assert!(
        site.complaint(&["undo", "museum", "--last", "99"]).contains("has written 28 increments of this map, and 99")
    );
    let nobody = site.complaint(&["undo", "museum", "--operator", "nobody"]);
    assert!(nobody.contains("nobody has written nothing in this map"), "{nobody}");

    site.run(&["place", "museum", "dock", "7,0"]);
    site.run(&["place", "museum", "dock", "6,0", "--operator", "other"]);
    let before = rules(&site);
    let refused = site.complaint(&["undo", "museum"]);
    assert!(refused.contains("place dock was changed by") && refused.contains("nothing is taken back"), "{refused}");
    assert_eq!(rules(&site), before);
    assert_eq!(undo(&site, &["--operator", "other"]), "place dock is at 7.00,0.00, 0° again");

    site.run(&["retain", "museum", "--keep", "0"]);
    assert!(site.complaint(&["undo", "museum"]).contains("are folded"));
    let of_other = site.complaint(&["undo", "museum", "--author", "other", "--all"]);
    assert!(of_other.contains("the increments of other up to ") && of_other.contains("are folded"), "{of_other}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn releases_are_taken_back_and_robots_use_what_they_used() {
    let site = Site::with(6).await;
    let names = || {
        let reply = site.run(&["release", "list", "museum"]);
        let view = |it: &Value| (it["name"].as_str().unwrap().to_owned(), it["enabled"] == true);
        reply["releases"].as_array().unwrap().iter().map(view).collect::<Vec<_>>()
    };
    let named = |all: &[(&str, bool)]| all.iter().map(|(name, on)| ((*name).to_owned(), *on)).collect::<Vec<_>>();
    site.run(&["release", "create", "museum", "first"]);
    assert!(undo(&site, &[]).ends_with("is deleted again"));
    assert_eq!(names(), named(&[]));
    assert!(undo(&site, &[]).contains("is there again, as first-2@"));
    assert_eq!(names(), named(&[("first-2", false)]));
    site.run(&["release", "enable", "museum", "first-2"]);
    assert_eq!(undo(&site, &[]), "robots use the newest state again");
    assert!(undo(&site, &[]).starts_with("robots use release first-2@"));
    assert_eq!(names(), named(&[("first-2", true)]));

    // Somebody else's word keeps it.
    site.run(&["release", "create", "museum", "second"]);
    site.run(&["release", "enable", "museum", "second", "--operator", "other"]);
    assert!(site.complaint(&["undo", "museum"]).contains("is what robots use"));
    site.run(&["release", "rollback", "museum", "--operator", "other"]);
    site.run(&["release", "delete", "museum", "second"]);
    undo(&site, &[]);
    assert_eq!(names(), named(&[("first-2", true), ("second-2", false)]));

    // What others have written between does not matter.
    site.run(&["release", "delete", "museum", "second-2"]);
    site.drive(7, 12).await;
    site.run(&["place", "museum", "dock", "5,0"]);
    undo(&site, &["--last", "2"]);
    assert_eq!(names().len(), 2, "while its state is there");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_at_once_under_one_name_take_back_each_change_once() {
    let site = Site::with(6).await;
    let places = ["a", "b", "c", "d"];
    for (x, name) in places.iter().enumerate() {
        site.run(&["place", "museum", name, &format!("{x},0")]);
    }
    let said: Vec<Result<String, String>> = std::thread::scope(|scope| {
        let undo = || site.try_run(&["undo", "museum"]);
        let both = [scope.spawn(undo), scope.spawn(undo)];
        both.into_iter().map(|one| one.join().unwrap()).collect()
    });
    let done = said.iter().filter(|outcome| outcome.is_ok()).count();
    let left = rules(&site)["places"].as_array().unwrap().len();
    // Who was overtaken says so, and has written nothing; who came after took back the undo.
    let overtaken = said.iter().filter_map(|outcome| outcome.as_ref().err());
    overtaken.for_each(|said| assert!(said.contains("at this moment"), "{said}"));
    assert_eq!(left, if done == 1 { 3 } else { 4 }, "{said:?}");
}
