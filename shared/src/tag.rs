//! EPCs and tag reads.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::units::{AntennaPort, BridgeTime, CentiDbm, ChannelIndex, DopplerCode, PhaseCode};

/// Longest EPC in bytes: the length field of a Gen2 tag's protocol control word counts up to 31 words of 16 bits.
pub const MAX_EPC_BYTES: usize = 62;

/// Electronic Product Code, the identity of a tag; most are 12 bytes.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Epc(Vec<u8, MAX_EPC_BYTES>);

impl Epc {
    /// An EPC of these bytes, or `None` if there are more than [`MAX_EPC_BYTES`].
    pub fn new(bytes: &[u8]) -> Option<Self> {
        Vec::from_slice(bytes).ok().map(Self)
    }

    /// The EPC written in `hex`, or `None` if that is no hexadecimal string of at most [`MAX_EPC_BYTES`] bytes.
    pub fn from_hex(hex: &str) -> Option<Self> {
        let digits = hex.as_bytes();
        if !digits.len().is_multiple_of(2) {
            return None;
        }
        let mut bytes = Vec::new();
        for pair in digits.chunks_exact(2) {
            let pair = core::str::from_utf8(pair).ok()?;
            bytes.push(u8::from_str_radix(pair, 16).ok()?).ok()?;
        }
        Some(Self(bytes))
    }

    /// The bytes, most significant first.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl fmt::Display for Epc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for byte in &self.0 {
            write!(f, "{byte:02x}")?;
        }
        Ok(())
    }
}

impl fmt::Debug for Epc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Epc({self})")
    }
}

/// One singulation of one tag.
///
/// `phase` and `doppler` are `None` where the reader did not report them; zero is a measurement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TagRead {
    /// When the tag was seen, in the bridge's time.
    pub time: BridgeTime,
    /// Which tag.
    pub epc: Epc,
    /// Which antenna port of the reader.
    pub antenna: AntennaPort,
    /// On which channel, or 0 where the reader did not say.
    pub channel: ChannelIndex,
    /// Backscatter phase, [`PhaseCode::CODES_PER_TURN`] codes to the turn.
    pub phase: Option<PhaseCode>,
    /// Received signal strength.
    pub rssi: CentiDbm,
    /// Doppler shift.
    pub doppler: Option<DopplerCode>,
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn hex_round_trip() {
        let hex = "e2806995000050182224441d";
        assert_eq!(Epc::from_hex(hex).unwrap().to_string(), hex);
        assert_eq!(Epc::from_hex("abc"), None);
        assert_eq!(Epc::from_hex("zz"), None);
        assert_eq!(Epc::from_hex("é"), None);
        assert_eq!(Epc::new(&[0; MAX_EPC_BYTES + 1]), None);
    }
}
