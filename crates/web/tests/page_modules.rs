//! The page's modules that need no browser: geometry, differences, figures, the view. Their tests
//! are in `page/`, and run in Node.js.
#![allow(clippy::unwrap_used)] // tests may panic

use std::path::Path;
use std::process::Command;

#[test]
fn the_modules_without_a_browser_do_what_they_say() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/page/pure.test.mjs");
    let run = Command::new("node").arg("--test").arg(tests).output();
    let run = run.expect("this test needs Node.js 20 or newer: apt-get install -y nodejs");
    assert!(run.status.success(), "{}{}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
}
