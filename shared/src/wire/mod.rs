//! The wire contract: every message between bridge and host.
//!
//! A packet is one postcard-encoded [`Packet`]: a [`Header`] and a [`Message`]. Its first five bytes are fixed for all
//! time, [`MAGIC`] and the version, and are checked before anything else is read: hosts and bridges of different
//! versions refuse each other by name ([`WireError::Version`]) and never misread.
//!
//! | message | direction | stream | what it carries | bytes, smallest to largest |
//! |---|---|---|---|---|
//! | `Frame` | up | radar | one radar frame: number, profile, losses, clipping, moving cells, latency | 17 to 60 |
//! | `MapRows` | up | radar | rows of a heatmap as u8 on a stated dB scale | 26 to 1461 |
//! | `Covariance` | up | radar | spatial covariance of the moving cells, packed Hermitian | 17 to 609 |
//! | `Points` | up | radar | points detected by the radar itself (UART) | 12 to 1311 |
//! | `Tags` | up | tags | tag reads | 11 to 1450 |
//! | `HopTable` | up | tags | the reader's channels in kHz | 12 to 349 |
//! | `Telemetry` | up | telemetry | losses, overruns, temperatures, load, states, why it started | 33 to 131 |
//! | `Hello` | up | control | who the bridge is, what it can hold | 22 to 61 |
//! | `Config` | up | control | the configuration in force | 66 to 174 |
//! | `Ack` | up | control | a command's outcome | 13 to 51 |
//! | `Command` | down | control | what the host asks | 12 to 178 |
//! | `Notice` | up | control | a sentence for a person | 11 to 187 |
//!
//! Sizes include the header (9 to 24 bytes) and are held by a test; the largest fits one datagram ([`MAX_PACKET`]).
//! Over UDP a packet is a datagram. Over a serial line it is followed by its CRC and COBS-framed ([`serial`]).
//!
//! A message may only be appended to the enum, a field only with a new [`VERSION`].

mod messages;
pub mod serial;

use core::fmt;

use serde::{Deserialize, Serialize};

pub use messages::*;

use crate::units::BridgeTime;

/// First bytes of every packet.
pub const MAGIC: [u8; 4] = *b"RFHO";
/// Version of the contract; changes with any change of layout.
pub const VERSION: u8 = 2;
/// Largest packet in bytes: UDP payload of an unfragmented Ethernet frame (1500 - 20 IP - 8 UDP).
pub const MAX_PACKET: usize = 1472;
/// UDP port on which a bridge takes commands and from which it sends.
pub const BRIDGE_PORT: u16 = 4780;

/// Packets are numbered within each stream, so the host knows what it lost of which kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stream {
    /// Radar frames.
    Radar,
    /// Tag reads and hop tables.
    Tags,
    /// Telemetry.
    Telemetry,
    /// Commands and what answers them.
    Control,
}

impl Stream {
    /// All streams, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Radar, Self::Tags, Self::Telemetry, Self::Control];
}

/// What every packet starts with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Header {
    /// [`MAGIC`].
    pub magic: [u8; 4],
    /// [`VERSION`] of the sender.
    pub version: u8,
    /// Differs from one start of the bridge to the next, so that a restart is not taken for loss.
    pub boot: u16,
    /// Which stream.
    pub stream: Stream,
    /// Number of the packet in its stream, from 0, wrapping.
    pub sequence: u32,
    /// When it was made, or for radar frames when the frame began.
    pub time: BridgeTime,
}

/// A header and its message.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Packet<'a> {
    /// The header.
    pub header: Header,
    /// The message; maps borrow from the packet's bytes.
    #[serde(borrow)]
    pub message: Message<'a>,
}

/// Why bytes are no packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WireError {
    /// Does not start with [`MAGIC`]: something else talks on this port.
    NotRfHoi,
    /// The other side speaks another version.
    Version {
        /// Version of the packet.
        theirs: u8,
        /// [`VERSION`] of this program.
        ours: u8,
    },
    /// The body does not decode, or is longer than its message.
    Malformed,
    /// A serial frame's CRC is wrong.
    Crc,
    /// The packet does not fit its buffer or [`MAX_PACKET`].
    TooLong,
}

impl fmt::Display for WireError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotRfHoi => write!(f, "not an RF-HOI packet"),
            Self::Version { theirs, ours } => {
                let old = if theirs < ours { "other side" } else { "side that reports this" };
                write!(f, "wire version {theirs} met version {ours}: update the {old}")
            }
            Self::Malformed => write!(f, "malformed packet"),
            Self::Crc => write!(f, "checksum of the serial frame is wrong"),
            Self::TooLong => write!(f, "packet is longer than {MAX_PACKET} bytes"),
        }
    }
}

impl core::error::Error for WireError {}

impl<'a> Packet<'a> {
    /// Writes the packet to `buffer` and returns the written part.
    ///
    /// # Errors
    /// [`WireError::TooLong`] if it does not fit.
    pub fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], WireError> {
        encode(&self.header, &self.message, buffer)
    }

    /// Reads a packet that is all of `bytes`.
    ///
    /// # Errors
    /// Any [`WireError`] but `Crc`.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, WireError> {
        let body = bytes.strip_prefix(&MAGIC).ok_or(WireError::NotRfHoi)?;
        match body.first() {
            Some(&VERSION) => {}
            Some(&theirs) => return Err(WireError::Version { theirs, ours: VERSION }),
            None => return Err(WireError::Malformed),
        }
        if bytes.len() > MAX_PACKET {
            return Err(WireError::TooLong);
        }
        match postcard::take_from_bytes::<Self>(bytes) {
            Ok((packet, [])) => Ok(packet),
            _ => Err(WireError::Malformed),
        }
    }
}

/// Writes the packet of `header` and `message` to `buffer` and returns the written part. A message is large: on a device it
/// is better not copied into a [`Packet`].
///
/// # Errors
/// [`WireError::TooLong`] if it does not fit.
pub fn encode<'b>(
    header: &Header,
    message: &Message<'_>,
    buffer: &'b mut [u8],
) -> Result<&'b [u8], WireError> {
    let room = buffer.len().min(MAX_PACKET);
    let buffer = buffer.get_mut(..room).ok_or(WireError::TooLong)?;
    // The fields of a struct and of a tuple are written alike.
    postcard::to_slice(&(header, message), buffer).map(|b| &*b).map_err(|_| WireError::TooLong)
}

/// Numbers the packets of one sender.
#[derive(Debug, Clone)]
pub struct Sequencer {
    boot: u16,
    next: [u32; Stream::ALL.len()],
}

impl Sequencer {
    /// A sender that has just started; `boot` should differ from its last start.
    pub fn new(boot: u16) -> Self {
        Self { boot, next: [0; Stream::ALL.len()] }
    }

    /// Gives `message` the next header of its stream.
    pub fn wrap<'a>(&mut self, time: BridgeTime, message: Message<'a>) -> Packet<'a> {
        Packet { header: self.header(time, message.stream()), message }
    }

    /// The next header of `stream`.
    pub fn header(&mut self, time: BridgeTime, stream: Stream) -> Header {
        let mut sequence = 0;
        if let Some(next) = self.next.get_mut(stream as usize) {
            sequence = *next;
            *next = next.wrapping_add(1);
        }
        Header { magic: MAGIC, version: VERSION, boot: self.boot, stream, sequence, time }
    }
}

#[cfg(test)]
mod tests;
