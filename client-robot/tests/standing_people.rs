//! A robot finds its place in a room in which people stand whom the map does not have, once it has
//! seen some walk.

mod drawn_walls;

use drawn_walls::{Wall, range_m};
use fht_localization::landmarks::Landmarks;
use fht_localization::relocalization::{Belief, RelocalizationConfig, Relocalizer, Sensed};
use fht_map::MapState;
use fht_perception::frame::LaserScan;
use fht_perception::pose::{Pose2, pose, to_fixed};
use fht_perception::scan_odometry::Odometry;
use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op, Signature};

fn lines(corners: &[(f64, f64)]) -> Vec<Wall> {
    corners.windows(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// A room with an alcove: no symmetry of its own.
fn room() -> Vec<Wall> {
    lines(&[
        (-5.0, -3.0),
        (5.0, -3.0),
        (5.0, 2.0),
        (3.0, 2.0),
        (3.0, 4.0),
        (-1.0, 4.0),
        (-1.0, 3.0),
        (-5.0, 3.0),
        (-5.0, -3.0),
    ])
}

/// Somebody who stands: 0.3 m wide.
fn somebody((x, y): (f64, f64)) -> Vec<Wall> {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
    lines(&corners.map(|(dx, dy)| (x + 0.15 * dx, y + 0.15 * dy)))
}

/// What 720 beams of 9 m see from `at`, with a noise of about 1 cm that repeats.
fn scan(walls: &[Wall], at: &Pose2) -> LaserScan {
    LaserScan::all_round(720, |cos, sin| {
        let noise_m = 0.015 * (12_345.678 * (cos + 2.0 * sin)).sin();
        range_m(walls, at, (cos, sin)) + noise_m
    })
}

/// The room, seen from places all over it when nobody stood there.
fn map() -> Landmarks {
    let author = AuthorId(1);
    let places = [(-4.0, -2.0), (-3.5, 1.5), (-1.5, 0.0), (0.5, -2.0), (1.0, 2.5), (2.5, 0.5), (4.2, -1.5)];
    let ops = places.into_iter().enumerate().flat_map(|(number, (x, y))| {
        let (id, at) = (NodeId { author, number: number as u32 }, pose(x, y, 0.7 * number as f64));
        let at_fixed: FixedPose = to_fixed(&at);
        let signature = Signature { descriptor: None, scan: scan(&room(), &at).to_record() };
        [Op::PutNode { id, kind: NodeKind::Main, pose: at_fixed }, Op::SetSignature { id, signature }]
    });
    let mut map = MapState::new();
    map.apply(&Increment { author, number: 1, hlc_us: 1, ops: ops.collect() });
    let mut landmarks = Landmarks::default();
    landmarks.refresh(&map);
    landmarks
}

/// A robot that drives 3.2 m through the room, in which people stand, after it has seen so many
/// walk: whether it knows its place in the end.
fn knows(walkers: usize, config: RelocalizationConfig) -> bool {
    let people = [(-2.6, -1.2), (-0.9, 1.6), (0.3, -0.9), (1.6, 1.2), (2.4, -1.6), (-3.4, 0.9), (3.6, 0.6), (0.9, 0.3)];
    let walls: Vec<Wall> = room().into_iter().chain(people.into_iter().flat_map(somebody)).collect();
    let (landmarks, mut relocalizer) = (map(), Relocalizer::new(config));
    relocalizer.expect_people(walkers);
    (0..9).any(|step| {
        let driven_m = 0.4 * f64::from(step);
        let odom_from_base = pose(driven_m, 0.0, 0.0);
        let at = pose(-1.8, -2.2, 0.0) * odom_from_base;
        let scan = scan(&walls, &at);
        let odometry = Odometry { odom_from_base, odometer_m: driven_m, turned_rad: 0.0, is_keyframe: true };
        let points = scan.points_in_base();
        let sensed = Sensed { odometry, scan: &scan, points: &points, descriptor: None };
        match relocalizer.observe(&landmarks, &sensed) {
            Belief::Localized(fix) => {
                let off_m = (fix.map_from_base.translation.vector - at.translation.vector).norm();
                assert!(off_m < 0.1, "{off_m} m off");
                true
            }
            _ => false,
        }
    })
}

#[test]
fn who_stands_keeps_nobody_from_finding_his_place_where_people_walk() {
    assert!(!knows(0, RelocalizationConfig::default()), "what cannot be speaks against every place");
    assert!(knows(8, RelocalizationConfig::default()));
}

#[test]
fn a_robot_that_is_to_declare_nothing_declares_nothing_among_people() {
    let never = RelocalizationConfig { min_confidence: f64::INFINITY, ..RelocalizationConfig::default() };
    assert!(!knows(8, never));
}
