//! Writing of messages into a caller's buffer: fields in order, lengths filled in behind them.

use core::fmt;

use super::frame::VERSION;
use super::message::{CUSTOM_PARAMETER, IMPINJ, MessageType, ParameterType};

/// Why a message cannot be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// It does not fit the buffer.
    BufferFull,
    /// A parameter is longer than its 16-bit length can say.
    ParameterTooLong,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BufferFull => "the LLRP message does not fit its buffer",
            Self::ParameterTooLong => "an LLRP parameter is longer than 65535 bytes",
        })
    }
}

impl core::error::Error for EncodeError {}

/// Writes fields and parameters; what does not fit is dropped and makes the whole message an error.
#[derive(Debug)]
pub struct Writer<'b> {
    buffer: &'b mut [u8],
    length: usize,
    error: Option<EncodeError>,
}

/// Writes a message whose body `body` writes, and returns its bytes.
///
/// # Errors
/// If it does not fit `buffer`, or a parameter its length field.
pub fn message(
    buffer: &mut [u8],
    kind: MessageType,
    id: u32,
    body: impl FnOnce(&mut Writer<'_>),
) -> Result<&[u8], EncodeError> {
    let mut w = Writer { buffer, length: 0, error: None };
    w.u16(u16::from(VERSION) << 10 | kind.0);
    let length_at = w.length;
    w.u32(0);
    w.u32(id);
    body(&mut w);
    let length = u32::try_from(w.length).unwrap_or(u32::MAX);
    w.put(length_at, &length.to_be_bytes());
    match w.error {
        Some(error) => Err(error),
        None => w.buffer.get(..w.length).ok_or(EncodeError::BufferFull),
    }
}

/// Writes a custom message of Impinj's.
///
/// # Errors
/// As [`message`].
pub fn impinj_message(
    buffer: &mut [u8],
    subtype: u8,
    id: u32,
    body: impl FnOnce(&mut Writer<'_>),
) -> Result<&[u8], EncodeError> {
    message(buffer, MessageType::CUSTOM_MESSAGE, id, |w| {
        w.u32(IMPINJ);
        w.u8(subtype);
        body(w);
    })
}

impl Writer<'_> {
    fn put(&mut self, at: usize, bytes: &[u8]) {
        match self.buffer.get_mut(at..).and_then(|free| free.get_mut(..bytes.len())) {
            Some(place) => place.copy_from_slice(bytes),
            None => self.error = Some(EncodeError::BufferFull),
        }
    }

    /// Bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.put(self.length, bytes);
        self.length = self.length.saturating_add(bytes.len());
    }

    /// u8.
    pub fn u8(&mut self, value: u8) {
        self.bytes(&[value]);
    }

    /// u16.
    pub fn u16(&mut self, value: u16) {
        self.bytes(&value.to_be_bytes());
    }

    /// s16.
    pub fn i16(&mut self, value: i16) {
        self.bytes(&value.to_be_bytes());
    }

    /// u32.
    pub fn u32(&mut self, value: u32) {
        self.bytes(&value.to_be_bytes());
    }

    /// u64.
    pub fn u64(&mut self, value: u64) {
        self.bytes(&value.to_be_bytes());
    }

    /// One flag in the first bit of a byte, the rest reserved.
    pub fn flag(&mut self, on: bool) {
        self.u8(u8::from(on) << 7);
    }

    /// Text with its u16 length in bytes before it.
    pub fn text(&mut self, text: &str) {
        match u16::try_from(text.len()) {
            Ok(n) => self.u16(n),
            Err(_) => self.error = Some(EncodeError::ParameterTooLong),
        }
        self.bytes(text.as_bytes());
    }

    /// A parameter whose value `value` writes.
    pub fn parameter(&mut self, kind: ParameterType, value: impl FnOnce(&mut Self)) {
        let start = self.length;
        match kind {
            ParameterType::Tv(kind) => {
                self.u8(0x80 | kind);
                return value(self);
            }
            ParameterType::Tlv(kind) => {
                self.u16(kind);
                self.u16(0);
            }
            ParameterType::Custom { vendor, subtype } => {
                self.u16(CUSTOM_PARAMETER);
                self.u16(0);
                self.u32(vendor);
                self.u32(subtype);
            }
        }
        value(self);
        match u16::try_from(self.length.saturating_sub(start)) {
            Ok(length) => self.put(start.saturating_add(2), &length.to_be_bytes()),
            Err(_) => self.error = Some(EncodeError::ParameterTooLong),
        }
    }

    /// A parameter that is one u16.
    pub fn u16_parameter(&mut self, kind: ParameterType, value: u16) {
        self.parameter(kind, |w| w.u16(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_an_error() {
        let write =
            |buffer: &mut [u8]| message(buffer, MessageType::KEEPALIVE, 1, |w| w.u16(7)).map(<[u8]>::len);
        assert_eq!(write(&mut [0; 12]), Ok(12));
        for n in 0..12 {
            assert_eq!(write(&mut [0; 12][..n]), Err(EncodeError::BufferFull));
        }
    }

    #[test]
    fn a_parameter_of_64_kilobytes_is_an_error() {
        let mut buffer = [0; 70_000];
        let mut write = |n: usize| {
            message(&mut buffer, MessageType::KEEPALIVE, 1, |w| {
                w.parameter(ParameterType::EPC_DATA, |w| w.bytes(&[0; 70_000][..n]));
            })
            .map(<[u8]>::len)
        };
        assert_eq!(write(65_531), Ok(65_545));
        assert_eq!(write(65_532), Err(EncodeError::ParameterTooLong));
    }
}
