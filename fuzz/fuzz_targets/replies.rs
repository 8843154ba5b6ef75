#![no_main]
//! The other binary messages: descriptors, compact paths and nodes, what explorers have seen.

use fht_fuzz::decode_all;
use fht_proto::api::compact::{CompactNodes, CompactNodesPage, CompactPath, CompactPathWithGoal};
use fht_proto::api::reply::NodesCursor;
use fht_proto::{Descriptor, SeenArea, Square};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for descriptor in decode_all::<Descriptor>(bytes) {
        let _ = descriptor.similarity(&descriptor);
    }
    decode_all::<CompactPath>(bytes);
    decode_all::<CompactPathWithGoal>(bytes);
    decode_all::<CompactNodes>(bytes);
    for page in decode_all::<CompactNodesPage>(bytes) {
        let _ = page.next.map(|next| next.parse::<NodesCursor>());
    }
    for area in decode_all::<SeenArea>(bytes) {
        let squares: Vec<Square> = area.squares().collect();
        assert_eq!(squares.len(), area.height() * usize::from(area.width));
        assert_eq!(SeenArea::runs_of(squares), area.runs);
    }
});
