//! Bags between us and other people's programs: what we record, rosbags and mcap read; what rosbags
//! and mcap write, we read.

use crate::programs::executable;
use fht_bag::{BagError, BagReport, Dropped, FrameConfig, Frames, TopicConfig, survey};
use fht_demo::{Process, Role, free_endpoint};
use fht_perception::frame::SensorFrame;
use fht_sim::SimSetup;
use fht_tests::packages::{environment, run};
use mapper::program::{ExploreReport, ExploreTask, explore};
use mapper::run::MappingTask;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::Duration;

const PACKAGES: [&str; 3] = ["rosbags==0.11.9", "mcap==1.6.0", "mcap-ros2-support==0.6.0"];

fn python(script: &str) -> Command {
    static COMMANDS: OnceLock<PathBuf> = OnceLock::new();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bags");
    let mut command = Command::new(COMMANDS.get_or_init(|| environment(&folder, &PACKAGES)).join("python"));
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bags").join(script));
    command
}

fn read(bag: &Path, config: FrameConfig) -> Result<(Vec<SensorFrame>, BagReport), BagError> {
    let mut frames = Frames::open(bag, config)?;
    let all = frames.by_ref().collect::<Result<Vec<_>, _>>()?;
    Ok((all, frames.report()))
}

#[test]
fn what_we_record_others_read() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run"] {
        let bag = folder.path().join(name);
        let mapping = MappingTask { max_s: 12.0, ..MappingTask::new("museum".parse().unwrap(), "explorer") };
        let task = ExploreTask { record: Some(bag.clone()), ..ExploreTask::new(SimSetup::of("museum"), mapping) };
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        runtime.block_on(explore(task, |_| {})).unwrap();
        let read_by_others = run(python("read.py").arg(&bag)).stdout;
        compare(&bag, &serde_json::from_slice(&read_by_others).unwrap());
    }
}

fn compare(bag: &Path, others: &Value) {
    let (rosbags, mcap) = (&others["rosbags"], &others["mcap"]);
    let info = survey(bag).unwrap();
    for topic in &info.topics {
        assert_eq!(rosbags["counts"][&topic.name], topic.messages, "{}", topic.name);
        assert_eq!(mcap["counts"][&topic.name], topic.messages, "{}", topic.name);
        assert_eq!(mcap["schemas"][&topic.type_name], "ros2msg");
        let is_latched = ["/tf_static", "/map", "/fht_map"].contains(&topic.name.as_str());
        assert_eq!(rosbags["qos"][&topic.name], if is_latched { "TRANSIENT_LOCAL" } else { "VOLATILE" });
    }
    assert_eq!(info.topics.len(), 11);
    assert_eq!(mcap["profile"], "ros2");
    assert_eq!(mcap["compression"], serde_json::json!(["zstd"]));
    assert_eq!(mcap["encodings"], serde_json::json!(["cdr"]));
    assert_eq!((&mcap["markers"]["main nodes"][0], &mcap["markers"]["edges"][0]), (&7.into(), &5.into()));
    assert_eq!(rosbags["statics"].as_array().unwrap().len(), 5);
    assert_eq!(rosbags["pictures"], 13 * 4);
    assert!(rosbags["grids"].as_array().unwrap().iter().all(|grid| grid[2].as_u64().unwrap() > 1000));

    let (frames, report) = read(bag, FrameConfig { strict: true, ..FrameConfig::default() }).unwrap();
    assert_eq!((frames.len(), report.panoramas), (61, 13));
    for (frame, odometry) in frames.iter().zip(rosbags["odometry"].as_array().unwrap()) {
        let [x, y, z, w] = [0, 1, 2, 3].map(|index| odometry[index].as_f64().unwrap());
        // JSON numbers may differ in the last bit.
        assert!((frame.odom_from_base.translation.vector - nalgebra::Vector2::new(x, y)).norm() < 1e-12);
        assert!((2.0 * z.atan2(w) - frame.odom_from_base.rotation.angle()).abs() < 1e-12);
    }
    // The velocities, put together, are the way.
    let twists = rosbags["twists"].as_array().unwrap();
    for (pair, twist) in frames.windows(2).zip(&twists[1..]) {
        let moved = pair[0].odom_from_base.inverse() * pair[1].odom_from_base;
        let seconds = (pair[1].time_us - pair[0].time_us) as f64 * 1e-6;
        let [mps, radps] = [0, 1].map(|index| twist[index].as_f64().unwrap());
        assert!((mps * seconds - moved.translation.vector.norm().copysign(mps)).abs() < 1e-3, "{twist}, {moved}");
        assert!((radps * seconds - moved.rotation.angle()).abs() < 1e-9, "{twist}, {moved}");
    }
    assert!(twists.iter().any(|twist| twist[0].as_f64().unwrap() > 0.1), "it drives");
    for (frame, scan) in frames.iter().zip(rosbags["scans"].as_array().unwrap()) {
        assert_eq!(scan["ns"], frame.time_us * 1000);
        for (range, theirs) in frame.scan.ranges_m.iter().zip(scan["ranges"].as_array().unwrap()) {
            assert_eq!(*range, theirs.as_f64().map_or(f32::INFINITY, |range| range as f32));
        }
    }
}

#[test]
fn a_client_records_its_map_so_that_others_can_show_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (executable, endpoint) = (executable(), free_endpoint().unwrap());
    let _server = Process::map_server(executable, &folder.path().join("data"), &endpoint, Duration::from_secs(60));
    // Neither comes to its end in so short a time, and says so by its exit code.
    let run_for = |role: Role, args: &[&str]| {
        let usual = ["--map", "museum", "--no-cameras", "--connect", &endpoint, "--max-sim"];
        let args = [&args[..1], &usual, &args[1..]].concat();
        _ = Process::start(executable, role, args).unwrap().follow(|_| ());
    };
    run_for(Role::Mapper, &["explore", "60", "--report", &at("explorer.json"), "--quiet"]);
    let explored: ExploreReport = serde_json::from_str(&std::fs::read_to_string(at("explorer.json")).unwrap()).unwrap();
    assert!(explored.map.delivered && explored.map.main_nodes > 0, "{explored:?}");
    for name in ["drive.mcap", "drive"] {
        run_for(Role::ClientRobot, &["relocalize", "12", "--record", &at(name), "--quiet"]);
        let others: Value = serde_json::from_slice(&run(python("read.py").arg(at(name))).stdout).unwrap();
        let (rosbags, mcap) = (&others["rosbags"], &others["mcap"]);
        for topic in ["/map", "/fht_map"] {
            // The map stays as it is, so once is enough for who subscribes late.
            assert_eq!(
                (&rosbags["counts"][topic], &mcap["counts"][topic]),
                (&1.into(), &1.into()),
                "{topic}: {others}"
            );
            assert_eq!(rosbags["qos"][topic], "TRANSIENT_LOCAL", "{topic}");
        }
        assert_eq!(mcap["markers"]["main nodes"][1], explored.map.main_nodes);
        assert_eq!(mcap["markers"]["support nodes"][1], explored.map.support_nodes);
        assert_eq!(mcap["markers"]["edges"][1], 2 * explored.map.edges);
        let (free, walls) = (rosbags["grids"][0][2].as_u64().unwrap(), rosbags["grids"][0][3].as_u64().unwrap());
        assert!(free > 1000 && walls > 100, "{free} free cells, {walls} of walls");
    }
}

#[test]
fn what_others_write_we_read() {
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path().join("bags");
    run(python("write.py").arg(&folder));
    let bag = |name: &str| read(&folder.join(name), FrameConfig::default()).unwrap();

    // The same run in every form: 1 m/s along x, the scanner 0.2 m ahead.
    for name in ["plain", "big_endian", "zstd.mcap", "lz4.mcap", "uncompressed.mcap", "unknown_topics", "other_names"] {
        let (frames, report) = bag(name);
        assert_eq!(frames.len(), 20, "{name}: {report}");
        assert!(report.dropped.is_empty() && report.broken.is_empty(), "{name}: {report}");
        for (k, frame) in frames.iter().enumerate() {
            assert_eq!(frame.time_us, 1_700_000_000_000_000 + k as u64 * 100_000);
            assert!((frame.odom_from_base.translation.x - 0.1 * k as f64).abs() < 1e-9, "{name} {k}");
            assert_eq!(frame.scan.base_from_sensor.translation.x, 0.2);
            assert_eq!((frame.scan.points_in_base().len(), frame.scan.range_max_m), (181, 10.0));
        }
        assert_eq!(report.notes.len(), if name == "other_names" { 2 } else { 0 }, "{report}");
    }
    let (frames, report) = bag("split");
    assert_eq!((frames.len(), report.messages), (60, 181), "run_10 comes after run_2: {report}");
    assert!(report.dropped.is_empty(), "{report}");

    let (frames, _) = bag("nothing_where_nothing_returned");
    let scan = &frames[3].scan;
    assert_eq!(scan.ranges_m.iter().filter(|range| scan.is_return(**range)).count(), 175);

    let (frames, report) = bag("time_that_goes_back");
    assert_eq!(frames.len(), 20);
    let dropped = [Dropped::ScanDuplicate, Dropped::ScanTimeBack, Dropped::OdometryNotNewer];
    assert_eq!(report.dropped, dropped.map(|reason| (reason, 1)).into(), "{report}");

    let (frames, report) = bag("a_gap");
    assert_eq!((frames.len(), report.dropped[&Dropped::ScanOdometryGap]), (9, 11), "{report}");

    let (frames, report) = bag("odometry_by_transforms");
    assert_eq!((frames.len(), report.odometry, report.notes.len()), (20, 40, 1), "{report}");
    assert!((frames[7].odom_from_base.translation.x - 0.7).abs() < 1e-9);

    let (frames, report) = bag("without_transforms");
    assert_eq!((frames.len(), report.notes.len()), (20, 1), "{report}");
    let strict = read(&folder.join("without_transforms"), FrameConfig { strict: true, ..FrameConfig::default() });
    assert!(matches!(strict, Err(BagError::MissingTransform { .. })));

    // The base is turned by 90° under the mast, which carries the scanner upside down: its first
    // beam (its right) points left.
    let (frames, report) = bag("upside_down");
    assert!(report.notes.is_empty() && report.dropped.is_empty(), "{report}");
    let points = frames[0].scan.points_in_base();
    let (first, last) = (points[0], points[180]);
    assert!((first.coords - nalgebra::Vector2::new(3.0, 1.0)).norm() < 1e-5, "{first}");
    assert!((last.coords - nalgebra::Vector2::new(-1.0, 1.0)).norm() < 1e-5, "{last}");

    let (frames, report) = bag("cameras");
    assert_eq!((report.panoramas, report.pictures), (10, 40), "{report}");
    let views = &frames[0].panorama.as_ref().unwrap().views;
    assert_eq!(views.each_ref().map(|view| view.get_pixel(3, 3).0), [[1, 2, 3], [1, 2, 3], [1, 2, 3], [7, 7, 7]]);
    let blind =
        FrameConfig { topics: TopicConfig { cameras: None, ..TopicConfig::default() }, ..FrameConfig::default() };
    assert_eq!(read(&folder.join("cameras"), blind).unwrap().1.panoramas, 0);

    let several = read(&folder.join("two_scanners"), FrameConfig::default()).unwrap_err().to_string();
    assert!(several.contains("/front/scan, /rear/scan") && several.contains("--scan-topic"), "{several}");
    let topics = TopicConfig { scan: Some("/rear/scan".to_owned()), ..TopicConfig::default() };
    let chosen = read(&folder.join("two_scanners"), FrameConfig { topics, ..FrameConfig::default() }).unwrap();
    assert_eq!(chosen.0.len(), 20);

    let (whole, _) = bag("big.mcap");
    let (cut, report) = bag("cut.mcap");
    assert_eq!(whole.len(), 3000);
    assert!((1200..1800).contains(&cut.len()), "{report}");
    assert!(cut.iter().zip(&whole).all(|(a, b)| a.time_us == b.time_us && a.odom_from_base == b.odom_from_base));
    let said = report.to_string();
    assert!(said.contains("can be read up to byte") && said.contains("ends in the middle of a record"), "{said}");
}
