#![no_main]
//! The other binary messages: descriptors, compact paths and nodes.

use fht_fuzz::decode_all;
use fht_proto::Descriptor;
use fht_proto::compact::{CompactNodes, CompactPath};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for descriptor in decode_all::<Descriptor>(bytes) {
        let _ = descriptor.similarity(&descriptor);
    }
    decode_all::<CompactPath>(bytes);
    decode_all::<CompactNodes>(bytes);
});
