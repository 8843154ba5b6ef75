#![no_main]
//! Compacted series, and compacting them once more.

use fht_fuzz::decode_all;
use fht_map::MapState;
use fht_map::crdt::compaction::{CompactionConfig, compact};
use fht_proto::{CompactedSeries, VersionVector};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for given in decode_all::<CompactedSeries>(bytes) {
        let mut upto = VersionVector::default();
        upto.set(given.author, given.last);
        let mut map = MapState::new();
        map.apply_fold(&given);
        let mut folded = MapState::new();
        for piece in compact(std::slice::from_ref(&given), &upto, &[], &CompactionConfig { max_bytes: 200 }) {
            folded.apply_fold(&piece);
        }
        assert_eq!(map.digest(), folded.digest());
    }
});
