#![no_main]
//! Exported maps.

use fht_proto::codec::archive::{Archive, header_line};
use fht_proto::codec::envelope::{FORMAT_VERSION, seal};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(archive) = Archive::open(bytes) {
        let line = header_line(&archive.header).expect("what was read can be written");
        // The bytes once more, as bodies of messages with right checksums.
        let mut file = line;
        for body in bytes.chunks(64) {
            file.extend(seal(FORMAT_VERSION, 6, body).expect("it is short"));
        }
        if let Ok(again) = Archive::open(&file) {
            again.for_each(drop);
        }
        archive.for_each(drop);
    }
});
