//! Packets on a serial line: postcard bytes, their CRC-32 (little-endian), COBS-framed, ended by a zero.
//!
//! A receiver finds the next packet after any damage at the next zero. The CRC is CRC-32/ISO-HDLC, as in Ethernet.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

use super::{MAX_PACKET, Packet, WireError};

const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
const CRC_BYTES: usize = 4;
/// Largest serial frame: packet and CRC, one COBS byte for each 254 begun, and the final zero.
pub const MAX_FRAME: usize = MAX_PACKET + CRC_BYTES + (MAX_PACKET + CRC_BYTES).div_ceil(254) + 1;

/// Writes an encoded packet ([`Packet::encode`]) as a serial frame to `frame` and returns the written part.
///
/// # Errors
/// [`WireError::TooLong`] if it is longer than a packet may be.
pub fn encode<'f>(packet: &[u8], frame: &'f mut [u8; MAX_FRAME]) -> Result<&'f [u8], WireError> {
    let mut plain = heapless::Vec::<u8, { MAX_PACKET + CRC_BYTES }>::new();
    let crc = CRC.checksum(packet).to_le_bytes();
    for part in [packet, &crc] {
        plain.extend_from_slice(part).map_err(|_| WireError::TooLong)?;
    }
    // The last byte of the largest frame is left for the zero.
    let coded = cobs::encode(&plain, frame);
    *frame.get_mut(coded).ok_or(WireError::TooLong)? = 0;
    frame.get(..=coded).ok_or(WireError::TooLong)
}

/// What became of the bytes of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SerialCounts {
    /// Frames whose packet was handed on.
    pub good: u32,
    /// Frames that were damaged, too long or no packets.
    pub bad: u32,
}

/// Takes a serial line's bytes and hands out packets.
#[derive(Debug)]
pub struct Decoder {
    frame: heapless::Vec<u8, MAX_FRAME>,
    /// The frame under way is too long: skip to the next zero.
    overflow: bool,
    counts: SerialCounts,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder at the start of a line; what comes before the first zero may be half a frame.
    pub const fn new() -> Self {
        Self { frame: heapless::Vec::new(), overflow: false, counts: SerialCounts { good: 0, bad: 0 } }
    }

    /// What was decoded and what was not.
    pub fn counts(&self) -> SerialCounts {
        self.counts
    }

    /// Takes `bytes` and calls `on_packet` for every packet, or with the error of every damaged frame.
    pub fn push(&mut self, bytes: &[u8], mut on_packet: impl FnMut(Result<Packet<'_>, WireError>)) {
        for &byte in bytes {
            if byte != 0 {
                self.overflow |= self.frame.push(byte).is_err();
                continue;
            }
            if !self.frame.is_empty() {
                let result = if self.overflow { Err(WireError::TooLong) } else { unframe(&mut self.frame) };
                match &result {
                    Ok(_) => self.counts.good = self.counts.good.wrapping_add(1),
                    Err(_) => self.counts.bad = self.counts.bad.wrapping_add(1),
                }
                on_packet(result);
            }
            self.frame.clear();
            self.overflow = false;
        }
    }
}

fn unframe(frame: &mut [u8]) -> Result<Packet<'_>, WireError> {
    let length = cobs::decode_in_place(frame).map_err(|_| WireError::Malformed)?;
    let plain = frame.get(..length).ok_or(WireError::Malformed)?;
    let (body, crc) = plain.split_last_chunk::<CRC_BYTES>().ok_or(WireError::Malformed)?;
    if CRC.checksum(body) != u32::from_le_bytes(*crc) {
        return Err(WireError::Crc);
    }
    Packet::decode(body)
}
