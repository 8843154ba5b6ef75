//! Two explorers map one building separately, from different starts; an operator merges their maps.
//! Real processes: server, explorers, operator's commands. A map of another building is refused.

use crate::programs::start;
use fht_demo::{Process, ProcessError, Role, free_endpoint};
use fht_eval::{MadeMap, merge_and_measure, quantile_x};
use fht_map::MapState;
use fht_map::plan::rules::Rules;
use fht_map::{FreeSpace, NodeRouteConfig};
use fht_merge::{AlignmentFigures, MergeConfig};
use fht_perception::pose::{from_fixed, pose};
use fht_proto::codec::archive::Archive;
use fht_proto::{AuthorId, NodeKind};
use mapper::program::ExploreReport;
use serde_json::Value;
use std::path::PathBuf;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(30);
/// The requirement: how near nodes of one map must be to where they truly are in the other's frame,
/// metres.
const BAR_M: f64 = 0.1;

struct Site {
    endpoint: String,
    folder: tempfile::TempDir,
    _server: Process,
}

impl Site {
    fn new() -> Self {
        let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
        let data = folder.path().join("data");
        let mut server = start(Role::MapServer, ["--data", data.to_str().unwrap(), "--listen", &endpoint]);
        server.wait_until_listening(&endpoint, PATIENCE).unwrap();
        Self { endpoint, folder, _server: server }
    }

    fn report(&self, map: &str) -> PathBuf {
        self.folder.path().join(format!("{map}.json"))
    }

    /// All explorers have the same name: their maps have nodes with the same ids.
    fn explorer(&self, map: &str, more: &[&str]) -> Process {
        let report = self.report(map);
        let usual = ["explore", "--map", map, "--no-cameras", "--quiet", "--connect", &self.endpoint];
        start(Role::Mapper, usual.into_iter().chain(["--report", report.to_str().unwrap()]).chain(more.iter().copied()))
    }

    fn operate(&self, args: &[&str]) -> Result<Value, (Option<Value>, String)> {
        let mut printed = String::new();
        let usual = args.iter().copied().chain(["--connect", &self.endpoint, "--json"]);
        let outcome = start(Role::MapServer, usual).follow(|line| printed += line);
        let value = serde_json::from_str(&printed).ok();
        match outcome {
            Ok(()) => Ok(value.unwrap()),
            Err(ProcessError::Failed { stderr, .. }) => Err((value, stderr)),
            Err(error) => panic!("{error}"),
        }
    }

    fn do_operate(&self, args: &[&str]) -> Value {
        self.operate(args).unwrap_or_else(|(_, complaint)| panic!("{args:?}: {complaint}"))
    }

    /// A map as the server has it.
    fn map(&self, map: &str) -> MapState {
        let file = self.folder.path().join(format!("{map}.fht"));
        self.do_operate(&["export", map, file.to_str().unwrap()]);
        let bytes = std::fs::read(file).unwrap();
        let mut state = MapState::new();
        for series in Archive::open(&bytes).unwrap() {
            let series = series.unwrap();
            series.folds.iter().for_each(|fold| state.apply_fold(fold));
            series.increments.iter().for_each(|increment| state.apply(increment));
        }
        state
    }

    fn made(&self, map: &str) -> MadeMap {
        let report = std::fs::read(self.report(map)).unwrap();
        let [x, y, yaw] = serde_json::from_slice::<ExploreReport>(&report).unwrap().world_from_map;
        MadeMap { map: self.map(map), world_from_map: pose(x, y, yaw) }
    }
}

#[test]
fn two_maps_of_one_museum_become_one_and_another_building_is_refused() {
    let site = Site::new();
    let explorers = [
        site.explorer("west", &["--seed", "1"]),
        site.explorer("east", &["--seed", "2", "--start", "13.9,1.5,2.39rad"]),
    ];
    explorers.into_iter().for_each(|explorer| explorer.follow(|_| ()).unwrap());
    // A part of the office is enough; an explorer that does not finish says so.
    let office = site.explorer("office", &["--world", "office", "--max-sim", "150"]).follow(|_| ());
    assert!(matches!(office, Err(ProcessError::Failed { .. })), "{office:?}");

    let (west, east) = (site.made("west"), site.made("east"));
    let world = fht_sim::load("museum", None, 1).unwrap();
    let merged = merge_and_measure(&west, &east, Some(&world), &MergeConfig::default()).unwrap();
    assert!(merged.error_max_m <= BAR_M, "{} m", merged.error_max_m);
    // Half of the building is in both maps: each has a part that the other lacks.
    let (low, high) = (quantile_x(&west, 0.25), quantile_x(&west, 0.75));
    let (part, other) = (west.part(|at| at.x <= high), east.part(|at| at.x >= low));
    let parts = merge_and_measure(&part, &other, Some(&world), &MergeConfig::default()).unwrap();
    println!("{}", serde_json::to_string_pretty(&parts).unwrap());
    assert!(parts.error_max_m <= BAR_M && parts.joined.main_nodes >= 3 && parts.parts[1] == 1, "{parts:?}");
    assert!(parts.paths > 0 && parts.planned == parts.paths && parts.touching == 0, "{parts:?}");
    assert!(merge_and_measure(&west, &east.mirrored(), None, &MergeConfig::default()).is_err());

    let before = (west.map.digest(), east.map.digest());
    let dry = site.do_operate(&["merge", "west", "east", "--dry-run"]);
    assert_eq!((&dry["fits"], &dry["written"]), (&Value::Bool(true), &Value::Null));
    let alignment: AlignmentFigures = serde_json::from_value(dry["alignment"].clone()).unwrap();
    // JSON numbers may differ in the last digit.
    let same = |one: f64, other: f64| (one - other).abs() < 1e-9;
    let is_same = alignment.transform.iter().zip(merged.alignment.transform).all(|(one, other)| same(*one, other));
    assert!(is_same && alignment.matched == merged.alignment.matched, "{alignment:?} {:?}", merged.alignment);
    site.do_operate(&["place", "east", "dock", "1,0,90"]);
    let done = site.do_operate(&["merge", "west", "east", "--into", "whole", "--operator", "ana"]);
    assert_eq!(done["written"][0], "whole");
    assert_eq!(site.map("west").digest(), before.0, "--into leaves the first as it is");

    // The nodes taken over are where they truly are.
    let whole = site.map("whole");
    let author = AuthorId::of_robot("ana");
    let new = || whole.nodes().filter(|node| node.id.author == author);
    let taken = |kind| new().filter(|node| node.kind == kind).count();
    assert_eq!(Value::from(taken(NodeKind::Main)), done["joined"]["main_nodes"]);
    assert_eq!(Value::from(taken(NodeKind::Support)), done["joined"]["support_nodes"]);
    for node in new().filter(|node| node.kind == NodeKind::Main) {
        let scan = |other: &fht_map::NodeRef<'_>| other.signature == node.signature;
        let origin = east.map.main_nodes().find(scan).unwrap();
        let world_from_origin = east.world_from_map * from_fixed(origin.pose);
        let off =
            (west.world_from_map * from_fixed(node.pose)).translation.vector - world_from_origin.translation.vector;
        assert!(off.norm() <= BAR_M, "{}: {} m", node.id, off.norm());
    }
    // A place of one map is reached from the other's origin.
    let dock = whole.annotations().place(&"dock".parse().unwrap()).unwrap();
    let rules = Rules::of(&whole, Vec::new());
    let space = FreeSpace::of(&whole, &rules.space_config());
    assert!(rules.plan(&whole, &space, Default::default(), dock.position, &NodeRouteConfig::default()).is_ok());

    // Into the first map itself; and requests that make no sense.
    let done = site.do_operate(&["merge", "west", "east"]);
    assert_eq!(done["written"][0], "west");
    assert_eq!(site.map("west").counts(), whole.counts());
    assert_eq!(site.do_operate(&["merge", "west", "east"])["written"], Value::Null, "there is nothing to change");
    let refused = |args: &[&str], reason: &str| {
        let (value, complaint) = site.operate(args).expect_err("a refusal");
        assert!(complaint.contains(reason), "{args:?}: {complaint}");
        value
    };
    for pair in [["west", "office"], ["office", "east"]] {
        let value = refused(&["merge", pair[0], pair[1]], "not merged: ").unwrap();
        println!("{pair:?}: {value}");
        assert_eq!((&value["fits"], &value["written"]), (&Value::Bool(false), &Value::Null));
        assert!(value["reason"].is_string());
    }
    assert_eq!(site.map("west").counts(), whole.counts());
    refused(&["merge", "west", "whole"], "they are one map");
    refused(&["merge", "west", "west"], "nothing to merge");
    refused(&["merge", "west", "east", "--into", "whole"], "there is a map whole already");
    refused(&["merge", "west", "louvre"], "louvre");
}
