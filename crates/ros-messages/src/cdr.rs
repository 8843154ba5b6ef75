//! ROS 2's serialization: a header of four bytes that names the encoding, then plain CDR.

use byteorder::{BigEndian, LittleEndian};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Bytes of the header: the encoding (a big-endian number) and two bytes of options.
const HEADER: usize = 4;

/// Why a message cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CdrError {
    /// Too short for its own header.
    #[error("{0} bytes are too few for a message")]
    Short(usize),
    /// The encoding is a parameter list, XCDR 2, or not CDR at all.
    #[error("encoding {0:#06x} is not plain CDR")]
    Encoding(u16),
    /// The bytes are not a message of this type.
    #[error(transparent)]
    Content(#[from] cdr_encoding::Error),
}

/// Reads a message of either byte order; bytes after it are padding.
///
/// # Errors
/// [`CdrError`] when the bytes are not a message of this type.
pub fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, CdrError> {
    let Some((&[high, low, _, _], body)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(CdrError::Short(bytes.len()));
    };
    match u16::from_be_bytes([high, low]) {
        0 => Ok(cdr_encoding::from_bytes::<T, BigEndian>(body)?.0),
        1 => Ok(cdr_encoding::from_bytes::<T, LittleEndian>(body)?.0),
        other => Err(CdrError::Encoding(other)),
    }
}

/// The same for types that borrow nothing from the bytes.
///
/// # Errors
/// [`CdrError`] when the bytes are not a message of this type.
pub fn decode_owned<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    decode(bytes)
}

/// Writes a message in little-endian CDR.
///
/// # Errors
/// [`CdrError`] when `message` has parts that CDR cannot represent (sequences of unknown length).
pub fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let mut bytes = vec![0, 1, 0, 0];
    // Alignment counts from the end of the header, and the serializer counts what it writes itself.
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::{Image, LaserScanMsg, TfMessage, Time, TransformStamped};
    use proptest::prelude::*;

    #[test]
    fn both_byte_orders_and_alignment() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Mixed {
            byte: u8,
            text: String,
            wide: f64,
        }
        let number = 1.5_f64;
        let little =
            [&[0, 1, 0, 0, 7, 0, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0, 0, 0, 0, 0][..], &number.to_le_bytes()].concat();
        let big =
            [&[0, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 2, b'a', 0, 0, 0, 0, 0, 0, 0][..], &number.to_be_bytes()].concat();
        let wanted = Mixed { byte: 7, text: "a".to_owned(), wide: number };
        assert_eq!(decode::<Mixed>(&little).unwrap(), wanted);
        assert_eq!(decode::<Mixed>(&big).unwrap(), wanted);
        assert_eq!(encode(&wanted).unwrap(), little);
    }

    #[test]
    fn other_encodings_are_refused() {
        assert!(matches!(decode::<Time>(&[0, 1, 0]), Err(CdrError::Short(3))));
        for kind in [2, 3, 6, 7, 10] {
            assert!(matches!(decode::<Time>(&[0, kind, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]), Err(CdrError::Encoding(_))));
        }
    }

    #[test]
    fn a_length_that_lies_costs_nothing() {
        // A transform message that claims four billion transforms.
        let lie = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff];
        assert!(decode::<TfMessage>(&lie).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400), is_headed in any::<bool>()) {
            let mut bytes = bytes;
            if is_headed {
                bytes.splice(0..0, [0, 1, 0, 0]);
            }
            let _ = decode::<LaserScanMsg>(&bytes);
            let _ = decode::<TfMessage>(&bytes);
            let _ = decode::<Image<'_>>(&bytes);
        }

        #[test]
        fn what_is_written_is_read(stamp in any::<(i32, u32)>(), child in ".{0,12}", x in any::<f64>()) {
            let mut stamped = TransformStamped { child_frame_id: child, ..TransformStamped::default() };
            stamped.header.stamp = Time { sec: stamp.0, nanosec: stamp.1 };
            stamped.transform.position.x = x;
            let message = TfMessage { transforms: vec![stamped] };
            let back: TfMessage = decode(&encode(&message).unwrap()).unwrap();
            prop_assert_eq!(back.transforms[0].transform.position.x.to_bits(), x.to_bits());
            prop_assert_eq!(&back.transforms[0].child_frame_id, &message.transforms[0].child_frame_id);
            prop_assert_eq!(back.transforms[0].header.stamp, message.transforms[0].header.stamp);
        }
    }
}
