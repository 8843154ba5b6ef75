//! The most similar of a million main nodes. `read`, the sum over as many bytes, is the machine's
//! yardstick.

use divan::{Bencher, black_box};
use fht_map::index::descriptors::DescriptorIndex;
use fht_proto::{AuthorId, Descriptor, ModelId, NodeId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::OnceLock;

fn main() {
    divan::main();
}

const DIMENSION: usize = 256;
const NODES: u32 = 1_000_000;

/// Components like quantised ones: a root mean square of four steps.
fn descriptor(rng: &mut ChaCha8Rng) -> Descriptor {
    let values = (0..DIMENSION).map(|_| rng.random_range(-7..=7)).collect();
    Descriptor { model: ModelId(1), scale: 1.0, values }
}

fn nodes() -> &'static DescriptorIndex {
    static NODES_OF_A_CITY: OnceLock<DescriptorIndex> = OnceLock::new();
    NODES_OF_A_CITY.get_or_init(|| {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut all = DescriptorIndex::default();
        for number in 0..NODES {
            all.put(NodeId { author: AuthorId(1), number }, Some(&descriptor(&mut rng)));
        }
        eprintln!("{NODES} nodes, {} B each", all.bytes() / NODES as usize);
        all
    })
}

#[divan::bench]
fn read(bencher: Bencher<'_, '_>) {
    let bytes = vec![1_u8; NODES as usize * DIMENSION];
    bencher.bench_local(|| black_box(&bytes).iter().map(|&byte| u64::from(byte)).sum::<u64>());
}

/// The best few of a million.
#[divan::bench(args = [1, 10, 100])]
fn most_similar(bencher: Bencher<'_, '_>, k: usize) {
    let asked = descriptor(&mut ChaCha8Rng::seed_from_u64(2));
    let nodes = nodes();
    bencher.bench_local(|| nodes.most_similar(black_box(&asked), k));
}

/// Another descriptor for one of a million nodes.
#[divan::bench]
fn change(bencher: Bencher<'_, '_>) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut nodes = nodes().clone();
    bencher.bench_local(|| {
        let id = NodeId { author: AuthorId(1), number: rng.random_range(0..NODES) };
        nodes.put(id, Some(&descriptor(&mut rng)));
    });
}
