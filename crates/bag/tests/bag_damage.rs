//! Bags that are written, damaged and read: intact data comes back unchanged, and no damage causes
//! a crash.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_bag::{BagError, BagReport, BagWriter, Dropped, FrameConfig, FrameRecording, Frames, Messages, WriteError};
use fht_bag::{examine, survey};
use fht_perception::frame::{LaserScan, Panorama, SensorFrame};
use fht_perception::pose::pose;
use image::RgbImage;
use mcap::Compression;
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A robot that drives a curve between walls, with a panorama in every fifth frame.
fn run(frames: u64) -> Vec<SensorFrame> {
    let panorama = |k: u64| Panorama {
        views: std::array::from_fn(|view| {
            RgbImage::from_fn(8, 8, |x, y| image::Rgb([k as u8, (view as u32 * 50 + x) as u8, y as u8]))
        }),
    };
    let frame =
        |k: u64| {
            let at = k as f64 * 0.037;
            SensorFrame {
                time_us: k * 200_000,
                odom_from_base: pose(at.sin() * 3.0, at, (at * 1.7).sin() * std::f64::consts::PI),
                scan: LaserScan {
                    base_from_sensor: pose(-0.032, 0.0, 0.0),
                    angle_min: 0.0,
                    angle_increment: std::f64::consts::TAU / 360.0,
                    range_min_m: 0.12,
                    range_max_m: 7.0,
                    ranges_m: (0..360)
                        .map(|beam| {
                            if beam % 7 == 0 { f32::INFINITY } else { 1.0 + (beam as f32 * 0.1 + k as f32).sin().abs() }
                        })
                        .collect(),
                },
                panorama: k.is_multiple_of(5).then(|| panorama(k)),
            }
        };
    (0..frames).map(frame).collect()
}

fn write(path: &Path, frames: &[SensorFrame]) {
    let mut bag = BagWriter::create(path).unwrap();
    let mut recording = FrameRecording::default();
    for frame in frames {
        recording.write(&mut bag, frame, Some(&frame.odom_from_base)).unwrap();
    }
    bag.finish().unwrap();
}

fn read(path: &Path) -> (Vec<SensorFrame>, BagReport) {
    let mut frames = Frames::open(path, FrameConfig { strict: true, ..FrameConfig::default() }).unwrap();
    let all = frames.by_ref().collect::<Result<Vec<_>, _>>().unwrap();
    (all, frames.report())
}

/// Everything in a frame, bit for bit.
fn bits(frame: &SensorFrame) -> impl PartialEq + std::fmt::Debug + use<> {
    let pose = |p: &fht_perception::pose::Pose2| {
        [p.translation.x, p.translation.y, p.rotation.re, p.rotation.im].map(f64::to_bits)
    };
    let scan = &frame.scan;
    let numbers = [scan.angle_min, scan.angle_increment, scan.range_min_m, scan.range_max_m].map(f64::to_bits);
    let ranges: Vec<u32> = scan.ranges_m.iter().map(|range| range.to_bits()).collect();
    let views = frame.panorama.as_ref().map(|panorama| panorama.views.clone().map(RgbImage::into_raw));
    (frame.time_us, pose(&frame.odom_from_base), pose(&scan.base_from_sensor), numbers, ranges, views)
}

#[test]
fn what_is_written_is_read_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let frames = run(60);
    for name in ["run.mcap", "run"] {
        let path = folder.path().join(name);
        write(&path, &frames);
        let (back, report) = read(&path);
        assert_eq!(back.len(), frames.len(), "{report}");
        for (back, frame) in back.iter().zip(&frames) {
            assert!(bits(back) == bits(frame), "{} µs", frame.time_us);
        }
        assert_eq!((report.frames, report.panoramas, report.pictures), (60, 12, 48));
        assert!(report.dropped.is_empty() && report.notes.is_empty() && report.broken.is_empty(), "{report}");
        let info = survey(&path).unwrap();
        assert_eq!(info.messages, report.messages);
        assert_eq!((info.start_ns, info.end_ns), (Some(0), Some(59 * 200_000_000)));
        assert!(matches!(BagWriter::create(&path), Err(WriteError::Exists { .. })));
    }
}

/// The same messages in chunks with another compression.
fn recompressed(from: &Path, to: &Path, compression: Option<Compression>) {
    let options = mcap::WriteOptions::new().profile("ros2").compression(compression).chunk_size(Some(20_000));
    let mut writer = options.create(std::fs::File::create(to).unwrap()).unwrap();
    Messages::open(from).unwrap().for_each(|message| writer.write(&message).unwrap());
    writer.finish().unwrap();
}

struct Good {
    _folder: TempDir,
    bags: [(PathBuf, Vec<u8>); 3],
    frames: usize,
}

/// One run in zstd, lz4 and plain chunks.
fn good() -> &'static Good {
    static GOOD: OnceLock<Good> = OnceLock::new();
    GOOD.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let frames = run(60);
        let original = folder.path().join("run.mcap");
        write(&original, &frames);
        let bags = [("zstd", Some(Compression::Zstd)), ("lz4", Some(Compression::Lz4)), ("plain", None)].map(
            |(name, compression)| {
                let path = folder.path().join(format!("{name}.mcap"));
                recompressed(&original, &path, compression);
                assert_eq!(read(&path).0.len(), frames.len());
                let bytes = std::fs::read(&path).unwrap();
                (path, bytes)
            },
        );
        Good { _folder: folder, bags, frames: frames.len() }
    })
}

/// Reads whatever is there; every frame must be sane.
fn survives(bytes: &[u8]) -> Option<(usize, BagReport)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mcap");
    std::fs::write(&path, bytes).unwrap();
    let mut frames = Frames::open(&path, FrameConfig::default()).ok()?;
    let mut last_us = None;
    let mut count = 0;
    for frame in frames.by_ref() {
        let frame = frame.unwrap();
        assert!(last_us < Some(frame.time_us));
        last_us = Some(frame.time_us);
        count += 1;
        assert!(frame.odom_from_base.translation.vector.norm().is_finite());
        assert!(frame.scan.range_max_m <= 200.0 && frame.scan.angle_increment > 0.0);
        assert!(frame.scan.points_in_base().iter().all(|point| point.coords.norm() < 1e3 + 1e6));
    }
    Some((count, frames.report()))
}

/// Dark pictures, as a bag of `count` messages of 32 MB.
fn dark_pictures(path: &Path, compression: Option<Compression>, count: u32) {
    let options = mcap::WriteOptions::new().profile("ros2").compression(compression).chunk_size(Some(1 << 20));
    let mut writer = options.create(std::fs::File::create(path).unwrap()).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"").unwrap();
    let channel_id = writer.add_channel(schema, "/camera", "cdr", &Default::default()).unwrap();
    let picture = vec![0; 32_000_000];
    for sequence in 0..count {
        let time = u64::from(sequence);
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &picture).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_small_bag_that_unpacks_to_much_is_read_up_to_a_bound() {
    let folder = tempfile::tempdir().unwrap();
    for (name, compression) in [("zstd", Compression::Zstd), ("lz4", Compression::Lz4)] {
        let path = folder.path().join(name);
        dark_pictures(&path, Some(compression), 20);
        let mut messages = Messages::open(&path).unwrap();
        let read = messages.by_ref().count();
        assert!((1..20).contains(&read), "{name}: {read} messages");
        let [broken] = messages.broken() else { panic!("{name}: {:?}", messages.broken()) };
        assert!(broken.reason.contains("unpacks to 32000") && broken.reason.contains("200 times"), "{broken}");
        // A chunk that claims more than it holds, and more than any chunk may.
        let mut bytes = std::fs::read(&path).unwrap();
        let chunk = (mcap::MAGIC.len()..).find(|&at| bytes[at..].starts_with(&[6])).unwrap();
        bytes[chunk + 25..chunk + 33].copy_from_slice(&u64::MAX.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let mut messages = Messages::open(&path).unwrap();
        assert_eq!(messages.by_ref().count(), 0);
        assert!(messages.broken()[0].reason.contains("unpacks to 18446744073709551615"), "{:?}", messages.broken());
    }
    let plain = folder.path().join("plain");
    dark_pictures(&plain, None, 3);
    let mut messages = Messages::open(&plain).unwrap();
    assert_eq!((messages.by_ref().count(), messages.broken()), (3, &[][..]));
}

#[test]
fn a_bag_is_examined_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    for (path, bytes) in &good().bags {
        let sound = examine(path).unwrap();
        assert_eq!(sound, survey(path).unwrap());
        assert!(sound.broken.is_empty(), "{:?}", sound.broken);
        // Zeros in the middle, far from the summary at the end.
        let damaged = folder.path().join("damaged.mcap");
        let (middle, length) = (bytes.len() / 2, 2_000.min(bytes.len() / 8));
        let mut zeroed = bytes.clone();
        zeroed[middle..middle + length].fill(0);
        std::fs::write(&damaged, &zeroed).unwrap();
        assert!(survey(&damaged).unwrap().broken.is_empty(), "the summary is as it was");
        let info = examine(&damaged).unwrap();
        assert_eq!((info.broken.len(), info.topics.len()), (1, sound.topics.len()), "{info:?}");
        assert!(info.messages < sound.messages && info.broken[0].byte > 0, "{info:?}");
    }
}

#[test]
fn what_follows_the_end_of_a_recording_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("joined.mcap");
    for (_, bytes) in &good().bags {
        for rest in [&b"x"[..], b"garbage", bytes] {
            std::fs::write(&path, [bytes, rest].concat()).unwrap();
            let (frames, report) = read(&path);
            assert_eq!(frames.len(), good().frames);
            for told in [&report.broken, &examine(&path).unwrap().broken] {
                let [broken] = told.as_slice() else { panic!("{told:?}") };
                assert_eq!(broken.byte, bytes.len() as u64);
                let said = format!("{} bytes follow the end of the recording", rest.len());
                assert!(broken.reason.contains(&said) && broken.last_log_ns.is_some(), "{broken}");
            }
        }
    }
}

#[test]
fn a_bag_that_lacks_what_was_cut_off_is_called_broken() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.mcap");
    std::fs::write(&path, &good().bags[0].1[..100]).unwrap();
    let error = Frames::open(&path, FrameConfig::default()).err().unwrap();
    assert!(matches!(&error, BagError::Broken { broken, .. } if broken.len() == 1), "{error}");
    let said = error.to_string();
    assert!(said.contains("(topics: none)") && said.contains("cut.mcap can be read up to byte"), "{said}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, max_shrink_iters: 20, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_bag_that_is_cut_gives_its_beginning(kind in 0_usize..3, share in 0.0..1.0_f64) {
        let good = good();
        let (path, bytes) = &good.bags[kind];
        let cut = (bytes.len() as f64 * share) as usize;
        if let Some((count, report)) = survives(&bytes[..cut]) {
            let whole = read(path).0;
            prop_assert!(count <= whole.len());
            prop_assert_eq!(report.broken.len(), 1, "{}", report);
            prop_assert!(report.broken[0].byte <= cut as u64);
            prop_assert!(report.dropped.keys().all(|reason| matches!(reason, Dropped::ScanOutsideOdometry)), "{}", report);
        }
    }

    #[test]
    fn flipped_bits_bring_nothing_down(
        kind in 0_usize..3,
        flips in proptest::collection::vec((0.0..1.0_f64, 0_u8..8), 1..12),
        is_at_front in any::<bool>(),
    ) {
        let mut bytes = good().bags[kind].1.clone();
        for (share, bit) in flips {
            let scale = if is_at_front { 2000.0 } else { bytes.len() as f64 };
            let at = (share * scale) as usize;
            bytes[at] ^= 1 << bit;
        }
        if let Some((count, _)) = survives(&bytes) {
            prop_assert!(count <= good().frames);
        }
    }

    #[test]
    fn any_bytes_are_refused_or_read(bytes in proptest::collection::vec(any::<u8>(), 0..600), is_headed in any::<bool>()) {
        let head: &[u8] = if is_headed { mcap::MAGIC } else { &[] };
        let _ = survives(&[head, &bytes].concat());
    }

    #[test]
    fn messages_of_any_content_bring_nothing_down(
        edits in proptest::collection::vec((0_usize..400, 0.0..1.0_f64, any::<u8>()), 1..60),
    ) {
        // The file is intact and its checksums are right; only the content of the messages is
        // absurd.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("absurd.mcap");
        let mut writer = mcap::WriteOptions::new().create(std::fs::File::create(&path).unwrap()).unwrap();
        for (index, mut message) in Messages::open(&good().bags[2].0).unwrap().enumerate() {
            let data = message.data.to_mut();
            for (_, share, byte) in edits.iter().filter(|(place, _, _)| *place == index) {
                let at = (data.len() as f64 * share) as usize;
                data[at] = *byte;
            }
            writer.write(&message).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let (count, report) = survives(&std::fs::read(&path).unwrap()).unwrap();
        prop_assert!(count <= good().frames && report.broken.is_empty());
    }
}
