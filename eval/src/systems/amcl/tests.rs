use super::*;
use fht_perception::grid::GridConfig;

/// Distance to the walls of a room from (-4, -3) to (4, 3), with a block in its corner if `block`,
/// along a direction.
fn range(from: Point2, heading: f64, block: bool) -> f64 {
    let (sin, cos) = heading.sin_cos();
    let inside = |metres: f64| {
        let (x, y) = (from.x + metres * cos, from.y + metres * sin);
        x.abs() < 4.0 && y.abs() < 3.0 && !(block && x > 1.5 && y > 0.5)
    };
    (1..).map(|step| f64::from(step) * 0.01).find(|&metres| !inside(metres)).unwrap_or(0.0)
}

fn scan(at: &Pose2, block: bool) -> LaserScan {
    let increment = std::f64::consts::TAU / 180.0;
    let from = Point2::from(at.translation.vector);
    let heading = |beam: i32| at.rotation.angle() + f64::from(beam) * increment;
    LaserScan {
        base_from_sensor: Pose2::identity(),
        angle_min: 0.0,
        angle_increment: increment,
        range_min_m: 0.1,
        range_max_m: 12.0,
        ranges_m: (0..180).map(|beam| range(from, heading(beam), block) as f32).collect(),
    }
}

fn room(block: bool) -> OccupancyGrid {
    let mut grid = OccupancyGrid::new(GridConfig::default());
    for (x, y) in [(-2.0, -1.0), (0.0, 0.0), (1.0, -2.0), (-3.0, 2.0), (3.0, -1.0)] {
        for _ in 0..3 {
            let at = pose(x, y, 0.0);
            grid.integrate(&at, &scan(&at, block));
        }
    }
    grid
}

/// Drives a loop in the room: how often the place was declared rightly, and wrongly.
fn drive(block: bool, config: AmclConfig, seed: u64) -> (usize, usize) {
    let grid = room(block);
    let map = AmclMap::new(&grid, &config.field);
    let mut amcl = Amcl::new(config, &map, seed);
    let mut truth = pose(-2.5, -1.5, 0.3);
    let mut odom = Pose2::identity();
    let (mut right, mut wrong) = (0, 0);
    for step in 0..60 {
        let frame =
            SensorFrame { time_us: step * 200_000, odom_from_base: odom, scan: scan(&truth, block), panorama: None };
        if let Some(said) = amcl.update(&frame, &mut || None) {
            let off = truth.inverse() * said;
            let is_right = off.translation.vector.norm() < 0.5 && off.rotation.angle().abs() < 0.2;
            (right, wrong) = (right + usize::from(is_right), wrong + usize::from(!is_right));
        }
        let moved = pose(0.12, 0.0, 0.1);
        truth *= moved;
        odom *= moved;
    }
    (right, wrong)
}

#[test]
fn in_a_room_that_looks_different_from_everywhere_the_place_is_found() {
    for config in [AmclConfig::paper(), AmclConfig::nav2()] {
        let found = (1..=5).map(|seed| drive(true, config.clone(), seed));
        let (right, wrong) = found.fold((0, 0), |sum, drive| (sum.0 + usize::from(drive.0 > 0), sum.1 + drive.1));
        assert!(right >= 4 && wrong <= 5, "right on {right} of 5 drives, wrong at {wrong} of 300 frames");
    }
}

#[test]
fn a_room_that_looks_the_same_turned_round_leaves_two_clusters_at_first() {
    let config = AmclConfig::paper();
    let grid = room(false);
    let map = AmclMap::new(&grid, &config.field);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut filter = ParticleFilter::anywhere(config, &map, &mut rng);
    let mut truth = pose(-2.5, -1.5, 0.3);
    for _ in 0..12 {
        filter.weigh(&scan(&truth, false));
        filter.resample(&mut rng);
        let moved = pose(0.2, 0.0, 0.1);
        truth *= moved;
        filter.predict(&moved, &mut rng);
    }
    let near = |particle: &&Particle, place: Point2| (Point2::new(particle.x, particle.y) - place).norm() < 1.0;
    let here = Point2::from(truth.translation.vector);
    let share = |place: Point2| {
        filter.particles().iter().filter(|particle| near(particle, place)).count() as f64
            / filter.particles().len() as f64
    };
    let (there, opposite) = (share(here), share(Point2::from(-here.coords)));
    assert!(there > 0.05 && opposite > 0.05, "{there} here, {opposite} opposite");
    assert!(filter.heaviest().is_some_and(|cluster| !filter.is_known(&cluster)));
}

#[test]
fn the_number_of_particles_follows_the_spread_of_the_cloud() {
    let config = AmclConfig::paper();
    assert_eq!(needed(1, &config), config.min_particles);
    assert!(needed(100, &config) > needed(60, &config));
    assert_eq!(needed(100_000, &config), config.max_particles);

    let grid = room(true);
    let map = AmclMap::new(&grid, &config.field);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut filter = ParticleFilter::anywhere(config.clone(), &map, &mut rng);
    assert_eq!(filter.particles().len(), config.max_particles);
    let truth = pose(-2.5, -1.5, 0.3);
    for _ in 0..15 {
        filter.weigh(&scan(&truth, true));
        filter.resample(&mut rng);
        filter.predict(&pose(0.0, 0.0, 0.0), &mut rng);
    }
    assert!(filter.particles().len() < config.max_particles / 2, "{}", filter.particles().len());
}

#[test]
fn when_scans_no_longer_fit_recovery_looks_elsewhere() {
    // Particles far from the place where the robot was picked up.
    let elsewhere = |config: AmclConfig| {
        let grid = room(true);
        let map = AmclMap::new(&grid, &config.field);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut filter = ParticleFilter::anywhere(config, &map, &mut rng);
        let (before, after) = (pose(-2.5, -1.5, 0.3), pose(0.8, -1.9, 2.4));
        for _ in 0..60 {
            filter.weigh(&scan(&before, true));
            filter.resample(&mut rng);
        }
        filter.weigh(&scan(&after, true));
        filter.resample(&mut rng);
        let far = |particle: &&Particle| (Point2::new(particle.x, particle.y) - Point2::new(-2.5, -1.5)).norm() > 1.5;
        filter.particles().iter().filter(far).count()
    };
    // Nav2's slow average needs a thousand scans to learn how well they fit.
    let rates = |recovery_alpha| elsewhere(AmclConfig { recovery_alpha, ..AmclConfig::nav2() });
    let (with, without) = (rates([0.1, 0.5]), rates([0.0; 2]));
    assert!(with > without + 20, "{with} with recovery, {without} without");
}
