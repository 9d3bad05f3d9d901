//! One datagram of raw samples.

use core::fmt;

/// Bytes before the samples: sequence number (u32) and byte count (u48), little-endian.
pub const HEADER_BYTES: usize = 10;
/// Largest datagram: UDP payload of an unfragmented Ethernet frame.
const MAX_BYTES: usize = 1472;

/// A view of a datagram in raw mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Datagram<'a> {
    /// Number of the datagram since recording started, from 1, wrapping.
    pub sequence: u32,
    /// Bytes of samples sent before this datagram, modulo 2^48.
    pub byte_count: u64,
    /// The samples' bytes, at least one.
    pub payload: &'a [u8],
}

/// Why bytes are no datagram of the DCA1000EVM.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DatagramError {
    /// No samples behind the header, or not even a header.
    TooShort,
    /// Longer than an Ethernet frame carries.
    TooLong,
}

impl fmt::Display for DatagramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort => write!(f, "shorter than the {HEADER_BYTES}-byte header and a sample"),
            Self::TooLong => write!(f, "longer than {MAX_BYTES} bytes"),
        }
    }
}

impl core::error::Error for DatagramError {}

impl<'a> Datagram<'a> {
    /// Modulus of [`Self::byte_count`].
    pub const BYTE_COUNT_MODULUS: u64 = 1 << 48;

    /// Reads a datagram.
    ///
    /// # Errors
    /// If its length cannot be right.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, DatagramError> {
        if bytes.len() > MAX_BYTES {
            return Err(DatagramError::TooLong);
        }
        let (&[s0, s1, s2, s3, c0, c1, c2, c3, c4, c5], payload) =
            bytes.split_first_chunk::<HEADER_BYTES>().ok_or(DatagramError::TooShort)?;
        if payload.is_empty() {
            return Err(DatagramError::TooShort);
        }
        Ok(Self {
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
            byte_count: u64::from_le_bytes([c0, c1, c2, c3, c4, c5, 0, 0]),
            payload,
        })
    }

    /// The header of a datagram with this `sequence` and `byte_count`.
    pub fn header(sequence: u32, byte_count: u64) -> [u8; HEADER_BYTES] {
        let [s0, s1, s2, s3] = sequence.to_le_bytes();
        let [c0, c1, c2, c3, c4, c5, ..] = byte_count.to_le_bytes();
        [s0, s1, s2, s3, c0, c1, c2, c3, c4, c5]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_datagram_of_a_real_recording() {
        let bytes = [0x02, 0, 0, 0, 0xb0, 0x05, 0, 0, 0, 0, 0xbb, 0x06, 0xb4, 0x00, 0xd8, 0x07];
        let datagram = Datagram::decode(&bytes).unwrap();
        assert_eq!((datagram.sequence, datagram.byte_count), (2, 1456));
        assert_eq!(datagram.payload, &bytes[10..]);
        assert_eq!(Datagram::header(2, 1456), bytes[..10]);
    }

    #[test]
    fn lengths_are_checked() {
        assert_eq!(Datagram::decode(&[]), Err(DatagramError::TooShort));
        assert_eq!(Datagram::decode(&[0; HEADER_BYTES]), Err(DatagramError::TooShort));
        assert!(Datagram::decode(&[0; MAX_BYTES]).is_ok());
        assert_eq!(Datagram::decode(&[0; MAX_BYTES + 1]), Err(DatagramError::TooLong));
    }
}
