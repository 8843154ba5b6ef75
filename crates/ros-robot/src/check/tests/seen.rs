//! What is wrong with cameras while a robot runs: it is said, and frames come all the same.

use super::{LifeCase, MS, Running};
use crate::config::RosRobotConfig;
use fht_ros_frames::{header_message, optical_rotation};
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{CameraInfoMsg, CompressedImage, Image, Pose};
use std::f64::consts::FRAC_PI_2;

fn with_cameras(config: &mut RosRobotConfig) {
    config.cameras = Some(["front", "left", "back", "right"].map(|name| format!("/r1/camera_{name}/image")));
}

/// A picture of a camera, `late_ms` after the robot's stamp, that has come `now_s` after the start.
fn picture(now: &mut Running, camera: usize, now_s: f64, late_ms: i64, change: impl FnOnce(&mut Image<'_>)) {
    let stamp_us = now.stamp_us.saturating_add_signed(late_ms * MS as i64);
    let (header, encoding, data) = (header_message(stamp_us, "camera"), "mono8".to_owned(), &[7; 64][..]);
    let mut image = Image { header, height: 8, width: 8, encoding, is_bigendian: 0, step: 8, data };
    change(&mut image);
    let bytes = cdr::encode(&image).expect("a message");
    now.intake.take_picture(camera, bytes, now_s, now.stamp_us * 1000);
}

fn all_but(now: &mut Running, silent: usize, now_s: f64) {
    (0..4).filter(|camera| *camera != silent).for_each(|camera| picture(now, camera, now_s, 0, |_| {}));
}

/// A frame, so many seconds after the start.
fn frame(now: &mut Running, now_s: f64) {
    now.laser();
    now.both();
    assert!(now.intake.frame(now_s).is_some(), "frames come all the same");
}

fn info(now: &mut Running, camera: usize, change: impl FnOnce(&mut CameraInfoMsg)) {
    let header = header_message(now.stamp_us, &format!("camera_{camera}"));
    let k = [4.0, 0.0, 4.0, 0.0, 4.0, 4.0, 0.0, 0.0, 1.0];
    let mut info = CameraInfoMsg { header, width: 8, height: 8, k, ..CameraInfoMsg::default() };
    change(&mut info);
    now.intake.take_camera_info(camera, info);
}

fn mounted(now: &mut Running, camera: usize, yaw: f64) {
    let orientation = optical_rotation(yaw);
    now.link("base_link", &format!("camera_{camera}"), Pose { orientation, ..Pose::default() });
}

/// Four cameras, of which that on the left is as `change` makes it, and turned by `off` radians.
fn left_is(now: &mut Running, off: f64, change: impl FnOnce(&mut CameraInfoMsg)) {
    for camera in 0..4 {
        mounted(now, camera, camera as f64 * FRAC_PI_2 + if camera == 1 { off } else { 0.0 });
    }
    info(now, 1, change);
    all_but(now, 9, 0.5);
    frame(now, 0.5);
}

pub(super) fn seen() -> Vec<LifeCase> {
    let mut all = pictures();
    all.extend(lenses());
    all
}

fn pictures() -> Vec<LifeCase> {
    vec![
        (
            with_cameras,
            |now| {
                all_but(now, 1, 3.5);
                frame(now, 4.0);
            },
            &["nothing has come on /r1/camera_left/image (sensor_msgs/Image)", "does its driver run"],
        ),
        (
            with_cameras,
            |now| {
                picture(now, 2, 0.5, -4000, |_| {});
                all_but(now, 2, 4.5);
                frame(now, 5.0);
            },
            &["/r1/camera_back/image has been silent for 4.5 s", "ros2 topic hz /r1/camera_back/image"],
        ),
        (
            with_cameras,
            |now| {
                (0..4).for_each(|camera| picture(now, camera, 3.9, -8000, |_| {}));
                frame(now, 4.0);
            },
            &["the pictures of /r1/camera_", "are 8.0 s behind the scans of /r1/scan", "chrony"],
        ),
        (
            with_cameras,
            |now| {
                all_but(now, 3, 0.5);
                picture(now, 3, 0.5, 0, |image| image.encoding = "bayer_rggb8".to_owned());
                frame(now, 0.5);
            },
            &["/r1/camera_right/image is of no use for panoramas: its encoding is \"bayer_rggb8\"", "image_proc"],
        ),
        (
            with_cameras,
            |now| {
                all_but(now, 0, 0.5);
                picture(now, 0, 0.5, 0, |image| image.step = 4);
                frame(now, 0.5);
            },
            &["/r1/camera_front/image is of no use", "8 x 8 pixels in rows of 4 bytes"],
        ),
        (
            with_cameras,
            |now| {
                all_but(now, 0, 0.5);
                picture(now, 0, 0.5, 0, |image| image.height = 4);
                frame(now, 0.5);
            },
            &["its pictures have 8 x 4 pixels", "let camera_info and a transform say how the cameras look"],
        ),
        (
            |config| config.cameras = Some(["a", "b", "c", "d"].map(|name| format!("/{name}/image/compressed"))),
            |now| {
                for camera in 0..4 {
                    let header = header_message(now.stamp_us, "camera");
                    let broken = CompressedImage { header, format: "jpeg".to_owned(), data: &[0xff, 0xd8, 0xff] };
                    let bytes = cdr::encode(&broken).expect("a message");
                    now.intake.take_picture(camera, bytes, 0.5, 0);
                }
                frame(now, 0.5);
            },
            &["/a/image/compressed is of no use", "cannot be decoded", "PNG and JPEG"],
        ),
        (
            with_cameras,
            |now| {
                now.intake.take_picture(1, vec![0, 1], 0.5, 0);
                frame(now, 0.5);
            },
            &["/r1/camera_left/image has stamps that are no times"],
        ),
    ]
}

fn lenses() -> Vec<LifeCase> {
    vec![
        (
            with_cameras,
            |now| {
                info(now, 1, |_| {});
                all_but(now, 9, 0.5);
                frame(now, 0.5);
            },
            &["/r1/camera_left/image is of no use", "no transform leads from base_link to camera_1", "tf_static"],
        ),
        (with_cameras, |now| left_is(now, 0.0, |info| info.k = [0.0; 9]), &["no focal length", "calibrate"]),
        (
            with_cameras,
            |now| left_is(now, 0.0, |info| info.distortion_model = "equidistant".to_owned()),
            &["/r1/camera_left/image is of no use", "its lens is \"equidistant\", not a pinhole", "image_proc"],
        ),
        (
            with_cameras,
            |now| left_is(now, 0.0, |info| info.d = vec![-0.3, 0.1]),
            &["the pictures of /r1/camera_left/image are bent by its lens", "image_rect"],
        ),
        (
            with_cameras,
            |now| left_is(now, 0.0, |info| (info.k[0], info.k[4]) = (8.0, 8.0)),
            &["/r1/camera_left/image is of no use", "53° across", "four cameras of about 90°"],
        ),
        (
            with_cameras,
            |now| left_is(now, FRAC_PI_2, |_| {}),
            &["/r1/camera_left/image is of no use", "see its transform, or the order of the topics"],
        ),
    ]
}
