//! Exploration of the built-in worlds with true poses: how much is seen, how far is driven, and
//! that nothing is touched. `cargo test --release -p mapper --test explore -- --nocapture` prints
//! the figures.

use fht_perception::grid::{GridConfig, OccupancyGrid};
use fht_perception::pose::Pose2;
use fht_sim::scoring::explored;
use fht_sim::{SimConfig, Simulator, load};
use mapper::explore::{Ending, ExploreConfig, ExploreStep, Explorer};
use std::sync::Arc;
use std::time::{Duration, Instant};

struct Outcome {
    explored_fraction: f64,
    driven_m: f64,
    collisions: u64,
    end: Pose2,
}

/// Explores a world from its start until the explorer is done.
fn explore(spec: &str, seed: u64) -> Outcome {
    let world = Arc::new(load(spec, None, seed).expect("a built-in world"));
    let start = world.start();
    let config = SimConfig { camera_every: 0, ..SimConfig::default() };
    let radius_m = config.radius_m;
    let mut sim = Simulator::new(world.clone(), config, start, seed);
    let mut grid = OccupancyGrid::new(GridConfig::default());
    let mut explorer = Explorer::new(ExploreConfig::default());
    let mut frame = sim.sense_first();
    let (mut total, mut longest, mut frames) = (Duration::ZERO, Duration::ZERO, 0);
    loop {
        let map_from_base = start.inverse() * sim.truth();
        grid.integrate(&map_from_base, &frame.scan);
        let before = Instant::now();
        let step = explorer.step(&grid, &map_from_base, &frame.scan, frame.time_us);
        total += before.elapsed();
        longest = longest.max(before.elapsed());
        if let Some(search) = explorer.question() {
            explorer.answer(search.run(&grid));
        }
        frames += 1;
        match step {
            ExploreStep::Drive(twist) => frame = sim.step(twist),
            ExploreStep::Done(ending) => {
                assert_eq!(ending, Ending::Complete);
                break;
            }
        }
        assert!(frames < 15_000, "still exploring after 50 simulated minutes");
    }
    let (area_m2, explored_fraction) = explored(world.plan(), &grid, &start, radius_m);
    println!(
        "{spec} seed {seed}: {:.2} % of {area_m2:.0} m², {:.1} m and {:.0} s driven, {} collisions, {:.2} ms a frame, at most {:.1} ms",
        100.0 * explored_fraction,
        sim.driven_m(),
        frame.time_us as f64 * 1e-6,
        sim.collisions(),
        total.as_secs_f64() * 1e3 / f64::from(frames),
        longest.as_secs_f64() * 1e3,
    );
    Outcome { explored_fraction, driven_m: sim.driven_m(), collisions: sim.collisions(), end: sim.truth() }
}

#[test]
fn the_museum_is_explored_without_a_touch_and_on_a_short_way() {
    for seed in 1..=3 {
        let outcome = explore("museum", seed);
        assert!(outcome.explored_fraction >= 0.98, "{}", outcome.explored_fraction);
        assert_eq!(outcome.collisions, 0);
        assert!(outcome.driven_m < 200.0, "{}", outcome.driven_m);
    }
}

#[test]
fn the_office_is_explored_without_a_touch_and_on_a_short_way() {
    let outcome = explore("office", 1);
    assert!(outcome.explored_fraction >= 0.98, "{}", outcome.explored_fraction);
    assert_eq!(outcome.collisions, 0);
    assert!(outcome.driven_m < 700.0, "{}", outcome.driven_m);
}

#[test]
fn the_same_seed_is_the_same_run() {
    let (first, second) = (explore("museum", 7), explore("museum", 7));
    assert_eq!(first.end, second.end);
}
