#![no_main]
//! Increments, and what a map makes of them.

use fht_fuzz::decode_all;
use fht_map::MapState;
use fht_proto::Increment;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for increment in decode_all::<Increment>(bytes) {
        let mut map = MapState::new();
        map.apply(&increment);
        let (digest, counts) = (map.digest(), map.counts());
        map.apply(&increment);
        assert_eq!((map.digest(), map.counts()), (digest, counts), "twice is once");
        assert_eq!(map.edges().count(), counts.edges);
        assert_eq!(map.nodes().count(), counts.main_nodes + counts.support_nodes);
    }
});
