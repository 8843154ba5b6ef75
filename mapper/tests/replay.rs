//! A run that was recorded and is replayed gives the same map, to the last bit.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_bag::{FrameConfig, TopicConfig};
use fht_program::stop::Stop;
use fht_sim::SimSetup;
use mapper::program::{ExploreReport, ExploreTask, ReplayError, ReplayReport, ReplayTask, explore, replay};
use mapper::run::MappingTask;
use std::path::{Path, PathBuf};

fn block_on<T>(future: impl Future<Output = T>) -> T {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap().block_on(future)
}

fn offline() -> MappingTask {
    MappingTask::new("museum".parse().unwrap(), "explorer")
}

fn explored(record: Option<PathBuf>, cameras: bool, seconds: f64, seed: u64) -> ExploreReport {
    let setup = SimSetup { seed, ..SimSetup::of("museum") };
    let mapping = MappingTask { cameras, max_s: seconds, ..offline() };
    let task = ExploreTask { record, ..ExploreTask::new(setup, mapping) };
    block_on(explore(task, |_| {})).unwrap()
}

fn replayed(bag: &Path, record: Option<PathBuf>, cameras: bool) -> Result<ReplayReport, ReplayError> {
    let usual = TopicConfig::default();
    let topics = TopicConfig { cameras: usual.cameras.clone().filter(|_| cameras), ..usual };
    let task = ReplayTask {
        bag: bag.to_owned(),
        frames: FrameConfig { topics, strict: true, ..FrameConfig::default() },
        mapping: offline(),
        rate: None,
        record,
        picture: None,
        stop: Stop::default(),
    };
    block_on(replay(task, |_| {}))
}

#[test]
fn a_recorded_minute_with_cameras_replays_to_the_same_map() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, again) = (folder.path().join("run.mcap"), folder.path().join("again"));
    let original = explored(Some(bag.clone()), true, 60.0, 1);
    assert!(original.main_nodes >= 5 && original.edges >= 20, "{original:?}");
    assert_eq!(explored(None, true, 60.0, 1).digest, original.digest, "recording changes nothing");
    let report = replayed(&bag, Some(again.clone()), true).unwrap();
    assert_eq!(report.digest, original.digest);
    assert_eq!(
        (report.version, report.main_nodes, report.edges),
        (original.version, original.main_nodes, original.edges)
    );
    assert_eq!((report.bag.frames, report.bag.panoramas), (301, 61));
    // What was not sent has its length all the same.
    assert!(original.map_bytes > 5_000 && report.map_bytes > 5_000, "{} {}", original.map_bytes, report.map_bytes);
    assert_eq!((original.wire_bytes, original.delivered, report.delivered), (0, false, false));
    assert!(report.bag.dropped.is_empty() && report.bag.notes.is_empty(), "{}", report.bag);
    // And the replay's own recording once more.
    assert_eq!(replayed(&again, None, true).unwrap().digest, original.digest);
    // The pictures can be left out.
    let blind = replayed(&bag, None, false).unwrap();
    assert!(!blind.has_cameras && blind.main_nodes > 0 && blind.digest != original.digest);
}

#[test]
fn whole_runs_without_cameras_replay_to_the_same_map() {
    for seed in [2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("run");
        let original = explored(Some(bag.clone()), false, 1e4, seed);
        let report = replayed(&bag, None, true).unwrap();
        assert_eq!((report.digest, report.version), (original.digest, original.version));
        assert!(!report.has_cameras && original.explored_fraction > 0.98);
    }
}

#[test]
fn an_existing_recording_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run.mcap");
    explored(Some(bag.clone()), false, 2.0, 1);
    let error = replayed(&bag, Some(bag.clone()), false).unwrap_err().to_string();
    assert!(error.contains("is there already"), "{error}");
}
