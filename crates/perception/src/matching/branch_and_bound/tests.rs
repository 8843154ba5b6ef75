//! Searches in a drawn building with two rooms of one shape.

use super::*;
use crate::pose::pose;
use proptest::prelude::*;
use std::f64::consts::PI;

/// Points every 5 cm along the walls of a building: two rooms of one shape, 12 m apart, and a
/// pillar in the second.
fn building() -> Vec<Point2> {
    let room = [(-3.0, -2.0), (4.0, -2.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (-3.0, 4.0), (-3.0, -2.0)];
    let pillar = [(10.0, 0.5), (10.6, 0.5), (10.6, 1.1), (10.0, 1.1), (10.0, 0.5)];
    let second = room.map(|(x, y)| (x + 12.0, y));
    [room.as_slice(), &second, &pillar].into_iter().flat_map(|corners| corners.windows(2).flat_map(along)).collect()
}

fn along(pair: &[(f64, f64)]) -> Vec<Point2> {
    let (from, to) = (Point2::new(pair[0].0, pair[0].1), Point2::new(pair[1].0, pair[1].1));
    let steps = ((to - from).norm() / 0.05).round() as usize;
    (0..steps).map(|step| from + (to - from) * (step as f64 / steps as f64)).collect()
}

fn places() -> Vec<Point2> {
    let room = (0..28).flat_map(|i| (0..24).map(move |j| (f64::from(i) * 0.2 - 2.6, f64::from(j) * 0.2 - 1.8)));
    let inside = room.filter(|&(x, y)| x < 0.9 || y < 0.9);
    inside.flat_map(|(x, y)| [Point2::new(x, y), Point2::new(x + 12.0, y)]).collect()
}

/// What is within 7 m of `at`, in its frame; walls hide nothing here.
fn scan(at: &Pose2) -> Vec<Point2> {
    let near = building().into_iter().step_by(3).map(|point| at.inverse() * point);
    near.filter(|point| point.coords.norm() < 4.0).collect()
}

fn pyramid() -> WallPyramid {
    WallPyramid::new(&building(), &places(), &BranchAndBoundConfig::default()).expect("a building")
}

fn gap(found: &PoseCandidate, truth: &Pose2) -> (f64, f64) {
    let apart = (found.map_from_scan.translation.vector - truth.translation.vector).norm();
    (apart, wrap_angle(found.map_from_scan.rotation.angle() - truth.rotation.angle()).abs())
}

#[test]
fn look_alikes_are_both_found_and_a_favour_decides_between_them() {
    let truth = pose(-2.0, 2.5, 1.0);
    let twin = pose(10.0, 2.5, 1.0);
    let seen = scan(&truth);
    let found = pyramid().find(&seen, &[]);
    for place in [truth, twin] {
        let is_there = found.iter().any(|alignment| gap(alignment, &place).0 < 0.3);
        assert!(is_there, "{place}: {found:?}");
    }
    for place in [truth, twin] {
        let centre = Point2::from(place.translation.vector);
        let favour = Favour { centre, radius_m: 3.0, bonus: 0.1 };
        let first = pyramid().find(&seen, &[favour])[0];
        assert!(gap(&first, &place).0 < 0.3, "{first:?}");
    }
}

#[test]
fn alignments_come_best_first_and_apart() {
    let config = BranchAndBoundConfig::default();
    let found = pyramid().find(&scan(&pose(1.5, -1.0, -2.0)), &[]);
    assert!(found.windows(2).all(|pair| pair[0].fit >= pair[1].fit));
    for (index, a) in found.iter().enumerate() {
        assert!(a.fit >= config.least_of_best * found[0].fit - 1e-9);
        for b in &found[..index] {
            let (metres, radians) = gap(a, &b.map_from_scan);
            assert!(metres >= config.apart_m || radians >= config.apart_rad, "{a:?} {b:?}");
        }
    }
}

#[test]
fn nothing_is_found_in_nothing() {
    let config = BranchAndBoundConfig::default();
    assert!(WallPyramid::new(&[], &places(), &config).is_none());
    assert!(WallPyramid::new(&building(), &[], &config).is_none());
    let far = [Point2::new(0.0, 0.0), Point2::new(1e9, 1e9)];
    assert!(WallPyramid::new(&far, &places(), &config).is_none());
    assert!(pyramid().find(&[], &[]).is_empty());
    assert!(pyramid().find(&[Point2::new(100.0, 0.0)], &[]).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_scan_is_found_where_it_was_taken(i in 0..500_usize, yaw in -PI..PI) {
        let place = places()[i % places().len()];
        let truth = pose(place.x, place.y, yaw);
        let found = pyramid().find(&scan(&truth), &[]);
        let best = found.iter().map(|alignment| gap(alignment, &truth)).filter(|&(metres, radians)| metres < 0.3 && radians < 0.1);
        prop_assert!(best.count() > 0, "{truth}: {found:?}");
    }

    #[test]
    fn a_first_window_bounds_all_places_in_it(i in 0..500_usize, turn in 0..126_usize, column in 0..40_usize, row in 0..30_usize) {
        let pyramid = pyramid();
        let place = places()[i % places().len()];
        let points: Vec<[i32; 2]> = scan(&pose(place.x, place.y, 0.05 * turn as f64)).iter()
            .map(|point| [point.x, point.y].map(|metres| (metres / 0.2 + 0.5).floor() as i32)).collect();
        let points = &points[..points.len().min(255)];
        let side = 1 << pyramid.config.levels;
        let margin = 64 / side;
        let (column, row) = (column % (pyramid.width / side - 2 * margin) + margin, row % (pyramid.height / side - 2 * margin) + margin);
        let first = u32::from(pyramid.first_fits(points)[row * (pyramid.width / side) + column]);
        prop_assert_eq!(first, pyramid.fit(points, pyramid.config.levels, column * side, row * side));
        for (j, i) in (0..side).flat_map(|j| (0..side).map(move |i| (j, i))) {
            prop_assert!(pyramid.fit(points, 0, column * side + i, row * side + j) <= first);
        }
    }
}
