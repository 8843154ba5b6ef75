//! Machines of a site are killed (SIGKILL) while robots write and ask: a router and a server,
//! twice, one after the other. For five minutes of it, with the times of answers, run `cargo run
//! --release --bin site`.

use crate::programs::executable;
use fht_tests::site::{SiteConfig, run};
use std::time::Duration;

#[test]
fn nothing_acknowledged_is_lost_and_questions_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let config = SiteConfig {
        duration: Duration::from_secs(24),
        kill_every: Duration::from_secs(12),
        back_after: Duration::from_secs(4),
        readers: 2,
        // Generous, for machines that are busy with other work.
        limit: Duration::from_secs(10),
        ..SiteConfig::new(executable().to_owned(), folder.path().to_owned())
    };
    let report = run(&config, |what| println!("{what}")).unwrap();
    assert!(report.is_success(), "{report:?}");
    assert!(report.kills == 4 && report.written > 200 && report.questions > 100, "{report:?}");
}
