//! What the targets share. A checksum would stop a fuzzer at the door, so targets put their bytes
//! into envelopes.

use fht_proto::codec::envelope::{FORMAT_VERSION, Message, OLDEST_FORMAT_VERSION, seal};
use fht_proto::{decode, encode};

/// Decodes the bytes as they are, and as the body of a message in every supported format. What
/// passes can be encoded again, and decodes to itself.
pub fn decode_all<M: Message + PartialEq + std::fmt::Debug>(bytes: &[u8]) -> Vec<M> {
    let _ = decode::<M>(bytes);
    let formats = OLDEST_FORMAT_VERSION..=FORMAT_VERSION;
    let decoded = formats.filter_map(|version| decode::<M>(&seal(version, M::KIND, bytes).ok()?).ok());
    let decoded: Vec<M> = decoded.collect();
    for message in &decoded {
        let again = encode(message).expect("what was accepted can be sent on");
        assert_eq!(decode::<M>(&again).expect("and is accepted again"), *message);
    }
    decoded
}
