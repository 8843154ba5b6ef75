//! What relocalization costs in an office of some 100 main nodes. `sense`, one LiDAR frame of the
//! simulator, is the machine's yardstick.

#[path = "../../client-robot/tests/fixture/mod.rs"]
mod fixture;

use divan::{Bencher, black_box};
use fht_localization::landmarks::Landmarks;
use fht_localization::relocalization::{RelocalizationConfig, Relocalizer, Sensed};
use fht_map::MapState;
use fht_perception::frame::LaserScan;
use fht_perception::pose::{Point2, Pose2, pose};
use fht_perception::scan_odometry::Odometry;
use fht_proto::Descriptor;
use fht_sim::{SimConfig, Simulator, World};
use fixture::{FixtureConfig, colour_descriptor, map_of};
use std::sync::{Arc, OnceLock};

fn main() {
    divan::main();
}

/// Distance between main nodes that gives the office about 100 of them, metres.
const SPACING_M: f64 = 4.4;
/// Distance between looks, metres.
const LOOK_EVERY_M: f64 = 0.5;

struct Look {
    odometry: Odometry,
    scan: LaserScan,
    points: Vec<Point2>,
    descriptor: Descriptor,
}

struct Office {
    world: Arc<World>,
    map: MapState,
    landmarks: Landmarks,
    looks: Vec<Look>,
}

fn office() -> &'static Office {
    static OFFICE: OnceLock<Office> = OnceLock::new();
    OFFICE.get_or_init(|| {
        let world = Arc::new(fht_sim::load("office", None, 1).expect("the built-in office is drawn"));
        let config = FixtureConfig { spacing_m: SPACING_M, ..FixtureConfig::default() };
        let map = map_of(&world, &config, &mut |panorama| Some(colour_descriptor(panorama)));
        let mut landmarks = Landmarks::default();
        landmarks.refresh(&map);
        eprintln!("{} main nodes", landmarks.len());
        let looks = looks(&world);
        Office { world, map, landmarks, looks }
    })
}

/// What a robot sees on its way between two places far apart.
fn looks(world: &Arc<World>) -> Vec<Look> {
    let [from, to] = [1, 5].map(|seed| Point2::from(world.random_free_pose(seed, 0.3).translation.vector));
    let way = world.plan().shortest_path(from, to, 0.2).expect("both places can be reached");
    let mut places: Vec<Pose2> = Vec::new();
    for pair in way.windows(2) {
        let along = pair[1] - pair[0];
        let steps = (along.norm() / LOOK_EVERY_M).floor() as usize;
        let ahead = along.y.atan2(along.x);
        places.extend((0..=steps).map(|step| {
            let at = pair[0] + along.normalize() * (step as f64 * LOOK_EVERY_M);
            pose(at.x, at.y, ahead)
        }));
    }
    places.truncate(24);
    let first = places[0];
    let look = |(index, place): (usize, &Pose2)| {
        let sim = SimConfig { light_seed: 9, ..SimConfig::default() };
        let frame = Simulator::new(Arc::clone(world), sim, *place, index as u64).sense_first();
        Look {
            odometry: Odometry {
                odom_from_base: first.inverse() * place,
                odometer_m: index as f64 * LOOK_EVERY_M,
                turned_rad: 0.0,
                is_keyframe: true,
            },
            points: frame.scan.points_in_base(),
            descriptor: colour_descriptor(frame.panorama.as_ref().expect("a panorama with the first frame")),
            scan: frame.scan,
        }
    };
    places.iter().enumerate().map(look).collect()
}

fn observe(relocalizer: &mut Relocalizer, look: &Look, has_camera: bool) {
    let observation = Sensed {
        odometry: look.odometry,
        scan: &look.scan,
        points: &look.points,
        descriptor: has_camera.then_some(&look.descriptor),
    };
    black_box(relocalizer.observe(&office().landmarks, &observation));
}

/// One LiDAR frame of the simulator.
#[divan::bench]
fn sense(bencher: Bencher<'_, '_>) {
    let start = office().world.start();
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    let mut simulator = Simulator::new(Arc::clone(&office().world), config, start, 1);
    bencher.bench_local(|| simulator.sense_first());
}

/// The reference map of all nodes, as after a change of the map.
#[divan::bench]
fn put_walls_together(bencher: Bencher<'_, '_>) {
    let mut landmarks = Landmarks::default();
    bencher.bench_local(|| {
        landmarks.refresh(&office().map);
        black_box(landmarks.walls().cloud.len())
    });
}

/// The first attempt: nothing is known yet.
#[divan::bench(args = [true, false])]
fn first_attempt(bencher: Bencher<'_, '_>, has_camera: bool) {
    let look = &office().looks[0];
    let _ = office().landmarks.walls();
    bencher.bench_local(|| {
        let mut relocalizer = Relocalizer::new(RelocalizationConfig::default());
        observe(&mut relocalizer, look, has_camera);
    });
}

/// Attempts on a drive of 12 m, none of which ends the search: the time of one.
#[divan::bench(args = [true, false], sample_count = 20, sample_size = 1)]
fn attempts(bencher: Bencher<'_, '_>, has_camera: bool) {
    let looks = &office().looks;
    let _ = office().landmarks.walls();
    let longest = std::cell::Cell::new(0.0_f64);
    bencher.counter(divan::counter::ItemsCount::new(looks.len())).bench_local(|| {
        let mut relocalizer = Relocalizer::new(RelocalizationConfig::default());
        for look in looks {
            let begin = std::time::Instant::now();
            observe(&mut relocalizer, look, has_camera);
            longest.set(longest.get().max(begin.elapsed().as_secs_f64()));
        }
    });
    eprintln!("{} attempts, camera {has_camera}: the longest took {:.1} ms", looks.len(), longest.get() * 1e3);
}
