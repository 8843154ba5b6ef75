//! `map-server restore`: a backup takes the place of a store, which is kept; nothing happens while
//! a server runs, or if the backup is damaged.

use crate::support::site::Site;
use crate::support::{ANA, Server, expected, head, head_when, until_up};
use map_server::rescue::Restored;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs the command; what it did, or its exit code and complaint.
fn restore(backup: &Path, store: &Path) -> Result<Restored, (Option<i32>, String)> {
    let output = Command::new(env!("CARGO_BIN_EXE_map-server"))
        .args(["restore".as_ref(), backup.as_os_str(), "--store".as_ref(), store.as_os_str(), "--json".as_ref()])
        .output()
        .unwrap();
    if output.status.success() {
        Ok(serde_json::from_slice(&output.stdout).unwrap())
    } else {
        Err((output.status.code(), String::from_utf8(output.stderr).unwrap()))
    }
}

/// What is said of a backup that is none: exit code 2.
fn complaint(backup: &Path, store: &Path) -> String {
    let (code, said) = restore(backup, store).expect_err("a complaint");
    assert!(code == Some(2) && !said.contains("panicked"), "{said}");
    said
}

/// The names of the files in a directory.
fn files(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir).unwrap();
    let mut names: Vec<String> = entries.map(|it| it.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_backup_takes_the_place_of_a_store() {
    let mut site = Site::with(20).await;
    let (data, copy) = (site.dir.path().join("data"), site.dir.path().join("copy"));
    let exported = site.dir.path().join("maps");
    std::fs::create_dir(&exported).unwrap();
    site.run(&["export", "museum", exported.join("museum.fht").to_str().unwrap()]);
    assert_eq!(site.server.terminate(), Some(0));
    std::fs::create_dir(&copy).unwrap();
    std::fs::copy(data.join("maps.redb"), copy.join("maps.redb")).unwrap();

    site.server = Server::start(&data, &site.endpoint);
    until_up(&site.session).await;
    site.drive(21, 30).await;
    let (newer, _) = expected(&[(ANA, 30)]);
    let (older, _) = expected(&[(ANA, 20)]);
    let (code, said) = restore(&copy, &data).expect_err("a complaint");
    assert!(code == Some(1) && said.contains("a map-server runs on"), "{said}");
    // Nor is what a server changes a backup; check and rescue end alike.
    let elsewhere = site.dir.path().join("elsewhere");
    let (code, said) = restore(&data, &elsewhere).expect_err("a complaint");
    assert!(code == Some(1) && said.contains("a map-server runs on") && !elsewhere.exists(), "{said}");
    for args in [vec!["check", data.to_str().unwrap()], vec!["rescue", data.to_str().unwrap(), "nowhere"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(&args).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && said.contains("in use"), "{args:?}: {said}");
    }
    assert_eq!(head(&site.session).await.unwrap().digest, newer.digest());
    assert_eq!(site.server.terminate(), Some(0));

    // Nothing happens with what is no backup.
    let before = std::fs::read(data.join("maps.redb")).unwrap();
    let damaged = site.dir.path().join("damaged.redb");
    let mut bytes = before.clone();
    let length = bytes.len();
    bytes[..length / 2].fill(0x5a);
    std::fs::write(&damaged, bytes).unwrap();
    assert!(complaint(&damaged, &data).contains("is damaged"));
    let empty = site.dir.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    assert!(complaint(&empty, &data).contains("this is no backup"));
    assert!(complaint(&empty.join("nothing"), &data).contains("this is no backup"));
    assert!(complaint(&data, &data).contains("is the store itself"));
    let cut = site.dir.path().join("cut.fht");
    let archive = std::fs::read(exported.join("museum.fht")).unwrap();
    std::fs::write(&cut, &archive[..archive.len() - 7]).unwrap();
    assert!(complaint(&cut, &data).contains("the file is damaged at byte"));
    assert_eq!(std::fs::read(data.join("maps.redb")).unwrap(), before);
    assert_eq!(files(&data), ["lock", "maps.redb"]);

    let serve = async |site: &mut Site| {
        site.server = Server::start(&data, &site.endpoint);
        until_up(&site.session).await;
        let head = head_when(&site.session, |_| true).await;
        assert_eq!(site.server.terminate(), Some(0));
        head.digest
    };
    let restored = restore(&copy, &data).unwrap();
    let kept: PathBuf = restored.replaced.unwrap();
    assert_eq!(std::fs::read(&kept).unwrap(), before, "what was there is kept");
    assert_eq!((restored.authors.len(), restored.authors[0].last), (1, 20));
    assert_eq!(serve(&mut site).await, older.digest());

    // Back again, and the exported maps.
    let again = restore(&kept, &data).unwrap();
    assert_eq!(serve(&mut site).await, newer.digest());
    assert!(kept.exists() && again.replaced.is_some_and(|file| file.exists() && file != kept));
    restore(&exported, &data).unwrap();
    assert_eq!(serve(&mut site).await, older.digest());
    let new = site.dir.path().join("new/store");
    assert_eq!(restore(&exported.join("museum.fht"), &new).unwrap().replaced, None);
    assert_eq!(files(&new), ["lock", "maps.redb"]);
    std::fs::copy(exported.join("museum.fht"), exported.join("museum-2.fht")).unwrap();
    let said = complaint(&exported, &data);
    assert!(said.contains("museum-2.fht and ") && said.contains("museum.fht: both are of map museum"), "{said}");
    check_owners(&copy, &data, &new);
}

/// What root puts in place is the server's, who has another account.
fn check_owners(backup: &Path, data: &Path, new: &Path) {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
    const NOBODY: u32 = 65_534;
    let of = |path: &Path| std::fs::metadata(path).map(|of| (of.uid(), of.permissions().mode() & 0o777)).unwrap();
    std::fs::set_permissions(data.join("maps.redb"), PermissionsExt::from_mode(0o600)).unwrap();
    let is_root = chown(data.join("maps.redb"), Some(NOBODY), Some(NOBODY)).is_ok();
    restore(backup, data).unwrap();
    assert_eq!(of(&data.join("maps.redb")).1, 0o600, "nobody else reads it, as before");
    if is_root {
        assert_eq!(of(&data.join("maps.redb")).0, NOBODY);
        // An empty directory that the server was given.
        std::fs::remove_dir_all(new).unwrap();
        std::fs::create_dir(new).unwrap();
        chown(new, Some(NOBODY), Some(NOBODY)).unwrap();
        restore(backup, new).unwrap();
        assert_eq!(["maps.redb", "lock"].map(|name| of(&new.join(name)).0), [NOBODY; 2]);
    }
}

#[test]
fn a_file_that_is_something_else_is_no_backup_and_no_store_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let (at, store) = (|name: &str| folder.path().join(name), folder.path().join("store"));
    for (name, bytes) in
        [("passwd", &b"root:x:0:0::/root:/bin/bash\n"[..]), ("map.png", b"\x89PNG\r\n"), ("empty", b"")]
    {
        std::fs::write(at(name), bytes).unwrap();
        let said = complaint(&at(name), &store);
        assert!(said.contains("this is no backup") && !said.contains("damaged"), "{said}");
    }
    assert!(!store.exists());
    // What is called like a store is a damaged one.
    std::fs::write(at("maps.redb.replaced-2026"), "root").unwrap();
    assert!(complaint(&at("maps.redb.replaced-2026"), &store).contains("is damaged"));
    std::fs::write(at("hall.fht"), "nothing").unwrap();
    assert!(complaint(&at("hall.fht"), &store).contains("not a map"));
    assert!(!store.exists(), "no folder stays");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_a_folder_with_both_kinds_all_take_the_store_and_no_folder_of_others_goes() {
    let mut site = Site::with(5).await;
    let (data, both, store) = (site.dir.path().join("data"), site.dir.path().join("both"), site.dir.path().join("new"));
    std::fs::create_dir(&both).unwrap();
    site.run(&["export", "museum", both.join("museum.fht").to_str().unwrap()]);
    site.drive(6, 9).await;
    assert_eq!(site.server.terminate(), Some(0));
    std::fs::copy(data.join("maps.redb"), both.join("maps.redb")).unwrap();
    for dir in [&both, &store] {
        std::fs::create_dir_all(dir.join("examined")).unwrap();
        std::fs::write(dir.join("examined/notes"), "mine").unwrap();
    }
    let run = |args: &[&Path]| {
        let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{args:?}: {said}");
        (String::from_utf8(output.stdout).unwrap(), said)
    };
    let taken = format!("{} is taken", both.join("maps.redb").display());
    let (printed, said) = run(&["check".as_ref(), &both]);
    assert!(printed.contains("the store is whole") && printed.contains(": 9 of 9 increments"), "{printed}");
    assert!(said.contains(&taken) && said.contains("1 exported maps"), "{said}");
    let (printed, said) = run(&["restore".as_ref(), &both, "--store".as_ref(), &store]);
    assert!(printed.contains(": 9 increments") && said.contains(&taken), "{printed} {said}");
    let (_, said) = run(&["check".as_ref(), &both.join("museum.fht")]);
    assert_eq!(said, "");
    let rescued = site.dir.path().join("rescued");
    std::fs::create_dir_all(rescued.join("examined")).unwrap();
    run(&["rescue".as_ref(), &store, &rescued]);
    assert_eq!(files(&rescued), ["examined", "maps.redb"]);
    assert_eq!(files(&store), ["examined", "lock", "maps.redb"]);
    assert_eq!(std::fs::read(store.join("examined/notes")).unwrap(), b"mine");
}
