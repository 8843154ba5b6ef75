//! The demo beside other people's work: an operator writes while the robots are at it.

use crate::programs::{executable, start};
use fht_demo::{Role, free_endpoint, hand_off};
use fht_tests::museum_demo::museum_demo;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Names places until it is told to stop; returns how many were taken.
fn operate(endpoint: &str, stop: &AtomicBool) -> usize {
    let mut taken = 0;
    for number in 0.. {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let name = format!("place{number}");
        let args = ["place", "museum", &name, "0,0", "--force", "--connect", endpoint];
        let command = start(Role::MapServer, args);
        // Before the map is there it is refused.
        taken += usize::from(command.finish(Duration::from_secs(60)).is_ok());
        std::thread::sleep(Duration::from_millis(200));
    }
    taken
}

#[test]
fn the_digests_agree_although_an_operator_writes_meanwhile() {
    let folder = tempfile::tempdir().unwrap();
    let config = museum_demo(executable(), free_endpoint().unwrap(), folder.path());
    let stop = AtomicBool::new(false);
    let (ended, taken) = std::thread::scope(|scope| {
        let operator = scope.spawn(|| operate(&config.endpoint, &stop));
        let ended = hand_off(&config);
        stop.store(true, Ordering::Relaxed);
        (ended, operator.join().unwrap())
    });
    let (report, _server) = ended.unwrap();
    assert!(report.digests_agree && report.arrived, "{report:?}");
    assert!(taken > 10, "{taken} places were named meanwhile");
}
