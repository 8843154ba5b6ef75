//! Real logs, read to the end. They are not part of the project (see `shared/data`); without them
//! the test says so and passes.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_bag::{BagReport, Dropped, FrameConfig, Frames};
use fht_perception::frame::SensorFrame;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn log(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/lidar").join(name);
    if !folder.exists() {
        println!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

fn read(name: &str) -> Option<(Vec<SensorFrame>, BagReport)> {
    let begin = Instant::now();
    let mut frames = Frames::open(&log(name)?, FrameConfig { strict: true, ..FrameConfig::default() }).unwrap();
    let all: Vec<SensorFrame> = frames.by_ref().collect::<Result<_, _>>().unwrap();
    let report = frames.report();
    let seconds = begin.elapsed().as_secs_f64();
    println!("{name}: {report}\n{:.0} frames/s", report.frames as f64 / seconds);
    Some((all, report))
}

fn driven_m(frames: &[SensorFrame]) -> f64 {
    let step =
        |pair: &[SensorFrame]| (pair[0].odom_from_base.inverse() * pair[1].odom_from_base).translation.vector.norm();
    frames.windows(2).map(step).sum()
}

#[test]
fn intel() {
    let Some((frames, report)) = read("intel") else { return };
    assert_eq!((report.messages, report.scans, report.odometry, report.frames), (54_178, 13_631, 40_546, 13_631));
    assert!(report.dropped.is_empty() && report.broken.is_empty() && report.notes.is_empty(), "{report}");
    assert!(frames.windows(2).all(|pair| pair[0].time_us < pair[1].time_us));
    assert!(frames.iter().all(|frame| frame.scan.ranges_m.len() == 180 && frame.scan.range_max_m == 81.0));
    assert_eq!(frames[0].time_us, 976_052_857_337_529);
    assert!((frames[0].scan.angle_min + std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    assert!((600.0..700.0).contains(&driven_m(&frames)), "{}", driven_m(&frames));
}

#[test]
fn aces() {
    let Some((frames, report)) = read("aces") else { return };
    assert_eq!((report.messages, report.scans, report.odometry), (22_124, 7_374, 14_749));
    assert_eq!(report.dropped.get(&Dropped::OdometryNotNewer), Some(&54));
    assert_eq!(report.frames, frames.len() as u64);
    assert!(report.frames >= 7_373, "{report}");
}

#[test]
fn mit_csail() {
    let Some((frames, report)) = read("mit-csail") else { return };
    assert_eq!((report.scans, report.frames), (1_988, 1_988));
    assert!(frames.iter().all(|frame| frame.scan.ranges_m.len() == 361));
}
