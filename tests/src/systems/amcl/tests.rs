use super::*;
use fht_robot::grid::GridConfig;

/// Distance to the walls of a room from (-4, -3) to (4, 3), with a block in its corner if `block`, along a direction.
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

/// Drives a loop in the room; the final estimate if declared, and the truth.
fn drive(block: bool, config: AmclConfig, seed: u64) -> (Option<Pose2>, Pose2) {
    let grid = room(block);
    let map = AmclMap::new(&grid, &config.field);
    let mut amcl = Amcl::new(config, &map, seed);
    let mut truth = pose(-2.5, -1.5, 0.3);
    let mut odom = Pose2::identity();
    let mut said = None;
    for step in 0..60 {
        let frame =
            SensorFrame { time_us: step * 200_000, odom_from_base: odom, scan: scan(&truth, block), panorama: None };
        said = amcl.update(&frame, &mut || None);
        let moved = pose(0.12, 0.0, 0.1);
        truth *= moved;
        odom *= moved;
        if step == 59 {
            truth *= moved.inverse();
        }
    }
    (said, truth)
}

#[test]
fn in_a_room_that_looks_different_from_everywhere_the_place_is_found() {
    for config in [AmclConfig::paper(), AmclConfig::nav2()] {
        let mut right = 0;
        for seed in 1..=5 {
            if let (Some(said), truth) = drive(true, config.clone(), seed) {
                let off = truth.inverse() * said;
                right += usize::from(off.translation.vector.norm() < 0.3 && off.rotation.angle().abs() < 0.1);
            }
        }
        assert!(right >= 4, "{right} of 5");
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
fn a_robot_that_is_carried_away_is_found_again_with_recovery_only() {
    let found = |config: AmclConfig| {
        let grid = room(true);
        let map = AmclMap::new(&grid, &config.field);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut filter = ParticleFilter::anywhere(config, &map, &mut rng);
        let mut places = vec![pose(-2.5, -1.5, 0.3); 25];
        places.extend(vec![pose(0.8, -1.9, 2.4); 120]);
        for place in &places {
            filter.weigh(&scan(place, true));
            filter.resample(&mut rng);
            filter.predict(&pose(0.0, 0.0, 0.0), &mut rng);
        }
        filter.heaviest().is_some_and(|cluster| {
            (Point2::new(cluster.mean[0], cluster.mean[1]) - Point2::new(0.8, -1.9)).norm() < 0.4
        })
    };
    assert!(found(AmclConfig::nav2()));
    assert!(!found(AmclConfig { recovery_alpha: [0.0; 2], ..AmclConfig::nav2() }));
}
