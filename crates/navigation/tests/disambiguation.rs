//! Where a robot drives that may be in either of two corridors: to what tells them apart, over what
//! is free in both.

use fht_navigation::disambiguation::{
    Ambiguity, DisambiguationConfig, DisambiguationCourse, Surroundings, TellingPlace, telling_place,
};
use fht_perception::candidate::Candidate;
use fht_perception::evidence_grid::{EvidenceGrid, Sighting};
use fht_perception::frame::LaserScan;
use fht_perception::grid::{GridConfig, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, pose};

type Corners = Vec<(f64, f64)>;

/// How far the scanner reaches, metres.
const RANGE_M: f64 = 7.0;
/// From one corridor to the other, metres.
const APART_M: f64 = 20.0;

/// A corridor 20 m long and 2 m wide that ends in a wall.
fn closed(y: f64) -> Corners {
    vec![(0.0, y), (20.0, y), (20.0, y + 2.0), (0.0, y + 2.0)]
}

/// The same, but for a hall at its end.
fn open(y: f64) -> Corners {
    let hall = [(20.0, y - 2.0), (24.0, y - 2.0), (24.0, y + 4.0), (20.0, y + 4.0)];
    [(0.0, y), (20.0, y)].into_iter().chain(hall).chain([(20.0, y + 2.0), (0.0, y + 2.0)]).collect()
}

/// What 360 beams see from a place.
fn scan(outlines: &[Corners], at: &Pose2) -> LaserScan {
    let yaw = at.rotation.angle();
    let scan = LaserScan::all_round(360, |cos, sin| {
        let (dx, dy) = (cos * yaw.cos() - sin * yaw.sin(), sin * yaw.cos() + cos * yaw.sin());
        let sides = outlines.iter().flat_map(|corners| corners.iter().zip(corners.iter().cycle().skip(1)));
        let meets = sides.filter_map(|(&(x1, y1), &(x2, y2))| {
            let (ex, ey, ox, oy) = (x2 - x1, y2 - y1, x1 - at.translation.x, y1 - at.translation.y);
            let cross = dx * ey - dy * ex;
            let (t, u) = ((ox * ey - oy * ex) / cross, (ox * dy - oy * dx) / cross);
            (t > 0.0 && (0.0..=1.0).contains(&u)).then_some(t)
        });
        meets.fold(f64::INFINITY, f64::min)
    });
    LaserScan { range_max_m: RANGE_M, ..scan }
}

/// A map of both, seen from every second metre of their middles.
fn known(outlines: &[Corners]) -> EvidenceGrid {
    let middles = outlines.iter().flat_map(|corners| {
        let (y, end) = (corners[0].1 + 1.0, corners.iter().map(|corner| corner.0).fold(0.0, f64::max));
        let along = (0..12).map(|step| 0.5 + 2.0 * f64::from(step)).take_while(move |x| *x < end);
        along.map(move |x| pose(x, y, 0.0))
    });
    let sighting = |at: Pose2| Sighting {
        from: Point2::from(at.translation.vector),
        ends: scan(outlines, &at).points_in_base().iter().map(|end| at * end).collect(),
    };
    EvidenceGrid::new(&middles.map(sighting).collect::<Vec<_>>(), &[])
}

/// The live grid of a robot that has stood here.
fn seen(outlines: &[Corners], at: &Pose2) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    (0..3).for_each(|_| grid.integrate(at, &scan(outlines, at)));
    grid
}

/// The robot in either corridor; the odometry frame is the map frame if it is in the first.
fn either(share_of_first: f64) -> [Candidate; 2] {
    let first = Candidate { map_from_odom: Pose2::identity(), share: share_of_first };
    [first, Candidate { map_from_odom: pose(0.0, APART_M, 0.0), share: 1.0 - share_of_first }]
}

fn found(known: &EvidenceGrid, candidates: &[Candidate], live: &OccupancyGrid) -> Option<TellingPlace> {
    let around = Surroundings { live, odom_from_base: &pose(6.0, 1.0, 0.0), range_m: RANGE_M };
    let nothing_spent = |_| false;
    telling_place(&Ambiguity { known, candidates }, &around, nothing_spent, &DisambiguationConfig::default())
}

#[test]
fn the_end_at_which_two_corridors_differ_is_worth_the_way() {
    let outlines = [open(0.0), closed(APART_M)];
    let known = known(&outlines);
    // Whichever it is in: it sees neither end from here.
    for outline in [open(0.0), closed(0.0)] {
        let live = seen(&[outline], &pose(6.0, 1.0, 0.0));
        let place = found(&known, &either(0.5), &live).expect("a place that tells");
        let end = place.way.last().expect("a way");
        assert!(end.x > 20.0 - RANGE_M - 1.0 && end.x < 20.0 && (0.2..1.8).contains(&end.y), "{place:?}");
        assert!(place.told > 0.15 && place.way_m < 20.0, "{place:?}");
    }
}

#[test]
fn a_place_that_was_seen_already_is_worth_nothing() {
    let outlines = [open(0.0), closed(APART_M)];
    let mut live = seen(&outlines, &pose(6.0, 1.0, 0.0));
    for x in [12.0, 16.0, 19.0, 22.0] {
        (0..3).for_each(|_| live.integrate(&pose(x, 1.0, 0.0), &scan(&outlines, &pose(x, 1.0, 0.0))));
    }
    // It saw the hall; the candidate without one is wrong, and nothing more is to be seen.
    let place = found(&known(&outlines), &either(0.5), &live);
    assert!(place.as_ref().is_none_or(|place| place.told < 0.5), "{place:?}");
}

#[test]
fn nothing_tells_what_is_alike_or_is_no_rival() {
    let alike = [closed(0.0), closed(APART_M)];
    let live = seen(&alike, &pose(6.0, 1.0, 0.0));
    assert_eq!(found(&known(&alike), &either(0.5), &live), None);
    let different = [open(0.0), closed(APART_M)];
    let known = known(&different);
    assert_eq!(found(&known, &either(0.5)[..1], &live), None, "one candidate");
    assert_eq!(found(&known, &[], &live), None, "no candidate");
    assert_eq!(found(&known, &either(0.99), &live), None, "the other is not likely");
}

#[test]
fn a_way_never_leads_through_what_the_robot_sees() {
    let outlines = [open(0.0), closed(APART_M)];
    // Somebody has closed the corridor at 9 m.
    let shut = vec![(0.0, 0.0), (9.0, 0.0), (9.0, 2.0), (0.0, 2.0)];
    let live = seen(&[shut], &pose(6.0, 1.0, 0.0));
    let place = found(&known(&outlines), &either(0.5), &live);
    assert!(place.as_ref().is_none_or(|place| place.way.iter().all(|point| point.x < 9.0)), "{place:?}");
}

#[test]
fn a_course_leads_to_the_end_and_not_before_the_robot_has_looked_around() {
    let outlines = [open(0.0), closed(APART_M)];
    let (known, candidates, config) = (known(&outlines), either(0.5), DisambiguationConfig::default());
    let ambiguity = Ambiguity { known: &known, candidates: &candidates };
    let mut live = OccupancyGrid::new(GridConfig::default());
    let mut course = DisambiguationCourse::new(config.clone());
    let mut at = pose(3.0, 1.0, 0.0);
    for frame in 0..200 {
        live.integrate(&at, &scan(&outlines, &at));
        let around = Surroundings { live: &live, odom_from_base: &at, range_m: RANGE_M };
        let next = course.next(Some(&ambiguity), &around);
        let driven_m = at.translation.x - 3.0;
        if driven_m < config.after_m - 0.05 {
            assert_eq!(next, None, "frame {frame}, after {driven_m} m");
        }
        let ahead =
            next.map_or(nalgebra::Vector2::x(), |point| (point - Point2::from(at.translation.vector)).normalize());
        at.translation.vector += ahead * 0.1;
        if at.translation.x > 20.0 - RANGE_M {
            return;
        }
    }
    panic!("it came to {at} only");
}

#[test]
fn a_robot_that_cannot_get_on_wanders_after_a_few_tries() {
    let outlines = [open(0.0), closed(APART_M)];
    let (known, candidates) = (known(&outlines), either(0.5));
    let ambiguity = Ambiguity { known: &known, candidates: &candidates };
    let at = pose(6.0, 1.0, 0.0);
    let live = seen(&outlines, &at);
    let config = DisambiguationConfig { after_m: 0.0, ..DisambiguationConfig::default() };
    let mut course = DisambiguationCourse::new(config);
    let around = Surroundings { live: &live, odom_from_base: &at, range_m: RANGE_M };
    let tries = (0..50).take_while(|_| {
        let is_on_way = course.next(Some(&ambiguity), &around).is_some();
        course.give_up();
        is_on_way
    });
    assert!((1..=4).contains(&tries.count()));
}
