//! Frames as the radar sends them, for simulated radars and tests.

use core::fmt;

use super::element::DetectedPoint;
use super::{
    Element, FrameHeader, HeaderFormat, MAGIC, SEGMENT, SideInfo, Statistics, Temperatures, TlvKind,
};

/// Why a frame cannot be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WriteError {
    /// The buffer is too short.
    Full,
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Full => f.write_str("the frame does not fit its buffer"),
        }
    }
}

impl core::error::Error for WriteError {}

/// Writes one frame into a buffer: TLVs first, then [`FrameWriter::finish`].
#[derive(Debug)]
pub struct FrameWriter<'b> {
    buffer: &'b mut [u8],
    format: HeaderFormat,
    length: usize,
    tlvs: u32,
}

impl<'b> FrameWriter<'b> {
    /// Begins a frame at the start of `buffer`.
    ///
    /// # Errors
    /// If not even the header fits.
    pub fn new(buffer: &'b mut [u8], format: HeaderFormat) -> Result<Self, WriteError> {
        if buffer.len() < format.bytes() {
            return Err(WriteError::Full);
        }
        Ok(Self { buffer, format, length: format.bytes(), tlvs: 0 })
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        let free = self.buffer.get_mut(self.length..).unwrap_or_default();
        free.get_mut(..bytes.len()).ok_or(WriteError::Full)?.copy_from_slice(bytes);
        self.length += bytes.len();
        Ok(())
    }

    fn begin(&mut self, code: u32, length: usize) -> Result<(), WriteError> {
        let length = u32::try_from(length).map_err(|_| WriteError::Full)?;
        self.put(&code.to_le_bytes())?;
        self.put(&length.to_le_bytes())?;
        self.tlvs = self.tlvs.saturating_add(1);
        Ok(())
    }

    /// Adds a TLV of any kind.
    ///
    /// # Errors
    /// If it does not fit; the writer is then of no more use.
    pub fn raw(&mut self, code: u32, payload: &[u8]) -> Result<(), WriteError> {
        self.begin(code, payload.len())?;
        self.put(payload)
    }

    /// Adds a TLV of `kind` that repeats `elements`.
    ///
    /// # Errors
    /// As [`Self::raw`].
    pub fn elements<T: Element>(&mut self, kind: TlvKind, elements: &[T]) -> Result<(), WriteError> {
        self.begin(kind.code(), elements.len().saturating_mul(T::BYTES))?;
        elements.iter().try_for_each(|element| self.put(element.wire().as_ref()))
    }

    /// Adds detected points, and their side information unless that is empty; nothing for no points, as the demo.
    ///
    /// # Errors
    /// As [`Self::raw`].
    pub fn points(&mut self, points: &[DetectedPoint], side: &[SideInfo]) -> Result<(), WriteError> {
        if points.is_empty() {
            return Ok(());
        }
        self.elements(TlvKind::DetectedPoints, points)?;
        if side.is_empty() { Ok(()) } else { self.elements(TlvKind::SideInfo, side) }
    }

    /// Adds timing and load.
    ///
    /// # Errors
    /// As [`Self::raw`].
    pub fn statistics(&mut self, statistics: Statistics) -> Result<(), WriteError> {
        self.begin(TlvKind::Statistics.code(), Statistics::BYTES)?;
        statistics.fields().iter().try_for_each(|field| self.put(&field.to_le_bytes()))
    }

    /// Adds temperatures.
    ///
    /// # Errors
    /// As [`Self::raw`].
    pub fn temperatures(&mut self, temperatures: &Temperatures) -> Result<(), WriteError> {
        self.begin(TlvKind::Temperatures.code(), Temperatures::BYTES)?;
        self.put(&temperatures.status.to_le_bytes())?;
        self.put(&temperatures.time_ms.to_le_bytes())?;
        temperatures.sensors().try_for_each(|sensor| self.put(&sensor.to_le_bytes()))
    }

    /// Writes padding and header and returns the frame's bytes. `total_length` and `tlvs` of `header` are set to what
    /// was written. The padding keeps what the buffer held, as on the radar.
    ///
    /// # Errors
    /// If the padding does not fit.
    pub fn finish(self, header: FrameHeader) -> Result<&'b [u8], WriteError> {
        let total = self.length.checked_next_multiple_of(SEGMENT).ok_or(WriteError::Full)?;
        let total_length = u32::try_from(total).map_err(|_| WriteError::Full)?;
        let FrameHeader { version, platform, number, cpu_cycles, points, subframe, .. } = header;
        let fields = [version, total_length, platform, number, cpu_cycles, points, self.tlvs, subframe];
        let frame = self.buffer.get_mut(..total).ok_or(WriteError::Full)?;
        let (magic, rest) = frame.split_at_mut_checked(MAGIC.len()).ok_or(WriteError::Full)?;
        magic.copy_from_slice(&MAGIC);
        // A header without subframe ends before the last field.
        let count = (self.format.bytes() - MAGIC.len()) / 4;
        for (bytes, field) in rest.as_chunks_mut::<4>().0.iter_mut().zip(fields).take(count) {
            *bytes = field.to_le_bytes();
        }
        Ok(frame)
    }
}
