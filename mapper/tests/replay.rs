//! A run that was recorded and is replayed gives the same map, to the last bit.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_bag::{FrameConfig, TopicConfig};
use fht_program::stop::Stop;
use fht_sim::SimSetup;
use mapper::program::{
    ExploreReport, ExploreTask, PictureTask, ReplayError, ReplayReport, ReplayTask, explore, replay,
};
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

fn replay_of(bag: &Path, record: Option<PathBuf>, cameras: bool) -> ReplayTask {
    let usual = TopicConfig::default();
    let topics = TopicConfig { cameras: usual.cameras.clone().filter(|_| cameras), ..usual };
    ReplayTask {
        bag: bag.to_owned(),
        frames: FrameConfig { topics, strict: true, ..FrameConfig::default() },
        mapping: offline(),
        rate: None,
        record,
        picture: None,
        stop: Stop::default(),
    }
}

fn replayed(bag: &Path, record: Option<PathBuf>, cameras: bool) -> Result<ReplayReport, ReplayError> {
    block_on(replay(replay_of(bag, record, cameras), |_| {}))
}

#[test]
fn a_recorded_minute_with_cameras_replays_to_the_same_map() {
    let folder = tempfile::tempdir().unwrap();
    let (bag, again) = (folder.path().join("run.mcap"), folder.path().join("again"));
    let original = explored(Some(bag.clone()), true, 60.0, 1);
    assert!(original.map.main_nodes >= 5 && original.map.edges >= 20, "{original:?}");
    assert_eq!(explored(None, true, 60.0, 1).map.digest, original.map.digest, "recording changes nothing");
    let report = replayed(&bag, Some(again.clone()), true).unwrap();
    assert_eq!(report.map.digest, original.map.digest);
    assert_eq!(
        (report.map.version, report.map.main_nodes, report.map.edges),
        (original.map.version, original.map.main_nodes, original.map.edges)
    );
    assert_eq!((report.bag.frames, report.bag.panoramas), (301, 61));
    // What was not sent has its length all the same.
    assert!(
        original.map.map_bytes > 5_000 && report.map.map_bytes > 5_000,
        "{} {}",
        original.map.map_bytes,
        report.map.map_bytes
    );
    assert_eq!((original.map.wire_bytes, original.map.delivered, report.map.delivered), (0, false, false));
    assert!(report.bag.dropped.is_empty() && report.bag.notes.is_empty(), "{}", report.bag);
    // And the replay's own recording once more.
    assert_eq!(replayed(&again, None, true).unwrap().map.digest, original.map.digest);
    // The pictures can be left out.
    let blind = replayed(&bag, None, false).unwrap();
    assert!(!blind.has_cameras && blind.map.main_nodes > 0 && blind.map.digest != original.map.digest);
}

#[test]
fn whole_runs_without_cameras_replay_to_the_same_map() {
    for seed in [2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("run");
        let original = explored(Some(bag.clone()), false, 1e4, seed);
        let report = replayed(&bag, None, true).unwrap();
        assert_eq!((report.map.digest, report.map.version), (original.map.digest, original.map.version));
        assert!(!report.has_cameras && original.explored_fraction > Some(0.98));
    }
}

#[test]
fn figures_stand_where_no_picture_can_be_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run.mcap");
    let picture = || Some(PictureTask { file: folder.path().join("gone").join("map.png"), title: String::new() });
    let mapping = MappingTask { cameras: false, max_s: 10.0, ..offline() };
    let task = ExploreTask {
        record: Some(bag.clone()),
        picture: picture(),
        ..ExploreTask::new(SimSetup::of("museum"), mapping)
    };
    let explored = block_on(explore(task, |_| {})).unwrap();
    let replayed = block_on(replay(ReplayTask { picture: picture(), ..replay_of(&bag, None, false) }, |_| {})).unwrap();
    assert_eq!(explored.map.digest, replayed.map.digest);
    assert_eq!(explored.kept.recording.as_deref(), Some(bag.as_path()), "the recording is whole all the same");
    for kept in [explored.kept, replayed.kept] {
        assert!(kept.picture.is_none() && kept.not_kept.as_deref().is_some_and(|why| why.contains("gone")), "{kept:?}");
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

#[test]
fn the_last_word_of_progress_is_of_the_finished_map() {
    let mapping = MappingTask { cameras: false, max_s: 10.5, ..offline() };
    let (tell, told) = std::sync::mpsc::channel();
    let watch = move |progress| tell.send(progress).unwrap();
    let report = block_on(explore(ExploreTask::new(SimSetup::of("museum"), mapping), watch)).unwrap();
    let last = told.iter().last().unwrap();
    assert_eq!((last.written, last.nodes), (report.map.written, report.map.main_nodes + report.map.support_nodes));
    assert!(last.sim_s >= 10.0 && last.placed && report.map.written > 0, "{last:?}");
}
