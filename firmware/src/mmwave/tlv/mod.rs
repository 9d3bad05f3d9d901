//! Frames on the SDK demo's data UART (921 600 baud, 8N1): bytes to [`Frame`]s to typed views, and back.
//!
//! ```text
//! frame: magic (8) | header | TLV | TLV | ... | padding to a multiple of 32, not zeroed
//! TLV:   kind u32 | length u32, of the payload alone | payload             all little-endian
//! ```
//!
//! [`StreamParser`] finds frames in the stream, [`Frame::tlvs`] walks one, [`Tlv::parse`] gives a kind's view with its
//! lengths checked, [`FrameWriter`] writes what a simulated radar sends. Layouts are those of `mmw_output.h`, SDK 3.x;
//! a frame of an SDK 2 demo is found and walked too, but its points have another layout, which [`Tlv`] does not know.

mod element;
mod framer;
mod level;
mod stream;
mod view;
mod write;

use core::iter::FusedIterator;

pub use element::{ComplexI16, DetectedPoint, Element, Elements, SideInfo};
pub use framer::{Counts, TlvCounts};
pub use level::LevelScale;
pub use stream::{DEFAULT_CAPACITY, StreamParser};
pub use view::{HeatMap, RangeDoppler, Statistics, Temperatures, Tlv, TlvError};
pub use write::{FrameWriter, WriteError};

use super::MAGIC;
use element::{take_u32, u32_at};

/// Frames are padded to a multiple of this many bytes (`MMWDEMO_OUTPUT_MSG_SEGMENT_LEN`).
pub const SEGMENT: usize = 32;
/// Bytes of a TLV before its payload.
pub const TLV_HEADER: usize = 8;

/// Layout of the frame header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum HeaderFormat {
    /// 40 bytes: SDK 3, and SDK 2 except xWR14xx.
    #[default]
    Subframe,
    /// 36 bytes, no subframe number: xWR14xx.
    NoSubframe,
}

impl HeaderFormat {
    /// Bytes of the header, with the magic.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Subframe => 40,
            Self::NoSubframe => 36,
        }
    }
}

/// The header's fields (`MmwDemo_output_message_header`), without the magic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FrameHeader {
    /// SDK version: major << 24 | minor << 16 | bugfix << 8 | build.
    pub version: u32,
    /// Bytes of the whole frame, padding included.
    pub total_length: u32,
    /// Device: 0xA1642, 0xA1843, 0xA6843.
    pub platform: u32,
    /// Number of the frame since the radar started.
    pub number: u32,
    /// Time at which it was made, in the radar's CPU cycles (200 MHz), wrapping.
    pub cpu_cycles: u32,
    /// Detected points.
    pub points: u32,
    /// TLVs.
    pub tlvs: u32,
    /// Number of the subframe, 0 without advanced frames.
    pub subframe: u32,
}

impl FrameHeader {
    /// Reads the header of a frame that starts with the magic; `None` if `bytes` is too short.
    fn read(bytes: &[u8], format: HeaderFormat) -> Option<Self> {
        let mut fields = bytes.get(MAGIC.len()..format.bytes())?;
        Some(Self {
            version: take_u32(&mut fields)?,
            total_length: take_u32(&mut fields)?,
            platform: take_u32(&mut fields)?,
            number: take_u32(&mut fields)?,
            cpu_cycles: take_u32(&mut fields)?,
            points: take_u32(&mut fields)?,
            tlvs: take_u32(&mut fields)?,
            subframe: take_u32(&mut fields).unwrap_or(0),
        })
    }
}

/// Kinds of TLV of the SDK 3 demo (`MmwDemo_output_message_type`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum TlvKind {
    /// Detected points.
    DetectedPoints = 1,
    /// Range profile at zero Doppler.
    RangeProfile = 2,
    /// Range profile at the largest Doppler.
    NoiseProfile = 3,
    /// Zero-Doppler samples of the azimuth antennas.
    AzimuthHeatmap = 4,
    /// Range-Doppler heat map.
    RangeDopplerHeatmap = 5,
    /// Timing and load.
    Statistics = 6,
    /// Signal-to-noise ratio and noise of the detected points.
    SideInfo = 7,
    /// Zero-Doppler samples of all antennas, sent by AOP demos instead of [`Self::AzimuthHeatmap`].
    AzimuthElevationHeatmap = 8,
    /// Temperatures.
    Temperatures = 9,
}

impl TlvKind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::DetectedPoints,
        Self::RangeProfile,
        Self::NoiseProfile,
        Self::AzimuthHeatmap,
        Self::RangeDopplerHeatmap,
        Self::Statistics,
        Self::SideInfo,
        Self::AzimuthElevationHeatmap,
        Self::Temperatures,
    ];

    /// The kind of this number.
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }

    /// Its number.
    pub const fn code(self) -> u32 {
        self as u32
    }
}

/// A TLV, its payload not looked into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawTlv<'a> {
    /// Number of its kind; [`TlvKind::from_code`].
    pub code: u32,
    /// The payload.
    pub payload: &'a [u8],
}

/// A complete frame: all of its TLVs lie within it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The header.
    pub header: FrameHeader,
    /// Its TLVs, without the padding.
    body: &'a [u8],
}

impl<'a> Frame<'a> {
    /// `bytes` from the magic to the last TLV's end, which the caller has checked.
    fn new(bytes: &'a [u8], format: HeaderFormat) -> Option<Self> {
        Some(Self { header: FrameHeader::read(bytes, format)?, body: bytes.get(format.bytes()..)? })
    }

    /// Its TLVs in the order in which they were sent.
    pub fn tlvs(&self) -> Tlvs<'a> {
        Tlvs { rest: self.body }
    }

    /// Views of the TLVs of known kind; those whose length does not fit their kind give an error.
    pub fn views(&self) -> impl Iterator<Item = Result<Tlv<'a>, TlvError>> {
        self.tlvs().filter_map(|raw| Tlv::parse(raw).transpose())
    }

    /// The detected points, each with its side information where that was sent.
    pub fn points(&self) -> impl Iterator<Item = (DetectedPoint, Option<SideInfo>)> {
        let elements = |kind: TlvKind| self.tlvs().find(|raw| raw.code == kind.code()).map(|raw| raw.payload);
        let points: Elements<'_, DetectedPoint> =
            elements(TlvKind::DetectedPoints).and_then(Elements::new).unwrap_or_default();
        let side: Elements<'_, SideInfo> =
            elements(TlvKind::SideInfo).and_then(Elements::new).unwrap_or_default();
        points.iter().enumerate().map(move |(index, point)| (point, side.get(index)))
    }
}

/// Walks the TLVs of a frame.
#[derive(Debug, Clone)]
pub struct Tlvs<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Tlvs<'a> {
    type Item = RawTlv<'a>;

    fn next(&mut self) -> Option<RawTlv<'a>> {
        let (code, length) = (u32_at(self.rest, 0)?, u32_at(self.rest, 4)?);
        let (payload, rest) = self.rest.get(TLV_HEADER..)?.split_at_checked(usize::try_from(length).ok()?)?;
        self.rest = rest;
        Some(RawTlv { code, payload })
    }
}

impl FusedIterator for Tlvs<'_> {}
