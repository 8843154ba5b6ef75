//! What `rmw_zenoh` attaches to each message: which of its sender's it is, when it was sent, and by
//! whom.

use xxhash_rust::xxh3::xxh3_128;

/// The name of a publisher or client, unique on the graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Gid(pub [u8; 16]);

impl Gid {
    /// That of the endpoint with this token: its hash (XXH3, 128 bits; the low half first).
    #[must_use]
    pub fn of_token(token: &str) -> Self {
        Self(xxh3_128(token.as_bytes()).to_le_bytes())
    }
}

/// The attachment of a message, a request or a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Counts the sender's messages: publishers from 0, clients from 1.
    pub sequence: i64,
    /// When it was sent by the sender's clock, nanoseconds since the epoch.
    pub stamp_ns: i64,
    /// Who sent it; in a reply, who asked.
    pub gid: Gid,
}

/// An attachment that is none: too short, or with another length of the name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0} bytes are attached, where rmw_zenoh attaches 33; does the robot run a version before 0.2.4 (Jazzy) or 0.1.2 (Humble)?"
)]
pub struct AttachmentError(usize);

impl Attachment {
    /// Its 33 bytes: sequence, stamp, the length of the name, the name; little-endian.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; 33] {
        let mut bytes = [0; 33];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.stamp_ns.to_le_bytes());
        bytes[16] = 16;
        bytes[17..].copy_from_slice(&self.gid.0);
        bytes
    }

    /// The reverse.
    ///
    /// # Errors
    /// [`AttachmentError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, AttachmentError> {
        let broken = || AttachmentError(bytes.len());
        let (sequence, rest) = bytes.split_first_chunk::<8>().ok_or_else(broken)?;
        let (stamp, rest) = rest.split_first_chunk::<8>().ok_or_else(broken)?;
        let (&length, rest) = rest.split_first().ok_or_else(broken)?;
        let gid = rest.first_chunk::<16>().filter(|_| length == 16).ok_or_else(broken)?;
        Ok(Self { sequence: i64::from_le_bytes(*sequence), stamp_ns: i64::from_le_bytes(*stamp), gid: Gid(*gid) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bytes_are_those_of_rmw_zenoh() {
        let attachment = Attachment { sequence: 1, stamp_ns: 0x0102, gid: Gid([7; 16]) };
        let mut wanted = [0; 33];
        (wanted[0], wanted[8], wanted[9], wanted[16]) = (1, 2, 1, 16);
        wanted[17..].fill(7);
        assert_eq!(attachment.to_bytes(), wanted);
        assert_eq!(Attachment::from_bytes(&wanted[..32]), Err(AttachmentError(32)));
        assert!(Attachment::from_bytes(&[]).is_err());
    }

    #[test]
    fn a_gid_is_the_hash_of_the_token() {
        // XXH3's own test value for nothing: 99aa06d3014798d8 6001c324468d497f.
        let low = 0x6001_c324_468d_497f_u64.to_le_bytes();
        let high = 0x99aa_06d3_0147_98d8_u64.to_le_bytes();
        assert_eq!(Gid::of_token("").0[..], [low, high].concat()[..]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..50)) {
            let _ = Attachment::from_bytes(&bytes);
        }

        #[test]
        fn what_is_written_is_read(sequence in any::<i64>(), stamp_ns in any::<i64>(), gid in any::<[u8; 16]>()) {
            let attachment = Attachment { sequence, stamp_ns, gid: Gid(gid) };
            prop_assert_eq!(Attachment::from_bytes(&attachment.to_bytes()), Ok(attachment));
        }
    }
}
