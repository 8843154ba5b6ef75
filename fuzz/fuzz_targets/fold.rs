#![no_main]
//! Folds, and folding them once more.

use fht_fuzz::decode_all;
use fht_map::MapState;
use fht_map::fold::{FoldConfig, fold};
use fht_proto::{Fold, VersionVector};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for given in decode_all::<Fold>(bytes) {
        let mut upto = VersionVector::default();
        upto.set(given.author, given.last);
        let mut map = MapState::new();
        map.apply_fold(&given);
        let mut folded = MapState::new();
        for piece in fold(std::slice::from_ref(&given), &upto, &[], &FoldConfig { max_bytes: 200 }) {
            folded.apply_fold(&piece);
        }
        assert_eq!(map.digest(), folded.digest());
    }
});
