//! Matching against rooms of known geometry.

use super::*;
use crate::pose::{Point2, pose, wrap_angle};
use std::f64::consts::PI;

type Wall = ((f64, f64), (f64, f64));

/// An L-shaped room with a pillar: no symmetry.
const ROOM: [Wall; 10] = [
    ((-3.0, -2.0), (4.0, -2.0)),
    ((4.0, -2.0), (4.0, 1.0)),
    ((4.0, 1.0), (1.0, 1.0)),
    ((1.0, 1.0), (1.0, 4.0)),
    ((1.0, 4.0), (-3.0, 4.0)),
    ((-3.0, 4.0), (-3.0, -2.0)),
    ((-1.5, 1.5), (-1.0, 1.5)),
    ((-1.0, 1.5), (-1.0, 2.2)),
    ((-1.0, 2.2), (-1.5, 2.2)),
    ((-1.5, 2.2), (-1.5, 1.5)),
];

/// Two endless parallel walls.
const CORRIDOR: [Wall; 2] = [((-50.0, -1.0), (50.0, -1.0)), ((-50.0, 1.0), (50.0, 1.0))];

/// What 360 beams of 7 m see from `at`, with a deterministic noise of about 1 cm.
fn scan(walls: &[Wall], at: &Pose2) -> Vec<Point2> {
    let mut points = Vec::new();
    let mut noise = 1_u32;
    for beam in 0..360 {
        let angle = f64::from(beam).to_radians();
        let heading = angle + at.rotation.angle();
        let (dx, dy) = (heading.cos(), heading.sin());
        let mut range = f64::INFINITY;
        for &((x1, y1), (x2, y2)) in walls {
            let (ex, ey) = (x2 - x1, y2 - y1);
            let (ox, oy) = (x1 - at.translation.x, y1 - at.translation.y);
            let cross = dx * ey - dy * ex;
            if cross.abs() < 1e-12 {
                continue;
            }
            let t = (ox * ey - oy * ex) / cross;
            let u = (ox * dy - oy * dx) / cross;
            if t > 0.0 && (0.0..=1.0).contains(&u) {
                range = range.min(t);
            }
        }
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        range += (f64::from(noise >> 16) / 65_536.0 - 0.5) * 0.035;
        if range < 7.0 {
            points.push(Point2::new(range * angle.cos(), range * angle.sin()));
        }
    }
    points
}

fn error(found: &Pose2, truth: &Pose2) -> (f64, f64) {
    let translation = (found.translation.vector - truth.translation.vector).norm();
    (translation, wrap_angle(found.rotation.angle() - truth.rotation.angle()).abs())
}

fn everywhere() -> SearchWindow {
    SearchWindow { centre: Pose2::identity(), half_x_m: 3.0, half_y_m: 3.0, half_yaw_rad: PI }
}

#[test]
fn a_scan_is_found_without_a_guess_at_any_heading() {
    let reference = ReferenceCloud::from_scan(&scan(&ROOM, &pose(0.0, 0.0, 0.0)));
    for (x, y, yaw) in [(0.3, -0.4, 0.0), (1.1, -0.9, 2.0), (-1.8, 0.6, -2.9), (-0.6, 0.9, 1.2), (1.6, -1.2, PI)] {
        let truth = pose(x, y, yaw);
        let found = search(&reference, &scan(&ROOM, &truth), &everywhere(), &MatchConfig::default())
            .unwrap_or_else(|no| panic!("({x}, {y}, {yaw}): {no}"));
        let (metres, radians) = error(&found.reference_from_moving, &truth);
        assert!(metres < 0.02 && radians < 0.006, "({x}, {y}, {yaw}): {metres} m, {radians} rad");
        assert!(found.score > 0.6, "{}", found.score);
    }
}

#[test]
fn another_room_does_not_match() {
    let reference = ReferenceCloud::from_scan(&scan(&ROOM, &pose(0.0, 0.0, 0.0)));
    let round: Vec<Wall> = (0..24)
        .map(|side| {
            let corner = |k: i32| (2.6 * (f64::from(k) * PI / 12.0).cos(), 2.6 * (f64::from(k) * PI / 12.0).sin());
            (corner(side), corner(side + 1))
        })
        .collect();
    let result = search(&reference, &scan(&round, &pose(0.2, 0.3, 0.4)), &everywhere(), &MatchConfig::default());
    assert!(result.is_err(), "score {:?}", result.map(|found| found.score));
}

#[test]
fn a_corridor_is_uncertain_along_and_certain_across() {
    let reference = ReferenceCloud::from_scan(&scan(&CORRIDOR, &pose(0.0, 0.0, 0.0)));
    let truth = pose(0.0, 0.1, 0.05);
    let found = refine(&reference, &scan(&CORRIDOR, &truth), &pose(0.0, 0.0, 0.0), &MatchConfig::default()).unwrap();
    assert!((found.reference_from_moving.translation.y - 0.1).abs() < 0.01);
    assert!(found.covariance[(0, 0)] > 100.0 * found.covariance[(1, 1)], "{}", found.covariance);
}

#[test]
fn odometry_holds_what_a_corridor_does_not_say() {
    let reference = ReferenceCloud::from_scan(&scan(&CORRIDOR, &pose(0.0, 0.0, 0.0)));
    let truth = pose(0.1, 0.02, 0.01);
    let information = Matrix3::from_diagonal(&nalgebra::Vector3::new(1e6, 1e4, 1e4));
    let prior = Prior { reference_from_moving: pose(0.1, 0.0, 0.0), information };
    let found = refine_with_prior(&reference, &scan(&CORRIDOR, &truth), &prior, &MatchConfig::default()).unwrap();
    let (metres, _) = error(&found.reference_from_moving, &truth);
    assert!(metres < 0.01, "{metres} m");
}

#[test]
fn the_far_side_of_a_thin_wall_is_another_wall() {
    // A wall 0.1 m thick, seen from below; then its other side, from above.
    let points: Vec<Point2> = (-100..=100).map(|step| Point2::new(f64::from(step) * 0.02, 1.0)).collect();
    let below = ReferenceCloud::from_scan(&points);
    let seen_from = |y: f64| SeenPoint::new(Point2::new(0.3, 1.05), Point2::new(0.3, y));
    assert!(below.explains(&seen_from(0.0), 0.06));
    assert!(!below.explains(&seen_from(2.0), 0.06));
    let mut both = below.clone();
    let above = points.iter().map(|point| SeenPoint::new(Point2::new(point.x, 1.1), Point2::new(0.0, 2.0)));
    both.absorb(above, 0.03);
    assert!(both.explains(&seen_from(2.0), 0.06), "the other side is there now");
}

#[test]
fn points_that_are_seen_again_become_their_mean() {
    let mut noise = 7_u32;
    let mut next = || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(noise >> 16) / 65_536.0 - 0.5) * 0.05
    };
    let mut cloud = ReferenceCloud::default();
    let spread = |cloud: &ReferenceCloud| {
        let count = cloud.len() as f64;
        (cloud.positions().map(|point| (point.y - 2.0).powi(2)).sum::<f64>() / count).sqrt()
    };
    let mut first = 0.0;
    for scan in 0..30 {
        let wall = (-40..=40).map(|step| Point2::new(f64::from(step) * 0.05, 2.0 + next()));
        let wall: Vec<Point2> = wall.collect();
        cloud.absorb(wall.into_iter().map(SeenPoint::of_scan), 0.06);
        if scan == 0 {
            first = spread(&cloud);
        }
    }
    assert!(spread(&cloud) < 0.4 * first, "{} {first}", spread(&cloud));
    assert!(cloud.len() < 2 * 81, "{}", cloud.len());
}

#[test]
fn nothing_from_nothing() {
    let config = MatchConfig::default();
    let empty = ReferenceCloud::default();
    let points = scan(&ROOM, &pose(0.0, 0.0, 0.0));
    assert!(search(&empty, &points, &everywhere(), &config).is_err());
    assert!(search(&ReferenceCloud::from_scan(&points), &[], &everywhere(), &config).is_err());
    let broken = vec![Point2::new(f64::NAN, 1.0); 100];
    assert!(ReferenceCloud::from_scan(&broken).is_empty());
    assert!(refine(&ReferenceCloud::from_scan(&points), &broken, &Pose2::identity(), &config).is_none());
}
