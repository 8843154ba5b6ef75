#![no_main]
//! Everything that is read as JSON: servers' answers and robots' messages.

use fht_map::plan::blocked::{Reporter, Reports};
use fht_proto::api::fleet::{BlockedReport, ExplorerGoal, FleetReply, RobotPose, RobotStatus};
use fht_proto::api::goal::GoalStatus;
use fht_proto::api::reply::{
    DiffReply, ErrorReply, Head, JournalReply, MapsReply, NodesReply, PathReply, ReleasesReply, RulesReply,
};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(head) = serde_json::from_slice::<Head>(bytes) {
        let map = head.map.clone();
        let _ = head.checked(&map);
    }
    if let Ok(report) = serde_json::from_slice::<BlockedReport>(bytes) {
        let mut reports = Reports::default();
        if reports.take("robot", Reporter::Robot { has_token: true }, &report, &[], 5).is_ok() {
            assert!(reports.at(5).count() <= 1);
        }
    }
    let _ = serde_json::from_slice::<RobotStatus>(bytes);
    let _ = serde_json::from_slice::<RobotPose>(bytes);
    let _ = serde_json::from_slice::<ExplorerGoal>(bytes);
    let _ = serde_json::from_slice::<GoalStatus>(bytes);
    let _ = serde_json::from_slice::<FleetReply>(bytes);
    let _ = serde_json::from_slice::<JournalReply>(bytes);
    let _ = serde_json::from_slice::<PathReply>(bytes);
    let _ = serde_json::from_slice::<NodesReply>(bytes);
    let _ = serde_json::from_slice::<MapsReply>(bytes);
    let _ = serde_json::from_slice::<ReleasesReply>(bytes);
    let _ = serde_json::from_slice::<RulesReply>(bytes);
    let _ = serde_json::from_slice::<DiffReply>(bytes);
    let _ = serde_json::from_slice::<ErrorReply>(bytes);
});
