#![no_main]
//! Recorded runs. The input is a row of messages (topic, length in two bytes, bytes), each also
//! read on its own; or an MCAP file, if it begins like one.

use fht_bag::{FrameConfig, Frames};
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{
    CompressedImage, GoalStatusArray, Image, LaserScanMsg, OdometryMsg, PathMsg, PointCloud2, TfMessage,
};
use libfuzzer_sys::fuzz_target;
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

const TOPICS: [(&str, &str); 8] = [
    ("/scan", "sensor_msgs/msg/LaserScan"),
    ("/odom", "nav_msgs/msg/Odometry"),
    ("/tf", "tf2_msgs/msg/TFMessage"),
    ("/tf_static", "tf2_msgs/msg/TFMessage"),
    ("/camera_front/image", "sensor_msgs/msg/Image"),
    ("/camera_left/image", "sensor_msgs/msg/Image"),
    ("/camera_back/image", "sensor_msgs/msg/Image"),
    ("/camera_right/image/compressed", "sensor_msgs/msg/CompressedImage"),
];

fn messages(mut rest: &[u8]) -> Vec<(usize, &[u8])> {
    let mut messages = Vec::new();
    while let Some((&[topic, low, high], after)) = rest.split_first_chunk::<3>() {
        let (bytes, after) = after.split_at(usize::from(u16::from_le_bytes([low, high])).min(after.len()));
        messages.push((usize::from(topic) % TOPICS.len(), bytes));
        rest = after;
    }
    messages
}

fn bag(messages: &[(usize, &[u8])]) -> Vec<u8> {
    let options = WriteOptions::new().profile("ros2").compression(None);
    let mut writer = Writer::with_options(Cursor::new(Vec::new()), options).expect("memory is there");
    let mut channels = BTreeMap::new();
    for (sequence, (topic, bytes)) in messages.iter().enumerate() {
        let (name, schema) = TOPICS[*topic];
        let channel_id = *channels.entry(*topic).or_insert_with(|| {
            let schema = writer.add_schema(schema, "ros2msg", b"").expect("memory is there");
            writer.add_channel(schema, name, "cdr", &BTreeMap::new()).expect("memory is there")
        });
        let log_time = 1_000_000_000 + sequence as u64 * 50_000_000;
        let header = MessageHeader { channel_id, sequence: sequence as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, bytes).expect("memory is there");
    }
    writer.finish().expect("memory is there");
    writer.into_inner().into_inner()
}

fn read(path: &Path) {
    let Ok(mut frames) = Frames::open(path, FrameConfig::default()) else { return };
    for frame in (&mut frames).flatten() {
        let _ = frame.check();
    }
    let _ = frames.report().to_string();
}

fuzz_target!(|bytes: &[u8]| {
    let path = std::env::temp_dir().join(format!("fht-fuzz-{}.mcap", std::process::id()));
    if bytes.starts_with(mcap::MAGIC) {
        std::fs::write(&path, bytes).expect("the folder for temporary files can be written");
    } else {
        let messages = messages(bytes);
        for (_, bytes) in &messages {
            let _ = cdr::decode::<LaserScanMsg>(bytes);
            let _ = cdr::decode::<OdometryMsg>(bytes);
            let _ = cdr::decode::<TfMessage>(bytes);
            let _ = cdr::decode::<Image<'_>>(bytes);
            let _ = cdr::decode::<CompressedImage<'_>>(bytes);
            let _ = cdr::decode::<PointCloud2<'_>>(bytes);
            let _ = cdr::decode::<PathMsg>(bytes);
            let _ = cdr::decode::<GoalStatusArray>(bytes);
        }
        std::fs::write(&path, bag(&messages)).expect("the folder for temporary files can be written");
    }
    read(&path);
});
