//! Two rooms of one shape: a robot in one of them says that it may be in either, until something
//! tells them apart.

mod drawn_walls;

use drawn_walls::{Wall, range_m};
use fht_localization::landmarks::Landmarks;
use fht_localization::relocalization::{Belief, RelocalizationConfig, Relocalizer, Sensed};
use fht_map::MapState;
use fht_perception::candidate::Candidate;
use fht_perception::frame::LaserScan;
use fht_perception::pose::{Point2, Pose2, pose, to_fixed};
use fht_perception::scan_odometry::Odometry;
use fht_proto::{
    AuthorId, Descriptor, DescriptorModel, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect, Signature,
};

const MODEL: ModelId = ModelId(7);
/// From one room to the other, metres.
const APART_M: f64 = 20.0;

/// An L-shaped room around (x, 0): no symmetry of its own.
fn room(x: f64) -> Vec<Wall> {
    let corners = [(-3.0, -2.0), (4.0, -2.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (-3.0, 4.0), (-3.0, -2.0)];
    corners.windows(2).map(|pair| [(pair[0].0 + x, pair[0].1), (pair[1].0 + x, pair[1].1)]).collect()
}

/// A row of cupboards of 2.4 m × 1.8 m against the lower wall of the room around x.
fn cupboard(x: f64) -> Vec<Wall> {
    let corners = [(0.8, -2.0), (0.8, -0.2), (3.2, -0.2), (3.2, -2.0)];
    corners.windows(2).map(|pair| [(pair[0].0 + x, pair[0].1), (pair[1].0 + x, pair[1].1)]).collect()
}

/// What 360 beams of 7 m see from `at`, with a noise of about 1 cm that repeats.
fn scan(walls: &[Wall], at: &Pose2) -> LaserScan {
    let mut noise = 1_u32;
    let ranges_m = (0..360).map(|degree| {
        let (sin, cos) = f64::from(degree).to_radians().sin_cos();
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (range_m(walls, at, (cos, sin)) + (f64::from(noise >> 16) / 65_536.0 - 0.5) * 0.03) as f32
    });
    LaserScan {
        base_from_sensor: pose(0.0, 0.0, 0.0),
        angle_min: 0.0,
        angle_increment: 1.0_f64.to_radians(),
        range_min_m: 0.1,
        range_max_m: 7.0,
        ranges_m: ranges_m.collect(),
    }
}

/// What a room looks like: one number for each.
fn look(room: usize) -> Descriptor {
    let mut components = [0.1_f32; 8];
    components[room] = 1.0;
    Descriptor::quantise(MODEL, &components)
}

/// Both rooms, each with two main nodes; `looks` says what each looks like.
fn map(walls: &[Wall], looks: [usize; 2]) -> Landmarks {
    map_without(walls, looks, |_| false)
}

/// The same, but nodes know nothing of what lies in a part of the world.
fn map_without(walls: &[Wall], looks: [usize; 2], is_unknown: impl Fn(Point2) -> bool) -> Landmarks {
    let author = AuthorId(1);
    let mut ops = vec![Op::PutModel {
        model: DescriptorModel { id: MODEL, name: "test".to_owned(), dimension: 8, match_threshold_e3: 600 },
    }];
    let places = [(0.0, 0.0, 0), (2.5, -0.5, 0), (APART_M, 0.0, 1), (APART_M + 2.5, -0.5, 1)];
    for (number, (x, y, room)) in places.into_iter().enumerate() {
        let id = NodeId { author, number: number as u32 };
        let map_from_node = pose(x, y, 0.7 * number as f64);
        let at: FixedPose = to_fixed(&map_from_node);
        let mut seen = scan(walls, &map_from_node);
        let ends: Vec<Point2> =
            (0..seen.ranges_m.len()).map(|beam| map_from_node * seen.beam_end_in_base(beam)).collect();
        for (range_m, _) in seen.ranges_m.iter_mut().zip(ends).filter(|(_, end)| is_unknown(*end)) {
            *range_m = f32::NAN;
        }
        let record = seen.to_record();
        ops.push(Op::PutNode { id, kind: NodeKind::Main, pose: at });
        ops.push(Op::SetFreeSpace {
            id,
            rect: Some(Rect::around(at.position, (x - 0.5, y - 0.4), (x + 0.5, y + 0.4))),
        });
        ops.push(Op::SetSignature { id, signature: Signature { descriptor: Some(look(looks[room])), scan: record } });
    }
    let mut map = MapState::new();
    map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
    let mut landmarks = Landmarks::default();
    landmarks.refresh(&map);
    landmarks
}

/// Where robots begin in the second room.
fn start() -> Pose2 {
    pose(APART_M - 1.5, 2.8, -1.3)
}

/// A robot in the second room that has driven 4 m.
fn driven(walls: &[Wall], landmarks: &Landmarks) -> Relocalizer {
    let mut relocalizer = Relocalizer::new(RelocalizationConfig::default());
    for step in 0..10 {
        let odom_from_base = pose(0.4 * f64::from(step), 0.0, 0.0);
        let scan = scan(walls, &(start() * odom_from_base));
        let odometry =
            Odometry { odom_from_base, odometer_m: 0.4 * f64::from(step), turned_rad: 0.0, is_keyframe: true };
        let points = scan.points_in_base();
        relocalizer.observe(landmarks, &Sensed { odometry, scan: &scan, points: &points, descriptor: None });
    }
    relocalizer
}

/// Drives through the second room; what the robot believes at the end, or when it knows, and where
/// it then is.
fn drive(walls: &[Wall], landmarks: &Landmarks, seen: Option<usize>) -> (Belief, Pose2) {
    drive_told(walls, landmarks, seen, None)
}

/// The same, while somebody says again and again that the robot is elsewhere by this much, map
/// frame.
fn drive_told(
    walls: &[Wall],
    landmarks: &Landmarks,
    seen: Option<usize>,
    told: Option<(f64, f64, f64)>,
) -> (Belief, Pose2) {
    let mut relocalizer = Relocalizer::new(RelocalizationConfig::default());
    let start = start();
    let mut last = (Belief::NotLocalized, start);
    for step in 0..12 {
        let odom_from_base = pose(0.4 * f64::from(step), 0.0, 0.0);
        let at = start * odom_from_base;
        let scan = scan(walls, &at);
        let points = scan.points_in_base();
        let odometry =
            Odometry { odom_from_base, odometer_m: 0.4 * f64::from(step), turned_rad: 0.0, is_keyframe: true };
        let descriptor = seen.map(look);
        let observation = Sensed { odometry, scan: &scan, points: &points, descriptor: descriptor.as_ref() };
        if let Some((dx, dy, turn)) = told {
            let said = pose(at.translation.x + dx, at.translation.y + dy, at.rotation.angle() + turn);
            relocalizer.point_at(said * odom_from_base.inverse());
        }
        last = (relocalizer.observe(landmarks, &observation), at);
        if matches!(last.0, Belief::Localized(_)) {
            break;
        }
    }
    last
}

fn assert_is_there(belief: &Belief, at: &Pose2) {
    let Belief::Localized(fix) = belief else { panic!("{belief:?}") };
    let error = (fix.map_from_base.translation.vector - at.translation.vector).norm();
    assert!(error < 0.03 && fix.confidence > 0.99, "{error} m off, {fix:?}");
    assert!(fix.sigma_m() < 0.1, "{fix:?}");
}

#[test]
fn a_place_that_looks_like_another_is_not_yet_known() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).collect();
    let landmarks = map(&walls, [0, 0]);
    for seen in [None, Some(0)] {
        match drive(&walls, &landmarks, seen).0 {
            Belief::Candidates { hypotheses, confidence } => {
                assert!(hypotheses >= 2 && (0.3..0.7).contains(&confidence), "{hypotheses} {confidence}");
            }
            belief => panic!("{seen:?}: {belief:?}"),
        }
    }
}

#[test]
fn a_room_that_was_mapped_in_part_is_not_ruled_out_by_its_twin_that_was_mapped_all_over() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).collect();
    // No node kept what it saw in the right arm of the room in which the robot is.
    let landmarks = map_without(&walls, [0, 0], |end| end.x > APART_M + 2.0);
    let (belief, _) = drive(&walls, &landmarks, None);
    assert!(matches!(belief, Belief::Candidates { .. }), "{belief:?}");
    let relocalizer = driven(&walls, &landmarks);
    let is_true = |place: &Candidate| (start().inverse() * place.map_from_odom).translation.vector.norm() < 0.1;
    assert!(relocalizer.ambiguity().iter().any(is_true), "{:?}", relocalizer.ambiguity());
}

#[test]
fn two_rooms_that_are_alike_are_two_candidates_of_one_share() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).collect();
    let relocalizer = driven(&walls, &map(&walls, [0, 0]));
    let places = relocalizer.ambiguity();
    assert!((places.iter().map(|place| place.share).sum::<f64>() - 1.0).abs() < 1e-9, "{places:?}");
    for truth in [start(), pose(-APART_M, 0.0, 0.0) * start()] {
        let near = places.iter().find(|place| {
            let off = truth.inverse() * place.map_from_odom;
            off.translation.vector.norm() < 0.1 && off.rotation.angle().abs() < 0.03
        });
        assert!(near.is_some_and(|place| place.share > 0.3), "{truth}: {places:?}");
    }
    // What stands in one of them makes that one likely.
    let walls: Vec<Wall> = walls.into_iter().chain(cupboard(APART_M)).collect();
    let relocalizer = driven(&walls, &map(&walls, [0, 0]));
    let places = relocalizer.ambiguity();
    let likeliest = places.first().map(|place| (start().inverse() * place.map_from_odom, place.share));
    assert!(likeliest.is_some_and(|(off, share)| off.translation.vector.norm() < 0.1 && share > 0.8), "{places:?}");
}

#[test]
fn a_person_who_points_does_not_decide_and_does_no_harm() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).collect();
    let alike = map(&walls, [0, 0]);
    // Right, nearly right, in the other room, and into a wall.
    let all = [(0.0, 0.0, 0.0), (0.4, -0.5, 0.5), (-APART_M, 0.0, 0.0), (2.0, 1.5, 2.0), (500.0, 0.0, 0.0)];
    for told in all {
        let (belief, _) = drive_told(&walls, &alike, None, Some(told));
        assert!(matches!(belief, Belief::Candidates { .. }), "{told:?}: {belief:?}");
    }
    let walls: Vec<Wall> = walls.into_iter().chain(cupboard(APART_M)).collect();
    for told in all {
        let (belief, at) = drive_told(&walls, &map(&walls, [0, 0]), None, Some(told));
        assert_is_there(&belief, &at);
    }
}

#[test]
fn a_thing_that_stands_in_one_of_them_decides() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).chain(cupboard(APART_M)).collect();
    let (belief, at) = drive(&walls, &map(&walls, [0, 0]), None);
    assert_is_there(&belief, &at);
}

#[test]
fn so_does_what_they_look_like() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).collect();
    let (belief, at) = drive(&walls, &map(&walls, [0, 1]), Some(1));
    assert_is_there(&belief, &at);
}

#[test]
fn a_room_that_is_not_on_the_map_is_nowhere() {
    let walls: Vec<Wall> = room(0.0).into_iter().chain(room(APART_M)).collect();
    let landmarks = map(&walls, [0, 0]);
    let round: Vec<Wall> = (0..24)
        .map(|side| {
            let corner = |k: i32| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::PI / 12.0).sin_cos();
                (APART_M + 3.0 * cos, 3.0 * sin)
            };
            [corner(side), corner(side + 1)]
        })
        .collect();
    let (belief, _) = drive(&round, &landmarks, None);
    assert!(!matches!(belief, Belief::Localized(_)), "{belief:?}");
}
