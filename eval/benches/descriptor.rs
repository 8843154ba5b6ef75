//! The visual descriptor of a panorama, beside the ray casting of that panorama.

use fht_descriptor::DescriptorNet;
use fht_sim::{SimConfig, Simulator};
use std::sync::Arc;

fn main() {
    divan::main();
}

fn simulator() -> Result<Simulator, fht_sim::WorldError> {
    let world = Arc::new(fht_sim::load("museum", None, 1)?);
    let start = world.start();
    Ok(Simulator::new(world, SimConfig { camera_every: 1, ..SimConfig::default() }, start, 1))
}

/// One frame of the simulator: LiDAR and four cameras.
#[divan::bench]
fn sense(bencher: divan::Bencher<'_, '_>) {
    let mut simulator = simulator().expect("the built-in museum is drawn");
    bencher.bench_local(|| simulator.sense_first());
}

/// One panorama to 256 numbers.
#[divan::bench]
fn describe(bencher: divan::Bencher<'_, '_>) {
    let frame = simulator().expect("the built-in museum is drawn").sense_first();
    let panorama = frame.panorama.expect("every frame has a panorama");
    let mut net = DescriptorNet::load(None).expect("the built-in model is loaded");
    bencher.bench_local(|| net.describe(&panorama));
}
