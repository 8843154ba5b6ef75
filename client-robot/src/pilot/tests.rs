use super::*;
use fht_perception::frame::LaserScan;
use fht_perception::pose::pose;
use std::collections::BTreeSet;

struct NoPaths;

impl PathSource for NoPaths {
    fn plan(&mut self, _: Point2, _: Point2, _: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        Err(ErrorReply::new(ErrorCode::NoPath, "none"))
    }
}

#[test]
fn a_frame_without_a_place_or_from_before_is_left_out() {
    let scan = LaserScan::all_round(360, |_, _| 3.0);
    let frame = |time_us: u64, x: f64| SensorFrame {
        time_us,
        odom_from_base: pose(x, 0.0, 0.0),
        scan: scan.clone(),
        panorama: None,
    };
    let mut pilot = Pilot::new(PilotConfig::default(), Task::Relocalize);
    let landmarks = Landmarks::default();
    let mut step = |frame: SensorFrame| pilot.step(&landmarks, &frame, || None, &mut NoPaths);
    let before = step(frame(1_000_000, 1.0)).localization.odometry;
    for bad in [frame(1_200_000, f64::NAN), frame(1_200_000, f64::INFINITY), frame(0, 1.0)] {
        let step = step(bad);
        assert_eq!(step.command, Twist::default());
        assert_eq!(step.localization.odometry.odom_from_base, before.odom_from_base);
    }
    let after = step(frame(1_400_000, 1.0)).localization.odometry;
    assert!((after.odometer_m - before.odometer_m).abs() < 1e-9 && after.odom_from_base.translation.x.is_finite());
}
