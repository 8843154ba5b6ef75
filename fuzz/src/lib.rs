//! What the targets share: a checksum stops a fuzzer at the door, so they put the bytes that they are given into envelopes.

use fht_proto::envelope::{FORMAT_VERSION, MAGIC, Message, OLDEST_FORMAT_VERSION};
use fht_proto::{decode, encode};

/// An envelope with a right length and checksum round any body.
pub fn envelope(version: u8, kind: u8, body: &[u8]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend([version, kind]);
    let mut length = body.len();
    while length >= 0x80 {
        bytes.push((length & 0x7f) as u8 | 0x80);
        length >>= 7;
    }
    bytes.push(length as u8);
    bytes.extend(body);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// Decodes the bytes as they are, and as the body of a message in every format that is read. Whatever passes can be encoded, and decodes to
/// itself.
pub fn decode_all<M: Message + PartialEq + std::fmt::Debug>(bytes: &[u8]) -> Vec<M> {
    let _ = decode::<M>(bytes);
    let formats = OLDEST_FORMAT_VERSION..=FORMAT_VERSION;
    let decoded = formats.filter_map(|version| decode::<M>(&envelope(version, M::KIND, bytes)).ok());
    let decoded: Vec<M> = decoded.collect();
    for message in &decoded {
        let again = encode(message).expect("what was accepted can be sent on");
        assert_eq!(decode::<M>(&again).expect("and is accepted again"), *message);
    }
    decoded
}
