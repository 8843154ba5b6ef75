//! The demo over ROS 2 topics: explorer and client drive simulated robots that speak ROS, each at a
//! router of its own. They do as well as without ROS.

use crate::programs::executable;
use fht_demo::{HandoffConfig, free_endpoint, hand_off};
use fht_tests::museum_demo::museum_demo;

#[test]
fn the_demo_over_ros_topics_does_as_well_as_without() {
    let folder = tempfile::tempdir().unwrap();
    let plain = museum_demo(executable(), free_endpoint().unwrap(), folder.path());
    let (report, _server) = hand_off(&HandoffConfig { ros: true, ..plain }).unwrap();
    println!("{report}");
    assert!(report.is_success() && report.explored_fraction >= 0.95, "{report:?}");
    assert!(report.mapping_error_m < 0.05, "{report:?}");
    let off = report.relocalization_error_m.zip(report.relocalization_error_deg);
    assert!(off.is_some_and(|(metres, degrees)| metres <= 0.3 && degrees <= 3.0), "{report:?}");
    let ros = report.ros.unwrap();
    // Where the processors are busy, a frame may be late; most are not.
    assert!(ros.frames > 500 && ros.frames_late + ros.frames_lost < ros.frames / 10, "{report:?}");
    assert_eq!(report.collisions, 0, "{report:?}");
}
