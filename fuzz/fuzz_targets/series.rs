#![no_main]
//! Series of increments and folds, as `since`, `snapshot` and `import` carry them, fed to a copy of
//! a map.

use fht_fuzz::decode_all;
use fht_map::Replica;
use fht_proto::api::reply::Series;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for series in decode_all::<Series>(bytes) {
        let mut replica = Replica::default();
        for fold in &series.folds {
            replica.accept_fold(fold);
        }
        for increment in series.increments {
            replica.accept(increment);
        }
        let _ = replica.state().digest();
    }
});
